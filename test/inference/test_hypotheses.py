"""The objective of a set of causes, what may stand beside what, and values as they are given."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from support.drawn_hypotheses import drawn

from spacerobot_ros.estimation.inference.constrained import ConstrainedProblem, PhysicalBody
from spacerobot_ros.inference.gram_blocks import GramBlocks
from spacerobot_ros.inference.hypotheses import Hypotheses, _positive
from spacerobot_ros.inference.hypothesis import Hypothesis

BODY = pin.Inertia(2.0, np.array([0.1, 0.0, 0.0]), np.diag([0.02, 0.03, 0.03]))


def one(key, column, **more) -> Hypothesis:
    at = np.array([column])
    return Hypothesis(
        **({'key': key, 'columns': at, 'slab': np.ones(1), 'spike': np.zeros(1)} | more)
    )


def laws(*every: Hypothesis) -> Hypotheses:
    blocks = GramBlocks(len(every))
    blocks.add(np.eye(len(every)), np.ones(len(every)))
    return Hypotheses(blocks, every)


def test_log_odds_are_by_the_number_of_what_can_be_asked():
    blocks = GramBlocks(4)
    columns = np.eye(4)
    columns[2, 2] = 0.0
    blocks.add(columns, np.ones(4))
    every = [one('a', 0), one('b', 1, log_odds=-2.0), one('unseen', 2)]
    hypotheses = Hypotheses(blocks, [*every, one('nuisance', 3, log_odds=math.inf)])
    usual = -math.log(2) - 3.0
    assert hypotheses.open == {0, 1}
    assert hypotheses.always == {3}
    assert hypotheses.prior([0, 1, 3]) == pytest.approx(2 * usual - 2.0)


def test_a_refinement_goes_with_the_last_law_that_it_needs():
    needs = frozenset(['dry', 'viscous'])
    hypotheses = laws(
        one('dry', 0), one('viscous', 1), one('curved', 2, needs=needs),
        one('finer', 3, needs=frozenset(['curved'])),
    )  # fmt: skip
    everything = {0, 1, 2, 3}
    assert hypotheses.dependents(frozenset(everything), [0]) == {0}
    assert hypotheses.dependents(frozenset(everything - {1}), [0]) == {0, 2, 3}
    assert not hypotheses.may_join(2, set())
    assert hypotheses.may_join(2, {1})


def test_what_excludes_another_is_no_cause_beside_it_either_way():
    hypotheses = laws(one('gain', 0, excludes=frozenset(['constant'])), one('constant', 1))
    assert not hypotheses.may_join(0, {1})
    assert not hypotheses.may_join(1, {0})


def test_of_variants_one_is_a_cause():
    hypotheses = laws(one('slow', 0, family='ripple'), one('fast', 1, family='ripple'))
    assert hypotheses.may_join(0, set())
    assert not hypotheses.may_join(1, {0})


@pytest.mark.parametrize(
    ('every', 'reason'),
    [
        ([one('a', 0)], 'each column'),
        ([one('a', 0), one('b', 0)], 'each column'),
        ([one('a', 0), one('a', 1)], 'one key'),
    ],
)
def test_hypotheses_that_do_not_fit_the_rows_are_refused(every, reason):
    blocks = GramBlocks(2)
    blocks.add(np.eye(2), np.ones(2))
    with pytest.raises(ValueError, match=reason):
        Hypotheses(blocks, every)


@pytest.mark.parametrize('seed', range(6))
def test_bounded_causes_pull_everything_else_along(seed):
    """The mean within bounds is that of all coefficients together, tolerated ones included."""
    problem = drawn(seed, bounded=1.0, is_cause=0.5)
    hypotheses = problem.hypotheses
    chosen = {0, 2, 5, 6}
    found = hypotheses.mean(hypotheses.marginal(chosen), chosen)
    used = hypotheses.columns_of(hypotheses.active(chosen))
    information = problem.columns[:, used].T @ problem.columns[:, used]
    lower = np.full(len(used), -np.inf)
    for i, (h, basis) in enumerate(zip(hypotheses.every, hypotheses.bases, strict=True)):
        at = np.searchsorted(used, h.columns)
        if i in hypotheses.active(chosen):
            v = np.ones(len(at)) if i in chosen else hypotheses.spikes[h.columns]
            information[np.ix_(at, at)] += np.linalg.inv(basis @ np.diag(v) @ basis.T)
            if i in chosen:
                lower[at] = h.least
    vector = problem.columns[:, used].T @ problem.data
    unbounded = np.linalg.solve(information, vector)
    want = ConstrainedProblem(
        information, vector, np.ones(len(used)), lower, np.full(len(used), np.inf)
    ).solve()
    # barriers of 0.01 nats at an information of some 100
    np.testing.assert_allclose(found[used], want, rtol=0.0, atol=0.02)
    assert np.all(found[used] >= lower - 1e-12)
    cost = information @ found[used] - vector
    assert np.all(cost[found[used] > lower + 1e-9] < 1e-6)
    assert np.any(unbounded < lower - 0.01) == bool(np.any(np.abs(cost) > 1e-6))


@pytest.mark.parametrize('is_cause', [True, False])
def test_bodies_stay_bodies_as_causes_and_as_tolerances(is_cause, rng):
    wanted = np.array([-3.0, *rng.standard_normal(9)])  # of negative mass
    body = PhysicalBody(np.arange(10), BODY.toDynamicParameters())
    wide, narrow = np.full(10, 10.0), np.full(10, 3.0)
    h = Hypothesis(key='body', columns=np.arange(10), slab=wide, spike=narrow, body=body)
    blocks = GramBlocks(10)
    blocks.add(100.0 * np.eye(10), 100.0 * wanted)
    hypotheses = Hypotheses(blocks, [h])
    chosen = {0} if is_cause else set()
    marginal = hypotheses.marginal(chosen)
    new = pin.Inertia.FromDynamicParameters(body.file + hypotheses.mean(marginal, chosen))
    assert new.mass > 0.0
    principal = np.linalg.eigvalsh(new.inertia)
    assert principal[0] > 0.0
    assert principal[2] <= principal[0] + principal[1]
    lost = marginal.log_density - hypotheses.evidence(marginal, chosen)
    assert (lost > 100.0) == is_cause  # tolerances are linear in the evidence


def test_an_unseen_column_changes_nothing(rng):
    problem = drawn(2)
    blocks = GramBlocks(problem.columns.shape[1] + 1)
    blocks.add(np.column_stack([problem.columns, np.zeros(240)]), problem.data)
    more = one('unseen', problem.columns.shape[1], spike=np.array([0.1]))
    hypotheses = Hypotheses(blocks, [*problem.every, more])
    own = problem.hypotheses
    found, want = (h.objective(h.marginal({1, 4}), {1, 4}) for h in (hypotheses, own))
    assert found == pytest.approx(want, abs=1e-8)
    assert not hypotheses.is_seen(9)


def test_what_is_always_in_costs_no_odds():
    problem = drawn(4)
    every = [replace(problem.every[0], log_odds=math.inf), *problem.every[1:]]
    hypotheses = Hypotheses(problem.sums, every)
    marginal = hypotheses.marginal({0})
    assert hypotheses.objective(marginal, {0}) == hypotheses.evidence(marginal, {0})


def test_a_covariance_that_rounding_left_not_positive_is_taken_as_one(rng):
    """Units apart by six orders; only the direction that is none changes, and by next to none."""
    sizes = np.array([1.0, 1e-3, 1e3])
    vectors = np.linalg.qr(rng.standard_normal((3, 3)))[0]

    def with_least(value):
        return np.outer(sizes, sizes) * (vectors * [value, 1.0, 2.0] @ vectors.T)

    good, bad = with_least(1e-3), with_least(-1e-9)
    assert _positive(good) is good
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(bad)
    mended = _positive(bad)
    np.linalg.cholesky(mended)
    np.testing.assert_allclose(
        mended / np.outer(sizes, sizes), bad / np.outer(sizes, sizes), rtol=0.0, atol=1e-6
    )
