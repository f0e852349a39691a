"""Attitude motions: rates are those of the attitudes, goals are reached the short way."""

from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from spacerobot_ros.control.attitude import (
    AttitudeBlend,
    build_attitude,
    check_attitude,
    rotation_between,
)
from spacerobot_ros.control.command import AttitudeHistory, RateHistory
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.motion_settings import ReferenceSettings

START = Rotation.from_rotvec([0.4, -0.7, 0.3])
GOAL = Rotation.from_rotvec([-0.5, 0.6, 1.1])
MS = 1_000_000


def motion(kind, **more):
    settings = ReferenceSettings(kind=kind, duration=8.0, **more)
    return build_attitude(settings, START.as_quat())


MOTIONS = {
    'hold': lambda: motion('hold'),
    'step': lambda: motion('step', attitude_xyzw=tuple(GOAL.as_quat())),
    'set_point': lambda: motion('set_point', attitude_xyzw=tuple(-GOAL.as_quat())),
    'harmonic': lambda: motion('harmonic', attitude_amplitude=(0.3, -0.2, 0.5)),
    'blend': lambda: AttitudeBlend(
        motion('harmonic', attitude_amplitude=(0.3, -0.2, 0.5)), 1.0, GOAL.as_quat(), 6.0
    ),
}


@pytest.mark.parametrize('name', MOTIONS)
def test_rates_and_accelerations_are_derivatives(name):
    reference, h = MOTIONS[name](), 1e-4
    for t in np.linspace(1.1, 7.9, 9):
        before, here, after = (reference.at(t + s) for s in (-h, 0.0, h))
        turned = Rotation.from_quat(before.q_WD_xyzw).inv() * Rotation.from_quat(after.q_WD_xyzw)
        # central differences: h^2 times third derivatives below 10, and 1e-16 / h
        assert_allclose(turned.as_rotvec() / (2 * h), here.omega_WD_D, rtol=0, atol=1e-7)
        slope = (after.omega_WD_D - before.omega_WD_D) / (2 * h)
        assert_allclose(slope, here.omega_dot_D, rtol=0, atol=1e-7)


@pytest.mark.parametrize('name', ['step', 'set_point'])
def test_goals_are_reached_whatever_the_sign_of_the_quaternion(name):
    reference = MOTIONS[name]()
    left = Rotation.from_quat(reference.at(8.0).q_WD_xyzw).inv() * GOAL
    assert left.magnitude() < 1e-12
    assert_allclose(reference.at(9.0).omega_WD_D, 0.0, rtol=0, atol=0)
    way = [(START.inv() * Rotation.from_quat(reference.at(t).q_WD_xyzw)).magnitude()
           for t in np.linspace(0.0, 8.0, 33)]  # fmt: skip
    assert max(way) < (START.inv() * GOAL).magnitude() + 1e-12  # the short way round


def test_a_blend_starts_where_the_base_is_and_joins():
    reference = motion('harmonic', attitude_amplitude=(0.3, -0.2, 0.5))
    blend = AttitudeBlend(reference, 1.0, GOAL.as_quat(), 6.0)
    at_start = Rotation.from_quat(blend.at(1.0).q_WD_xyzw)
    assert (at_start.inv() * GOAL).magnitude() < 1e-12
    for t in (7.0, 9.0):
        assert_allclose(blend.at(t).q_WD_xyzw, reference.at(t).q_WD_xyzw, rtol=0, atol=0)


@pytest.mark.parametrize('angle', [0.0, 1e-12, 1e-6, 1.0, np.pi - 1e-6])
def test_rotation_between_is_the_logarithm(angle, rng):
    axis = rng.normal(size=3)
    vector = angle * axis / np.linalg.norm(axis)
    end = START * Rotation.from_rotvec(vector)
    for sign in (1.0, -1.0):
        got = rotation_between(START.as_quat(), sign * end.as_quat())
        assert_allclose(got, vector, rtol=1e-8, atol=1e-15)  # near pi the sine loses digits


@pytest.mark.parametrize(
    ('settings', 'match'),
    [
        ({'attitude_xyzw': (1.0,)}, r'attitude_xyzw: expected 4'),
        ({'attitude_xyzw': (0.0, 0.0, 0.0, 1.1)}, r'norm 1\.1'),
        ({'attitude_xyzw': (0.0, 0.0, 0.0, 0.0)}, r'norm 0'),
        ({'attitude_amplitude': (1.0, 2.0)}, r'attitude_amplitude: expected 3'),
    ],
)
def test_unusable_settings_are_refused(settings, match):
    values = {'attitude_xyzw': (), 'attitude_amplitude': (), **settings}
    with pytest.raises(ConfigurationError, match=match):
        check_attitude(SimpleNamespace(**values))


def test_an_attitude_is_carried_along_the_measured_rates():
    rates, attitudes = RateHistory(2.0), AttitudeHistory()
    axis, rate = np.array([0.6, 0.0, 0.8]), 0.7
    for k in range(101):
        rates.add(k * 10 * MS, rate * (1.0 + 0.01 * k) * axis)  # linear, about a fixed axis
    attitudes.add(300 * MS, START.as_quat())
    for ms in (100, 300, 305, 995, 1000):
        got = Rotation.from_quat(attitudes.at(ms * MS, rates))
        t, t0 = ms * 1e-3, 0.3
        angle = rate * ((t + t**2 / 2) - (t0 + t0**2 / 2))
        assert (got.inv() * START * Rotation.from_rotvec(angle * axis)).magnitude() < 1e-12
    assert AttitudeHistory().at(0, rates) is None
