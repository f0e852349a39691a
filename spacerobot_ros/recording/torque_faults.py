r"""Faults of the data that only the robot's dynamics shows: slips in all columns of a joint.

Along the measured motion the model asks for the torques

    tau = H(q) q'' + c(q, q', omega)                     # base eliminated; docs/equations.md

Where the measured efforts are unlike it and one slip of a data sheet makes them alike, that slip
is named. Both are judged twice: as they are, and with friction and bias allowed for. What no slip
explains is left to the diagnosis.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from ..dynamics.equations import joint_torques
from ..model.robot import Robot
from ..types import Array
from .faults import DataFault
from .record import Record

UNLIKE = 0.02  # share of the torques that the model does not explain: less is no slip
ALIKE = 0.03  # a slip must leave less than this,
GAIN = 20.0  # and this much less than none
SPAN = 0.25  # s, over which positions are smoothed
ROWS = 100
_DEGREES = 57.29577951308232


@dataclass(frozen=True, slots=True)
class _Slip:
    """What was done to the data, undone by exchanging columns and dividing by factors."""

    fault: DataFault
    order: tuple[int, ...]
    motion: Array  # (n,) factor of positions
    effort_order: tuple[int, ...]
    effort: Array  # (n,) factor of efforts


def find_torque_faults(record: Record, robot: Robot) -> tuple[DataFault, ...]:
    """The slip that makes measured efforts and the model's torques alike, if there is one.

    Args:
        record: With joint efforts; for a free base with the gyro.
        robot: What the model believes.

    Returns:
        At most one fault; none where the data lack what it takes, or where none is needed.
    """
    data = _prepared(record, robot)
    if data is None:
        return ()
    q, effort, omega, step, rows = data
    n = robot.n_joints
    none = _slip(n, '', '', '')
    before = _unlike(robot, none, q, effort, omega, step, rows)
    if np.all(before < UNLIKE):
        return ()
    slips = list(_slips(robot.joints[:n]))
    shares = np.array([_unlike(robot, slip, q, effort, omega, step, rows) for slip in slips])
    for way in range(2):
        best = int(np.argmin(shares[:, way].mean(axis=1)))
        if _explains(before[way], shares[best, way]):
            return (slips[best].fault,)
    return ()


def _explains(before: Array, after: Array) -> bool:
    """Whether a slip mends at least one joint and spoils none; noise is left as it is."""
    mended = (before > UNLIKE) & (after < np.minimum(ALIKE, before / GAIN))
    return bool(mended.any() and np.all(after < np.maximum(ALIKE, 1.2 * before)))


def _prepared(record: Record, robot: Robot) -> tuple[Array, Array, Array, float, Array] | None:
    """Positions and efforts on an even grid, the gyro beside them, step and rows to look at."""
    joints = record.joints
    if joints is None or joints.effort is None or robot.rotor_count:
        return None
    if robot.is_free and record.rates is None:
        return None
    t = (joints.stamp_ns - joints.stamp_ns[0]) / 1e9
    if len(t) < 50:
        return None
    step = float(np.median(np.diff(t)))
    grid = np.arange(0.0, t[-1], step)
    span = 2 * max(2, round(0.5 * SPAN / step)) + 1
    if len(grid) < 4 * span:
        return None
    q, effort = (
        np.column_stack([np.interp(grid, t, column) for column in values.T])
        for values in (joints.position, joints.effort)
    )
    omega = np.zeros((len(grid), 3))
    if robot.is_free and record.rates is not None:
        clock = (record.rates.stamp_ns - joints.stamp_ns[0]) / 1e9
        omega = np.column_stack([np.interp(grid, clock, w) for w in record.rates.omega.T])
    effort = savgol_filter(effort, span, 3, axis=0)
    rows = np.linspace(span, len(grid) - span - 1, ROWS).astype(int)
    return q, effort[rows], omega[rows], step, rows


def _unlike(
    robot: Robot,
    slip: _Slip,
    q: Array,
    effort: Array,
    omega: Array,
    step: float,
    rows: Array,
) -> Array:
    """(2, n) share of each joint's torque that the model does not explain, the slip undone.

    As it is, and with friction and bias taken out of both.
    """
    span = 2 * max(2, round(0.5 * SPAN / step)) + 1
    undone = q[:, slip.order] / slip.motion
    position, rate, acceleration = (
        savgol_filter(undone, span, 3, d, step, axis=0)[rows] for d in range(3)
    )
    measured = effort[:, slip.effort_order] / slip.effort
    model = joint_torques(robot, position, rate, acceleration, omega)
    shares = [_shares(model[:, i], measured[:, i], rate[:, i]) for i in range(measured.shape[1])]
    return np.array(shares).T


def _shares(model: Array, measured: Array, rate: Array) -> tuple[float, float]:
    """Difference of the larger of the two torques; again with friction and bias out of both."""
    others = np.column_stack([np.ones_like(rate), rate, np.sign(rate)])
    both = np.column_stack([model, measured])
    rest = both - others @ np.linalg.lstsq(others, both, rcond=None)[0]
    return _difference(both), _difference(rest)


def _difference(pair: Array) -> float:
    scale = float(np.max(np.sum(pair**2, axis=0)))
    return float(np.sum((pair[:, 1] - pair[:, 0]) ** 2)) / scale if scale > 0.0 else 0.0


def _slip(
    n: int,
    kind: str,
    place: str,
    message: str,
    *,
    order: tuple[int, ...] | None = None,
    motion: Array | float = 1.0,
    effort_order: tuple[int, ...] | None = None,
    effort: Array | float = 1.0,
) -> _Slip:
    same = tuple(range(n))
    return _Slip(
        DataFault(kind, place, message),
        order or same,
        np.ones(n) * motion,
        effort_order or same,
        np.ones(n) * effort,
    )


def _slips(names: tuple[str, ...]) -> Iterator[_Slip]:
    """Every slip that is tried, the efforts' own first."""
    n = len(names)
    for factor, words in ((1000.0, 'large'), (1e-3, 'small')):
        message = f'a thousand times too {words} for this robot: N m expected'
        yield _slip(n, 'scale', 'joint_torque', message, effort=factor)
    yield _slip(n, 'sign', 'joint_torque', 'all efforts are of the wrong sign', effort=-1.0)
    for factor, words in (
        (_DEGREES, 'degrees instead of radians'),
        (1.0 / _DEGREES, 'radians converted as if they were degrees'),
    ):
        yield _slip(n, 'scale', 'joints', f'positions are {words}', motion=factor)
    for i, name in enumerate(names):
        flip = np.where(np.arange(n) == i, -1.0, 1.0)
        place = f'joint_torque/{name}'
        yield _slip(n, 'sign', place, 'of the wrong sign', effort=flip)
        message = 'position, rate and effort are of the wrong sign'
        yield _slip(n, 'sign', f'joints/{name}', message, motion=flip, effort=flip)
        message = 'position and rate are of the wrong sign'
        yield _slip(n, 'sign', f'joints/{name}', message, motion=flip)
    for i, j in itertools.combinations(range(n), 2):
        order = list(range(n))
        order[i], order[j] = j, i
        pair, both = f'columns of {names[i]} and {names[j]} are exchanged', tuple(order)
        yield _slip(n, 'exchanged', 'joint_torque', pair, effort_order=both)
        yield _slip(n, 'exchanged', 'joints', pair, order=both, effort_order=both)
