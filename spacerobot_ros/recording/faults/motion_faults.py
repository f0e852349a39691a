r"""Faults that kinematics alone shows: no mass, no torque, no model.

Positions and rates of a joint, and attitude and gyro, mean the same motion twice:

    q(t2) - q(t1) = int q' dt           log(R(t1)^T R(t2)) ~ int omega dt

Where they disagree and one slip of a data sheet (a unit, a sign, two columns exchanged, another
convention of quaternions) makes them agree, that slip is named. A physical cause must not be: a
few per cent of scale or a small angle of misalignment is left to the diagnosis.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...types import Array
from ..record import Record
from .signals import Pair, agree, base_pair, clock_jumps, disagree, joint_pair, turned, turns
from .thresholds import (
    COMMON,
    DEAD_TURN,
    EXTREME,
    MOVED,
    OWN_SCALE,
    DataFault,
    in_lines,
)

DEGREES = 180.0 / np.pi
_FACTORS = {
    DEGREES: 'degrees instead of radians',
    1.0 / DEGREES: 'radians converted as if they were degrees',
    30.0 / np.pi: 'rpm instead of rad/s',
    1000.0: 'a thousand times too large',
    1e-3: 'a thousand times too small',
    -1.0: 'of the wrong sign',
}
_INVERSE = np.array([-1.0, -1.0, -1.0, 1.0])
_SCALAR_FIRST = 'the quaternion has its scalar first, expected xyzw'
_INVERTED = 'it takes inertial to base coordinates, expected q_WB'


def find_faults(record: Record) -> tuple[DataFault, ...]:
    """Every fault that kinematics shows, joints first; none where nothing moves."""
    return (*_joint_faults(record), *_base_faults(record))


def contradictions(record: Record) -> tuple[str, ...]:
    """Every fault that kinematics shows, and disagreements that no slip explains, in lines."""
    faults = find_faults(record)
    named = {fault.place.split('/')[0] for fault in faults}
    for pair, places, what in (
        (joint_pair(record), {'joint_rate', 'joint_position'}, 'joint positions and rates'),
        (base_pair(record), {'gyro', 'attitude'}, 'gyro and attitude'),
    ):
        if pair is None or named & places or not pair.is_large:
            continue
        if disagree(pair.moved, pair.integrated):
            faults += (DataFault('foreign', what, 'they do not belong together'),)
    return in_lines(faults)


def dead_base(record: Record) -> Iterator[DataFault]:
    """Axes of the gyro that never change although the base turns about them; or the attitude."""
    if record.rates is None or record.attitude is None:
        return
    omega, turned_by = record.omega, np.ptp(turns(record), axis=0)
    seconds = float(record.attitude_time[-1] - record.attitude_time[0])
    if np.ptp(record.attitude_xyzw, axis=0).max() == 0.0:
        if len(record.attitude_time) > 2 and np.any(omega):
            yield DataFault('constant', 'attitude', 'never changes, the gyro does')
        return
    steady = np.isclose(turned_by, np.abs(omega.mean(axis=0)) * seconds, rtol=0.1, atol=0.0)
    dead = (np.ptp(omega, axis=0) == 0.0) & (turned_by > DEAD_TURN * turned_by.max()) & ~steady
    places = (
        ['gyro'] if np.ptp(omega) == 0.0 else [f'gyro/{"xyz"[i]}' for i in np.flatnonzero(dead)]
    )
    for place in places if dead.any() else ():
        yield DataFault('constant', place, 'never changes, the attitude does')


def _joint_faults(record: Record) -> Iterator[DataFault]:
    if record.joints is None or record.qd is None:
        return
    names = record.joints.names
    yield from clock_jumps(Record(record.joints))
    pair = joint_pair(record)
    if pair is None:
        return
    unlike = _beyond_noise(record, pair)
    for kind, other, values in (
        ('position', 'rate', record.q),
        ('rate', 'position', record.qd),
    ):
        for i in np.flatnonzero((np.ptp(values, axis=0) == 0.0) & unlike):
            message = f'never changes, its {other} does'
            yield DataFault('constant', f'joint_{kind}/{names[i]}', message)
    yield from _joint_slips(names, pair)


def unlike_positions(record: Record) -> NDArray[np.bool_]:
    """(n,) joints whose rates are no derivative of their positions; none where a slip is named."""
    pair = joint_pair(record)
    if pair is None or any(_joint_faults(record)):
        return np.zeros(record.q.shape[1], dtype=bool)
    moved, integrated = pair.moved.T, pair.integrated.T
    rms = [np.sqrt(np.mean(x**2, axis=1)) for x in (moved, integrated)]
    wrong = [disagree(*motion) for motion in zip(moved, integrated, strict=True)]
    return np.array(wrong) & (np.maximum(*rms) > MOVED)


def _beyond_noise(record: Record, pair: Pair) -> NDArray[np.bool_]:
    """(n,) whether positions and rates differ by more than steps and noise allow of both.

    Over a window of T seconds with samples dt apart

        |moved - integrated| <= 2 step + r T + EXTREME (sqrt(2) s_q + s_v sqrt(T dt))

    as both ends of a motion may be read a step off, rates are rounded to their own steps, some of
    which leave out zero, and below r, the larger of such a step and the smallest rate that any
    joint says, may be held to zero; and of noise that is white the two ends and the integral have
    these standard deviations. A column that never changes does not show its step: it has the
    largest of the other joints.
    """
    time, q, qd = record.joint_time, record.q, np.asarray(record.qd)
    steps = _steps(q)
    moving = np.abs(qd[:, np.ptp(qd, axis=0) > 0.0])
    least = np.maximum(_steps(qd), _smallest(moving[moving > 0.0]))
    # fourth differences of a smooth motion are noise: variance 1 + 16 + 36 + 16 + 1 times its own
    s_q, s_v = (np.std(np.diff(x, n=4, axis=0), axis=0) / np.sqrt(70.0) for x in (q, qd))
    T = time[pair.windows[:, 1]] - time[pair.windows[:, 0]]
    noise = np.sqrt(2.0) * s_q + s_v * np.sqrt(T * np.median(np.diff(time)))[:, None]
    allowed = 2.0 * steps + least * T[:, None] + EXTREME * noise
    return np.asarray(np.any(np.abs(pair.moved - pair.integrated) > allowed, axis=0))


def _steps(values: Array) -> Array:
    """(n,) smallest difference between the values of each column."""
    steps = np.array([_smallest(np.diff(np.unique(column))) for column in values.T])
    return np.where(steps == 0.0, steps.max(), steps)


def _smallest(values: Array) -> float:
    """The smallest of some positive numbers; 0 without any."""
    return float(values.min()) if values.size else 0.0


def _joint_slips(names: tuple[str, ...], pair: Pair) -> Iterator[DataFault]:
    moved, integrated = pair.moved.T, pair.integrated.T
    wrong = [i for i in range(len(names)) if disagree(moved[i], integrated[i])]
    for i, j in itertools.combinations(wrong, 2):
        if agree(moved[i], integrated[j]) and agree(moved[j], integrated[i]):
            message = f'columns of {names[i]} and {names[j]} are exchanged'
            yield DataFault('exchanged', 'joint_rate', message)
            wrong = [k for k in wrong if k not in (i, j)]
    slips = [
        fault
        for i in wrong
        for fault in _factor(f'joint_rate/{names[i]}', 'positions', moved[i], integrated[i])
    ]
    yield from slips or _clock_factor(pair)


def _clock_factor(pair: Pair) -> Iterator[DataFault]:
    """The factor by which all rates miss the derivatives of positions: that of the clock.

    Sensors of several joints have no scale in common; one joint may.
    """
    rms = np.sqrt(np.mean(pair.moved**2, axis=0))
    moves = (rms > MOVED) & np.any(pair.integrated, axis=0)
    moved, integrated = pair.moved[:, moves], pair.integrated[:, moves]
    factors = np.sum(moved * integrated, axis=0) / np.sum(integrated**2, axis=0)
    if len(factors) < 2 or np.min(factors) <= 0.0:
        return
    factor = float(np.median(factors))
    is_common = np.max(np.abs(factors / factor - 1.0)) < COMMON
    is_all = all(agree(m, factor * i) for m, i in zip(moved.T, integrated.T, strict=True))
    if not (is_common and is_all and abs(np.log(factor)) > OWN_SCALE):
        return
    message = (
        f'all rates are {1.0 / factor:.3g} times the derivative of the positions: is the clock '
        f'off by that factor? Scale its stamps by {factor:.3g}, or the rates'
    )
    yield DataFault('clock', 'joints', message)


def _factor(place: str, others: str, moved: Array, integrated: Array) -> tuple[DataFault, ...]:
    """The slip of unit or sign that makes the rates fit the motion, if there is one."""
    for factor, words in _FACTORS.items():
        if agree(moved, integrated / factor):
            kind = 'sign' if factor < 0.0 else 'scale'
            return (DataFault(kind, place, f'rates against {others} are {words}'),)
    return ()


def _base_faults(record: Record) -> Iterator[DataFault]:
    """The one slip that makes attitude and gyro agree; nothing where there is none."""
    pair = base_pair(record)
    if pair is None or not disagree(pair.moved, pair.integrated):
        return
    yield from (
        tuple(dead_base(record))
        or _factor('gyro', 'the attitude', pair.moved, pair.integrated)
        or itertools.islice(_conventions(record, pair), 1)
    )


def _conventions(record: Record, pair: Pair) -> Iterator[DataFault]:
    """Every other convention that fits: of the quaternion, of the gyro's frame and axes."""
    q, windows, integrated = record.attitude_xyzw, pair.windows, pair.integrated
    scalar_last = np.roll(q, -1, axis=1)
    for kind, quaternion, message in (
        ('order', scalar_last, _SCALAR_FIRST),
        ('sign', q * _INVERSE, _INVERTED),
        ('order', scalar_last * _INVERSE, f'{_SCALAR_FIRST}; and {_INVERTED}'),
    ):
        if agree(turned(quaternion, windows), integrated):
            yield DataFault(kind, 'attitude', message)
    if agree(turned(q, windows, in_base=False), integrated):
        message = 'its rates are in inertial coordinates, expected base coordinates'
        yield DataFault('frame', 'gyro', message)
    signs = itertools.product((1.0, -1.0), repeat=3)
    for order, sign in itertools.product(itertools.permutations(range(3)), list(signs)):
        if agree(pair.moved, integrated[:, order] * np.array(sign)):
            axes = ', '.join(
                f'{"-" if s < 0 else ""}{"xyz"[k]}' for k, s in zip(order, sign, strict=True)
            )
            kind = 'sign' if order == (0, 1, 2) else 'exchanged'
            message = f"its ({axes}) are the base's x, y, z"
            yield DataFault(kind, 'gyro', f'axes are exchanged or flipped: {message}')
