"""Innovations stay white and of unit variance where samples of held torques are missing."""

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.estimation.filters.measured_torque import MeasuredTorque
from spacerobot_ros.estimation.filters.prediction import Innovations, MeasuredMotion
from spacerobot_ros.estimation.filters.torque_process import TorqueDriven
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.trajectory.time_base import make_time_base
from spacerobot_ros.recording.buffer import SampleBuffer
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record, to_stamps
from validation.hidden.monitor_flights import Flight, monitor_of

SPAN_NS = 8_000_000_000


@pytest.fixture(scope='module')
def flown():
    """Return the true robot and 8 s of a flight at 100 Hz."""
    flight = Flight(seed=5)
    robot = monitor_of(flight).robot
    window = SampleBuffer(robot.joints)
    for sample in flight.samples(1e-9 * SPAN_NS):
        sample.feed(window)
    momentum = np.array(flight.file.settings.truth.target_momentum)
    return robot.with_target_momentum(momentum), window.record(0, SPAN_NS)


def chi2_per_row(robot, record, timing):
    noise, _ = noise_levels(robot.sensors, record)
    process = TorqueDriven(robot)
    found = Innovations(MeasuredMotion(record, noise, process), process, timing)
    settled = found.row_times > 0.5
    return float(np.mean(found.data[settled] ** 2)), int(np.sum(settled))


@pytest.mark.parametrize('timing', ['held_before', 'held_after'])
@pytest.mark.parametrize(
    'lost',
    [
        slice(50, -50, 20),  # one in twenty, alone
        slice(50, -50, 4),
        [300, 301, 302, 500, 501, 650],  # several in a row
    ],
)
def test_lost_samples_cost_nothing_but_themselves(flown, timing, lost):
    robot, record = flown
    joints = record.joints
    if timing == 'held_after':  # the sample that ends an interval, said at its beginning
        joints = replace(joints, effort=np.roll(joints.effort, -1, axis=0)).at(slice(0, -1))
    kept = np.ones(len(joints), dtype=bool)
    kept[lost] = False
    record = replace(record, zero_ns=record.origin_ns, joints=joints.at(kept))
    value, rows = chi2_per_row(robot, record, timing)
    assert value == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / rows))


@pytest.mark.parametrize(
    ('timing', 'from_ms', 'to_ms'),
    [
        ('held_before', 0, 10),  # the next sample is of the interval that it ends
        ('held_after', 10, 20),
        ('held_about', 0, 20),
        ('sampled', 5, 15),  # nearer to what is missing than to any other
    ],
)
def test_a_missing_sample_is_as_uncertain_as_others_about_their_neighbours(
    rng, timing, from_ms, to_ms
):
    """Of white samples the mean of two is off by 3/2 of their variance."""
    effort = 2.0 * rng.standard_normal((20_001, 1))
    stamps = to_stamps(0.01 * np.arange(20_001))
    joints = JointSeries(('a',), stamps, np.zeros((20_001, 1)), None, effort)
    kept = np.arange(20_001) % 40 != 20
    fine = RateSeries(to_stamps(0.0025 * np.arange(80_001)), np.zeros((80_001, 3)))
    record = Record(joints=joints.at(kept), rates=fine)
    base = make_time_base(record, 4, 3)
    torque = MeasuredTorque(record, None, base, np.ones(1), timing)
    variance = torque.lost_variance()[:, 0]
    middle = 1e3 * 0.5 * (base.times[1:] + base.times[:-1])
    since = np.mod(middle - 190.0, 400.0)  # from the sample before one that is missing [ms]
    expected = (since > from_ms) & (since < to_ms)
    np.testing.assert_array_equal(variance > 0.0, expected)
    np.testing.assert_allclose(variance[expected], 1.5 * 4.0, rtol=0.1)
