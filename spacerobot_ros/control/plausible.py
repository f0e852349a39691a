"""Which motions and which estimates a controller accepts, from what the robot file says."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import MessageRejectedError
from ..estimation.unknowns.body_coordinates import BodyCoordinates
from ..estimation.unknowns.minimal import MinimalSet, minimal_set
from ..identification.estimate import Estimate
from ..inference.scaled_prior import LARGEST
from ..model.motion_settings import ReferenceSettings
from ..model.robot import Robot
from ..model.settings import Settings
from ..types import Array
from .joint_reference import Blend, build_reference
from .waypoints import Waypoints

FURTHEST = 6.0
"""Standard deviations beyond which an estimate contradicts what is believed: noise goes there once
in 5e8, and what the identifier may think possible (`identifier.momentum_prior_std`,
`robot.uncertainty` by the largest factor that it finds of data) is a Gaussian of that width about
the robot file's values."""

WOUND = 1e6  # rad; encoders count fewer turns
_JOINING = 50  # times at which the way to a motion is looked at; a quintic has no narrower peaks
_STEP = 1e-3  # of the derivatives, in standard deviations of the robot file
_LOOKS = 48  # times at which each period of a sine is looked at, of which 0.2 % may be missed


class MotionLimits:
    """The URDF's limits of joint positions and rates.

    A joint whose URDF states no velocity limit may turn by half a turn between two samples of its
    encoder, beyond which they no longer tell how often it turned.

    Args:
        robot: Whose URDF states them.
        joint_rate: Samples of the joints a second [Hz].
    """

    def __init__(self, robot: Robot, joint_rate: float) -> None:
        self.joints = robot.joints
        self._units = [robot.unit_of('rad', joint) for joint in robot.joints]
        self.lower, self.upper = robot.position_limits.T
        self._countable = np.pi * joint_rate
        self.rate = np.minimum(robot.velocity_limits, self._countable)

    def check_measured(self, q: Array, qd: Array) -> None:
        """Refuse a sample (n,) [rad], [rad/s] that no encoder gives, whatever came before.

        Raises:
            MessageRejectedError: faster than half a turn between samples, or a million radians.
        """
        if (np.abs(qd) > self._countable).any() or (np.abs(q) > WOUND).any():
            raise MessageRejectedError('position or velocity is none that a joint has')

    def check(self, q: Array, qd: Array) -> None:
        """Refuse a motion of positions (T, n) [rad] and rates (T, n) [rad/s].

        Raises:
            MessageRejectedError: not finite, or beyond a limit, with joint, value and limit.
        """
        if not (np.isfinite(q).all() and np.isfinite(qd).all()):
            raise MessageRejectedError('the motion is not finite')
        for words in self._beyond(q, qd):
            raise MessageRejectedError(words)

    def _beyond(self, q: Array, qd: Array) -> Iterator[str]:
        """What a motion asks of each joint beyond its limits, and the limit."""
        ends = np.stack([q.min(axis=0), q.max(axis=0), np.abs(qd).max(axis=0)], axis=1)
        limits = np.column_stack([self.lower, self.upper, self.rate])
        for name, unit, (low, high, fast), (lower, upper, rate) in zip(
            self.joints, self._units, ends, limits, strict=True
        ):
            if low < lower or high > upper:
                yield (
                    f'{name} would move to {low if low < lower else high:.6g} {unit}, its range '
                    f'is {lower:.6g} to {upper:.6g} {unit}'
                )
            if fast > rate:
                yield f'{name} would move at {fast:.6g} {unit}/s, its limit is {rate:.6g} {unit}/s'

    def asked_beyond(self, settings: ReferenceSettings, start: Array) -> str:
        """What a robot file's motion asks of the joints beyond their limits; empty: nothing.

        Args:
            settings: Section `reference`.
            start: (n,) joint positions at its start [rad].
        """
        motion = build_reference(settings, start)
        times = np.linspace(0.0, settings.duration, _LOOKS * settings.harmonics + 1)
        way = [motion.at(t) for t in times]
        q, qd = np.array([s.q for s in way]), np.array([s.qd for s in way])
        return '; '.join(self._beyond(q, qd))

    def check_joined(self, reference: Waypoints, joined: Blend | None) -> None:
        """Refuse a motion, or the way to it, beyond the limits; raises as `check`.

        Args:
            reference: The motion.
            joined: The motion as it is joined from where the joints are; None: they are not known.
        """
        with np.errstate(all='ignore'):  # numbers near the largest there are
            self.check(*reference.sampled())
            if joined is not None:
                times = joined.begins + np.linspace(0.0, joined.joining, _JOINING)
                way = [joined.at(t) for t in times]
                # where the joints are is not for the motion to answer
                q = np.clip([s.q for s in way], self.lower, self.upper)
                self.check(q, np.array([s.qd for s in way]))


