r"""Faults of the data themselves, found by kinematics alone: no mass, no torque, no model.

Positions and rates of a joint, and attitude and gyro, say the same thing twice:

    q(t2) - q(t1) = int q' dt           log(R(t1)^T R(t2)) ~ int omega dt

Where they disagree and one slip of a data sheet (a unit, a sign, two columns exchanged, a
quaternion with its scalar first) makes them agree, that slip is named. A physical cause must not
be: a few per cent of scale or a small angle of misalignment is left to the diagnosis.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..types import Array, IntArray
from .record import AttitudeSeries, JointSeries, RateSeries, Record

DISAGREE = 0.3  # share of the motion that is not explained: more can't be a physical cause
AGREE = 0.03  # less is agreement
WINDOW = 0.2  # s: the shortest stretch that is compared
JUMP_PERIODS = 10.0

_FACTORS = {
    57.29577951308232: 'degrees instead of radians',
    1.0 / 57.29577951308232: 'radians converted as if they were degrees',
    9.549296585513721: 'rpm instead of rad/s',
    1000.0: 'a thousand times too large',
    1e-3: 'a thousand times too small',
    -1.0: 'of the wrong sign',
}


@dataclass(frozen=True, slots=True)
class DataFault:
    """A fault of the data.

    Args:
        kind: `constant`, `scale`, `sign`, `exchanged`, `order` or `clock`.
        place: Channel, such as `joint_rate/joint_2`.
        message: What is wrong, in a sentence without the place.
    """

    kind: str
    place: str
    message: str

    def __str__(self) -> str:
        """One line."""
        return f'{self.place}: {self.message}'


def find_faults(record: Record) -> tuple[DataFault, ...]:
    """Every fault that kinematics shows.

    Args:
        record: As it was read.

    Returns:
        The faults, joints first; empty where nothing contradicts, or nothing moves.
    """
    faults: list[DataFault] = []
    if record.joints is not None:
        faults += _constant_joints(record.joints)
        if record.joints.velocity is not None:
            faults += _joint_faults(record.joints, record.joints.velocity)
    if record.rates is not None and record.attitudes is not None:
        faults += _attitude_faults(record.rates, record.attitudes)
    return tuple(faults)


def _constant_joints(joints: JointSeries) -> Iterator[DataFault]:
    """Columns that never change although their joint's other column does."""
    if len(joints.stamp_ns) < 3 or joints.velocity is None:
        return
    still, at_rest = np.ptp(joints.position, axis=0) == 0, np.ptp(joints.velocity, axis=0) == 0
    for i, name in enumerate(joints.names):
        if still[i] and not at_rest[i]:
            yield DataFault('constant', f'joint_position/{name}', 'never changes, its rate does')
        if at_rest[i] and not still[i]:
            yield DataFault('constant', f'joint_rate/{name}', 'never changes, its position does')


def _joint_faults(joints: JointSeries, velocity: Array) -> Iterator[DataFault]:
    seconds = joints.stamp_ns / 1e9
    yield from _clock_jumps(seconds, joints.position, velocity)
    pairs = _windows(seconds)
    if len(pairs) < 2:
        return
    moved = joints.position[pairs[:, 1]] - joints.position[pairs[:, 0]]
    told = _integrals(seconds, velocity, seconds[pairs])
    wrong = [i for i in range(len(joints.names)) if _disagreement(moved[:, i], told[:, i])]
    for i, j in itertools.combinations(wrong, 2):
        if _agree(moved[:, i], told[:, j]) and _agree(moved[:, j], told[:, i]):
            names = f'{joints.names[i]} and {joints.names[j]}'
            yield DataFault('exchanged', 'joint_rate', f'columns of {names} are exchanged')
            wrong = [k for k in wrong if k not in (i, j)]
    for i in wrong:
        factor = _factor(moved[:, i], told[:, i])
        if factor is not None:
            yield DataFault(
                'sign' if factor < 0 else 'scale',
                f'joint_rate/{joints.names[i]}',
                f'rates against positions are {_FACTORS[factor]}',
            )


def _clock_jumps(seconds: Array, position: Array, velocity: Array) -> Iterator[DataFault]:
    """Long pauses in which the joints did not move, although their rates say that they did."""
    steps = np.diff(seconds)
    if len(steps) < 3:
        return
    period = float(np.median(steps))
    mean_rate = 0.5 * (velocity[1:] + velocity[:-1])
    error = np.diff(position, axis=0) - mean_rate * period
    usual = float(np.median(np.linalg.norm(error, axis=1)))
    for k in np.flatnonzero(steps > JUMP_PERIODS * period):
        expected = float(np.linalg.norm(mean_rate[k]) * steps[k])
        if expected > 30.0 * usual and float(np.linalg.norm(error[k])) < 0.1 * expected:
            yield DataFault(
                'clock',
                'joints',
                f'the clock jumps by {steps[k]:.4g} s, {seconds[k] - seconds[0]:.6g} s after '
                'the start: the joints moved on as if no time had passed',
            )


