"""The nearest allowed point against a general optimizer and closed forms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import lsq_linear

from spacerobot_ros.estimation.inference.constrained import ConstrainedProblem, PhysicalBody
from spacerobot_ros.inference.bounded import nearest


@dataclass
class Inequality:
    columns: np.ndarray
    offset: np.ndarray
    basis: np.ndarray


def problem(seed):
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 12))
    root = rng.standard_normal((k, k)) + 0.3 * np.eye(k)
    lower = np.where(rng.random(k) < 0.6, -rng.uniform(0.0, 0.5, k), -np.inf)
    upper = np.where(rng.random(k) < 0.5, rng.uniform(0.0, 0.5, k), np.inf)
    return 2.0 * rng.standard_normal(k), root @ root.T + 0.05 * np.eye(k), lower, upper


@pytest.mark.parametrize('seed', range(60))
def test_bounds_are_those_of_bounded_least_squares(seed):
    mean, covariance, lower, upper = problem(seed)
    x, loss = nearest(mean, covariance, (lower, upper))
    inverse = np.linalg.inv(np.linalg.cholesky(covariance))
    want = lsq_linear(inverse, inverse @ mean, (lower, upper), method='bvls', tol=1e-14)
    assert np.all((x >= lower) & (x <= upper))
    assert loss == pytest.approx(want.cost, rel=1e-6, abs=1e-9)
    np.testing.assert_allclose(x, want.x, rtol=0.0, atol=1e-6)


def test_an_allowed_mean_costs_nothing(rng):
    mean, bounds = rng.uniform(0.0, 1.0, 5), (np.zeros(5), np.full(5, np.inf))
    x, loss = nearest(mean, np.eye(5), bounds)
    assert loss == 0.0
    np.testing.assert_array_equal(x, mean)


def test_one_bound_costs_half_the_square_of_its_deviations():
    free = np.full(2, np.inf)
    covariance = np.array([[4.0, 1.0], [1.0, 9.0]])
    x, loss = nearest(np.array([-3.0, 1.0]), covariance, (np.array([0.0, -9.0]), free))
    assert loss == pytest.approx(0.5 * 9.0 / 4.0)
    np.testing.assert_allclose(x, [0.0, 1.0 + 3.0 * 1.0 / 4.0], rtol=1e-12)


def test_a_matrix_that_has_to_stay_positive():
    """[[1 + x, y], [y, 1 - x]] > 0 is the unit disc: the nearest point lies on its edge."""
    basis = np.array([[[1.0, 0.0], [0.0, -1.0]], [[0.0, 1.0], [1.0, 0.0]]])
    disc = Inequality(np.arange(2), np.eye(2), basis)
    mean, free = np.array([30.0, 40.0]), np.full(2, np.inf)
    x, loss = nearest(mean, np.eye(2), (-free, free), [disc])
    # the last plane costs less than 0.01 of 1200 nats
    np.testing.assert_allclose(x, [0.6, 0.8], rtol=0.0, atol=1e-3)
    assert 0.5 * 49.0**2 - 0.02 < loss <= 0.5 * 49.0**2 + 1e-9
    x, loss = nearest(0.01 * mean, np.eye(2), (-free, free), [disc])
    assert loss == 0.0


def test_what_is_known_to_be_too_dear_is_not_sought_further():
    basis = np.array([[[1.0, 0.0], [0.0, -1.0]], [[0.0, 1.0], [1.0, 0.0]]])
    disc = Inequality(np.arange(2), np.eye(2), basis)
    free, covariance = np.full(2, np.inf), np.diag([25.0, 1.0])
    place = np.array([30.0, 40.0]), covariance, (-free, free), [disc]
    x, loss = nearest(*place)
    assert np.linalg.norm(x) == pytest.approx(1.0, abs=1e-2)
    _, less = nearest(*place, enough=100.0)
    assert 100.0 < less < loss


@pytest.mark.parametrize('seed', range(8))
def test_a_body_costs_what_the_interior_point_says(seed):
    """Ten inertial parameters beside three bounded ones; data that want no body at all."""
    rng = np.random.default_rng(seed)
    file = pin.Inertia(2.0, np.array([0.1, 0.0, 0.05]), np.diag([0.02, 0.03, 0.025]))
    body = PhysicalBody(np.arange(10), file.toDynamicParameters())
    scale = np.concatenate([[2.0], np.full(3, 0.3), np.full(6, 0.05), np.ones(3)])
    root = scale[:, None] * (0.3 * rng.standard_normal((13, 13)) + np.eye(13))
    mean, covariance = 3.0 * scale * rng.standard_normal(13), 0.1 * root @ root.T
    lower = np.concatenate([np.full(10, -np.inf), np.zeros(3)])
    bounds = lower, np.full(13, np.inf)
    x, loss = nearest(mean, covariance, bounds, [body])
    information = np.linalg.inv(covariance)
    inside = ConstrainedProblem(information, information @ mean, scale, *bounds, [body]).solve()
    want = 0.5 * (inside - mean) @ information @ (inside - mean)
    # barriers of 0.01 nats at seven bounds, and planes that each cost less than that
    assert want - 0.3 < loss <= want + 1e-6
    off = x - inside
    assert 0.5 * off @ information @ off < 0.3
