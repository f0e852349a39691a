"""Passivity-based and adaptive laws of base attitude and joints, in a control loop."""

from __future__ import annotations

import numpy as np

from ..errors import ConfigurationError
from ..identification.estimate import Estimate
from ..model.robot import Robot
from ..model.settings import Settings
from ..types import Array
from .adaptive.controller import AdaptiveController
from .adaptive.settings import AdaptiveSettings
from .adaptive.types import Measured, Target
from .feedback import NS, Feedback
from .laws import (
    ComputedTorque,
    Torque,
    base_torque_limits,
    robot_model,
    torque_limits,
    within_limits,
)
from .motion import Motion

_FIXED = 'passivity'


class FreeFlyingPilot:
    """An adaptive law with limits, damping, and the hand-over of an estimate.

    The first valid estimate starts the adaptation; later ones rest on the same data or on data
    under torques on the base, so they are ignored. With fixed parameters each is used.

    Args:
        robot: The robot as the model believes it to be.
        settings: `controller`, `adaptive`, `identifier.structure` and `simulator.joint_rate`, the
            rate of the joint states, are used.

    Raises:
        ConfigurationError: settings that don't fit the robot or the control period.
    """

    needs_attitude = True

    def __init__(self, robot: Robot, settings: Settings) -> None:
        options = settings.controller
        self._robot = robot
        self._structure = settings.identifier.structure
        self._options = AdaptiveSettings.of(settings)
        self._period = 1.0 / settings.simulator.joint_rate
        if options.state_timeout < self._period:
            raise ConfigurationError(
                'controller.state_timeout',
                f'{options.state_timeout:g} s is shorter than the {self._period:g} s between '
                'joint states (simulator.joint_rate)',
            )
        limits = torque_limits(robot, options.torque_limit)
        self._limits = np.concatenate([base_torque_limits(options.base_torque_limit), limits])
        self.adaptive = self._from_file()
        self._brake = ComputedTorque(
            robot_model(robot), options.bandwidth, limits, options.damping
        )
        self.takes_estimates = options.use_estimate
        self.estimate: Estimate | None = None
        self.joining = 4.0 / min(self._options.attitude_bandwidth, self._options.joint_bandwidth)
        self._is_started = False

    def restart(self) -> None:
        """The adaptation goes on from the parameters in force, without the interval up to now."""
        self._is_started = False

    def use(self, estimate: Estimate | None, q: Array) -> None:
        """Start the adaptation from an estimate, mean and covariance (None: the robot file).

        Raises:
            IdentificationError: it doesn't fit the robot, or its covariance is indefinite.
        """
        if estimate is not None and self.estimate is not None and self._options.law != _FIXED:
            return
        adaptive = self._from_file()
        if estimate is not None:
            adaptive.hand_over(estimate, self._structure)
        self.adaptive, self.estimate = adaptive, estimate
        self.restart()

    def track(self, motion: Motion, stamp_ns: int, sample: Feedback, hold_ns: int) -> Torque:
        """Torques on base and joints that follow the motion."""
        if sample.q_WB_xyzw is None:
            raise RuntimeError('tracking without an attitude')
        measured = Measured(sample.q_WB_xyzw, sample.omega_WB_B, sample.q, sample.qd)
        if not self._is_started:
            self.adaptive.start(measured)
        elapsed = hold_ns * NS if self._is_started else None
        self._is_started = True
        target = Target(*motion.attitude(stamp_ns), *motion.point(stamp_ns))
        asked = self.adaptive.step(measured, target, elapsed)
        u, cut = within_limits(np.concatenate([asked.base, asked.joints]), self._limits)
        if cut.any():
            self.adaptive.applied(u[:3], u[3:])
        return Torque(u[3:], cut[3:], u[:3], bool(cut[:3].any()), asked.attitude_error)

    def damp(self, sample: Feedback, trust: float = 1.0) -> Torque:
        """Torque under which the joint rates decay; none on the base."""
        torque = self._brake.damp(sample, trust)
        return Torque(torque.tau, torque.saturated, np.zeros(3))

    def _from_file(self) -> AdaptiveController:
        return AdaptiveController(self._robot, self._options, self._period)
