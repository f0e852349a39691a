"""Limits of a motion, and how near each candidate comes to them.

Each limit gives a series over time, its use: 1 at the limit. A joint range that is not centred is
used by the distance from its middle.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Robot
from ..model.settings import ExcitationSettings
from ..types import Array
from .free_base import BaseMotion

HEADROOM = 0.9  # of the URDF's effort limits; feedback needs the rest


@dataclass(frozen=True, slots=True, eq=False)
class Use:
    """How a motion uses one limit.

    Args:
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


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Limits of one robot, infinite where there is none.

    Args:
        joints: Names of the n joints.
        lower, upper: (n,) joint positions [rad].
        rate: (n,) [rad/s]. acceleration: (n,) [rad/s^2]. torque: (n,) [N m].
        base_rotation: [rad]. base_rate: [rad/s].
    """

    joints: tuple[str, ...]
    lower: Array
    upper: Array
    rate: Array
    acceleration: Array
    torque: Array
    base_rotation: float
    base_rate: float

    @classmethod
    def of(cls, robot: Robot, settings: ExcitationSettings) -> Limits:
        """The limits that the settings and the URDF state.

        Raises:
            ConfigurationError: a list of the wrong length, or an empty joint range.
        """
        n = robot.n_joints
        reach = _per_joint(settings.joint_range, n, 'joint_range')
        lower = np.maximum(robot.position_limits[:, 0], -reach)
        upper = np.minimum(robot.position_limits[:, 1], reach)
        for joint, low, high in zip(robot.joints, lower, upper, strict=True):
            if low >= high:
                raise ConfigurationError(
                    'excitation.joint_range',
                    f'leaves joint {joint!r} nothing between {low:g} and {high:g} rad',
                )
        torque = _per_joint(settings.joint_torque, n, 'joint_torque')
        return cls(
            robot.joints,
            lower,
            upper,
            _per_joint(settings.joint_rate, n, 'joint_rate'),
            _per_joint(settings.joint_acceleration, n, 'joint_acceleration'),
            np.minimum(torque, HEADROOM * robot.effort_limits),
            _or_infinite(settings.base_rotation),
            _or_infinite(settings.base_rate),
        )

    def fractions(self, motion: BaseMotion) -> Array:
        """(B, T, m) use of every finite limit over time."""
        parts = [self._range_use(motion.q)[..., np.isfinite(self._half_range())]]
        for values, limit in (
            (motion.qd, self.rate),
            (motion.qdd, self.acceleration),
            (motion.torque, self.torque),
        ):
            finite = np.isfinite(limit)
            parts.append(np.abs(values[..., finite]) / limit[finite])
        if np.isfinite(self.base_rate):
            parts.append(np.linalg.norm(motion.omega, axis=-1, keepdims=True) / self.base_rate)
        if np.isfinite(self.base_rotation):
            parts.append(_turn(motion)[..., None] / self.base_rotation)
        return np.concatenate(parts, axis=-1)

    def uses(self, motion: BaseMotion) -> tuple[Use, ...]:
        """How the worst of the candidates uses every limit, the unlimited quantities included."""
        return tuple(self._uses(motion))

    def _uses(self, motion: BaseMotion) -> Iterator[Use]:
        range_use = np.max(self._range_use(motion.q), axis=(0, 1))
        for j, joint in enumerate(self.joints):
            q = motion.q[..., j]
            ends = (float(q.min()), float(q.max()))
            near_upper = self.upper[j] - ends[1] <= ends[0] - self.lower[j]
            value, limit = (ends[1], self.upper[j]) if near_upper else (ends[0], self.lower[j])
            yield Use('joint_range', joint, 'rad', value, float(limit), float(range_use[j]))
        for name, unit, values, limits in (
            ('joint_rate', 'rad/s', motion.qd, self.rate),
            ('joint_acceleration', 'rad/s^2', motion.qdd, self.acceleration),
            ('joint_torque', 'N m', motion.torque, self.torque),
        ):
            for j, joint in enumerate(self.joints):
                yield _use(name, joint, unit, np.abs(values[..., j]), float(limits[j]))
        rate = np.linalg.norm(motion.omega, axis=-1)
        yield _use('base_rate', 'base', 'rad/s', rate, self.base_rate)
        yield _use('base_rotation', 'base', 'rad', _turn(motion), self.base_rotation)

    def _half_range(self) -> Array:
        return 0.5 * (self.upper - self.lower)

    def _range_use(self, q: Array) -> Array:
        half = self._half_range()
        if not np.all(np.isfinite(half)):
            bounded = np.where(np.isfinite(half), half, 1.0)
            middle = np.where(np.isfinite(half), self.upper - bounded, 0.0)
            return np.where(np.isfinite(half), np.abs(q - middle) / bounded, 0.0)
        return np.abs(q - 0.5 * (self.upper + self.lower)) / half


def _use(name: str, where: str, unit: str, values: Array, limit: float) -> Use:
    value = float(np.max(values))
    return Use(name, where, unit, value, limit, value / limit)


def _turn(motion: BaseMotion) -> Array:
    """(B, T) angle between each attitude and the first [rad]."""
    relative = np.swapaxes(motion.R_WB[:, :1], -1, -2) @ motion.R_WB
    cosine = 0.5 * (np.trace(relative, axis1=-2, axis2=-1) - 1.0)
    skew = relative - np.swapaxes(relative, -1, -2)
    sine = 0.5 * np.sqrt(0.5 * np.sum(skew**2, axis=(-2, -1)))
    return np.arctan2(sine, cosine)


def _per_joint(values: tuple[float, ...], n: int, name: str) -> Array:
    if len(values) in (0, 1):
        return np.full(n, values[0] if values else np.inf)
    if len(values) != n:
        raise ConfigurationError(
            f'excitation.{name}',
            f'expected one number, or {n} (one a joint), got {len(values)}',
        )
    return np.array(values)


def _or_infinite(value: float | None) -> float:
    return np.inf if value is None else value
