"""The interior point against closed forms, a bounded solver, and what a body is."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import lsq_linear

from spacerobot_ros.estimation.inference.constrained import ConstrainedProblem, PhysicalBody

FREE = np.full(10, np.inf)


def problem(rows: np.ndarray, data: np.ndarray, lower, upper, bodies=()) -> ConstrainedProblem:
    count = rows.shape[1]
    return ConstrainedProblem(
        rows.T @ rows + 1e-6 * np.eye(count), rows.T @ data, np.ones(count), lower, upper, bodies
    )


def test_without_bounds_it_is_least_squares(rng: np.random.Generator) -> None:
    rows, data = 30.0 * rng.normal(size=(40, 6)), rng.normal(size=40)
    found = problem(rows, data, -FREE[:6], FREE[:6]).solve()
    expected = np.linalg.lstsq(rows, data, rcond=None)[0]
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize('seed', range(5))
def test_bounds_are_those_of_a_bounded_solver(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rows, data = 1e3 * rng.normal(size=(40, 6)), 1e3 * rng.normal(size=40)
    lower, upper = np.zeros(6), np.where(np.arange(6) % 2, 0.05, np.inf)
    found = problem(rows, data, lower, upper).solve()
    expected = lsq_linear(rows, data, (lower, upper), method='bvls').x
    # the last barrier of 0.01 nats against information of 4e7
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-3)


def test_a_body_that_the_data_would_not_leave_one_stays_one(rng: np.random.Generator) -> None:
    file = pin.Inertia(2.0, np.array([0.1, 0.0, 0.0]), np.diag([0.02, 0.03, 0.03]))
    wanted = np.array([-3.0, *rng.normal(size=9)])  # of negative mass
    body = PhysicalBody(np.arange(10), file.toDynamicParameters())
    rows = 100.0 * np.eye(10)
    found = problem(rows, rows @ wanted, -FREE, FREE, (body,)).solve()
    new = pin.Inertia.FromDynamicParameters(body.file + found)
    assert new.mass > 0.0
    principal = np.linalg.eigvalsh(new.inertia)
    assert principal[0] > 0.0
    assert principal[2] <= principal[0] + principal[1]


def test_a_body_that_the_data_leave_one_is_as_they_say(rng: np.random.Generator) -> None:
    file = pin.Inertia(2.0, np.array([0.1, 0.0, 0.0]), np.diag([0.02, 0.03, 0.03]))
    other = pin.Inertia(2.6, np.array([0.1, 0.05, 0.0]), np.diag([0.03, 0.03, 0.04]))
    change = other.toDynamicParameters() - file.toDynamicParameters()
    rows = 1e4 * rng.normal(size=(40, 10))
    body = PhysicalBody(np.arange(10), file.toDynamicParameters())
    found = problem(rows, rows @ change, -FREE, FREE, (body,)).solve()
    np.testing.assert_allclose(found, change, rtol=0.0, atol=1e-5)  # barrier 0.01, info 4e9


@pytest.mark.parametrize('seed', range(3))
def test_it_ends_at_the_least_cost_however_much_there_is_to_gain(seed: int) -> None:
    """A flange that carries a load, beside friction of both signs: the walls are far from zero.

    Nothing feasible is cheaper by the slope there than the last barrier of 0.01 nats a bound.
    """
    rng = np.random.default_rng(seed)
    lower = np.concatenate([FREE * -1.0, np.zeros(20)])
    upper = np.full(30, np.inf)
    flange = pin.Inertia(0.2, np.array([0.0, 0.09, 0.0]), np.diag([3e-4, 1e-4, 3e-4]))
    load = pin.Inertia(3.0, np.array([0.03, 0.15, -0.17]), np.diag([0.01, 0.01, 0.004]))
    body = PhysicalBody(np.arange(10), flange.toDynamicParameters())
    truth = np.concatenate([load.toDynamicParameters(), rng.uniform(0.0, 2.0, 20)])
    rows = rng.normal(size=(400, 30)) @ (np.eye(30) + 0.3 * rng.normal(size=(30, 30)))
    data = 300.0 * (rows @ truth + 0.2 * rng.normal(size=400))
    posed = problem(300.0 * rows, data, lower, upper, (body,))
    found = posed.solve()
    slope = posed.information @ found - posed.vector
    assert slope @ (truth - found) > -0.01 * (20 + 4 + 1)  # one more: rounding and the last step
