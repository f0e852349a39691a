"""Attitudes that a controller follows: each gives attitude, rate and acceleration at any time.

Every motion here turns about an axis that is fixed in the base: D = start * exp(s(t) phi).
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ..dynamics.rotation import cross, rotation_between, rotation_matrix, turned
from ..errors import ConfigurationError
from ..model.motion_settings import ReferenceSettings
from ..types import Quaternion, Vector3
from .joint_reference import Harmonic, Hold, PointToPoint, Reference

_IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
_UNIT = 1e-3  # largest difference of a quaternion's norm from one


class AttitudeSetpoint(NamedTuple):
    """Where an attitude motion is at one time; D is the wanted base frame.

    Args:
        q_WD_xyzw: (4,) wanted attitude.
        omega_WD_D: (3,) its angular velocity [rad/s].
        omega_dot_D: (3,) derivative of its components [rad/s^2].
    """

    q_WD_xyzw: Quaternion
    omega_WD_D: Vector3
    omega_dot_D: Vector3


class AttitudeReference(Protocol):
    """A motion of the base's attitude."""

    @property
    def duration(self) -> float:
        """Time from which on the motion rests [s]."""

    def at(self, t: float) -> AttitudeSetpoint:
        """The setpoint at time t [s] since the start of the motion."""


class Turn:
    """A turn about one axis.

    Args:
        start_xyzw: (4,) attitude q_WB from which it turns.
        rotation: (3,) rotation vector phi, in base coordinates [rad].
        profile: Motion of one number, the part s of the rotation.
    """

    def __init__(self, start_xyzw: Quaternion, rotation: Vector3, profile: Reference) -> None:
        self._start = turned(start_xyzw, np.zeros(3))  # normalized
        self._rotation = np.array(rotation, dtype=float)
        self._profile = profile
        self.duration = profile.duration

    def at(self, t: float) -> AttitudeSetpoint:
        """The setpoint at time t [s]."""
        phi, (s, sd, sdd) = self._rotation, self._profile.at(t)
        return AttitudeSetpoint(turned(self._start, s[0] * phi), sd[0] * phi, sdd[0] * phi)


class AttitudeBlend:
    """A motion joined smoothly from another attitude: the offset dies away along a quintic.

    With E = exp(s phi) the frame D E has the rate E^T omega + s' phi.

    Args:
        reference: The motion to join.
        t_start: Time of the motion at which it is joined [s].
        start_xyzw: (4,) attitude of the base at that time.
        duration: Time over which the offset dies away [s].
    """

    def __init__(
        self, reference: AttitudeReference, t_start: float, start_xyzw: Quaternion, duration: float
    ) -> None:
        self._reference, self._t_start, self._blend = reference, t_start, duration
        self._offset = rotation_between(reference.at(t_start).q_WD_xyzw, start_xyzw)
        self._profile = PointToPoint(np.ones(1), np.zeros(1), duration)
        self.duration = max(reference.duration, t_start + duration)

    def at(self, t: float) -> AttitudeSetpoint:
        """The setpoint at time t [s]."""
        setpoint, since = self._reference.at(t), t - self._t_start
        if since >= self._blend:
            return setpoint
        phi, (s, sd, sdd) = self._offset, self._profile.at(since)
        back = rotation_matrix(turned(_IDENTITY, s[0] * phi)).T
        omega = back @ setpoint.omega_WD_D
        return AttitudeSetpoint(
            turned(setpoint.q_WD_xyzw, s[0] * phi),
            omega + sd[0] * phi,
            back @ setpoint.omega_dot_D - sd[0] * cross(phi, omega) + sdd[0] * phi,
        )


def check_attitude(settings: ReferenceSettings) -> None:
    """Refuse attitude settings that can't be used.

    Args:
        settings: Section `reference` of the robot file.

    Raises:
        ConfigurationError: wrong numbers of entries, or a quaternion far from unit norm.
    """
    for name, size in (('attitude_xyzw', 4), ('attitude_amplitude', 3)):
        got = len(getattr(settings, name))
        if got not in (0, size):
            raise ConfigurationError(f'reference.{name}', f'expected {size} numbers, got {got}')
    norm = float(np.linalg.norm(settings.attitude_xyzw or 1.0))
    if abs(norm - 1.0) > _UNIT:
        raise ConfigurationError('reference.attitude_xyzw', f'has norm {norm:.6g}, not 1')


def build_attitude(settings: ReferenceSettings, start_xyzw: Quaternion) -> AttitudeReference:
    """The attitude motion that the settings ask for.

    Args:
        settings: Section `reference` of the robot file.
        start_xyzw: (4,) attitude of the base at the start.

    Raises:
        ConfigurationError: settings that can't be used.
    """
    check_attitude(settings)
    none, zero, one = np.zeros(3), np.zeros(1), np.ones(1)
    if settings.kind == 'harmonic' and settings.attitude_amplitude:
        amplitude = np.array(settings.attitude_amplitude)
        return Turn(start_xyzw, amplitude, Harmonic(zero, one, settings.duration))
    if settings.kind in ('set_point', 'step') and settings.attitude_xyzw:
        goal = np.array(settings.attitude_xyzw)
        rotation = rotation_between(start_xyzw, goal / np.linalg.norm(goal))
        if settings.kind == 'step':
            return Turn(start_xyzw, rotation, Hold(one))
        return Turn(start_xyzw, rotation, PointToPoint(zero, one, settings.duration))
    return Turn(start_xyzw, none, Hold(zero))
