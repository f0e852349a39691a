r"""Slips in the telemetry of a servicer's own wheels, which conservation of momentum shows.

    R (h(q, omega, q') + R_t h_t + sum_k a_k s_k) = constant

with h that of the bodies, a_k the axis of a wheel times its inertia, s_k its rate, h_t the unknown
momenta of captured wheels and R the attitude. A slip that makes momentum constant is named.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy

from ...dynamics.angular_momentum import angular_momentum
from ...dynamics.tree import tree_of
from ...model.robot import Robot
from ...types import Array
from ..integral import interpolated
from ..record import Record
from ..robot_inputs import own_wheels, wheel_axes, wheel_rates
from . import thresholds as limits
from .thresholds import DataFault

_RPM = 30.0 / np.pi


def wheel_faults(record: Record, robot: Robot) -> tuple[DataFault, ...]:
    """The slip of one wheel, or of all, that makes momentum hold; none where none is needed.

    Args:
        record: With attitude, gyro and rates of the wheels.
        robot: What the model believes; free, nothing acting on it that the record has.
    """
    rates = wheel_rates(robot, record)
    is_closed = not {'thrusters', 'base_wrench'} & set(record.inputs)
    if rates is None or not (robot.is_free and is_closed) or record.wheels is None:
        return ()
    if record.attitude is None or record.rates is None or len(record.attitude_time) < limits.ROWS:
        return ()
    left, turned = _momenta(record, robot, record.wheels.seconds(record.origin_ns), rates)
    before = _misfit(left + np.sum(turned, axis=1), turned)
    tried = [
        (_misfit(left + turned.transpose(0, 2, 1) @ factors, turned), fault)
        for factors, fault in _slips(own_wheels(robot))
    ]
    after, fault = min(tried, key=lambda it: it[0])
    return (fault,) if after < min(before / limits.GAIN, limits.ALIKE) else ()


def _momenta(record: Record, robot: Robot, wheel_time: Array, rates: Array) -> tuple[Array, Array]:
    """(K, 3) momentum without the own wheels, and (K, W, 3) theirs, in inertial axes [N m s].

    Directions that captured wheels may have are taken out of both, as constants are.
    """
    starts = (record.rate_time[0], wheel_time[0], *record.joint_time[:1])
    ends = (record.rate_time[-1], wheel_time[-1], *record.joint_time[-1:])
    time = record.attitude_time
    inside = np.flatnonzero((time >= max(starts)) & (time <= min(ends)))
    at = inside[np.linspace(0, len(inside) - 1, min(limits.ROWS, len(inside))).astype(int)]
    rotations = scipy.spatial.transform.Rotation.from_quat(record.attitude_xyzw[at])
    time, matrices = time[at], rotations.as_matrix()
    q = qd = np.zeros((len(time), robot.n_joints))
    if robot.n_joints and record.qd is not None:
        q, qd = (interpolated(time, record.joint_time, x) for x in (record.q, record.qd))
    omega = interpolated(time, record.rate_time, record.omega)
    found = angular_momentum(tree_of(robot), q, omega, qd)
    wheels = interpolated(time, wheel_time, rates)[:, :, None] * wheel_axes(robot)
    own = np.einsum('kij,kj->ki', matrices, found.momentum)
    turned = np.einsum('kij,kwj->kwi', matrices, wheels)
    held = [matrices @ found.rotations[:, wheel.body] for wheel in robot.target_wheels]
    beside = np.concatenate([np.tile(np.eye(3), (len(time), 1, 1)), *held], axis=2)
    basis = scipy.linalg.orth(beside.reshape(-1, beside.shape[2]))

    def free(values: Array) -> Array:
        flat = values.reshape(-1)
        return np.asarray((flat - basis @ (basis.T @ flat)).reshape(values.shape))

    return free(own), np.stack([free(turned[:, w]) for w in range(turned.shape[1])], axis=1)


def _misfit(left: Array, turned: Array) -> float:
    """Square of what is not constant, a share of that of the wheels' momenta."""
    return float(np.sum(left**2) / max(np.sum(turned**2), 1e-300))


def _slips(names: list[str]) -> Iterator[tuple[Array, DataFault]]:
    """Factors (W,) that undo a slip, and its name."""
    ones = np.ones(len(names))
    every = (
        (-1.0, 'sign', 'of the wrong sign'),
        (1.0 / _RPM, 'scale', 'in rpm instead of rad/s'),
        (_RPM, 'scale', 'converted as if they were in rpm'),
    )
    for factor, kind, words in every:
        yield factor * ones, DataFault(kind, 'wheels', f'all rates are {words}')
        for k, name in enumerate(names if len(names) > 1 else ()):
            own = np.where(np.arange(len(names)) == k, factor, 1.0)
            message = words if kind == 'sign' else f'rates are {words}'
            yield own, DataFault(kind, f'wheels/{name}', message)