class EstimateCheck:
    """Refuses estimates that the robot file makes impossible, or that contradict earlier ones.

    An estimate that contradicts the last one is believed once another one agrees with it. Robots
    that no identifier takes (on the ground) have no estimates to be refused.

    Args:
        robot: The robot as the model believes it to be.
        settings: Section `identifier` is used.
    """

    def __init__(self, robot: Robot, settings: Settings) -> None:
        options = settings.identifier
        x, std = np.zeros(0), np.zeros(0)
        if robot.is_free:
            minimal = minimal_set(robot, options.structure)
            x = minimal.of_robot(robot)
            told = _spread(minimal, BodyCoordinates(robot, options.structure))
            # what bodies do not change to first order may still come out different
            units = np.array(minimal.units)
            std = np.maximum(told, [np.max(np.abs(x[units == unit])) for unit in units])
        aam = robot.target_momentum
        self._believed = np.concatenate([aam, x])
        self._std = np.concatenate([np.full(len(aam), options.momentum_prior_std), std])
        self.clear()

    def clear(self) -> None:
        """Forget earlier estimates."""
        self._last: Estimate | None = None
        self._doubted: Estimate | None = None

    def check(self, estimate: Estimate) -> None:
        """Take a valid estimate that fits the robot.

        Raises:
            MessageRejectedError: it is not believed.
        """
        values = _values(estimate)
        if len(values) == len(self._believed):  # otherwise names are refused, by name
            far = np.abs(values - self._believed) / self._std
            if far.max(initial=0.0) > FURTHEST:
                k = int(np.argmax(far))
                raise MessageRejectedError(
                    f'estimate: {values[k]:.6g} is implausible, thought possible is '
                    f'{self._believed[k]:.6g} +- {self._std[k]:.6g} '
                    '(identifier.momentum_prior_std, robot.uncertainty)'
                )
        if self._last is not None and not _agree(estimate, self._last):
            doubted, self._doubted = self._doubted, estimate
            if doubted is None or not _agree(estimate, doubted):
                raise MessageRejectedError(
                    'estimate: contradicts the last one, waiting for one that agrees with it'
                )
        self._last, self._doubted = estimate, None


def _spread(minimal: MinimalSet, bodies: BodyCoordinates) -> Array:
    """(k,) standard deviations of minimal parameters, the robot file's by the largest factor."""
    shifts = _STEP * np.diag(bodies.std)
    ahead, behind = (minimal.of_bodies(*bodies.bodies(s)) for s in (shifts, -shifts))
    return np.asarray(LARGEST * np.linalg.norm((ahead - behind) / (2.0 * _STEP), axis=0))


def _values(estimate: Estimate) -> Array:
    return np.concatenate([estimate.aam, estimate.parameters])


def _agree(one: Estimate, other: Estimate) -> bool:
    """Whether two estimates differ by no more than their standard deviations allow."""
    if len(one.covariance) != len(other.covariance):
        return False
    spread = np.hypot(one.std, other.std)
    return bool(np.all(np.abs(_values(one) - _values(other)) <= FURTHEST * spread))
