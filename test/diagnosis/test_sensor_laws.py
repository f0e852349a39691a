"""Errors of sensors that no catalogue knows: what they depend on, told from torques."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.diagnosis import hand_made

from spacerobot_ros.diagnosis.discovery.discover_in_flight import discover_in_flight
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.recording.series import InputSeries
from validation.hidden.diagnosis_scenario import robot_file, simulated

ROBOT, SECONDS = 'minisat', 8.0
SHIFT, BEND, SCALE, TURN = 1e-4, 8e-3, 1e-3, 2e-4
"""rad/s by degC, s/rad, by degC, rad: three to ten times the sensors' noise."""


def temperature(t):
    return 20.0 + 5.0 * np.sin(0.9 * t) + 2.0 * np.sin(2.3 * t + 1.0)


def phase(t):
    return 0.7 + 1.1 * t


@pytest.fixture(scope='module')
def clean():
    """A flight whose housekeeping has a temperature and the orbit's phase."""
    record = simulated(ROBOT, 'fast', 5, (), SECONDS)
    stamps = record.joints.stamp_ns[::10]
    slow = (stamps - record.joints.stamp_ns[0]) / 1e9
    extras = {
        f'extra/{name}': InputSeries((name,), stamps, f(slow)[:, None], (unit,))
        for name, f, unit in (('temp', temperature, 'degC'), ('phase', phase, 'rad'))
    }
    return replace(record, inputs=extras)


def warm(record, t):
    rates = record.rates.omega.copy()
    rates[:, 0] += SHIFT * temperature(t)
    return replace(record, rates=replace(record.rates, omega=rates))


def bent(record, t):
    rates = record.rates.omega.copy()
    rates[:, 1] += BEND * rates[:, 1] ** 2
    return replace(record, rates=replace(record.rates, omega=rates))


def scaled(record, t):
    rates = record.rates.omega.copy()
    rates[:, 2] *= 1.0 + SCALE * (temperature(t) - 20.0)
    return replace(record, rates=replace(record.rates, omega=rates))


def turned(record, t):
    stamps = record.attitudes.stamp_ns
    at = phase((stamps - record.joints.stamp_ns[0]) / 1e9)
    small = np.outer(TURN * np.sin(at), [0.0, 1.0, 0.0])
    true = Rotation.from_quat(record.attitudes.q_xyzw)
    said = (true * Rotation.from_rotvec(small)).as_quat()
    return replace(record, attitudes=replace(record.attitudes, q_xyzw=said))


@pytest.mark.parametrize(
    ('error', 'channel', 'variables', 'form', 'last', 'unit'),
    [
        (warm, 'gyro/x', {'extra/temp'}, 'x', SHIFT, 'rad/s temp'),
        (bent, 'gyro/y', {'base_rate/y'}, 'x^2', BEND, 's/rad'),
        (scaled, 'gyro/z', {'base_rate/z', 'extra/temp'}, 'x, x y', SCALE, '1/temp'),
        (turned, 'attitude/y', {'extra/phase'}, 'sin(m x), cos(m x)', 0.0, 'rad'),
    ],
)
def test_an_error_of_a_sensor_is_said_with_its_variables(
    error, channel, variables, form, last, unit, clean
):
    file = robot_file(ROBOT)
    t = (clean.rates.stamp_ns - clean.joints.stamp_ns[0]) / 1e9
    record = observed(error(clean, t), file.robot)
    noise, _ = noise_levels(file.robot.sensors, record)
    run = Run(record, file.robot, file.effects, noise, 'held_before')
    answer = discover_in_flight(hand_made('unexplained'), Fit(run, ()), lambda what, share: None)
    (entry,) = [e for e in answer.leftover if e.form is not None]
    assert answer.verdict == 'partly_explained'
    assert entry.channel == channel
    assert set(entry.depends_on) == variables
    assert entry.form == form
    assert entry.kind == 'sensor'
    assert entry.applied is None  # no torque: it is said, and not simulated
    assert entry.coefficients[-1].unit == unit
    assert entry.coefficients[-1].value == pytest.approx(last, rel=0.1, abs=0.1 * TURN)
