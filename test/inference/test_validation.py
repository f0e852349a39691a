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


def conditional(problem, hypotheses, chosen, part) -> float:
    """ln N of some rows given all others."""
    covariance = np.eye(len(problem.data))
    variances = hypotheses.variances(chosen)
    for h, basis in zip(hypotheses.every, hypotheses.bases, strict=True):
        half = problem.columns[:, h.columns] @ basis
        covariance += half @ np.diag(variances[h.columns]) @ half.T
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
    gains = np.array(density) - less
    np.testing.assert_allclose(held_out.gains(2), gains, rtol=0.0, atol=1e-7)


def test_a_tolerance_that_is_stretched_is_no_rival(rng):
    """Ten of its deviations off, it predicts as well as the cause; nothing does not."""
    blocks, column = GramBlocks(1), rng.standard_normal((600, 1))
    for own in np.split(np.arange(600), 30):
        blocks.add(column[own], column[own, 0] + rng.standard_normal(20))
    prior = {'slab': np.ones(1), 'spike': np.full(1, 0.1)}
    hypotheses = Hypotheses(blocks, [Hypothesis(key=0, columns=np.array([0]), **prior)])
    gains = [HeldOut(hypotheses, {0}, is_absent=absent).gains(0) for absent in (False, True)]
    assert np.sum(gains[0]) < 12.0
    # all that a coefficient of one explains of 600 rows, but for what six parts lack of it
    assert np.sum(gains[1]) == pytest.approx(300.0, rel=0.2)


def test_a_law_is_judged_with_what_refines_it():
    problem = drawn(6)
    every = list(problem.every)
    every[3] = replace(every[3], needs=frozenset([every[1].key]))
    hypotheses = Hypotheses(problem.sums, every)
    held_out = HeldOut(hypotheses, {1, 3, 4})
    gone = HeldOut(hypotheses, {4})
    both = held_out.density() - gone.density()
    np.testing.assert_allclose(held_out.gains(1), both, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(
    ('gains', 'expected'),
    [
        ([5.0, 6.0, 4.0, 5.0, 7.0, 5.0], True),
        ([0.4] * 6, False),  # less than odds of twenty
        ([30.0, -0.5, -0.2, -0.1, -0.4, -0.3], False),  # one part decides
        ([30.0, 1.0, -0.2, 0.5, 0.0, 0.3], True),  # the others agree
        ([20.0, -9.0], False),
        ([20.0, 1.0], True),
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
