"""Slips of a data sheet are named by kinematics; physical causes and clean data are left alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')

from spacerobot_ros.recording.faults.motion_faults import find_faults  # noqa: E402
from spacerobot_ros.recording.record import (  # noqa: E402
    AttitudeSeries,
    JointSeries,
    RateSeries,
    Record,
)
from validation.mujoco.truth import generate  # noqa: E402

DEGREES = 180.0 / np.pi


@pytest.fixture(scope='module')
def record(tmp_path_factory):
    """Five noisy seconds of the six-joint arm on its free base."""
    return generate('sixdof', folder=tmp_path_factory.mktemp('truth'), seed=3, duration=5.0).data


def joints(record, **changes):
    old = record.joints
    values = {k: getattr(old, k) for k in ('names', 'stamp_ns', 'position', 'velocity', 'effort')}
    return replace(record, joints=JointSeries(**{**values, **changes}))


def gyro(record, omega):
    return replace(record, rates=RateSeries(record.rates.stamp_ns, omega))


def tracker(record, q):
    return replace(record, attitudes=AttitudeSeries(record.attitudes.stamp_ns, q))


def column(values, index, factor):
    out = values.copy()
    out[:, index] *= factor
    return out


def jumped(record, at, jump):
    stamps = record.joints.stamp_ns.copy()
    stamps[at:] += round(jump * 1e9)
    return joints(record, stamp_ns=stamps)


SLIPS = {
    'rates in degrees': (
        lambda r: joints(r, velocity=r.joints.velocity * DEGREES),
        'scale', 'joint_rate/joint_6', 'degrees instead of radians'),
    'rates in rpm': (
        lambda r: joints(r, velocity=r.joints.velocity * 30.0 / np.pi),
        'scale', 'joint_rate/joint_6', 'rpm instead of rad/s'),
    'positions in degrees': (
        lambda r: joints(r, position=r.joints.position * DEGREES),
        'scale', 'joint_rate/joint_6', 'radians converted as if'),
    'milliradians': (
        lambda r: joints(r, velocity=column(r.joints.velocity, 5, 1000.0)),
        'scale', 'joint_rate/joint_6', 'a thousand times too large'),
    'a sign': (
        lambda r: joints(r, velocity=column(r.joints.velocity, 5, -1.0)),
        'sign', 'joint_rate/joint_6', 'of the wrong sign'),
    'two joints': (
        lambda r: joints(r, velocity=r.joints.velocity[:, [0, 2, 1, 3, 4, 5]]),
        'exchanged', 'joint_rate', 'columns of joint_2 and joint_3 are exchanged'),
    'dead rate': (
        lambda r: joints(r, velocity=column(r.joints.velocity, 5, 0.0)),
        'constant', 'joint_rate/joint_6', 'never changes, its position does'),
    'dead encoder': (
        lambda r: joints(r, position=column(r.joints.position, 5, 0.0)),
        'constant', 'joint_position/joint_6', 'never changes, its rate does'),
    'clock': (
        lambda r: jumped(r, 250, 3.0),
        'clock', 'joints', 'the clock jumps by 3.01 s, 2.49 s after the start'),
    'gyro in degrees': (
        lambda r: gyro(r, r.rates.omega * DEGREES),
        'scale', 'gyro', 'degrees instead of radians'),
    'gyro upside down': (
        lambda r: gyro(r, r.rates.omega * [1.0, -1.0, -1.0]),
        'sign', 'gyro', r'its (x, -y, -z)'),
    'gyro axes': (
        lambda r: gyro(r, r.rates.omega[:, [1, 2, 0]]),
        'exchanged', 'gyro', 'its (z, x, y)'),
    'dead gyro': (
        lambda r: gyro(r, r.rates.omega * 0.0),
        'constant', 'gyro', 'never changes, the attitude does'),
    'scalar first': (
        lambda r: tracker(r, np.roll(r.attitudes.q_xyzw, 1, axis=1)),
        'order', 'attitude', 'scalar first'),
    'inverse': (
        lambda r: tracker(r, r.attitudes.q_xyzw * [-1.0, -1.0, -1.0, 1.0]),
        'sign', 'attitude', 'inertial to base'),
}  # fmt: skip


@pytest.mark.parametrize(('slip', 'kind', 'place', 'words'), SLIPS.values(), ids=SLIPS.keys())
def test_a_slip_is_named(record, slip, kind, place, words):
    faults = find_faults(slip(record))
    assert any(f.kind == kind and f.place == place and words in f.message for f in faults), faults
    assert len({f.kind for f in faults}) == 1
    assert all('\n' not in str(f) for f in faults)


CAUSES = {
    'nothing': [],
    'gyro': [
        ('gyro_bias', None, {'x': 1e-3, 'y': 1e-3, 'z': -1e-3}),
        ('gyro_scale', None, {'x': 0.03, 'y': -0.02, 'z': 0.05}),
        ('gyro_misalignment', None, {'x': 0.05, 'y': 0.05, 'z': 0.0}),
    ],
    'attitude': [
        ('attitude_misalignment', None, {'x': 0.05, 'y': 0.0, 'z': 0.1}),
        ('attitude_delay', None, {'delay': 0.1}),
    ],
    'joints': [
        ('joint_rate_scale', 'joint_1', {'gain': 1.1}),
        ('encoder_offset', 'joint_2', {'offset': 0.1}),
        ('encoder_scale', 'joint_3', {'gain': 1.1}),
        ('joint_delay', None, {'delay': 0.02}),
    ],
}


@pytest.mark.parametrize('robot', ['sixdof', 'servicer', 'ground', 'pendulum'])
@pytest.mark.parametrize('cause', CAUSES)
def test_a_physical_cause_is_no_fault_of_the_data(tmp_path, robot, cause):
    known = {'joint_3': 'joint_1', 'joint_1': 'joint_1', 'joint_2': 'joint_2', None: None}
    effects = [
        (name, known[where] if robot == 'pendulum' else where, values)
        for name, where, values in CAUSES[cause]
    ]
    case = generate(robot, effects, folder=tmp_path, seed=4, duration=4.0)
    assert find_faults(case.data) == ()


def test_pauses_are_no_jumps_and_rest_is_no_fault(record):
    kept = np.r_[0:150, 320:500]
    old = record.joints
    columns = {k: getattr(old, k)[kept] for k in ('stamp_ns', 'position', 'velocity', 'effort')}
    assert find_faults(joints(record, **columns)) == ()
    n = len(old.stamp_ns)
    assert find_faults(joints(record, position=np.ones((n, 6)), velocity=np.zeros((n, 6)))) == ()
    assert find_faults(Record()) == ()
    short = JointSeries(old.names, old.stamp_ns[:2], old.position[:2], old.velocity[:2])
    assert find_faults(Record(short, record.rates)) == ()


@pytest.mark.parametrize('seed', range(6))
def test_samples_that_were_lost_are_no_clock_that_jumped(seed):
    rng = np.random.default_rng(seed)
    t = np.arange(1000) * 0.01
    kept = (rng.random(1000) > 0.05) & ((t < 4.0) | (t > 6.0) | (rng.random(1000) > 0.9))
    turn = np.outer(t[kept], [0.9, 1.7, 2.6])
    q = np.sin(turn) + 2e-5 * rng.standard_normal(turn.shape)
    qd = [0.9, 1.7, 2.6] * np.cos(turn) + 2e-4 * rng.standard_normal(turn.shape)
    stamps = np.round(t[kept] * 1e9).astype(np.int64)
    assert find_faults(Record(JointSeries(('a', 'b', 'c'), stamps, q, qd))) == ()


def test_rates_of_joints_at_rest_in_codes_that_leave_out_zero():
    """Rates in whole codes and a half; a joint at rest says half a code, its angle nothing."""
    t = np.arange(1000) * 0.02
    step_q, step_v = 4e-4, 2e-2
    q = np.column_stack([np.sin(t), np.full_like(t, 0.3)])
    qd = np.column_stack([np.cos(t), np.zeros_like(t)])
    q = np.round(q / step_q) * step_q
    qd[:, 0] = (np.floor(qd[:, 0] / step_v / 0.5) + 0.5) * step_v * 0.5  # finer codes
    qd[:, 1] = np.where(np.arange(1000) % 97 == 0, 0.5, -0.5) * step_v
    stamps = np.round(t * 1e9).astype(np.int64)
    assert find_faults(Record(JointSeries(('a', 'b'), stamps, q, qd))) == ()
    qd[:, 1] = 0.4 * np.cos(2.0 * t)  # moves, and its angle is dead
    (fault,) = find_faults(Record(JointSeries(('a', 'b'), stamps, q, qd)))
    assert fault.place == 'joint_position/b'
