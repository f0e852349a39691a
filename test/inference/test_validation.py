"""Predictive densities against conditional normal ones, and what chance does to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from support.drawn_hypotheses import drawn

from spacerobot_ros.inference.gram_blocks import GramBlocks
from spacerobot_ros.inference.hypotheses import Hypotheses
from spacerobot_ros.inference.hypothesis import Hypothesis
from spacerobot_ros.inference.model_search import best_set
from spacerobot_ros.inference.validation import HeldOut, passes, weakest


def marginal_covariance(problem, hypotheses, chosen):
    """(N, N) of all rows."""
    out = np.eye(len(problem.data))
    variances = hypotheses.variances(chosen)
    for h, basis in zip(hypotheses.every, hypotheses.bases, strict=True):
        half = problem.columns[:, h.columns] @ basis
        out += half @ np.diag(variances[h.columns]) @ half.T
    return out


def strain(problem, hypotheses, chosen) -> float:
    """1/2 sum of squared posterior means of tolerances by their prior variances."""
    whitened = np.linalg.solve(marginal_covariance(problem, hypotheses, chosen), problem.data)
    total = 0.0
    for i, h in enumerate(hypotheses.every):
        if i not in chosen:
            half = problem.columns[:, h.columns] @ hypotheses.bases[i]
            means = hypotheses.spikes[h.columns] * (half.T @ whitened)
            held = hypotheses.spikes[h.columns] > 0.0
            total += 0.5 * float(np.sum(means[held] ** 2 / hypotheses.spikes[h.columns][held]))
    return total


def conditional(problem, hypotheses, chosen, part) -> float:
    """ln N of some rows given all others."""
    covariance = marginal_covariance(problem, hypotheses, chosen)
    rest = np.setdiff1d(np.arange(len(problem.data)), part)
    gain = np.linalg.solve(covariance[np.ix_(rest, rest)], covariance[np.ix_(rest, part)]).T
    mean = gain @ problem.data[rest]
    own = covariance[np.ix_(part, part)] - gain @ covariance[np.ix_(rest, part)]
    return float(multivariate_normal(mean, own).logpdf(problem.data[part]))


@pytest.mark.parametrize('recordings', [1, 4])
def test_density_of_a_part_is_conditional_on_the_others(recordings):
    problem = drawn(5, blocks=12, recordings=recordings)
    hypotheses, chosen = problem.hypotheses, {0, 2, 4}
    held_out = HeldOut(hypotheses, chosen)
    count = 6 if recordings == 1 else recordings
    parts = np.array_split(np.arange(240), count)
    density = [conditional(problem, hypotheses, chosen, part) for part in parts]
    np.testing.assert_allclose(held_out.density(), density, rtol=0.0, atol=1e-7)
    less = [conditional(problem, hypotheses, {0, 4}, part) for part in parts]
    relaxed = strain(problem, hypotheses, {0, 4}) - strain(problem, hypotheses, chosen)
    gains = np.array(density) - less + relaxed / count
    np.testing.assert_allclose(held_out.gains(2), gains, rtol=0.0, atol=1e-7)


def test_a_law_is_judged_with_what_refines_it():
    problem = drawn(6)
    every = list(problem.every)
    every[3] = replace(every[3], needs=frozenset([every[1].key]))
    hypotheses = Hypotheses(problem.sums, every)
    held_out = HeldOut(hypotheses, {1, 3, 4})
    gone = HeldOut(hypotheses, {4})
    both = held_out.density() - gone.density()
    strains = [strain(problem, hypotheses, chosen) for chosen in ({4}, {1, 3, 4})]
    both += (strains[0] - strains[1]) / len(both)
    np.testing.assert_allclose(held_out.gains(1), both, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize(
    ('gains', 'expected'),
    [
        ([5.0, 6.0, 4.0, 5.0, 7.0, 5.0], True),
        ([0.4] * 6, False),  # less than odds of twenty
        ([30.0, -0.5, -0.2, -0.1, -0.4, -0.3], False),  # one part decides
        ([30.0, 2.0, -0.2, 1.5, 0.0, 0.3], True),  # the others agree, by odds of twenty
        ([30.0, 1.0, -0.2, 0.5, 0.0, 0.3], False),  # they hardly do
        ([20.0, -9.0], False),
        ([20.0, 4.0], True),
        ([20.0, 1.0], False),
        ([20.0], False),  # nothing predicts it
        ([], False),
    ],
)
def test_what_passes(gains, expected):
    assert passes(np.array(gains)) == expected


def test_the_weakest_of_those_that_fail_goes():
    gains = {1: np.full(6, 2.0), 2: np.full(6, 0.3), 3: np.full(6, -1.0)}
    assert weakest(gains) == 3
    assert weakest({1: gains[1]}) is None


def test_a_blip_has_evidence_and_predicts_nothing(rng):
    """A column that fits one moment alone, as a start of a motion does a rotor's inertia."""
    X = rng.standard_normal((600, 1))
    data = rng.standard_normal(600)
    data[100:110] += 12.0 * np.sign(X[100:110, 0])
    blocks = GramBlocks(1)
    for own in np.split(np.arange(600), 30):
        blocks.add(X[own], data[own])
    cause = Hypothesis(key=0, columns=np.arange(1), slab=np.ones(1), spike=np.zeros(1))
    hypotheses = Hypotheses(blocks, [cause])
    assert best_set(hypotheses).chosen == {0}
    assert not passes(HeldOut(hypotheses, {0}).gains(0))


def test_a_tolerance_that_fits_every_part_beyond_what_it_is_speaks_for_a_cause(rng):
    """A column of which a tolerance has a tenth, and a cause that does the same."""
    X = rng.standard_normal((600, 1))
    blocks = GramBlocks(2)
    data = X[:, 0] + 0.1 * rng.standard_normal(600)
    for own in np.split(np.arange(600), 30):
        blocks.add(np.repeat(X[own], 2, axis=1) / 0.1, data[own] / 0.1)
    ones, nothing = np.ones(1), np.zeros(1)
    tolerance = Hypothesis(
        key=0, columns=np.array([0]), slab=ones, spike=0.1 * ones, log_odds=-np.inf
    )
    cause = Hypothesis(key=1, columns=np.array([1]), slab=ones, spike=nothing)
    gains = HeldOut(Hypotheses(blocks, [tolerance, cause]), {1}).gains(1)
    # without the cause the tolerance is at ten times its deviation, 50 nats, and predicts as well
    assert float(np.sum(gains)) == pytest.approx(50.0, rel=0.05)
    assert passes(gains)
