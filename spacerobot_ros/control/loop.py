"""The control loop without ROS: samples and estimates in, torques out, stale inputs noticed.

`ControlLoop` is what the controller node and the offline simulation share. Time is the stamp of
the joint states, in nanoseconds; the motion starts at the first one.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from ..effects.catalogue import believed_effects, changed_robot
from ..errors import MessageRejectedError, SpaceRobotError
from ..identification.estimate import Estimate
from ..model.control_settings import ADAPTIVE_LAWS
from ..model.robot import Robot
from ..model.settings import Settings
from ..recording.buffer import check_later
from ..sensing.sensor_faults import SensorFaults
from ..types import Array, Quaternion, Vector3
from .adaptive.controller import AdaptiveController
from .attitude import check_attitude
from .base_sensors import BaseSensors
from .command import NS, Command, Feedback, Mode, Torque
from .controllers import Controller, FreeFlyingController, JointController
from .joint_reference import Reference, Setpoint, check_reference, rest
from .plausible import MotionLimits
from .reference_motion import EventAnswer, ReferenceMotion
from .sample_screen import SampleScreen
from .waypoints import Waypoints

_MOVING = 6.0  # standard deviations of a rate, from which on a joint is not at rest
_BRAKED = 5.0  # time constants of the damping, after which 0.7 % of a rate is left
_BEYOND = 1.1
"""Times a joint's largest rate, from which on it is braked: the law's own torques lead to 1.02."""
_TORQUE = tuple(field.name for field in fields(Torque))


class ControlLoop:
    """Tracks a reference by the law in force; damps to zero when an input is stale.

    The settings' `effects` are part of the model: the robot is what they make of it, their forces
    are made up for where that can be done, and their sensor faults undone (`laws`).

    Args:
        robot: The robot of the robot file.
        settings: `controller`, `adaptive`, `reference`, `effects`, `identifier.structure`, of
            `simulator` the period and the rate of the joint states, `monitor.on_event` and
            `initial.joint_position`.

    Attributes:
        mode: What the loop is doing.
        screen: Leaves samples out that contradict their forerunners.
        event: How it answers what acts from outside.
        reference_warning: What the robot file's motion asks beyond the joints' limits, from where
            it starts, before the first sample from `initial`; empty: nothing.

    Raises:
        ConfigurationError: settings that don't fit the robot.
    """

    def __init__(self, robot: Robot, settings: Settings) -> None:
        effects = believed_effects(settings, robot)
        robot = changed_robot(robot, effects)
        self._faults = SensorFaults(robot, effects)
        self.robot = robot
        self.n = robot.n_joints
        self._settings, self._reference = settings.controller, settings.reference
        self.event = EventAnswer(settings.monitor.on_event)
        check_reference(settings.reference, self.n)
        check_attitude(settings.reference)
        is_adaptive = self._settings.law in ADAPTIVE_LAWS
        self.controller: Controller = (
            FreeFlyingController(robot, settings)
            if is_adaptive
            else JointController(robot, settings, effects)
        )
        self._motion = ReferenceMotion(settings.reference, self.controller.joining)
        self._timeout_ns = round(self._settings.state_timeout * 1e9)
        self._first_hold_ns = round(settings.simulator.period * 1e9)
        self._limits = MotionLimits(robot, settings.simulator.joint_rate)
        self._rest_std = settings.sensors.std('joint_velocity') or 0.0
        self.screen = SampleScreen(settings.sensors, settings.controller)
        start = settings.initial.joint_position
        self._see_limits(np.array(start if len(start) == self.n else np.zeros(self.n)))
        self.reset()

    def reset(self) -> None:
        """Forget the samples, keep the estimate; the motion starts again at the next sample."""
        self.begin_segment()
        self._motion.reset()
        self.controller.restart()
        self._last: tuple[int, Array, Array] | None = None
        self._believed: tuple[int, Array, Array] | None = None  # the last one that was measured
        self.event.forget()
        self._tau: Array | None = None
        self._hold_ns = self._first_hold_ns
        self.mode: Mode = 'hold'

    def begin_segment(self) -> None:
        """Take what comes now in another time; the motion goes on from where it is."""
        self._base = BaseSensors(self._settings)
        self.screen.reset()
        self._is_new_time = True

    @property
    def estimate(self) -> Estimate | None:
        """The estimate in use; None: the robot file's model."""
        return self.controller.estimate

    @property
    def adaptive(self) -> AdaptiveController | None:
        """The adaptive law in force; None under computed torque."""
        return self.controller.adaptive

    @property
    def joints_ns(self) -> int | None:
        """Stamp of the last joint sample, None before the first."""
        return self._last[0] if self._last else None

    @property
    def rate_ns(self) -> int | None:
        """Stamp of the newest gyro sample, None before the first."""
        return self._base.rates.newest_ns

    @property
    def attitude_ns(self) -> int | None:
        """Stamp of the newest attitude, None before the first."""
        return self._base.attitudes.newest_ns

    def set_estimate(self, estimate: Estimate | None) -> None:
        """Use an estimate from now on (None: the robot file's model again).

        Raises:
            MessageRejectedError: not valid, not for this robot, or with an indefinite inertia or
                covariance.
        """
        q = self._last[1] if self._last else np.zeros(self.n)
        if estimate is None:
            self.controller.use(None, q)
            return
        if not estimate.valid:
            raise MessageRejectedError(f'estimate not valid: {estimate.reason}')
        try:
            estimate.check()
            self.controller.use(estimate, q)
        except SpaceRobotError as error:
            raise MessageRejectedError(str(error)) from error

    def retune(self, settings: Settings) -> None:
        """Go on with other gains, damping and limits.

        Raises:
            ConfigurationError: they don't fit; nothing has changed.
        """
        self.controller.retune(settings)
        self._settings = settings.controller

    def set_reference(self, reference: Reference, start_ns: int | None = None) -> None:
        """Follow another joint motion, joined smoothly from the present one.

        Args:
            reference: The motion.
            start_ns: Stamp of its t = 0; None: the next joint sample.

        Raises:
            MessageRejectedError: it, or the way to it, leaves the joints' ranges or is too fast.
        """
        if isinstance(reference, Waypoints):
            with np.errstate(all='ignore'):  # what overflows is beyond the limits
                joined = None
                if self._last is not None and self._motion.has_begun:
                    joined = self._motion.joined(reference, self._last[0], start_ns)
                self._limits.check_joined(reference, joined)
        self._motion.follow(reference, start_ns)

    def setpoint(self) -> Setpoint | None:
        """Where the present motion is at the last joint sample; None before the first."""
        return self._motion.setpoint(self._last[0]) if self._last else None

    def time_left(self) -> float:
        """Time from the last joint sample to the end of the motion asked for last [s]."""
        return self._motion.left(self._last[0]) if self._last else np.inf

    def add_rate(self, stamp_ns: int, omega_WB_B: Vector3) -> None:
        """Take a gyro sample.

        Raises:
            MessageRejectedError: stamp not after the last one.
        """
        check_later(stamp_ns, self.rate_ns)
        if self.screen.takes_rate(stamp_ns, omega_WB_B, self.controller.expected(stamp_ns)):
            self._base.rates.add(stamp_ns, self._faults.undo_rate(omega_WB_B))

    def add_attitude(self, stamp_ns: int, q_WB_xyzw: Quaternion) -> None:
        """Take an attitude.

        Raises:
            MessageRejectedError: stamp not after the last one.
        """
        check_later(stamp_ns, self.attitude_ns)
        predicted = self._base.attitudes.at(stamp_ns, self._base.rates)
        if self.screen.takes_attitude(stamp_ns, q_WB_xyzw, predicted):
            self._base.attitudes.add(stamp_ns, q_WB_xyzw)

    def add_joints(self, stamp_ns: int, q: Array, qd: Array) -> Command:
        """Take a joint sample and answer it.

        Raises:
            MessageRejectedError: stamp not after the last one, or numbers that no joint has.
        """
        if self._is_new_time and self._last is not None:
            self._motion.release(self._last[0])
            self._motion.wait(stamp_ns - self._last[0])
            self.event.forget()
            self._last = self._believed = None
        self._is_new_time = False
        check_later(stamp_ns, self.joints_ns)
        self._limits.check_measured(q, qd)
        q, qd = self.screen.joints(stamp_ns, q, qd, self.controller.expected(stamp_ns))
        q, qd, _ = self._faults.undo_joints(q, qd, np.zeros(self.n))
        if self._believed is None or self.screen.believes(stamp_ns):
            self._believed = stamp_ns, q, qd
        elapsed = stamp_ns - self._last[0] if self._last else 0
        if elapsed:
            self._hold_ns = min(elapsed, self._timeout_ns)
        reason = self._stale(stamp_ns) or self._too_fast(qd)
        is_damped = self.event.damps(stamp_ns) or bool(reason)
        sample = self._sample(stamp_ns, q, qd)
        if is_damped:
            self._motion.release(stamp_ns - elapsed)
        self._prepare_motion(stamp_ns, sample, elapsed, is_damped)
        if not is_damped and self.event.follow(self._motion, stamp_ns, sample):
            self.controller.restart()  # what pushes is not learnt
        self._last = (stamp_ns, q, qd)
        reason = reason or self.event.words
        if is_damped:
            self.mode = 'damping'
            is_blind = self.screen.is_lost(stamp_ns)
            torque = self._coast(stamp_ns)[1] if is_blind else self.controller.damp(sample)
            torque = self.event.eased(torque, self._tau, stamp_ns)
        else:
            self.mode = 'hold' if self._motion.rests(stamp_ns) else 'tracking'
            torque = self.controller.track(self._motion, stamp_ns, sample, self._hold_ns)
        return self._command(stamp_ns, torque, self._motion.setpoint(stamp_ns), sample, reason)

    def blind(self, elapsed_ns: int) -> Command | None:
        """Command for when no joint states arrive any more; None while the last is fresh.

        The joints are extrapolated along the decay that the damping law asks for. The torque that
        holds against the wheels fades meanwhile; both are zero from five time constants on, for a
        torque that rests on a guess must not stay on. None also before the first sample.

        Args:
            elapsed_ns: Time since the last joint sample [ns].
        """
        if self._last is None or elapsed_ns <= self._timeout_ns:
            return None
        self.mode = 'damping'
        stamp_ns, q, _ = self._last
        now, torque = self._coast(stamp_ns + elapsed_ns)
        setpoint = self._motion.setpoint(stamp_ns) if self._motion.has_begun else rest(q)
        return self._command(
            stamp_ns + elapsed_ns, torque, setpoint, now, 'joint states are stale'
        )

    def _coast(self, stamp_ns: int) -> tuple[Feedback, Torque]:
        """Extrapolated state, and torque, where no joint sample was believed for too long."""
        if self._believed is None:
            raise RuntimeError('no sample yet')
        seen_ns, q, qd = self._believed
        rate = self._settings.damping
        past = (stamp_ns - seen_ns - self._timeout_ns) * NS
        is_over = past * rate > _BRAKED
        decay = float(np.exp(-rate * past))
        seen = self._timeout_ns * NS
        omega = self._sample(seen_ns, q, qd).omega_WB_B
        now = Feedback(q + qd * (seen + (1.0 - decay) / rate), qd * decay, omega, np.zeros(3))
        torque = self.controller.damp(now, trust=max(0.0, 1.0 - past * rate / _BRAKED))
        if is_over:
            base = None if torque.base is None else np.zeros(3)
            torque = Torque(np.zeros(self.n), np.zeros(self.n, dtype=bool), base)
        return now, torque

    def _too_fast(self, qd: Array) -> str:
        """Which joint is to be braked; empty: none."""
        most = self._limits.rate * (1.0 if self.mode == 'damping' else _BEYOND)
        beyond = np.flatnonzero(np.abs(qd) > most)
        return f'{self.robot.joints[beyond[0]]} is faster than its limit' if len(beyond) else ''

    def _stale(self, stamp_ns: int) -> str:
        """Which sensor is missing or too old at a joint sample; empty where none is."""
        if self.screen.is_lost(stamp_ns):
            return 'joint states contradict each other'
        if not self.robot.is_free:
            return ''
        return self._base.missing(stamp_ns, self.controller.controls_attitude)

    def _sample(self, stamp_ns: int, q: Array, qd: Array) -> Feedback:
        if not self.robot.is_free:
            return Feedback(q, qd, np.zeros(3), np.zeros(3))
        needs_attitude = self.controller.controls_attitude
        return self._base.feedback(stamp_ns, q, qd, self._hold_ns, needs_attitude)

    def _see_limits(self, start: Array) -> None:
        asked = self._limits.asked_beyond(self._reference, start)
        self.reference_warning = asked and f'reference: {asked}; joints keep their limits'

    def _prepare_motion(self, stamp_ns: int, sample: Feedback, elapsed: int, stale: bool) -> None:
        motion = self._motion
        is_lost = elapsed > self._timeout_ns
        if stale or is_lost:
            # the motion waits, so that it doesn't run away from joints that don't follow
            motion.wait(elapsed)
        if not motion.has_begun:
            motion.begin(stamp_ns, sample.q)
            self._see_limits(sample.q)
            if np.any(np.abs(sample.qd) > _MOVING * self._rest_std):
                motion.rejoin(stamp_ns, sample)
        elif not stale and (is_lost or self.mode == 'damping'):
            motion.rejoin(stamp_ns, sample)
            self.controller.restart()
        if stale:
            return
        if sample.q_WB_xyzw is not None:
            motion.begin_attitude(sample.q_WB_xyzw)
        motion.take_pending(stamp_ns)

    def _command(
        self, stamp_ns: int, torque: Torque, setpoint: Setpoint, sample: Feedback, reason: str
    ) -> Command:
        self._tau = torque.tau
        return Command(
            **{name: getattr(torque, name) for name in _TORQUE},
            stamp_ns=stamp_ns,
            setpoint=setpoint,
            error=setpoint.q - sample.q,
            error_rate=setpoint.qd - sample.qd,
            mode=self.mode,
            reason=reason,
            uses_estimate=self.estimate is not None and self.controller.takes_estimates,
        )


__all__ = ['Command', 'ControlLoop', 'Mode']
