"""Held torques: the shape of their error against a held ramp, and what it does to an estimate."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file
from spacerobot_ros.estimation.unknowns.torque_hold import Holds, find_holds
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record
from spacerobot_ros.simulation.closed_loop import ClosedLoop

FILE = Path(__file__).parents[2] / 'config' / 'servicer.yaml'
PERIOD = 0.02  # s, of control


# --- the shape


def test_shape_is_that_of_a_held_ramp():
    # a mass under a force that follows the ramp j t in steps, each at the ramp's mean
    T, j, fine = 0.1, 3.0, 1000
    t = np.arange(20 * fine + 1) * (T / fine)
    force = j * (np.floor(t[:-1] / T + 1e-9) + 0.5) * T
    rate = np.concatenate([[0.0], np.cumsum(force) * (T / fine)])
    ramp = 0.5 * j * t**2
    difference = rate - ramp
    difference -= np.mean(difference[:-1])
    holds = Holds(T * np.arange(20), T, is_known=True)
    np.testing.assert_allclose(
        -(T**2) / 12.0 * holds.shape(t) * j,
        difference,
        rtol=0,
        atol=1e-5 * j * T**2,  # of the mean over a thousand steps
    )


def test_shape_is_zero_without_holds():
    np.testing.assert_array_equal(Holds(np.zeros(0), 0.0, is_known=False).shape(np.ones(3)), 0.0)


# --- where holds come from

TIMES = np.arange(40) / 100.0
STEPPED = np.repeat(np.arange(10.0), 4)[:, None]


def samples(effort, start=0.0):
    time = TIMES + start
    return SimpleNamespace(joint_time=time, effort=effort, effort_time=time)


def test_stated_period_counts_from_the_first_joint_sample():
    holds = find_holds(samples(STEPPED, 5.0), 0.03)
    assert (holds.starts[0], holds.period, holds.is_known) == (5.0, 0.03, True)
    np.testing.assert_allclose(holds.prior(), (0.03**2 / 12, 0.03**2 / 120), rtol=1e-12, atol=0)


def test_efforts_show_their_holds():
    holds = find_holds(samples(STEPPED), 0.0)
    assert holds.is_known
    np.testing.assert_allclose(holds.period, 0.04, rtol=1e-9, atol=0)
    # efforts are those of the step that ended at a stamp
    np.testing.assert_allclose(holds.starts, TIMES[3:-1:4], rtol=0, atol=1e-12)


@pytest.mark.parametrize('effort', [None, np.zeros((40, 1)), np.sin(TIMES)[:, None]])
def test_otherwise_holds_meet_at_the_joint_samples(effort):
    holds = find_holds(samples(effort), 0.0)
    assert not holds.is_known
    assert holds.prior() is None
    np.testing.assert_allclose(holds.shape(TIMES), 1.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(holds.shape(TIMES[:-1] + 0.005), -0.5, rtol=0, atol=1e-9)


# --- the estimate


@lru_cache(maxsize=1)
def closed_loop(joint_rate: float = 50.0, imu_rate: float = 100.0) -> tuple[RobotFile, Record]:
    """Exact sensors on twelve seconds under held torques, the gyro also in the middle of holds."""
    file = load_robot_file(FILE)
    simulator = replace(
        file.settings.simulator, noise=False, joint_rate=joint_rate, imu_rate=imu_rate
    )
    loop = ClosedLoop(file.robot, replace(file.settings, simulator=simulator))
    samples = [(step.stamp_ns, step.measured) for step in loop.run(1200)]
    joints = [(ns, m.joints) for ns, m in samples if m.joints is not None]
    rates = [(ns, m.omega) for ns, m in samples if m.omega is not None]
    attitudes = [(ns, m.attitude_xyzw) for ns, m in samples if m.attitude_xyzw is not None]
    stamps = [np.array([ns for ns, _ in part]) for part in (joints, rates, attitudes)]
    return file, Record(
        JointSeries(
            file.robot.joints,
            stamps[0],
            np.array([j.position for _, j in joints]),
            np.array([j.velocity for _, j in joints]),
        ),
        RateSeries(stamps[1], np.array([w for _, w in rates])),
        AttitudeSeries(stamps[2], np.array([a for _, a in attitudes])),
    )


def error_in_std(**settings):
    """Largest error of the wheel momentum in standard deviations of the stated noise."""
    file, record = closed_loop()
    identifier = replace(file.settings.identifier, **settings)
    estimate = identify(record, file.robot, identifier).estimate
    error = estimate.aam - np.array(file.settings.truth.target_momentum)
    return np.max(np.abs(error) / estimate.std[:3]), estimate


@pytest.mark.parametrize('period', [0.0, PERIOD])
def test_held_torques_do_not_bias_the_estimate(period):
    error, estimate = error_in_std(torque_hold_period=period)
    assert error < 0.05  # what is left comes from the splines
    factor = next(v for v in estimate.nuisances if v.name == 'torque_hold')
    np.testing.assert_allclose(factor.value, PERIOD**2 / 12.0, rtol=0.02, atol=0)
    assert factor.std < 0.1 * PERIOD**2 / 12.0


def test_ignored_they_do():
    error, _ = error_in_std(nuisances=('gyro_bias',))
    assert error > 0.5
