"""The filter carried from block to block says what one pass over the whole flight says."""

import numpy as np
import pytest

from spacerobot_ros.diagnosis.flight.block_filter import FlightFilter
from spacerobot_ros.diagnosis.flight.block_innovations import BlockInnovations
from spacerobot_ros.diagnosis.flight.probes import probes_of
from spacerobot_ros.diagnosis.flight.wheel_momentum import Momentum, constant_pass
from spacerobot_ros.estimation.filters.prediction import MeasuredMotion
from spacerobot_ros.estimation.filters.torque_process import TorqueDriven
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.recording.buffer import SampleBuffer
from validation.hidden.monitor_flights import Flight, monitor_of


@pytest.fixture(scope='module')
def flight():
    """Return the truth's robot and the samples of 6 s."""
    flight = Flight(seed=3)
    robot = monitor_of(flight).robot
    truth = flight.file.settings.truth.target_momentum
    window = SampleBuffer(robot.joints)
    for s in flight.samples(6.0):
        s.feed(window)
    return robot.with_target_momentum(np.array(truth)), window


def seconds(x):
    """Seconds in nanoseconds."""
    return round(x * 1e9)


def test_blocks_say_what_one_pass_says(flight):
    robot, window = flight
    whole = window.record(0, seconds(6.0))
    noise, _ = noise_levels(robot.sensors, whole)
    process = TorqueDriven(robot)
    known = Momentum(np.zeros(3), np.zeros((3, 3)))
    carried = FlightFilter(process, noise, 'held_before', probes_of(robot), known)
    blocks = [
        carried.block(
            window.record(seconds(max(t - 1.3, 0.0)), seconds(t + 0.3)), t
        )
        for t in (1.0, 2.0, 3.0, 4.0, 5.0)
    ]  # fmt: skip
    once = BlockInnovations(MeasuredMotion(whole, noise, process), process, 'held_before')
    data = np.concatenate([block.data for block in blocks])
    times = np.concatenate([block.time for block in blocks])
    expected = once.data[: len(data)]
    np.testing.assert_allclose(times, once.row_times[: len(data)], rtol=0.0, atol=1e-9)
    settled = times > 0.5
    # references differ at the blocks' ends: second order of 1e-4 rad against noise of 2e-5
    np.testing.assert_allclose(data[settled], expected[settled], rtol=0.0, atol=0.1)


def test_every_row_is_judged_once(flight):
    robot, window = flight
    noise, _ = noise_levels(robot.sensors, window.record(0, seconds(6.0)))
    unknown = Momentum(np.zeros(3), np.eye(3) * 1e4)
    carried = FlightFilter(TorqueDriven(robot), noise, 'held_before', probes_of(robot), unknown)
    first = carried.block(window.record(0, seconds(1.3)), 1.0)
    second = carried.block(window.record(seconds(0.7), seconds(2.3)), 2.0)
    assert first.time[-1] < second.time[0]
    # 100 joint samples of 6 numbers, 100 of the gyro, 10 of the tracker, a second
    assert len(second.data) == 100 * 6 + 100 * 3 + 10 * 3
    assert np.all(np.diag(carried.momentum.covariance) < 1e4)


def test_constants_estimated_along_are_least_squares(rng):
    columns, truth = rng.standard_normal((200, 2)), np.array([3.0, -2.0])
    data = columns @ truth + rng.standard_normal(200)
    mean, covariance = np.zeros((2, 1)), 100.0 * np.eye(2)
    white = constant_pass(data[:, None], columns, mean, covariance)
    information = columns.T @ columns + np.eye(2) / 100.0
    expected = np.linalg.solve(information, columns.T @ data)
    np.testing.assert_allclose(mean[:, 0], expected, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(covariance, np.linalg.inv(information), rtol=1e-9, atol=1e-12)
    # what is left has the marginal likelihood's exponent
    marginal = np.eye(200) + 100.0 * columns @ columns.T
    exponent = data @ np.linalg.solve(marginal, data)
    np.testing.assert_allclose(float(white[:, 0] @ white[:, 0]), exponent, rtol=1e-9, atol=0.0)
