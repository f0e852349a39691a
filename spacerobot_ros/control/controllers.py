"""What a control loop asks of its controller: computed torque of the joints, and adaptive laws."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence

import numpy as np

from ..effects.effect import Effect
from ..errors import ConfigurationError, IdentificationError, MessageRejectedError
from ..identification.estimate import Estimate
from ..model.robot import Robot
from ..model.settings import Settings
from ..types import Array
from .adaptive.controller import AdaptiveController
from .adaptive.law_signals import AdaptiveSettings, Measured, Target
from .adaptive.parameter_prior import Learned
from .command import NS, Feedback, Torque
from .computed_torque import (
    ComputedTorque,
    FeedForward,
    law_model,
    robot_model,
    torque_limits,
    within_limits,
)
from .motion_barrier import MotionBarrier
from .reference_motion import ReferenceMotion

_FIXED = 'passivity'


class Controller(ABC):
    """A controller in a control loop.

    Args:
        robot: The robot as the model believes it to be, its effects' changes made.
        settings: `controller` and `identifier.structure` are used.
        bandwidth: Its slowest [rad/s].

    Attributes:
        controls_attitude: Whether it controls the base's attitude, too.
        takes_estimates: Whether it makes use of an identifier's estimates.
        estimate: The estimate that it runs on or started from; None: the robot file's model.
        joining: Time over which a motion should be joined [s].
        adaptive: The adaptive law in force, if it is one.
    """

    controls_attitude = False

    def __init__(self, robot: Robot, settings: Settings, bandwidth: float) -> None:
        options = settings.controller
        self._robot, self._law = robot, options.law
        self._structure = settings.identifier.structure
        self._limits = self._joint_limits(settings)
        self._barrier = MotionBarrier(robot)
        self.takes_estimates = options.use_estimate
        self.estimate: Estimate | None = None
        self.joining = 4.0 / bandwidth
        self.adaptive: AdaptiveController | None = None

    @abstractmethod
    def retune(self, settings: Settings) -> None:
        """Go on with other gains, damping and limits.

        Raises:
            ConfigurationError: they don't fit; nothing has changed.
        """

    def _joint_limits(self, settings: Settings) -> Array:
        given, limits = settings.controller.torque_limit, self._robot.effort_limits
        return torque_limits(given, limits, 'torque_limit', 'a joint')

    @abstractmethod
    def restart(self) -> None:
        """The next sample does not follow the last one."""

    @abstractmethod
    def use(self, estimate: Estimate | None, q: Array) -> None:
        """Take a checked estimate, or go back to the robot file's model.

        Args:
            estimate: The estimate, or None.
            q: (n,) joint positions at which it must make sense [rad].

        Raises:
            SpaceRobotError: it can't be used; nothing has changed.
        """

    @abstractmethod
    def track(
        self, motion: ReferenceMotion, stamp_ns: int, sample: Feedback, hold_ns: int
    ) -> Torque:
        """Torque that follows the motion, to be held for `hold_ns` [ns]."""

    @abstractmethod
    def damp(self, sample: Feedback, trust: float = 1.0) -> Torque:
        """Torque under which the joint rates decay; none on the base (`ComputedTorque.damp`)."""

    def expected(self, stamp_ns: int) -> Feedback | None:
        """What the sample of a stamp will be by the equations of motion; None: nobody asked."""
        return self._barrier.expected(stamp_ns)

    def _slowed(
        self, stamp_ns: int, sample: Feedback, u: Array, limits: Array, hold_ns: int
    ) -> tuple[Array, np.ndarray]:
        """Torques under which the joints keep their limits, and where they are others than `u`."""
        held = self._barrier.hold(stamp_ns, sample, u, limits, hold_ns)
        return held, held != u


class JointController(Controller):
    """Computed torque on the joints of a floating base, on the latest estimate.

    Args:
        robot: The robot as the model believes it to be, its effects' changes made.
        settings: `controller` and `identifier.structure` are used.
        effects: Physical effects to make up for.

    Raises:
        ConfigurationError: settings that don't fit the robot.
    """

    def __init__(self, robot: Robot, settings: Settings, effects: Sequence[Effect] = ()) -> None:
        options = settings.controller
        super().__init__(robot, settings, options.bandwidth)
        self._compensates = options.hold_compensation
        model = law_model(options.law, robot)
        feed_forward = FeedForward(robot, effects) if effects else None
        self._torque = ComputedTorque(
            model, options.bandwidth, self._limits, options.damping, feed_forward
        )
        self.takes_estimates &= options.law != 'computed_torque_no_aam'

    def retune(self, settings: Settings) -> None:
        """Go on with other gains, damping and limits."""
        self._limits, options = self._joint_limits(settings), settings.controller
        self._torque.tune(options.bandwidth, self._limits, options.damping)

    def restart(self) -> None:
        """Nothing to forget."""

    def use(self, estimate: Estimate | None, q: Array) -> None:
        """Run on an estimate from now on (None: on the robot file's model).

        Raises:
            SpaceRobotError: names that don't fit, or a joint inertia that is not positive.
        """
        model = law_model(self._law, self._robot, self._structure, estimate)
        if estimate is not None:
            try:
                np.linalg.cholesky(model(q, np.zeros(len(q)), np.zeros(3)).H)
            except np.linalg.LinAlgError as error:
                raise MessageRejectedError('estimate: joint inertia not positive') from error
        self._torque.model, self.estimate = model, estimate

    def track(
        self, motion: ReferenceMotion, stamp_ns: int, sample: Feedback, hold_ns: int
    ) -> Torque:
        """Torque that follows the joint motion."""
        hold = hold_ns * NS if self._compensates else 0.0
        joints, t = motion.joints, motion.time(stamp_ns)
        torque = self._usable(sample, lambda: self._torque.track(joints, t, sample, hold))
        tau, slowed = self._slowed(stamp_ns, sample, torque.tau, self._limits, hold_ns)
        return Torque(tau, torque.saturated | slowed)

    def damp(self, sample: Feedback, trust: float = 1.0) -> Torque:
        """Torque under which the joint rates decay."""
        return self._usable(sample, lambda: self._torque.damp(sample, trust))

    def _usable(self, sample: Feedback, torque: Callable[[], Torque]) -> Torque:
        """A torque; where the estimate is unusable in this state, without it from now on."""
        try:
            return torque()
        except (IdentificationError, np.linalg.LinAlgError):
            self.use(None, sample.q)
            return torque()


class FreeFlyingController(Controller):
    """An adaptive law of base attitude and joints, with limits, damping and hand-over.

    The first valid estimate starts the adaptation; later ones rest on the same data or on data
    under torques on the base, so they are ignored. With fixed parameters each is used.

    Args:
        robot: The robot as the model believes it to be.
        settings: `controller`, `adaptive`, `identifier.structure` and `simulator.joint_rate`, the
            rate of the joint states, are used.

    Raises:
        ConfigurationError: settings that don't fit the robot or the control period.
    """

    controls_attitude = True
    adaptive: AdaptiveController

    def __init__(self, robot: Robot, settings: Settings) -> None:
        options, self._options = settings.controller, AdaptiveSettings.of(settings)
        slowest = min(self._options.attitude_bandwidth, self._options.joint_bandwidth)
        super().__init__(robot, settings, slowest)
        self._period = 1.0 / settings.simulator.joint_rate
        if options.state_timeout < self._period:
            raise ConfigurationError(
                'controller.state_timeout',
                f'{options.state_timeout:g} s is shorter than the {self._period:g} s between '
                'joint states (simulator.joint_rate)',
            )
        self._all_limits = self._of_all(settings)
        self.adaptive = self._from_file()
        self._brake = ComputedTorque(
            robot_model(robot), options.bandwidth, self._limits, options.damping
        )
        self._is_started = self._has_learned = False

    def _of_all(self, settings: Settings) -> Array:
        """(3 + n,) limits of base and joints."""
        given, unlimited = settings.controller.base_torque_limit, np.full(3, np.inf)
        base = torque_limits(given, unlimited, 'base_torque_limit', 'an axis')
        return np.concatenate([base, self._joint_limits(settings)])

    def retune(self, settings: Settings) -> None:
        """Go on with other gains, damping and limits; what was learned stays."""
        limits, adaptive = self._of_all(settings), AdaptiveSettings.of(settings)
        self.adaptive.retune(adaptive)
        self._options, self._all_limits = adaptive, limits
        self._brake.tune(settings.controller.bandwidth, limits[3:], settings.controller.damping)
        self.restart()

    def resume(self, learned: Learned) -> None:
        """Go on with what was learned before, in place of any estimate."""
        self.adaptive.take(learned)
        self._has_learned = True
        self.restart()

    def restart(self) -> None:
        """The adaptation goes on from the parameters in force, without the interval up to now."""
        self._is_started = False

    def use(self, estimate: Estimate | None, q: Array) -> None:
        """Start the adaptation from an estimate, mean and covariance (None: the robot file).

        Raises:
            IdentificationError: it doesn't fit the robot, or its covariance is indefinite.
        """
        goes_on = self.estimate is not None or self._has_learned
        if estimate is not None and goes_on and self._law != _FIXED:
            return
        self._has_learned = False
        adaptive = self._from_file()
        if estimate is not None:
            adaptive.hand_over(estimate, self._structure)
        self.adaptive, self.estimate = adaptive, estimate
        self.restart()

    def track(
        self, motion: ReferenceMotion, stamp_ns: int, sample: Feedback, hold_ns: int
    ) -> Torque:
        """Torques on base and joints that follow the motion."""
        if sample.q_WB_xyzw is None:
            raise RuntimeError('tracking without an attitude')
        measured = Measured(sample.q_WB_xyzw, sample.omega_WB_B, sample.q, sample.qd)
        if not self._is_started:
            self.adaptive.start(measured)
        elapsed = hold_ns * NS if self._is_started else None
        self._is_started = True
        target = Target(*motion.attitude(stamp_ns), *motion.setpoint(stamp_ns))
        asked = self.adaptive.step(measured, target, elapsed)
        u, cut = within_limits(np.concatenate([asked.base, asked.joints]), self._all_limits)
        u, slowed = self._slowed(stamp_ns, sample, u, self._all_limits, hold_ns)
        cut = cut | slowed
        if cut.any():
            self.adaptive.applied(u[:3], u[3:], limited=True)
        return Torque(u[3:], cut[3:], u[:3], bool(cut[:3].any()), asked.attitude_error)

    def damp(self, sample: Feedback, trust: float = 1.0) -> Torque:
        """Torque under which the joint rates decay; none on the base."""
        torque = self._brake.damp(sample, trust)
        return Torque(torque.tau, torque.saturated, np.zeros(3))

    def _from_file(self) -> AdaptiveController:
        return AdaptiveController(self._robot, self._options, self._period)
