"""Inference on Gram matrices against the Gaussian densities that it stands for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from spacerobot_ros.estimation.inference.evidence import explained, inverse_of_positive
from spacerobot_ros.inference.gram import Gram


def test_marginalized_columns_leave_what_they_can_not_explain(rng: np.random.Generator) -> None:
    held, own, data = rng.normal(size=(40, 3)), rng.normal(size=(40, 2)), rng.normal(size=40)
    gram = Gram.of(np.concatenate([held, own], axis=1), data).without(3, np.zeros(3))
    rest = np.eye(40) - held @ np.linalg.pinv(held)
    np.testing.assert_allclose(gram.matrix, own.T @ rest @ own, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(gram.vector, own.T @ rest @ data, rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(gram.square, data @ rest @ data, rtol=1e-9, atol=1e-10)


def test_what_a_group_explains_is_the_ratio_of_two_gaussians(rng: np.random.Generator) -> None:
    columns, data, sizes = rng.normal(size=(30, 2)), rng.normal(size=30), np.array([0.3, 0.5])
    gain, _ = explained(Gram.of(columns, data), sizes)
    cov = np.eye(30) + columns @ np.diag(sizes**2) @ columns.T
    found = 0.5 * gain - 0.5 * np.linalg.slogdet(cov)[1]
    expected = multivariate_normal(cov=cov).logpdf(data) - multivariate_normal(
        cov=np.eye(30)
    ).logpdf(data)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)


def test_gain_without_effect_is_chi_squared(rng: np.random.Generator) -> None:
    columns, sizes = rng.normal(size=(100, 2)), np.full(2, 100.0)
    p = [explained(Gram.of(columns, rng.normal(size=100)), sizes)[1] for _ in range(1000)]
    # 1000 uniform p-values: standard deviation of the share below 0.05 is 0.007
    assert abs(np.mean(np.array(p) < 0.05) - 0.05) < 0.025


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
