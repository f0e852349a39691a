"""Torques that are held for long: their least change that keeps rates within bounds meanwhile."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.states import hold_step

from spacerobot_ros.control.command import Feedback
from spacerobot_ros.control.held_torques import HeldTorques, shortest
from spacerobot_ros.control.motion_barrier import MotionBarrier
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.effects.robot_file import load_robot_file

MS = 1_000_000
PERIOD = 0.05


@pytest.fixture
def twin():
    return load_robot_file('config/twin.yaml').robot


@pytest.fixture
def in_line():
    """Joints of the twin whose first and third axes come into line within 50 ms."""
    q = np.array([-0.5, 1.53, 0.24, 0.1, -1.8, 1.3])
    qd = np.array([1.08, 1.6, 1.56, -0.44, 0.18, 0.32])
    return Feedback(q, qd, np.array([0.74, 0.2, 0.25]), np.zeros(3))


def rates(robot, sample, tau, count=50):
    """(count, n) rates within a hold, by the plant's own integrator."""
    n = robot.n_joints
    x, found = np.zeros(13 + 2 * n), []
    x[6], x[7 : 7 + n], x[10 + n : 13 + n] = 1.0, sample.q, sample.omega_WB_B
    x[13 + n :] = sample.qd
    dynamics = Dynamics(robot)
    for _ in range(count):
        x = hold_step(dynamics, x, tau, PERIOD / count)
        found.append(x[-n:])
    return np.array(found)


def test_rates_are_bounded_within_a_hold(twin, in_line):
    free = rates(twin, in_line, np.zeros(6))
    limits = twin.velocity_limits
    assert np.abs(free).max() > 1.5 * 2.0
    assert np.all(np.abs(free[-1]) < limits)  # the end alone tells nothing of it
    unlimited = np.full(6, np.inf)
    held = MotionBarrier(twin).hold(0, in_line, np.zeros(6), unlimited, 50 * MS)
    assert np.all(np.abs(rates(twin, in_line, held)) < limits)


@pytest.mark.parametrize('share', [1.0, 1e-3])
def test_torques_within_limits_miss_bounds_by_as_little_as_can_be(twin, in_line, share):
    free = rates(twin, in_line, np.zeros(6))
    limits = share * twin.effort_limits
    held = MotionBarrier(twin).hold(0, in_line, np.zeros(6), limits, 50 * MS)
    assert np.all(np.abs(held) <= limits)
    assert np.abs(rates(twin, in_line, held)).max() < np.abs(free).max()
    assert (np.abs(held) > 0.999 * limits).any()


def test_a_hold_of_one_moment_changes_the_joints_that_are_bounded(twin, rng):
    n, period = 6, 1e-4
    dynamics = Dynamics(twin)
    held = HeldTorques(dynamics, period)
    q, u = rng.uniform(-1.0, 1.0, n), rng.normal(size=3 + n)
    M = dynamics.mass_matrix(q)
    M = M[3:, 3:] - M[3:, :3] @ np.linalg.solve(M[:3, :3], M[:3, 3:])
    x = np.zeros(13 + 2 * n)
    x[6], x[7 : 7 + n], x[-n:] = 1.0, q, 0.5 * rng.normal(size=n)
    free = held.states(x, u)[:, -n:]
    bounds = np.array([free - np.inf, free + np.inf])
    bounds[1, 0, 2], bounds[0, 0, 4] = free[0, 2] - 1e-3, free[0, 4] + 2e-3
    got = held.kept(x, u, M, np.zeros((1, n)), bounds, np.full(9, np.inf))
    change = np.zeros(9)
    change[3 + 2], change[3 + 4] = -1e-3 / period, 2e-3 / period
    assert_allclose(got.u, u + M @ change, rtol=2e-3, atol=2e-3 * np.abs(M @ change).max())
    assert got.excess < 1e-5


def test_the_shortest_vector_that_satisfies_inequalities(rng):
    for _ in range(20):
        rows, least = rng.normal(size=(7, 4)), rng.normal(size=7)
        firm = rng.normal(size=(3, 4)), -np.ones(3)  # zero satisfies them
        x = shortest((rows, least), firm)
        assert np.all(firm[0] @ x >= firm[1] - 1e-9)
        # no way from there is shorter, what is missed counted as documented
        sizes = np.linalg.norm(rows, axis=1)

        def cost(x, rows=rows, least=least, sizes=sizes):
            return x @ x + np.sum((100.0 * np.maximum(least - rows @ x, 0.0) / sizes) ** 2)

        for step in 1e-3 * rng.normal(size=(50, 4)):
            if np.all(firm[0] @ (x + step) >= firm[1]):
                assert cost(x + step) > cost(x)


def test_what_leads_nowhere_is_not_commanded(twin, in_line):
    with np.errstate(all='ignore'):
        u = np.full(6, 1e300)
        held = MotionBarrier(twin).hold(0, in_line, u, np.full(6, np.inf), 50 * MS)
    assert not held.any()


def test_a_sample_is_foretold(twin, in_line):
    barrier = MotionBarrier(twin)
    assert barrier.expected(50 * MS) is None
    tau = barrier.hold(0, in_line, np.zeros(6), twin.effort_limits, 50 * MS)
    got = barrier.expected(50 * MS)
    assert_allclose(got.qd, rates(twin, in_line, tau)[-1], atol=2e-3)  # steps of 10 ms there
    late = barrier.expected(52 * MS)
    assert_allclose(late.q, got.q + 0.002 * got.qd, rtol=1e-12)
    assert barrier.expected(100 * MS) is None
