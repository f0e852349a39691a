"""Marginal sums against the dense covariance of the data."""

from __future__ import annotations

import numpy as np
import pytest
from support.drawn_hypotheses import dense_log_density, drawn

SETS = [(), (0,), (1, 4), (0, 2, 3, 8), tuple(range(9))]


@pytest.mark.parametrize('chosen', SETS)
@pytest.mark.parametrize('seed', range(4))
def test_log_density_is_that_of_the_dense_covariance(seed, chosen):
    problem = drawn(seed)
    hypotheses = problem.hypotheses
    found = hypotheses.marginal(chosen).log_density
    # 240 rows and determinants up to 1e5 to the 20th
    assert found == pytest.approx(dense_log_density(problem, hypotheses, chosen), abs=1e-7)


@pytest.mark.parametrize('seed', range(6))
def test_exchanged_priors_are_as_if_made_anew(seed):
    hypotheses = drawn(seed).hypotheses
    now = hypotheses.marginal({1, 2})
    changed = now.changed(*hypotheses.exchange([5, 7], [2]))
    anew = hypotheses.marginal({1, 5, 7})
    np.testing.assert_allclose(changed.matrix, anew.matrix, rtol=1e-11, atol=1e-8)
    np.testing.assert_allclose(changed.vector, anew.vector, rtol=0.0, atol=1e-8)
    assert changed.log_density == pytest.approx(anew.log_density, abs=1e-8)


def test_gains_of_many_moves_are_those_of_each(rng):
    hypotheses = drawn(3, count=12).hypotheses
    now = hypotheses.marginal({0, 1})
    single = [i for i in range(2, 12) if len(hypotheses.every[i].columns) == 2]
    pairs = [hypotheses.exchange([i], []) for i in single]
    gains = now.gains(np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs]))
    want = [hypotheses.marginal({0, 1, i}).log_density - now.log_density for i in single]
    assert len(single) > 1
    np.testing.assert_allclose(gains, want, rtol=0.0, atol=1e-8)


def test_mean_and_covariance_are_those_of_ridge_regression():
    problem = drawn(5)
    hypotheses = problem.hypotheses
    chosen, X = {0, 3, 4}, problem.columns
    prior = np.zeros((X.shape[1], X.shape[1]))
    for i, (h, basis) in enumerate(zip(hypotheses.every, hypotheses.bases, strict=True)):
        v = np.ones(len(h.columns)) if i in chosen else hypotheses.spikes[h.columns]
        prior[np.ix_(h.columns, h.columns)] = basis @ np.diag(v) @ basis.T
    gain = prior @ X.T @ np.linalg.inv(np.eye(len(X)) + X @ prior @ X.T)
    marginal = hypotheses.marginal(chosen)
    found = hypotheses.mean(marginal, chosen)
    np.testing.assert_allclose(found, gain @ problem.data, rtol=0.0, atol=1e-9)
    own = hypotheses.every[3].columns
    covariance = marginal.covariance(own, np.ones(len(own)))
    found = hypotheses.bases[3] @ covariance @ hypotheses.bases[3].T
    want = (prior - gain @ X @ prior)[np.ix_(own, own)]
    np.testing.assert_allclose(found, want, rtol=0.0, atol=1e-10)


def test_a_part_of_the_columns_is_enough_for_their_exchange():
    hypotheses = drawn(7).hypotheses
    now = hypotheses.marginal({1, 2})
    part = now.part(hypotheses.columns_of([2, 6]))
    move = hypotheses.exchange([6], [2])
    assert part.changed(*move).log_density == pytest.approx(
        now.changed(*move).log_density, abs=1e-10
    )


def test_densities_of_one_set_of_data_under_two_scales_of_noise_compare(rng):
    """Data divided by their noise have another density; `log_scale` gives it back."""
    from spacerobot_ros.inference.gram_blocks import GramBlocks
    from spacerobot_ros.inference.hypotheses import Hypotheses
    from spacerobot_ros.inference.hypothesis import Hypothesis

    one = Hypothesis(key=0, columns=np.arange(1), slab=np.ones(1), spike=np.zeros(1))
    data, column = 0.1 * rng.standard_normal(500), np.ones((500, 1))
    density = {}
    for std in (0.05, 0.1, 0.2):
        blocks = GramBlocks(1)
        blocks.add(column / std, data / std, log_scale=500 * np.log(std))
        density[std] = Hypotheses(blocks, [one]).marginal(()).log_density
    want = -0.5 * np.sum((data / 0.1) ** 2) - 500 * (np.log(0.1) + 0.5 * np.log(2.0 * np.pi))
    assert density[0.1] == pytest.approx(want, abs=1e-9)
    assert max(density, key=density.get) == 0.1
