"""Limits of a motion, and how near each candidate comes to them.

Each limit gives a series over time, its use: 1 at the limit. A joint range that is not centred is
used by the distance from its middle. The base must not turn faster than gyro and star tracker can
follow, where the robot file says how fast that is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from ...errors import ConfigurationError
from ...model.motion_settings import ExcitationSettings
from ...model.robot import Robot
from ...types import Array
from .base_response import BaseMotion

HEADROOM = 0.9  # of the URDF's effort limits; feedback needs the rest


class Use(NamedTuple):
    """How a motion uses one limit.

    Attributes:
        name: Such as `joint_rate`.
        where: Joint, or `base`.
        unit: Of value and limit.
        value: Largest magnitude that occurs; of a joint range, the position nearest to its end.
        limit: What is allowed; infinite where nothing is limited.
        fraction: Of the limit that is used; at most 1 where it holds.
    """

    name: str
    where: str
    unit: str
    value: float
    limit: float
    fraction: float


class _Size(NamedTuple):
    """A limited quantity: its name, (k,) units, places and limits, and (B, T, k) magnitudes."""

    name: str
    units: tuple[str, ...]
    places: tuple[str, ...]
    limits: Array
    of: Callable[[BaseMotion], Array]


class Limits:
    """Limits of one robot, infinite where there is none.

    Args:
        robot: Its URDF limits positions, rates and efforts, its sensors the base's rate.
        settings: What else is limited.

    Attributes:
        lower, upper: (n,) joint positions [rad].
        torque: (n,) [N m].
        rate: (n,) joint rates [rad/s].
        base_rate: The least that operator and star tracker allow, whichever the axis [rad/s].

    Raises:
        ConfigurationError: a list of the wrong length, or an empty joint range.
    """

    def __init__(self, robot: Robot, settings: ExcitationSettings) -> None:
        joints = robot.joints
        reach, rate, acceleration, torque = (
            _per_joint(getattr(settings, name), len(joints), name)
            for name in ('joint_range', 'joint_rate', 'joint_acceleration', 'joint_torque')
        )
        self.lower = np.maximum(robot.position_limits[:, 0], -reach)
        self.upper = np.minimum(robot.position_limits[:, 1], reach)
        for joint, low, high in zip(joints, self.lower, self.upper, strict=True):
            if low >= high:
                unit = robot.unit_of('rad', joint)
                reason = f'leaves joint {joint!r} nothing between {low:g} and {high:g} {unit}'
                raise ConfigurationError('excitation.joint_range', reason)
        self.rate = np.minimum(rate, robot.velocity_limits)
        self.torque = np.minimum(torque, HEADROOM * robot.effort_limits)
        sensors = robot.sensors
        self.base_rate = min(settings.base_rate or np.inf, sensors.attitude_rate_limit or np.inf)
        turn = np.inf if settings.base_rotation is None else settings.base_rotation
        gyro = np.full(3, sensors.gyro_range or np.inf)
        half = 0.5 * (self.upper - self.lower)
        bounded = np.isfinite(half)
        middle = np.subtract(self.upper, half, out=np.zeros_like(half), where=bounded)
        base, rad = ('base',), [robot.unit_of('rad', joint) for joint in joints]
        by_time = [tuple(f'{unit}{per}' for unit in rad) for per in ('', '/s', '/s^2')]
        torques = tuple(robot.unit_of('N m', joint) for joint in joints)
        axes = tuple(f'base {axis}' for axis in 'xyz')
        self._sizes = (
            _Size('joint_range', by_time[0], joints, half, lambda m: np.abs(m.q - middle)),
            _Size('joint_rate', by_time[1], joints, self.rate, lambda m: np.abs(m.qd)),
            _Size('joint_acceleration', by_time[2], joints, acceleration, lambda m: np.abs(m.qdd)),
            _Size('joint_torque', torques, joints, self.torque, lambda m: np.abs(m.torque)),
            _Size('base_rate', ('rad/s',), base, np.array([self.base_rate]), _rate),
            _Size('base_rotation', ('rad',), base, np.array([turn]), _turn),
            *(
                [_Size('gyro_range', 3 * ('rad/s',), axes, gyro, lambda m: np.abs(m.omega))]
                if np.isfinite(gyro[0])
                else []
            ),
        )

    def fractions(self, motion: BaseMotion) -> Array:
        """(B, T, m) use of every finite limit over time."""
        parts: list[Array] = []
        for size in self._sizes:
            finite = np.isfinite(size.limits)
            if finite.any() or not parts:
                parts.append(size.of(motion)[..., finite] / size.limits[finite])
        return np.concatenate(parts, axis=-1)

    def uses(self, motion: BaseMotion) -> tuple[Use, ...]:
        """How the worst of the candidates uses every limit, the unlimited quantities included."""
        return tuple(self._uses(motion))

    def _uses(self, motion: BaseMotion) -> Iterator[Use]:
        for name, units, places, limits, of in self._sizes:
            largest = of(motion).max(axis=(0, 1))
            for j, (where, unit) in enumerate(zip(places, units, strict=True)):
                shown = float(largest[j]), float(limits[j])
                if name == 'joint_range':
                    shown = self._nearest_end(motion.q[..., j], j)
                yield Use(name, where, unit, *shown, float(largest[j] / limits[j]))

    def _nearest_end(self, q: Array, joint: int) -> tuple[float, float]:
        """Position nearest to an end of a joint's range, and that end."""
        low, high, lower, upper = q.min(), q.max(), self.lower[joint], self.upper[joint]
        value, limit = (high, upper) if upper - high <= low - lower else (low, lower)
        return float(value), float(limit)


def _rate(motion: BaseMotion) -> Array:
    return np.linalg.norm(motion.omega, axis=-1, keepdims=True)


def _turn(motion: BaseMotion) -> Array:
    """(B, T, 1) angle between each attitude and the first [rad]."""
    relative = np.swapaxes(motion.R_WB[:, :1], -1, -2) @ motion.R_WB
    cosine = 0.5 * (np.trace(relative, axis1=-2, axis2=-1) - 1.0)
    skew = relative - np.swapaxes(relative, -1, -2)
    sine = 0.5 * np.sqrt(0.5 * np.sum(skew**2, axis=(-2, -1)))
    return np.arctan2(sine, cosine)[..., None]


def _per_joint(values: tuple[float, ...], n: int, name: str) -> Array:
    if len(values) in (0, 1):
        return np.full(n, values[0] if values else np.inf)
    if len(values) != n:
        reason = f'expected one number, or {n} (one a joint), got {len(values)}'
        raise ConfigurationError(f'excitation.{name}', reason)
    return np.array(values)
