"""Single bad samples are left out and said; what lasts, flickers or is rough stays."""

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.recording.faults.spikes import spikes, without_spikes
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record, to_stamps

TIME = np.arange(0.0, 20.0, 0.01)
MOTION = np.column_stack([np.sin(TIME), 0.3 * np.cos(2.0 * TIME), np.zeros(len(TIME))])


def noisy(rng):
    """Positions of three joints, one of them at rest, with noise of 1e-5 rad."""
    return MOTION + 1e-5 * rng.standard_normal(MOTION.shape)


@pytest.mark.parametrize('size', [-0.2, 0.5, 1e6, 1e300])
@pytest.mark.parametrize('joint', [0, 2])
def test_one_bad_sample_is_found_and_no_other(rng, size, joint):
    values = noisy(rng)
    values[700, joint] += size
    assert np.flatnonzero(spikes(TIME, values)).tolist() == [700]


def test_bad_samples_beside_each_other_are_found(rng):
    values = noisy(rng)
    values[[300, 301, 305, 900], [0, 0, 1, 2]] += 0.2
    assert np.flatnonzero(spikes(TIME, values)).tolist() == [300, 301, 305, 900]


def test_one_sample_in_a_hundred_of_any_size_is_found(rng):
    values = noisy(rng)
    bad = np.flatnonzero(rng.random(len(TIME)) < 0.01)
    values[bad, rng.integers(0, 3, len(bad))] += 10.0 ** rng.uniform(-0.5, 3.0, len(bad))
    assert np.flatnonzero(spikes(TIME, values)).tolist() == bad.tolist()


@pytest.mark.parametrize(
    'values',
    [
        np.column_stack([np.sign(np.sin(TIME)), TIME % 2.0]),  # steps, and angles that begin anew
        np.where((TIME > 3.0) & (TIME < 3.5), 1.0, 0.0)[:, None],  # what lasts
        np.round(0.002 * np.sin(3.0 * TIME) / 1e-3)[:, None],  # an encoder's steps
        np.abs(np.sin(3.0 * TIME))[:, None],  # corners
        np.where(np.arange(len(TIME)) % 7 == 0, 1.0, 0.0)[:, None],  # as usual as can be
        np.zeros((len(TIME), 2)),
        np.zeros((len(TIME), 0)),
    ],
)
def test_what_lasts_or_comes_back_is_none(values):
    assert not spikes(TIME, values).any()


def test_noise_alone_has_none():
    for seed in range(20):
        assert not spikes(TIME, np.random.default_rng(seed).standard_normal((len(TIME), 6))).any()


def test_samples_go_one_sensor_at_a_time_and_the_notes_say_so(rng):
    values = noisy(rng)
    effort = 0.1 * rng.standard_normal(values.shape)
    values[500, 0] += 0.4
    effort[900, 1] = 1e3
    rate = 1e-3 * rng.standard_normal(values.shape) + MOTION
    stamps = to_stamps(TIME)
    joints = JointSeries(('a', 'b', 'c'), stamps, values, None, effort)
    record = Record(joints=joints, rates=RateSeries(stamps, rate), source='run')
    kept = without_spikes(record)
    assert kept.joints is not None
    assert np.flatnonzero(~np.isin(stamps, kept.joints.stamp_ns)).tolist() == [500, 900]
    assert kept.rates is record.rates
    assert kept.notes == (
        'joints: 1 sample of 2000 left out, whose position is nowhere near its neighbours, the '
        'first 5 s after the start',
        'joints: 1 sample of 2000 left out, whose effort is nowhere near its neighbours, the '
        'first 9 s after the start',
    )
    clean = replace(record, joints=replace(joints, position=noisy(rng), effort=0.0 * effort))
    assert without_spikes(clean) is clean


def test_a_first_bad_sample_does_not_move_the_times_of_others(rng):
    """Times count from the record's first stamp, whatever is left out."""
    values = noisy(rng)
    values[3, 0] += 1.0
    record = Record(joints=JointSeries(('a', 'b', 'c'), to_stamps(TIME), values, None, None))
    kept = without_spikes(record)
    assert len(kept.joint_time) == len(TIME) - 1
    assert kept.origin_ns == record.origin_ns
