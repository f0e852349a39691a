"""Messages to arrays, with every check that a message must pass before it is used, and back.

A message that fails raises `MessageRejectedError` with the reason; nothing is repaired.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from trajectory_msgs.msg import JointTrajectory

from ..control.reference import Point, Sampled
from ..errors import ConfigurationError, IdentificationError, MessageRejectedError
from ..identification.estimate import Estimate
from ..types import Array, Quaternion, Vector6
from ..types import Vector3 as Triple
from .compose import (
    INERTIAL_FRAME,
    base_torque,
    doubles,
    estimate_message,
    imu,
    joint_state,
    ledger_message,
    parameters_message,
    quaternion,
    to_time,
    tracking_message,
    vector,
)

UNIT_TOLERANCE = 1e-3


def stamp_ns(stamp: Time) -> int:
    """Stamp of a header [ns]."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def joint_sample(message: JointState, names: list[str]) -> tuple[int, Array, Array]:
    """Stamp [ns], positions and rates of the named joints; other joints are left out.

    Raises:
        MessageRejectedError: a joint missing or named twice, wrong lengths, or non-finite.
    """
    order = _order(message.name, names)
    q = _entries(message.position, len(message.name), order, 'position')
    qd = _entries(message.velocity, len(message.name), order, 'velocity')
    return stamp_ns(message.header.stamp), q, qd


def joint_efforts(message: JointState, names: list[str]) -> tuple[int, Array]:
    """Stamp [ns] and efforts of a command for exactly the named joints, in any order.

    Raises:
        MessageRejectedError: a joint missing, unknown or named twice, wrong length, or non-finite.
    """
    unknown = [name for name in message.name if name not in names]
    if unknown:
        raise MessageRejectedError(f'unknown joint {unknown[0]!r}')
    order = _order(message.name, names)
    return stamp_ns(message.header.stamp), _entries(
        message.effort, len(message.name), order, 'effort'
    )


def angular_rate(message: Imu, base_link: str) -> tuple[int, Triple]:
    """Stamp [ns] and omega_WB_B (3,) of an IMU message [rad/s].

    Raises:
        MessageRejectedError: another frame, no angular velocity in it (REP 145), or non-finite.
    """
    _frame(message.header.frame_id, base_link)
    if message.angular_velocity_covariance[0] == -1.0:
        raise MessageRejectedError('holds no angular velocity (covariance[0] is -1)')
    w = message.angular_velocity
    return stamp_ns(message.header.stamp), _finite(np.array([w.x, w.y, w.z]), 'angular_velocity')


def attitude(message: QuaternionStamped) -> tuple[int, Quaternion]:
    """Stamp [ns] and q_WB (4,) xyzw of an attitude message, as it came.

    Raises:
        MessageRejectedError: another frame, non-finite, or a norm off one by more than 1e-3.
    """
    _frame(message.header.frame_id, INERTIAL_FRAME)
    q = message.quaternion
    q_xyzw = _finite(np.array([q.x, q.y, q.z, q.w]), 'quaternion')
    norm = float(np.sqrt(q_xyzw @ q_xyzw))
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        raise MessageRejectedError(f'quaternion has norm {norm:.6g}, not 1')
    return stamp_ns(message.header.stamp), q_xyzw


def base_wrench(message: WrenchStamped, base_link: str) -> Vector6:
    """[force; torque] (6,) on the base in base coordinates [N, N m].

    Raises:
        MessageRejectedError: another frame, or non-finite.
    """
    _frame(message.header.frame_id, base_link)
    f, t = message.wrench.force, message.wrench.torque
    return _finite(np.array([f.x, f.y, f.z, t.x, t.y, t.z]), 'wrench')


