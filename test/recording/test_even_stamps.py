"""Stamps that scatter about an even clock are its own; of samples taken unevenly they stay."""

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.recording.faults.even_stamps import with_even_stamps
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record, to_stamps
from spacerobot_ros.recording.series import InputSeries
from spacerobot_ros.recording.tables.sample_clock import parted

PERIOD = 0.01
EVEN = PERIOD * np.arange(3000)
NOISE = 1e-5


def motion(time):
    """Positions of two joints."""
    return np.column_stack([np.sin(time), 0.5 * np.cos(2.0 * time)])


def record_of(stamped, sampled, rng, lost=()):
    """Samples taken at some times, stamped with others."""
    values = motion(sampled) + NOISE * rng.standard_normal((len(sampled), 2))
    keep = ~np.isin(np.arange(len(sampled)), lost)
    stamps = to_stamps(stamped[keep], 10**18)
    return Record(joints=JointSeries(('a', 'b'), stamps, values[keep], None, None), source='run')


@pytest.mark.parametrize('scatter', [1e-4, 5e-4, 1e-3])
@pytest.mark.parametrize('lost', [(), range(20, 2900, 37), range(500, 560)])
def test_an_even_clock_counts_where_samples_follow_it(rng, scatter, lost):
    stamped = EVEN + scatter * rng.standard_normal(len(EVEN))
    record = record_of(np.sort(stamped), EVEN, rng, lost)
    even = with_even_stamps(record)
    assert 'about an even clock' in even.notes[0]
    kept = EVEN[~np.isin(np.arange(len(EVEN)), lost)]
    off = 1e-9 * (even.joints.stamp_ns - 10**18) - kept
    assert np.max(np.abs(off)) < 5.0 * scatter / np.sqrt(len(EVEN))
    np.testing.assert_array_equal(even.q, record.q)
    assert even.origin_ns == record.origin_ns


def test_stamps_that_are_late_by_periods_do_not_lose_the_clock(rng):
    """Samples that waited in a queue: two dozen come at once, twice two of them with one stamp."""
    stamped = EVEN + 5e-4 * rng.standard_normal(len(EVEN))
    stamped[700:703] = stamped[703] - 1e-3 * np.array([3.0, 2.0, 2.0])
    stamped[1500:1503] = stamped[1503] - 1e-3 * np.array([3.0, 3.0, 2.0])
    even = with_even_stamps(record_of(parted(np.sort(stamped)), EVEN, rng))
    off = 1e-9 * (even.joints.stamp_ns - 10**18) - EVEN
    assert np.max(np.abs(off)) < 1e-4


@pytest.mark.parametrize(
    ('alike', 'is_parted'),
    [
        ([50], True),
        ([50, 51, 70], True),
        ([50, 51, 52], False),  # a block
        ([50, 52, 54, 56], False),  # too many of 300
        ([299], False),  # nothing follows
    ],
)
def test_a_few_stamps_that_come_twice_are_spread_up_to_the_next(alike, is_parted):
    stamps = np.arange(300.0)
    for k in alike:
        stamps[k] = stamps[k - 1]
    out = parted(stamps)
    if not is_parted:
        np.testing.assert_array_equal(out, stamps)
    else:
        assert np.all(np.diff(out) > 0.0)
        changed = np.flatnonzero(out != stamps)
        np.testing.assert_array_equal(changed, alike)
        assert out[alike[0]] == 50.0 if len(alike) == 1 else 49.0 < out[50] < out[51] < 52.0


@pytest.mark.parametrize('scatter', [1e-4, 1e-3])
def test_stamps_of_samples_that_were_taken_unevenly_stay(rng, scatter):
    taken = np.sort(EVEN + scatter * rng.standard_normal(len(EVEN)))
    record = record_of(taken, taken, rng)
    assert with_even_stamps(record) is record


@pytest.mark.parametrize(
    'stamped',
    [
        EVEN,
        EVEN + 1e-3 * np.sin(EVEN),  # a clock that wanders
        EVEN * (1.0 + 1e-4 * EVEN),  # or drifts
        np.where(EVEN > 15.0, EVEN + 0.3, EVEN),  # or jumps
    ],
)
def test_clocks_that_are_even_already_or_not_at_all_stay(rng, stamped):
    record = record_of(stamped, EVEN, rng)
    assert with_even_stamps(record) is record


def test_too_few_samples_say_nothing_and_each_sensor_has_its_own_clock(rng):
    stamped = np.sort(EVEN + 1e-3 * rng.standard_normal(len(EVEN)))
    record = record_of(stamped, EVEN, rng)
    few = Record(joints=record.joints.at(slice(0, 150)))
    assert with_even_stamps(few) is few
    rate = np.cos(stamped)[:, None] * np.ones(3) + 1e-6 * rng.standard_normal((len(EVEN), 3))
    both = Record(joints=record.joints, rates=RateSeries(to_stamps(stamped, 10**18), rate))
    even = with_even_stamps(both)
    assert even.rates is both.rates  # taken when stamped
    assert even.joints is not both.joints


@pytest.mark.parametrize('size', [3, 10])
@pytest.mark.parametrize('lost', [(), range(1200, 1260)], ids=['whole', 'with a pause'])
def test_bursts_of_a_buffer_are_put_on_its_even_clock(rng, size, lost):
    """The newest sample of a burst is stamped when it is read, the others just before."""
    reads = EVEN[size - 1 :: size]
    within = 1e-4 * (np.arange(size) - size + 1)
    late = 1e-3 * rng.standard_normal(len(reads))
    stamped = (reads + late)[:, None] + within
    sampled = EVEN[: stamped.size]
    record = record_of(stamped.ravel(), sampled, rng, lost)
    same = {'extra/oil': InputSeries(('oil',), record.joints.stamp_ns, record.q[:, :1], ('K',))}
    even = with_even_stamps(replace(record, inputs=same))
    assert f'stamps come in bursts of {size} about an even clock' in even.notes[0]
    kept = sampled[~np.isin(np.arange(len(sampled)), lost)]
    off = 1e-9 * (even.joints.stamp_ns - 10**18) - kept
    assert np.max(np.abs(off)) < 2e-4  # 5 deviations of the mean of 300 late readings
    np.testing.assert_array_equal(even.inputs['extra/oil'].stamp_ns, even.joints.stamp_ns)


def test_stamps_in_bursts_of_no_even_clock_stay(rng):
    """Samples that were really taken three at a time are no smoother at even times."""
    stamped = (0.03 * np.arange(1000)[:, None] + 1e-4 * np.arange(3)).ravel()
    record = record_of(stamped, stamped, rng)
    assert with_even_stamps(record) is record
