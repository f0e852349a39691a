"""Readings that a faster logger repeats count once; what stands still is read as it is."""

import numpy as np
import pytest

from spacerobot_ros.recording.faults.held_readings import (
    first_of_each,
    without_repeats,
    without_stalls,
)
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record, to_stamps

TIME = np.arange(0.0, 10.0, 0.01)


def noisy(rng, width=3):
    """Noise of 1e-5 about a motion."""
    return np.sin(TIME)[:, None] + 1e-5 * rng.standard_normal((len(TIME), width))


@pytest.mark.parametrize('times', [2, 3, 8])
@pytest.mark.parametrize('offset', [0, 1])
def test_every_reading_is_taken_once(rng, times, offset):
    values = noisy(rng)[(np.arange(len(TIME)) + offset) // times]
    first = first_of_each(values)
    assert len(first) == pytest.approx(len(TIME) / times, abs=1.0)
    assert np.all(np.any(np.diff(values[first], axis=0) != 0.0, axis=1))
    assert first[0] == 0
    np.testing.assert_array_equal(first[1:], np.arange(times - offset, len(TIME), times)[:])


def test_of_rates_that_do_not_divide_readings_last_a_sample_more_or_less(rng):
    """A sensor at 30 Hz in a log at 100 Hz."""
    held = np.floor(TIME * 30.0 + 1e-9).astype(int)
    first = first_of_each(noisy(rng)[held])
    assert len(first) == held[-1] + 1


@pytest.mark.parametrize(
    'values',
    [
        np.zeros((len(TIME), 3)),
        np.round(np.sin(2.0 * TIME) / 0.05)[:, None],  # an encoder of coarse steps
        np.where(TIME < 8.0, 0.0, np.sin(5.0 * TIME))[:, None],  # rest, then motion
        np.floor(TIME / 0.7)[:, None],  # too few to say
        np.zeros((0, 3)),
        np.full((len(TIME), 2), np.nan),
    ],
)
def test_what_stands_is_no_repeat(values):
    assert len(first_of_each(values)) == len(values)


def test_noise_repeats_nothing(rng):
    assert len(first_of_each(noisy(rng))) == len(TIME)


def test_each_sensor_by_itself_and_the_notes_say_so(rng):
    stamps = to_stamps(TIME)
    held = noisy(rng)[np.arange(len(TIME)) // 4]
    # positions are repeated, rates are not: one message says both, so nothing is
    joints = JointSeries(('a', 'b', 'c'), stamps, held, noisy(rng), None)
    record = Record(joints=joints, rates=RateSeries(stamps, held))
    kept = without_repeats(record)
    assert kept.joints is record.joints
    np.testing.assert_array_equal(kept.rates.stamp_ns, stamps[::4])
    assert kept.notes == ('rates: every reading is there 4 times: taken once',)
    assert without_repeats(kept) is kept


def test_readings_that_stand_while_the_arm_goes_on_are_left_out(rng):
    """A logger that gets none for 30 ms: the next one is where the arm has gone meanwhile."""
    position = np.sin(3.0 * TIME)[:, None] * [1.0, 0.5]
    effort = noisy(rng, 2)
    held = np.arange(len(TIME))
    for first in (100, 400, 730):
        held[first : first + 4] = first
    joints = JointSeries(('a', 'b'), to_stamps(TIME), position[held], None, effort[held])
    kept = without_repeats(Record(joints=joints))
    lost = [k for first in (100, 400, 730) for k in range(first + 1, first + 4)]
    np.testing.assert_array_equal(kept.joints.position, np.delete(position, lost, axis=0))
    assert kept.notes == ('joints: 9 readings repeated while it moved on: left out',)


@pytest.mark.parametrize(
    'position',
    [
        np.zeros(len(TIME)),
        np.where((TIME > 3.0) & (TIME < 6.0), 0.0, np.sin(np.pi * TIME)),  # rest, and on again
        np.round(np.sin(0.4 * TIME) / 0.01),  # it creeps by the steps of its encoder
    ],
)
def test_what_rests_or_creeps_has_no_stalls(position):
    """Without any noise of its torques."""
    values = np.column_stack([position, np.zeros(len(TIME))])
    assert len(without_stalls(values, position[:, None])) == len(TIME)
