"""Deviations that hold under noise that is not as it is thought, and cost nothing where it is."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import sqrtm
from scipy.stats import norm, t

from spacerobot_ros.inference.cluster_robust import robust_covariance
from spacerobot_ros.inference.gram_blocks import GramBlocks
from spacerobot_ros.inference.hypotheses import Hypotheses
from spacerobot_ros.inference.hypothesis import Hypothesis

BLOCKS, ROWS, COUNT = 30, 20, 5


def posed(columns: np.ndarray, data: np.ndarray, blocks: int = BLOCKS) -> Hypotheses:
    """A group of three and two single columns; the last one is a nuisance of the file."""
    sums = GramBlocks(COUNT)
    for own in np.array_split(np.arange(len(data)), blocks):
        sums.add(columns[own], data[own])
    wide, narrow = 3.0 * np.ones(3), np.full(1, 3.0)
    return Hypotheses(
        sums,
        [
            Hypothesis(key=0, columns=np.arange(3), slab=wide, spike=np.zeros(3)),
            Hypothesis(key=1, columns=np.array([3]), slab=narrow, spike=np.zeros(1)),
            Hypothesis(key=2, columns=np.array([4]), slab=narrow, spike=np.array([0.5])),
        ],
    )


def robust_of(hypotheses: Hypotheses, chosen=frozenset([0, 1])):
    fitted = hypotheses.fitted(hypotheses.marginal(chosen), chosen)
    return robust_covariance(hypotheses, fitted, chosen)


def slow_columns(rng: np.random.Generator) -> np.ndarray:
    """(R, 5) as slow as motions are: correlated within blocks."""
    white = rng.standard_normal((BLOCKS * ROWS, COUNT))
    for k in range(1, len(white)):
        white[k] = 0.9 * white[k - 1] + np.sqrt(1.0 - 0.81) * white[k]
    return white


def test_on_white_noise_deviations_are_the_models_own():
    ratios = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        columns = slow_columns(rng)
        ratios.append(robust_of(posed(columns, rng.standard_normal(len(columns)))).wider)
    assert np.median(ratios) <= 1.05
    assert np.min(ratios) >= 1.0


def test_coloured_noise_is_covered_as_often_as_stated():
    """Noise as slow as the columns: the model's own deviations are some three times too small."""
    inside, naive, truth = [], [], np.array([1.0, -0.5, 0.3, 0.8, 0.1])
    for seed in range(150):
        rng = np.random.default_rng(seed)
        columns = slow_columns(rng)
        hypotheses = posed(columns, columns @ truth + slow_columns(rng)[:, 0])
        found = robust_of(hypotheses)
        mean = hypotheses.mean(hypotheses.marginal({0, 1}), {0, 1})
        off = np.abs(mean - truth)[found.columns]
        inside.append(off < t.ppf(0.975, found.freedom) * found.deviations)
        naive.append(off < norm.ppf(0.975) * np.sqrt(np.diag(found.own)))
    # 600 values of 150 records: three deviations of the share of 150 are 5 %; blocks are twice as
    # long as the noise's memory, so that a little of it is lost
    assert np.mean(inside) > 0.88
    assert np.mean(naive) < 0.75


def test_it_is_cr2_of_least_squares_where_no_prior_says_anything(rng):
    """Against the dense formula: adjusted residuals of each block, all columns causes."""
    columns = slow_columns(rng)
    hypotheses = posed(columns, slow_columns(rng)[:, 0])
    hypotheses.spikes[:] = 1.0
    everything = frozenset([0, 1, 2])
    found = robust_of(hypotheses, everything)
    whole, basis = hypotheses.blocks.whole, hypotheses.basis(everything)
    V = np.linalg.inv(whole.matrix + np.linalg.inv(basis @ basis.T))
    mean = V @ whole.vector
    meat = np.zeros((COUNT, COUNT))
    for k, own in enumerate(np.split(np.arange(len(columns)), BLOCKS)):
        X = columns[own]
        block = hypotheses.blocks.grams(np.arange(COUNT))[k]
        # residuals of the block from its sums: X' e is all that is used
        score = block.vector - block.matrix @ mean
        root = np.real(sqrtm(np.linalg.inv(np.eye(len(own)) - X @ V @ X.T)))
        adjusted = X.T @ root @ np.linalg.pinv(X.T) @ score
        meat += np.outer(adjusted, adjusted)
    want = np.diag(V + V @ meat @ V - V @ whole.matrix @ V)
    assert np.min(want / np.diag(V)) > 1.0
    np.testing.assert_allclose(found.deviations**2, want, rtol=1e-8)


def test_freedom_is_the_number_of_blocks_that_count(rng):
    columns = rng.standard_normal((BLOCKS * ROWS, COUNT))
    columns[ROWS:, 3] = 0.0  # seen in one block alone
    found = robust_of(posed(columns, rng.standard_normal(len(columns))))
    assert found.freedom[3] == pytest.approx(1.0, abs=0.05)
    assert np.all(found.freedom[:3] > 20.0)


def test_a_few_blocks_are_refused(rng):
    columns = slow_columns(rng)
    with pytest.raises(ValueError, match='20 blocks of rows, fewer than 30'):
        robust_of(posed(columns, columns[:, 0], blocks=20))
