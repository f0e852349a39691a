"""Inference on Gram matrices against the Gaussian densities that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from spacerobot_ros.estimation.inference.evidence import (
    Gram,
    cross_validated,
    folds,
    inverse_of_positive,
    score,
    sum_of,
)
from spacerobot_ros.estimation.inference.placebo import held_out_gain

UNBOUNDED = (np.full(2, -np.inf), np.full(2, np.inf))


def test_evidence_is_the_ratio_of_two_gaussians(rng: np.random.Generator) -> None:
    columns, data = rng.normal(size=(30, 2)), rng.normal(size=30)
    sizes = np.array([0.3, 0.5])  # as sharp as the data, not sharper by their number
    found = score(Gram.of(columns, data), sizes, UNBOUNDED, None)
    with_effect = np.eye(30) + columns @ np.diag(sizes**2) @ columns.T
    expected = multivariate_normal(cov=with_effect).logpdf(data) - multivariate_normal(
        cov=np.eye(30)
    ).logpdf(data)
    np.testing.assert_allclose(found.evidence, expected, rtol=1e-9, atol=1e-9)


def test_a_prior_far_too_wide_costs_no_more_than_one_datum(rng: np.random.Generator) -> None:
    gram = Gram.of(rng.normal(size=(50, 2)), rng.normal(size=50))
    wide, wider = (score(gram, np.full(2, s), UNBOUNDED, None) for s in (1e6, 1e9))
    np.testing.assert_allclose(wide.evidence, wider.evidence, rtol=1e-6)
    np.testing.assert_allclose(wide.evidence, 0.5 * wide.gain - np.log(51.0), rtol=1e-9)


def test_marginalized_columns_leave_what_they_can_not_explain(rng: np.random.Generator) -> None:
    held, own, data = rng.normal(size=(40, 3)), rng.normal(size=(40, 2)), rng.normal(size=40)
    gram = Gram.of(np.concatenate([held, own], axis=1), data).without(3, np.zeros(3))
    rest = np.eye(40) - held @ np.linalg.pinv(held)
    np.testing.assert_allclose(gram.matrix, own.T @ rest @ own, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(gram.vector, own.T @ rest @ data, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(gram.square, data @ rest @ data, rtol=1e-9, atol=1e-10)


def test_bounds_hold_and_cost_gain(rng: np.random.Generator) -> None:
    columns = rng.normal(size=(200, 2))
    data = columns @ np.array([-1.0, 1.0]) + rng.normal(size=200)
    gram, sizes = Gram.of(columns, data), np.full(2, 10.0)
    free = score(gram, sizes, UNBOUNDED, None)
    bound = score(gram, sizes, (np.zeros(2), np.full(2, np.inf)), None)
    assert free.estimate[0] < 0.0 <= bound.estimate[0]
    assert bound.gain < free.gain


def test_gain_without_effect_is_chi_squared(rng: np.random.Generator) -> None:
    columns = rng.normal(size=(100, 2))
    sizes = np.full(2, 100.0)
    p = [
        score(Gram.of(columns, rng.normal(size=100)), sizes, UNBOUNDED, None).p_value
        for _ in range(1000)
    ]
    # 1000 uniform p-values: standard deviation of the share below 0.05 is 0.007
    assert abs(np.mean(np.array(p) < 0.05) - 0.05) < 0.025


def test_held_out_gain_is_the_fall_of_the_misfit(rng: np.random.Generator) -> None:
    columns, data = rng.normal(size=(60, 2)), rng.normal(size=60)
    train, test = Gram.of(columns[:40], data[:40]), Gram.of(columns[40:], data[40:])
    found = score(train, np.ones(2), UNBOUNDED, test)
    left = data[40:] - columns[40:] @ found.estimate
    np.testing.assert_allclose(
        found.held_out, data[40:] @ data[40:] - left @ left, rtol=1e-9, atol=1e-10
    )


def test_every_part_is_predicted_from_the_others(rng: np.random.Generator) -> None:
    held, own, data = rng.normal(size=(60, 1)), rng.normal(size=(60, 2)), rng.normal(size=60)
    columns, sizes, precision = np.concatenate([held, own], axis=1), np.ones(2), np.ones(1)
    rows = [slice(0, 20), slice(20, 40), slice(40, 60)]
    parts = [Gram.of(columns[r], data[r]) for r in rows]
    np.testing.assert_allclose(sum_of(parts).matrix, columns.T @ columns, rtol=1e-12)
    expected = 0.0
    for r in rows:
        inside = np.zeros(60, dtype=bool)
        inside[r] = True
        # companions of prior precision one are as good as noise of this covariance
        before, after = (np.eye(n) + held[m] @ held[m].T for n, m in ((40, ~inside), (20, inside)))
        weighted = own[~inside].T @ np.linalg.inv(before)
        estimate = np.linalg.solve(weighted @ own[~inside] + np.eye(2), weighted @ data[~inside])
        left = data[inside] - own[inside] @ estimate
        weight = np.linalg.inv(after)
        expected += data[inside] @ weight @ data[inside] - left @ weight @ left
    found = cross_validated(folds(parts, 1, precision), sizes, UNBOUNDED)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10)


def test_a_constant_is_not_its_own_placebo(rng: np.random.Generator) -> None:
    """Of 2 in noise of 1 it takes 4 a row; 20 random signs of 40 pieces 4 (2.5^2) / 40 at most."""
    data, times = 2.0 + rng.normal(size=400), np.tile(np.arange(200) * 0.1, 2)  # two recordings
    halves = [slice(0, 200), slice(200, 400)]
    gain = held_out_gain(np.ones((400, 1)), data, np.array([1.0]), halves, times)
    assert gain < 0.25 * (400 * 4)


def test_few_moves_are_not_their_own_placebo() -> None:
    """Nine moves of a second have too few orders and signs to make columns without meaning."""
    times = np.arange(180) / 20.0
    shares = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        sign = np.repeat(rng.choice((-1.0, 1.0), 9), 20)[:, None]
        data = 1.5 * sign[:, 0] + rng.normal(size=180)
        halves = [slice(0, 90), slice(90, 180)]
        shares.append(held_out_gain(sign, data, np.ones(1), halves, times) / (180 * 1.5**2))
    assert np.max(shares) < 0.3  # 0.15 to 0.95 in pieces of a second


@pytest.mark.parametrize('size', [1, 7, 60])
def test_the_inverse_of_a_positive_matrix(rng, size):
    root = rng.normal(size=(size, 2 * size))
    positive = root @ root.T / size + np.eye(size)
    inverse = inverse_of_positive(positive)
    np.testing.assert_allclose(positive @ inverse, np.eye(size), rtol=0, atol=1e-12)
    np.testing.assert_array_equal(inverse, inverse.T)


def test_a_matrix_that_rounding_left_not_positive_has_an_inverse_still():
    almost = np.array([[1.0, 1.0 + 1e-9], [1.0 + 1e-9, 1.0]])
    np.testing.assert_allclose(almost @ inverse_of_positive(almost), np.eye(2), rtol=0, atol=1e-6)
