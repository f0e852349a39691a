"""Steps of a linear system against SciPy's integrator, on a system that turns fast."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spacerobot_ros.estimation.filters.linear_steps import Steps

DT = 0.01


@pytest.fixture
def system(rng: np.random.Generator):
    """A(t) = A0 + A1 t of two bodies whose rates turn by up to half a radian in a step."""
    early = np.zeros((4, 4))
    early[:2, 2:] = np.eye(2)
    early[2:, 2:] = [[-3.0, 50.0], [-50.0, 2.0]]
    early[2:, :2] = rng.normal(size=(2, 2))
    late = early.copy()
    late[2:, 2:] *= 1.05
    late[2:, :2] += rng.normal(size=(2, 2))
    return early, late


def exact(early, late, start, drive):
    def rate(t, x):
        s = t / DT
        a = (1.0 - s) * early + s * late
        return a @ x + np.concatenate([np.zeros(2), drive(s)])

    return solve_ivp(rate, (0.0, DT), start, rtol=1e-12, atol=1e-14).y[:, -1]


def test_transition(system, rng):
    start = rng.normal(size=4)
    steps = Steps(np.array([DT]), np.stack(system))
    expected = exact(*system, start, lambda s: np.zeros(2))
    # z^5 / 720 of Pade's approximant with |z| = 0.5, and the fifth order of Magnus' series
    np.testing.assert_allclose(steps.transitions[0] @ start, expected, rtol=0, atol=1e-4)


@pytest.mark.parametrize('power', [0, 1, 2])
def test_what_drives_along_a_step(system, rng, power):
    push = rng.normal(size=(1, 2, 1))
    nothing = np.zeros_like(push)
    terms = [push if k == power else nothing for k in range(3)]
    steps = Steps(np.array([DT]), np.stack(system))
    expected = exact(*system, np.zeros(4), lambda s: push[0, :, 0] * s**power)
    found = steps.driven(*terms)[0, :, 0]
    # A is taken as its mean here: half of its change, 5 %, by half of |z| / 2 on average
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-3 * np.max(np.abs(expected)))


def test_errors_fall_with_the_fourth_power_of_the_step(system, rng):
    """Half the step, about 1/32 of its error."""
    start = rng.normal(size=4)

    def error(share):
        middle = (1.0 - share) * system[0] + share * system[1]
        step = Steps(np.array([share * DT]), np.stack([system[0], middle]))
        x = step.transitions[0] @ start

        def rate(t, y):
            s = t / DT
            return ((1.0 - s) * system[0] + s * system[1]) @ y

        true = solve_ivp(rate, (0.0, share * DT), start, rtol=1e-12, atol=1e-14).y[:, -1]
        return np.max(np.abs(x - true))

    assert error(0.5) < error(1.0) / 20.0