def _windows(seconds: Array) -> IntArray:
    """(K, 2) first and last sample of stretches of at least `WINDOW`, without long pauses."""
    longest = max(WINDOW, 2.0 * float(np.median(np.diff(seconds))) if len(seconds) > 1 else 0.0)
    first = np.arange(0, len(seconds))
    last = np.searchsorted(seconds, seconds + WINDOW - 1e-9)
    ok = (last < len(seconds)) & (last > first)
    first, last = first[ok], last[ok]
    ok = seconds[last] - seconds[first] < 2.0 * longest
    stride = max(1, int(ok.sum()) // 2000)
    return np.column_stack([first[ok], last[ok]])[::stride]


def _integrals(seconds: Array, rates: Array, spans: Array) -> Array:
    """(K, n) integrals of the rates over time spans (K, 2), by trapezoids."""
    steps = np.diff(seconds)[:, None]
    sums = np.vstack(
        [np.zeros((1, rates.shape[1])), np.cumsum(0.5 * (rates[1:] + rates[:-1]) * steps, axis=0)]
    )
    ends = [
        np.column_stack([np.interp(spans[:, side], seconds, column) for column in sums.T])
        for side in (0, 1)
    ]
    return np.asarray(ends[1] - ends[0])


def _share(moved: Array, told: Array) -> float:
    """Share of the motion that the rates don't explain, of the larger of the two."""
    scale = max(float(np.sum(moved**2)), float(np.sum(told**2)))
    return float(np.sum((moved - told) ** 2)) / scale if scale > 0.0 else 0.0


def _disagreement(moved: Array, told: Array) -> bool:
    return _share(moved, told) > DISAGREE


def _agree(moved: Array, told: Array) -> bool:
    return _share(moved, told) < AGREE


def _factor(moved: Array, told: Array) -> float | None:
    """The slip that makes the rates fit the motion."""
    return next((f for f in _FACTORS if _agree(moved, told / f)), None)


def _attitude_faults(rates: RateSeries, attitudes: AttitudeSeries) -> Iterator[DataFault]:
    clock, stamps = rates.stamp_ns / 1e9, attitudes.stamp_ns / 1e9
    pairs = _windows(stamps)
    inside = (stamps[pairs[:, 0]] >= clock[0]) & (stamps[pairs[:, 1]] <= clock[-1])
    pairs = pairs[inside]
    if len(pairs) < 3:
        return
    told = _integrals(clock, rates.omega, stamps[pairs])
    q = attitudes.q_xyzw
    moved = _turned(q, pairs)
    if np.ptp(rates.omega) == 0.0 and _disagreement(moved, told):
        yield DataFault('constant', 'gyro', 'never changes, the attitude does')
    elif _disagreement(moved, told):
        yield from _attitude_slip(q, pairs, moved, told)


def _attitude_slip(q: Array, pairs: IntArray, moved: Array, told: Array) -> Iterator[DataFault]:
    """The one slip that makes attitude and gyro agree; nothing where there is none."""
    factor = _factor(moved, told)
    if factor is not None:
        kind = 'sign' if factor < 0 else 'scale'
        yield DataFault(kind, 'gyro', f'rates against the attitude are {_FACTORS[factor]}')
    elif _agree(_turned(np.roll(q, -1, axis=1), pairs), told):
        yield DataFault('order', 'attitude', 'the quaternion has its scalar first, expected xyzw')
    elif _agree(_turned(q * np.array([-1.0, -1.0, -1.0, 1.0]), pairs), told):
        yield DataFault('sign', 'attitude', 'it takes inertial to base coordinates, expected q_WB')
    else:
        yield from _axis_slip(moved, told)


def _axis_slip(moved: Array, told: Array) -> Iterator[DataFault]:
    """The first order and signs of the gyro's axes that fit, those as they stand first."""
    choices = itertools.product(
        itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3)
    )
    for order, signs in choices:
        if _agree(moved, told[:, order] * np.array(signs)):
            axes = ', '.join(
                f'{"-" if sign < 0 else ""}{"xyz"[k]}'
                for k, sign in zip(order, signs, strict=True)
            )
            kind = 'sign' if order == (0, 1, 2) else 'exchanged'
            message = f"its ({axes}) are the base's x, y, z"
            yield DataFault(kind, 'gyro', f'axes are exchanged or flipped: {message}')
            return


def _turned(q: Array, pairs: IntArray) -> Array:
    """(K, 3) rotation vectors from the first to the last attitude of each pair [rad]."""
    rotation = Rotation.from_quat(q)
    return np.asarray((rotation[pairs[:, 0]].inv() * rotation[pairs[:, 1]]).as_rotvec())
