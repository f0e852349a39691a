"""What takes a cause's place, how nearly it does as well, and angles between what both can do."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import subspace_angles
from support.drawn_hypotheses import drawn

from spacerobot_ros.inference.alternatives import alternatives, principal_angles
from spacerobot_ros.inference.gram_blocks import GramBlocks
from spacerobot_ros.inference.hypotheses import Hypotheses
from spacerobot_ros.inference.hypothesis import Hypothesis
from spacerobot_ros.inference.model_search import ChosenSet, best_set


def single(columns: np.ndarray, data: np.ndarray, families=()) -> Hypotheses:
    blocks = GramBlocks(columns.shape[1])
    blocks.add(columns, data)
    one, none = np.ones(1), np.zeros(1)
    families = families or (None,) * columns.shape[1]
    return Hypotheses(
        blocks,
        [
            Hypothesis(key=k, columns=np.array([k]), slab=one, spike=none, family=family)
            for k, family in enumerate(families)
        ],
    )


def turned(rng, angle: float, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """Two columns at an angle, and a third one across."""
    basis, _ = np.linalg.qr(rng.standard_normal((count, 4)))
    scale = math.sqrt(count)
    other = math.cos(angle) * basis[:, 0] + math.sin(angle) * basis[:, 1]
    columns = scale * np.column_stack([basis[:, 0], other, basis[:, 2]])
    return columns, columns[:, 0] + basis[:, 3]


def test_a_twin_is_a_rival_at_even_odds_and_no_angle(rng):
    columns, data = turned(rng, 0.0)
    hypotheses = single(columns, data)
    found = best_set(hypotheses)
    (i,) = found.chosen
    (rival,), _ = alternatives(hypotheses, found, i, ())
    assert rival.causes == (1 - i,)
    assert rival.log_odds == pytest.approx(0.0, abs=1e-8)
    assert rival.probability == pytest.approx(0.5)
    assert rival.angle == pytest.approx(0.0, abs=1e-6)
    assert rival.is_confounded


@pytest.mark.parametrize('angle', [0.05, 0.3, 1.2])
def test_odds_against_a_rival_grow_with_the_angle(angle, rng):
    """A column at an angle loses 1/2 |x|^2 sin^2, here of some 400 squares, by closed form."""
    columns, data = turned(rng, angle)
    hypotheses = single(columns, data)
    found = best_set(hypotheses)
    assert found.chosen == {0}
    (rival, *_), _ = alternatives(hypotheses, found, 0, ())
    shrunk = 400.0**2 / (1.0 + 400.0)
    want = 0.5 * shrunk * math.sin(angle) ** 2
    want = min(want, 0.5 * shrunk - 0.5 * math.log(401.0) - math.log(3.0) - 3.0)
    assert rival.log_odds == pytest.approx(want, rel=1e-6)
    if rival.causes:
        assert rival.angle == pytest.approx(angle, abs=1e-9)
    assert rival.is_confounded == (want < 6.0 and bool(rival.causes))


def test_rivals_are_named_one_after_the_other(rng):
    columns, data = turned(rng, 0.05)
    third = columns[:, 0] + 0.1 * columns[:, 2]
    hypotheses = single(np.column_stack([columns[:, :2], third]), data)
    found = best_set(hypotheses)
    others, _ = alternatives(hypotheses, found, 0, ())
    assert [rival.causes for rival in others] == [(1,), (2,)]
    assert others[0].log_odds < others[1].log_odds


def test_a_variant_of_the_cause_is_no_rival(rng):
    columns, data = turned(rng, 0.02)
    hypotheses = single(columns, data, families=('ripple', 'ripple', 'other'))
    found = best_set(hypotheses)
    (other,), _ = alternatives(hypotheses, found, min(found.chosen), ())
    assert other.causes == ()
    assert other.log_odds > 100.0
    assert other.angle == pytest.approx(0.5 * math.pi)


def test_a_better_set_without_a_cause_is_handed_back():
    problem = drawn(1)
    hypotheses = problem.hypotheses
    best = best_set(hypotheses)
    worse = ChosenSet.of(hypotheses, best.chosen ^ {min(set(range(9)) - best.chosen)})
    (extra,) = worse.chosen - best.chosen
    _, found = alternatives(hypotheses, worse, extra, ())
    assert found.objective > worse.objective


@pytest.mark.parametrize(('m', 'n'), [(1, 1), (3, 2), (2, 4)])
def test_angles_are_those_between_subspaces(m, n, rng):
    columns = rng.standard_normal((50, m + n)) @ rng.standard_normal((m + n, m + n))
    columns += 2.0 * columns[:, :1]
    hypotheses = single(columns, np.zeros(50))
    found = principal_angles(hypotheses.marginal(()), np.arange(m), np.arange(m, m + n))
    want = np.sort(subspace_angles(columns[:, :m], columns[:, m:]))
    np.testing.assert_allclose(found, want, rtol=0.0, atol=1e-6)  # of arccos near 1


def test_what_is_given_narrows_the_angle(rng):
    """Two columns that differ by a third one are the same beside it."""
    basis = rng.standard_normal((300, 2))
    columns = np.column_stack([basis[:, 0], basis.sum(axis=1), basis[:, 1]])
    hypotheses = single(columns, np.zeros(300))
    one, other = np.array([0]), np.array([1])
    (apart,) = principal_angles(hypotheses.marginal(()), one, other)
    (beside,) = principal_angles(hypotheses.marginal({2}), one, other)
    assert apart > 0.5
    assert beside < 0.1  # the third one is known to a standard deviation of 1, not exactly
