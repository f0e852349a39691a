"""Messages of ROS from and to the objects of the control loop; sensors: `recording.messages`."""

from __future__ import annotations

import importlib
from array import array
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from rclpy.serialization import deserialize_message

from ..control.waypoints import Waypoints
from ..errors import ConfigurationError, IdentificationError, MessageRejectedError
from ..identification.estimate import Estimate
from ..recording.bags.compose import PACKAGE, Composer
from ..recording.messages import INERTIAL_FRAME, joint_order, stamp_ns
from ..types import Array

if TYPE_CHECKING:
    from ..control.adaptive.controller import AdaptiveController
    from ..control.command import Command
    from ..control.joint_reference import Setpoint


@cache
def message_type(kind: str) -> Any:
    """The class of a message type such as `sensor_msgs/msg/Imu`."""
    module, _, name = kind.replace('/', '.').rpartition('.')
    return getattr(importlib.import_module(module), name)


def deserialized(kind: str, cdr: bytes) -> Any:
    """A message of a type from its serialized form."""
    return deserialize_message(cdr, message_type(kind))


def doubles(values: Array) -> array[float]:
    """A float64 vector in the form that message fields take without a check of each entry."""
    out = array('d')
    out.frombytes(np.ascontiguousarray(values, dtype=np.float64).tobytes())
    return out


compose = Composer(message_type, doubles)


def type_name(message_class: Any) -> str:
    """The name of a message class, such as `sensor_msgs/msg/Imu`."""
    return f'{message_class.__module__.split(".")[0]}/msg/{message_class.__name__}'


_SCALARS = ('method', 'valid', 'reason', 'rank', 'unknowns', 'samples')
_NUMBERS = ('condition', 'chi2_per_dof', 'prior_factor')
_TEXTS = {'units': 'parameter_units'} | {
    name: name for name in ('aam_links', 'parameter_names', 'unexcited', 'sources')
}
"""Fields of an estimate that are lists of texts, by their names in its message."""


def estimate_message(value: Estimate, rejected: int) -> Any:
    """An Estimate message."""
    return compose.stamped(
        f'{PACKAGE}/msg/Estimate',
        value.stamp_ns,
        INERTIAL_FRAME,
        **{name: getattr(value, name) for name in _SCALARS},
        **{name: float(getattr(value, name)) for name in _NUMBERS},
        **{name: doubles(getattr(value, name)) for name in ('aam', 'parameters', 'covariance')},
        **{field: list(getattr(value, name)) for name, field in _TEXTS.items()},
        total_momentum=np.array(value.total_momentum, dtype=np.float64),
        total_momentum_covariance=np.ravel(value.total_momentum_covariance),
        rejected=rejected,
    )


def estimate(message: Any) -> Estimate:
    """An estimate from its message.

    Raises:
        MessageRejectedError: lengths that do not fit, non-finite numbers, negative variance.
    """
    size = len(message.aam) + len(message.parameters)
    if len(message.covariance) != size * size:
        raise MessageRejectedError(
            f'covariance has {len(message.covariance)} entries, expected {size * size}'
        )
    fields: dict[str, Any] = {name: getattr(message, name) for name in (*_SCALARS, *_NUMBERS)}
    fields |= {name: tuple(getattr(message, field)) for name, field in _TEXTS.items()}
    out = Estimate(
        **fields,
        aam=np.array(message.aam),
        parameters=np.array(message.parameters),
        covariance=np.array(message.covariance).reshape(size, size),
        total_momentum=np.array(message.total_momentum),
        total_momentum_covariance=np.array(message.total_momentum_covariance).reshape(3, 3),
        stamp_ns=stamp_ns(message.header.stamp),
    )
    try:
        out.check()
    except IdentificationError as error:
        raise MessageRejectedError(str(error)) from error
    return out


def tracking_message(command: Command, names: list[str], law: str) -> Any:
    """A Tracking message."""
    attitude = np.zeros(0) if command.attitude_error is None else command.attitude_error
    base = np.zeros(0) if command.base is None else command.base
    columns: dict[str, Array] = {
        'reference_position': command.setpoint.q,
        'reference_velocity': command.setpoint.qd,
        'reference_acceleration': command.setpoint.qdd,
        'position_error': command.error,
        'velocity_error': command.error_rate,
        'effort': command.tau,
        'attitude_error': attitude,
        'base_torque': base,
    }
    return compose.stamped(
        f'{PACKAGE}/msg/Tracking',
        command.stamp_ns,
        joint_names=names,
        **{name: compose.sequence(values) for name, values in columns.items()},
        saturated=np.asarray(command.saturated).tolist(),
        law=law,
        state=command.mode,
        uses_estimate=command.uses_estimate,
        max_error=float(np.abs(command.error).max(initial=0.0)),
        base_saturated=command.base_saturated,
    )


def parameters_message(ns: int, adaptive: AdaptiveController, from_estimate: bool) -> Any:
    """A Parameters message of what an adaptive law runs on."""
    parameters, health = adaptive.parameters, adaptive.health
    covariance = np.zeros(0) if parameters.covariance is None else parameters.covariance
    return compose.stamped(
        f'{PACKAGE}/msg/Parameters',
        ns,
        law=adaptive.settings.law,
        names=list(parameters.names),
        units=list(parameters.units),
        values=doubles(parameters.values),
        covariance=doubles(covariance),
        physical=health.physical,
        adapting=health.adapting,
        reason=health.reason,
        excitation=health.excitation,
        from_estimate=from_estimate,
    )


def trajectory(
    message: Any, names: list[str], start: Setpoint | None
) -> tuple[Waypoints, int | None]:
    """A reference and the stamp of its t = 0 [ns] (None: now, as a zero stamp says).

    Raises:
        MessageRejectedError: joints missing or unknown, no points, wrong lengths, non-finite
            numbers, or times that do not increase.
    """
    order, count = joint_order(message.joint_names, names), len(names)
    times = [stamp_ns(p.time_from_start) * 1e-9 for p in message.points]
    columns: dict[str, Array] = {}
    for name, kind in (('q', 'positions'), ('qd', 'velocities'), ('qdd', 'accelerations')):
        rows = [getattr(p, kind) for p in message.points]
        if kind != 'positions' and not any(len(row) for row in rows):
            continue
        if any(len(row) != count for row in rows):
            raise MessageRejectedError(f'{kind}: every point needs {count} numbers, or none')
        columns[name] = np.array(rows, dtype=float).reshape(len(rows), count)[:, order]
    try:
        reference = Waypoints(np.array(times), **columns, start=start)
    except ConfigurationError as error:
        raise MessageRejectedError(error.reason) from error
    except ValueError as error:  # of SciPy, where numbers are too large for it
        raise MessageRejectedError(f'no curve goes through the points: {error}') from error
    return reference, stamp_ns(message.header.stamp) or None
