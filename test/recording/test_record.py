"""A record refuses what isn't a clean time series, names the place, and can't be changed."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.npz import load_npz, save_npz
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record

STAMPS = np.array([0, 10, 20])
NAMES = ('a', 'b')
UNIT = np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))


def joints(**changes):
    values = {
        'names': NAMES,
        'stamp_ns': STAMPS,
        'position': np.arange(6.0).reshape(3, 2),
        'velocity': np.ones((3, 2)),
        'effort': np.zeros((3, 2)),
    }
    return JointSeries(**{**values, **changes})


def with_entry(values, index, entry):
    values = np.array(values, dtype=float)
    values[index] = entry
    return values


REFUSALS = {
    'nan': (lambda: joints(position=with_entry(np.ones((3, 2)), (1, 0), np.nan)),
            r'joints.position\[1\] \(a\): nan is not finite'),
    'infinite effort': (lambda: joints(effort=with_entry(np.ones((3, 2)), (2, 1), np.inf)),
                        r'joints.effort\[2\] \(b\): inf is not finite'),
    'shape': (lambda: joints(velocity=np.ones((2, 2))),
              r'joints.velocity: expected shape \(3, 2\), got \(2, 2\)'),
    'transposed': (lambda: joints(position=np.ones((2, 3))), 'joints.position: expected shape'),
    'backwards': (lambda: joints(stamp_ns=np.array([0, 20, 10])),
                  r'joints.stamp_ns\[2\]: 10 ns is not after 20 ns'),
    'duplicate': (lambda: joints(stamp_ns=np.array([0, 0, 10])),
                  r'joints.stamp_ns\[1\]: 0 ns is not after 0 ns'),
    'float stamps': (lambda: joints(stamp_ns=STAMPS * 1e-9), 'expected whole nanoseconds'),
    'empty': (lambda: joints(stamp_ns=np.zeros(0, dtype=int)), 'expected a list of stamps'),
    'same name twice': (lambda: joints(names=('a', 'a')), 'must be distinct'),
    'no name': (lambda: joints(names=()), r'expected shape \(3, 0\), got \(3, 2\)'),
    'rate': (lambda: RateSeries(STAMPS, with_entry(np.ones((3, 3)), (0, 2), np.nan)),
             r'rates.omega\[0\] \(z\): nan is not finite'),
    'norm': (lambda: AttitudeSeries(STAMPS, with_entry(UNIT, (1, 3), 1.00001)),
             r'attitudes.q_xyzw\[1\]: not a unit quaternion: its norm is 1.00001'),
    'zero quaternion': (lambda: AttitudeSeries(STAMPS, with_entry(UNIT, 2, 0.0)), 'norm is 0'),
}  # fmt: skip


@pytest.mark.parametrize(('make', 'message'), REFUSALS.values(), ids=REFUSALS.keys())
def test_refusals_name_the_place(make, message):
    with pytest.raises(RecordingError, match=message):
        make()


def test_a_record_is_frozen_and_keeps_no_alias():
    position = np.zeros((3, 2))
    series = joints(position=position)
    position[:] = 5.0
    assert not series.position.any()
    with pytest.raises(ValueError, match='read-only'):
        series.position[0] = 1.0
    with pytest.raises(ValueError, match='read-only'):
        series.stamp_ns[0] = 1


def record(**changes):
    values = {
        'joints': joints(),
        'rates': RateSeries(STAMPS + 5, np.ones((3, 3))),
        'attitudes': AttitudeSeries(STAMPS[:1], UNIT[:1]),
        'wheels': joints(names=('w1', 'w2'), effort=None),
        'source': 'a run',
        'notes': ('first', 'second'),
    }
    return Record(**{**values, **changes})


def test_views_count_seconds_from_one_origin():
    r = record(joints=joints(effort_delay=5e-9))
    np.testing.assert_allclose(r.joint_time, [0.0, 1e-8, 2e-8], rtol=1e-15, atol=0.0)  # rounding
    np.testing.assert_allclose(r.effort_time, r.joint_time - 5e-9, rtol=0.0, atol=1e-24)
    np.testing.assert_allclose(r.rate_time, [5e-9, 1.5e-8, 2.5e-8], rtol=1e-15, atol=0.0)
    assert r.q is r.joints.position
    assert r.attitude is not None
    assert len(r.attitude) == len(r.attitude_time) == 1


def test_a_part_keeps_the_origin_and_may_lack_a_sensor():
    r = record().between(5e-9, 2e-8)
    assert r.origin_ns == 0
    assert r.joints.stamp_ns.tolist() == [10, 20]
    assert r.rates.stamp_ns.tolist() == [15]  # start < t <= end
    assert (len(r.attitude_time), r.attitude, r.attitude_xyzw.shape) == (0, None, (0, 4))
    assert r.span == (1e-8, 2e-8)
    with pytest.raises(ValueError, match='read-only'):
        r.q[0] = 1.0


def test_views_of_absent_sensors_are_empty():
    r = Record()
    assert (r.q.shape, r.qd, r.effort, r.attitude) == ((0, 0), None, None, None)
    assert r.omega.shape == (0, 3)
    assert len(r.joint_time) == len(r.effort_time) == len(r.rate_time) == 0


def test_span():
    assert record().span_ns == (0, 25)
    assert Record(None, None, None).span_ns == (0, 0)


@pytest.mark.parametrize(
    'changes',
    [{}, {'wheels': None}, {'joints': None, 'rates': None}, {'attitudes': None, 'notes': ()}],
)
def test_npz_round_trip_is_exact(tmp_path, changes):
    path = tmp_path / 'run.npz'
    first = record(**changes)
    save_npz(first, path)
    again = load_npz(path)
    assert (again.source, again.notes) == (first.source, first.notes)
    for name in ('joints', 'rates', 'attitudes', 'wheels'):
        a, b = getattr(first, name), getattr(again, name)
        assert (a is None) == (b is None)
        for field in () if a is None else a.__dataclass_fields__:
            if isinstance(getattr(a, field), np.ndarray):
                np.testing.assert_array_equal(getattr(a, field), getattr(b, field))
            else:
                assert getattr(a, field) == getattr(b, field)


def test_npz_is_the_same_to_the_last_bit(tmp_path):
    digests = set()
    for name in ('one.npz', 'two.npz'):
        save_npz(record(), tmp_path / name)
        digests.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert len(digests) == 1


def test_npz_refusals(tmp_path):
    path = tmp_path / 'x.npz'
    with pytest.raises(RecordingError, match='not a readable npz'):
        load_npz(path)
    path.write_bytes(b'nonsense')
    with pytest.raises(RecordingError, match='not a readable npz'):
        load_npz(path)
    np.savez(path, a=np.ones(3))
    with pytest.raises(RecordingError, match='not a record'):
        load_npz(path)
    np.savez(path, a=np.array([object()], dtype=object))
    with pytest.raises(RecordingError, match=r'Object arrays cannot|pickle'):
        load_npz(path)
    save_npz(record(), path)
    with np.load(path) as file:
        content = dict(file)
    content['rates.omega'][1, 1] = np.nan
    np.savez(path, **content)
    with pytest.raises(RecordingError, match=r'x.npz: rates.omega\[1\] \(y\): nan'):
        load_npz(path)
    del content['rates.stamp_ns']
    np.savez(path, **content)
    with pytest.raises(RecordingError, match=r"lacks 'rates\.stamp_ns'"):
        load_npz(path)
    with pytest.raises(RecordingError, match='can not be written'):
        save_npz(record(), path / 'no_folder.npz')