def estimate(message: EstimateMessage) -> Estimate:
    """An estimate from its message.

    Raises:
        MessageRejectedError: lengths that do not fit, non-finite numbers, negative variance.
    """
    size = len(message.aam) + len(message.parameters)
    if len(message.covariance) != size * size:
        raise MessageRejectedError(
            f'covariance has {len(message.covariance)} entries, expected {size * size}'
        )
    out = Estimate(
        method=message.method,
        valid=message.valid,
        reason=message.reason,
        aam_links=tuple(message.aam_links),
        aam=np.array(message.aam),
        parameter_names=tuple(message.parameter_names),
        parameters=np.array(message.parameters),
        covariance=np.array(message.covariance).reshape(size, size),
        rank=message.rank,
        condition=message.condition,
        unexcited=tuple(message.unexcited),
        total_momentum=np.array(message.total_momentum),
        total_momentum_covariance=np.array(message.total_momentum_covariance).reshape(3, 3),
        chi2_per_dof=message.chi2_per_dof,
        samples=message.samples,
        stamp_ns=stamp_ns(message.header.stamp),
    )
    try:
        out.check()
    except IdentificationError as error:
        raise MessageRejectedError(str(error)) from error
    return out


def trajectory(
    message: JointTrajectory, names: list[str], start: Point | None
) -> tuple[Sampled, int | None]:
    """A reference and the stamp of its t = 0 [ns] (None: now, as a zero stamp says).

    Raises:
        MessageRejectedError: joints missing or unknown, no points, wrong lengths, non-finite
            numbers, or times that do not increase.
    """
    if sorted(message.joint_names) != sorted(names):
        raise MessageRejectedError(
            f'joints are {list(message.joint_names)}, expected {list(names)}'
        )
    order = _order(message.joint_names, names)
    count = len(names)
    times = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec for p in message.points]
    kinds: list[Array | None] = []
    for kind in ('positions', 'velocities', 'accelerations'):
        rows = [getattr(p, kind) for p in message.points]
        if kind != 'positions' and not any(len(row) for row in rows):
            kinds.append(None)
            continue
        if any(len(row) != count for row in rows):
            raise MessageRejectedError(f'{kind}: every point needs {count} numbers, or none')
        kinds.append(np.array([np.asarray(row)[order] for row in rows]).reshape(-1, count))
    if kinds[0] is None:
        raise MessageRejectedError('has no positions')
    try:
        reference = Sampled(np.array(times), kinds[0], kinds[1], kinds[2], start)
    except ConfigurationError as error:
        raise MessageRejectedError(error.reason) from error
    ns = stamp_ns(message.header.stamp)
    return reference, ns or None


def _order(given: Sequence[str], names: list[str]) -> list[int]:
    if given == names:
        return list(range(len(names)))
    index = {name: i for i, name in enumerate(given)}
    if len(index) != len(given):
        raise MessageRejectedError('a joint is named twice')
    missing = [name for name in names if name not in index]
    if missing:
        raise MessageRejectedError(f'joint {missing[0]!r} is missing')
    return [index[name] for name in names]


def _entries(values: Any, count: int, order: list[int], what: str) -> Array:
    if len(values) != count:
        raise MessageRejectedError(f'{what} has {len(values)} entries for {count} joints')
    return _finite(np.array(values, dtype=float)[order], what)


def _finite(values: Array, what: str) -> Array:
    if not np.isfinite(values).all():
        raise MessageRejectedError(f'{what} is not finite')
    return values


def _frame(frame: str, expected: str) -> None:
    if frame not in ('', expected):
        raise MessageRejectedError(f'frame_id is {frame!r}, expected {expected!r}')


__all__ = [
    'INERTIAL_FRAME',
    'angular_rate',
    'attitude',
    'base_torque',
    'base_wrench',
    'doubles',
    'estimate',
    'estimate_message',
    'imu',
    'joint_efforts',
    'joint_sample',
    'joint_state',
    'ledger_message',
    'parameters_message',
    'quaternion',
    'stamp_ns',
    'to_time',
    'tracking_message',
    'trajectory',
    'vector',
]
