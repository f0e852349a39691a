"""What a control loop asks of its law, and computed torque as such a law."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ..effects.effect import Effect
from ..errors import IdentificationError, MessageRejectedError
from ..identification.estimate import Estimate
from ..model.robot import Robot
from ..model.settings import Settings
from ..types import Array
from .compensation import FeedForward
from .feedback import NS, Feedback
from .laws import ComputedTorque, Torque, law_model, torque_limits
from .motion import Motion


class Pilot(Protocol):
    """A law in a control loop.

    Attributes:
        needs_attitude: Whether it controls the base's attitude, too.
        takes_estimates: Whether it makes use of an identifier's estimates.
        estimate: The estimate that it runs on or started from; None: the robot file's model.
        joining: Time over which a motion should be joined [s].
    """

    needs_attitude: bool
    takes_estimates: bool
    estimate: Estimate | None
    joining: float

    def restart(self) -> None:
        """The next sample does not follow the last one."""

    def use(self, estimate: Estimate | None, q: Array) -> None:
        """Take a checked estimate, or go back to the robot file's model.

        Args:
            estimate: The estimate, or None.
            q: (n,) joint positions at which it must make sense [rad].

        Raises:
            SpaceRobotError: it can't be used; nothing has changed.
        """

    def track(self, motion: Motion, stamp_ns: int, sample: Feedback, hold_ns: int) -> Torque:
        """Torque that follows the motion, to be held for `hold_ns` [ns]."""

    def damp(self, sample: Feedback, trust: float = 1.0) -> Torque:
        """Torque under which the joint rates decay; none on the base (`ComputedTorque.damp`)."""


class JointPilot:
    """Computed torque on the joints of a floating base, on the latest estimate.

    Args:
        robot: The robot as the model believes it to be, its effects' changes made.
        settings: `controller` and `identifier.structure` are used.
        effects: Physical effects to make up for.

    Raises:
        ConfigurationError: settings that don't fit the robot.
    """

    needs_attitude = False

    def __init__(self, robot: Robot, settings: Settings, effects: Sequence[Effect] = ()) -> None:
        options = settings.controller
        self._robot, self._name = robot, options.law
        self._structure = settings.identifier.structure
        self._compensates = options.hold_compensation
        limits = torque_limits(robot, options.torque_limit)
        model = law_model(options.law, robot)
        feed_forward = FeedForward(robot, effects) if effects else None
        self._law = ComputedTorque(model, options.bandwidth, limits, options.damping, feed_forward)
        self.takes_estimates = options.use_estimate and options.law != 'computed_torque_no_aam'
        self.estimate: Estimate | None = None
        self.joining = 4.0 / options.bandwidth

    def restart(self) -> None:
        """Nothing to forget."""

    def use(self, estimate: Estimate | None, q: Array) -> None:
        """Run on an estimate from now on (None: on the robot file's model).

        Raises:
            SpaceRobotError: names that don't fit, or a joint inertia that is not positive.
        """
        model = law_model(self._name, self._robot, self._structure, estimate)
        if estimate is not None:
            try:
                np.linalg.cholesky(model(q, np.zeros(len(q)), np.zeros(3)).H)
            except np.linalg.LinAlgError as error:
                raise MessageRejectedError('estimate: joint inertia not positive') from error
        self._law.model, self.estimate = model, estimate

    def track(self, motion: Motion, stamp_ns: int, sample: Feedback, hold_ns: int) -> Torque:
        """Torque that follows the joint motion."""
        hold = hold_ns * NS if self._compensates else 0.0
        t = motion.time(stamp_ns)
        try:
            return self._law.track(motion.joints, t, sample, hold)
        except (IdentificationError, np.linalg.LinAlgError):
            self.use(None, sample.q)  # unusable in this state
            return self._law.track(motion.joints, t, sample, hold)

    def damp(self, sample: Feedback, trust: float = 1.0) -> Torque:
        """Torque under which the joint rates decay."""
        try:
            return self._law.damp(sample, trust)
        except (IdentificationError, np.linalg.LinAlgError):
            self.use(None, sample.q)
            return self._law.damp(sample, trust)
