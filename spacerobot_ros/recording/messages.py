"""What a message must be before it is used, for the nodes and for whoever reads a bag.

Messages are taken by their fields, so those of ROS and those that rosbags decodes serve alike. One
that fails raises `MessageRejectedError` with the reason; nothing is repaired.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import MessageRejectedError
from ..types import Array, Quaternion, Vector3, Vector6

INERTIAL_FRAME = 'inertial'
SECOND_NS = 1_000_000_000
LARGEST = 1e12  # SI; no machine's, and fourth powers of it can still be summed
NORM_LIMIT = 1e-3  # a quaternion further from unit norm is a bad message, not rounding
_NUMBER = re.compile(r'(?<![\w.])[-+]?\d+(\.\d+)?([eE][-+]?\d+)?(?!\w)')


def kind_of(reason: object) -> str:
    """A reason without its numbers, to count what was rejected by."""
    return _NUMBER.sub('#', str(reason))


def stamp_ns(stamp: Any) -> int:
    """A stamp or duration [ns].

    Raises:
        MessageRejectedError: more nanoseconds than a second has.
    """
    if stamp.nanosec >= SECOND_NS:
        raise MessageRejectedError(f'stamp has {stamp.nanosec} ns beside the seconds')
    return int(stamp.sec) * SECOND_NS + int(stamp.nanosec)


def joint_columns(
    message: Any, names: Sequence[str], *columns: str, others: bool = False, partly: bool = False
) -> tuple[Array | None, ...]:
    """Columns of a JointState in the order of the named joints.

    Args:
        message: A JointState.
        names: The joints.
        columns: `position`, `velocity` or `effort`; with `?` behind it may be empty, or all NaN.
        others: Whether there may be joints besides these; they are left out.
        partly: Whether such a column may be NaN for some joints, which do not measure it.

    Returns:
        (n,) each; None for an empty one.

    Raises:
        MessageRejectedError: joints that are missing, foreign or named twice, wrong lengths, or a
            number that is not finite.
    """
    given = list(message.name)
    order = None if given == list(names) else joint_order(given, names, others=others)
    out: list[Array | None] = []
    for column in columns:
        name = column.rstrip('?')
        values = np.asarray(getattr(message, name), dtype=float)
        is_optional = column != name
        if is_optional and np.isnan(values).all():
            out.append(None)
            continue
        if len(values) != len(given):
            raise MessageRejectedError(f'{name} has {len(values)} entries for {len(given)} joints')
        # what other joints say is of no concern
        values = values.copy() if order is None else values[order]
        if not is_optional:
            out.append(_bounded(values, name))
            continue
        absent = np.isnan(values)
        _bounded(values[~absent] if partly else values, name)
        out.append(None if len(absent) and absent.all() else values)
    return tuple(out)


def joint_sample(
    message: Any, names: Sequence[str], *, effort_units: Array | None = None
) -> tuple[Any, ...]:
    """Stamp [ns], positions and rates (n,) of the named joints, other joints left out.

    Args:
        message: A JointState.
        names: The joints.
        effort_units: (n,) `Robot.effort_units`, where efforts (n,) shall follow in N m; None
            where the message has none.

    Raises:
        MessageRejectedError: see `joint_columns`.
    """
    columns = ('position', 'velocity', *(() if effort_units is None else ('effort?',)))
    values = joint_columns(message, names, *columns, others=True)
    if effort_units is not None and values[2] is not None:
        values = (*values[:2], values[2] * effort_units)
    return stamp_ns(message.header.stamp), *values


def joint_efforts(message: Any, names: Sequence[str]) -> tuple[int, Array]:
    """Stamp [ns] and efforts of a command for exactly the named joints, in any order.

    Raises:
        MessageRejectedError: see `joint_columns`.
    """
    (effort,) = joint_columns(message, names, 'effort')
    return stamp_ns(message.header.stamp), np.asarray(effort)


def thruster_shares(message: Any, names: Sequence[str]) -> Array:
    """Commands (k,) of a JointState to exactly the named thrusters, in any order.

    Raises:
        MessageRejectedError: see `joint_columns`.
    """
    try:
        (shares,) = joint_columns(message, names, 'effort')
    except MessageRejectedError as error:
        raise MessageRejectedError(str(error).replace('joint names', 'thrusters')) from error
    return np.asarray(shares)


def angular_rate(message: Any, base_link: str) -> tuple[int, Vector3]:
    """Stamp [ns] and omega_WB_B (3,) of an Imu [rad/s].

    Raises:
        MessageRejectedError: another frame, no angular velocity in it (REP 145), or not finite.
    """
    _check_frame(message.header.frame_id, base_link)
    if message.angular_velocity_covariance[0] == -1.0:
        raise MessageRejectedError('holds no angular velocity (covariance[0] is -1)')
    return stamp_ns(message.header.stamp), _vector(message.angular_velocity, 'angular_velocity')


def attitude(message: Any, base_link: str = '') -> tuple[int, Quaternion]:
    """Stamp [ns] and q_WB (4,) xyzw of a QuaternionStamped, as it came.

    Args:
        message: The message.
        base_link: Where given, any frame but this one is the inertial one.

    Raises:
        MessageRejectedError: another frame, not finite, or a norm off one by more than 1e-3.
    """
    frame = message.header.frame_id
    if frame == base_link != '':
        raise MessageRejectedError(
            f'frame_id is {frame!r}, the base itself, expected the inertial frame'
        )
    if not base_link:
        _check_frame(frame, INERTIAL_FRAME)
    q_xyzw = _vector(message.quaternion, 'quaternion', 'xyzw')
    unit(q_xyzw)
    return stamp_ns(message.header.stamp), q_xyzw


def base_wrench(message: Any, base_link: str) -> tuple[int, Vector6]:
    """Stamp [ns] and [force; torque] (6,) of a WrenchStamped, in base coordinates [N, N m].

    Raises:
        MessageRejectedError: another frame, or not finite.
    """
    _check_frame(message.header.frame_id, base_link)
    parts = [_vector(v, 'wrench') for v in (message.wrench.force, message.wrench.torque)]
    return stamp_ns(message.header.stamp), np.concatenate(parts)


def joint_order(given: Sequence[str], wanted: Sequence[str], *, others: bool = False) -> list[int]:
    """Where each wanted joint stands among the given ones.

    Raises:
        MessageRejectedError: a joint is missing, twice, or foreign and there may be no others.
    """
    given, wanted = list(given), list(wanted)
    if given == wanted:
        return list(range(len(wanted)))
    missing = [name for name in wanted if name not in given]
    foreign = [] if others else [name for name in given if name not in wanted]
    if missing or foreign or len(set(given)) != len(given):
        parts = [f'lacks {", ".join(missing)}'] if missing else []
        parts += [f'has foreign {", ".join(foreign)}'] if foreign else []
        raise MessageRejectedError(f'joint names: {" and ".join(parts) or "one appears twice"}')
    return [given.index(name) for name in wanted]


def vector(values: Array, size: int, what: str) -> Array:
    """(size,) finite numbers.

    Raises:
        MessageRejectedError: wrong length, or not finite.
    """
    if np.shape(values) != (size,):
        raise MessageRejectedError(f'{what} has {np.size(values)} entries, expected {size}')
    return finite(np.asarray(values, dtype=float), what)


def unit(q_xyzw: Quaternion) -> Quaternion:
    """A quaternion (4,), normalized.

    Raises:
        MessageRejectedError: wrong length, not finite, or a norm off by more than 1e-3.
    """
    q_xyzw = vector(q_xyzw, 4, 'quaternion')
    with np.errstate(over='ignore'):  # numbers near the largest there are
        norm = float(np.linalg.norm(q_xyzw))
    if abs(norm - 1.0) > NORM_LIMIT:
        raise MessageRejectedError(f'quaternion has norm {norm:.6g}, not 1')
    return q_xyzw / norm


def finite(values: Array, what: str) -> Array:
    """The values; raise MessageRejectedError where one is not finite."""
    few = values.ndim == 1  # then Python is quicker than NumPy
    if not (all(map(math.isfinite, values.tolist())) if few else np.isfinite(values).all()):
        raise MessageRejectedError(f'{what} is not finite')
    return values


def _bounded(values: Array, what: str) -> Array:
    """As `finite`; nor may one be beyond all machines."""
    numbers = finite(values, what).tolist()
    if numbers and not -LARGEST <= min(numbers) <= max(numbers) <= LARGEST:
        why = f'has a number of no machine, beyond {LARGEST:g}'
        raise MessageRejectedError(f'{what} {why}')
    return values


def _vector(message: Any, what: str, axes: str = 'xyz') -> Array:
    return _bounded(np.array([getattr(message, axis) for axis in axes], dtype=float), what)


def _check_frame(frame: str, expected: str) -> None:
    if frame not in ('', expected):
        raise MessageRejectedError(f'frame_id is {frame!r}, expected {expected!r}')
