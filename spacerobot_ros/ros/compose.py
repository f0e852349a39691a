"""Arrays to messages."""

from __future__ import annotations

from array import array

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import QuaternionStamped, Vector3, WrenchStamped
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Ledger, Parameters, Tracking

from ..control.adaptive.controller import AdaptiveController
from ..control.command import Command
from ..dynamics.ledger import MomentumLedger
from ..identification.estimate import Estimate
from ..types import Array, Quaternion
from ..types import Vector3 as Triple

INERTIAL_FRAME = 'inertial'
PARAMETER_UNIT = 'kg m^2'


def to_time(ns: int) -> Time:
    """Whole nanoseconds to a stamp."""
    return Time(sec=ns // 1_000_000_000, nanosec=ns % 1_000_000_000)


def doubles(values: Array) -> array[float]:
    """A float64 vector in the form that message fields take without a check of each entry."""
    out = array('d')
    out.frombytes(np.ascontiguousarray(values, dtype=np.float64).tobytes())
    return out


def joint_state(
    ns: int,
    names: list[str],
    position: Array | None = None,
    velocity: Array | None = None,
    effort: Array | None = None,
) -> JointState:
    """A JointState message; what is None stays empty."""
    message = JointState()
    message.header.stamp = to_time(ns)
    message.name = names
    if position is not None:
        message.position = doubles(position)
    if velocity is not None:
        message.velocity = doubles(velocity)
    if effort is not None:
        message.effort = doubles(effort)
    return message


def imu(ns: int, base_link: str, omega_WB_B: Triple, std: float | None) -> Imu:
    """An Imu message with the angular velocity only (REP 145)."""
    message = Imu()
    message.header.stamp = to_time(ns)
    message.header.frame_id = base_link
    message.angular_velocity = vector(omega_WB_B)
    message.orientation_covariance[0] = -1.0
    message.linear_acceleration_covariance[0] = -1.0
    if std is not None:
        message.angular_velocity_covariance[0::4] = std**2
    return message


def quaternion(ns: int, q_WB_xyzw: Quaternion) -> QuaternionStamped:
    """An attitude message."""
    message = QuaternionStamped()
    message.header.stamp = to_time(ns)
    message.header.frame_id = INERTIAL_FRAME
    q = message.quaternion
    q.x, q.y, q.z, q.w = (float(v) for v in q_WB_xyzw)
    return message


def base_torque(ns: int, base_link: str, torque: Triple) -> WrenchStamped:
    """A wrench of a torque alone, in base coordinates."""
    message = WrenchStamped()
    message.header.stamp = to_time(ns)
    message.header.frame_id = base_link
    message.wrench.torque = vector(torque)
    return message


def vector(values: Triple) -> Vector3:
    """A Vector3 message."""
    x, y, z = values.tolist()
    return Vector3(x=x, y=y, z=z)


def estimate_message(value: Estimate, rejected: int) -> EstimateMessage:
    """An Estimate message."""
    message = EstimateMessage()
    message.header.stamp = to_time(value.stamp_ns)
    message.header.frame_id = INERTIAL_FRAME
    for name in ('method', 'valid', 'reason', 'rank', 'unknowns', 'samples'):
        setattr(message, name, getattr(value, name))
    message.condition, message.chi2_per_dof = float(value.condition), float(value.chi2_per_dof)
    message.aam_links = list(value.aam_links)
    message.parameter_names = list(value.parameter_names)
    message.parameter_units = [PARAMETER_UNIT] * len(value.parameter_names)
    message.unexcited = list(value.unexcited)
    for name in ('aam', 'parameters', 'covariance'):
        setattr(message, name, doubles(getattr(value, name)))
    message.total_momentum = np.array(value.total_momentum, dtype=np.float64)
    message.total_momentum_covariance = np.ravel(value.total_momentum_covariance)
    message.rejected = rejected
    return message


def tracking_message(command: Command, names: list[str], law: str) -> Tracking:
    """A Tracking message."""
    message = Tracking()
    message.header.stamp = to_time(command.stamp_ns)
    message.joint_names = names
    message.reference_position = doubles(command.point.q)
    message.reference_velocity = doubles(command.point.qd)
    message.reference_acceleration = doubles(command.point.qdd)
    message.position_error = doubles(command.error)
    message.velocity_error = doubles(command.error_rate)
    message.effort = doubles(command.tau)
    message.saturated = command.saturated.tolist()
    message.law = law
    message.state = command.mode
    message.uses_estimate = command.uses_estimate
    message.max_error = float(np.abs(command.error).max())
    if command.attitude_error is not None:
        message.attitude_error = doubles(command.attitude_error)
    if command.base is not None:
        message.base_torque = doubles(command.base)
    message.base_saturated = command.base_saturated
    return message


def ledger_message(ns: int, ledger: MomentumLedger) -> Ledger:
    """A Ledger message."""
    message = Ledger()
    message.header.stamp = to_time(ns)
    message.header.frame_id = INERTIAL_FRAME
    message.linear_momentum = vector(ledger.linear)
    message.angular_momentum = vector(ledger.angular)
    message.kinetic_energy = ledger.kinetic
    message.potential_energy = ledger.potential
    message.joint_work = ledger.joint_work
    message.angular_impulse = vector(ledger.angular_impulse)
    message.momentum_drift = ledger.momentum_drift
    message.energy_drift = ledger.energy_drift
    return message


def parameters_message(ns: int, adaptive: AdaptiveController, from_estimate: bool) -> Parameters:
    """A Parameters message of what an adaptive law runs on."""
    parameters, health = adaptive.parameters, adaptive.health
    message = Parameters()
    message.header.stamp = to_time(ns)
    message.law = adaptive.settings.law
    message.names, message.units = list(parameters.names), list(parameters.units)
    message.values = doubles(parameters.values)
    if parameters.covariance is not None:
        message.covariance = doubles(parameters.covariance)
    message.physical, message.adapting = health.physical, health.adapting
    message.reason, message.excitation = health.reason, health.excitation
    message.from_estimate = from_estimate
    return message
