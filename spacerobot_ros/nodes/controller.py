"""Controller node (lifecycle): joint states in, torques on joints and base out.

See docs/nodes/controller.md.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Tracking
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from ..control.controllers import FreeFlyingController
from ..control.loop import Command, ControlLoop
from ..control.plausible import EstimateCheck
from ..errors import MessageRejectedError
from ..model.robot import Robot
from ..model.settings import Settings
from ..recording.buffer import check_later
from ..ros import convert
from ..ros.convert import compose
from ..ros.diagnostics import ERROR, WARN, Status
from ..ros.qos import LATCHED, STATE
from .controller_status import (
    adaptation_status,
    control_status,
    estimate_status,
    input_status,
)
from .pace import IdleTime
from .pairing import Pairing
from .parameter_publisher import AdaptationFile, ParameterPublisher
from .sensor_node import TOPICS, SensorNode
from .trajectory_action import TrajectoryAction


def load_solvers() -> None:
    """Load what limits and waypoints call: within a cycle of the loop that takes too long."""
    for name in ('scipy.interpolate', 'scipy.optimize'):
        import_module(name)


class ControllerNode(SensorNode):
    """Answers every joint sample with a torque while active."""

    loop: ControlLoop
    live = frozenset(
        (
            'controller.bandwidth',
            'controller.damping',
            'controller.torque_limit',
            'controller.base_torque_limit',
            'adaptive.kappa',
            'adaptive.attitude_bandwidth',
            'adaptive.joint_bandwidth',
        )
    )
    _in_force: ParameterPublisher | None = None
    _learned: AdaptationFile | None = None
    _action: TrajectoryAction | None = None

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('controller', **node_kwargs)
        self.last_command: Command | None = None
        self._answered: Command | None = None  # the last that was no guess in between
        self._arrived_ns = self._takers = 0
        self._watch_period = self.settings.controller.state_timeout / 4.0
        self._idle = IdleTime(self._watch_period, lambda: self.wall_ns())
        self._estimate_note = 'none received'
        self.jump_ns = round(self.settings.controller.state_timeout * 1e9)
        self._efforts = self.create_lifecycle_publisher(JointState, '/joint_commands', STATE)
        self._trackings = self.create_lifecycle_publisher(Tracking, '/tracking', STATE)
        self._arrays = self.create_lifecycle_publisher(
            Float64MultiArray, '~/effort_commands', STATE
        )
        self._wrenches = self.create_lifecycle_publisher(WrenchStamped, '/base_torque', STATE)
        self.find_robot()

    # ------------------------------------------------------------ life cycle

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the motion: at the last joint sample if there is one, it is owed an answer."""
        result = super().on_activate(state)
        self.loop.reset()
        if 'imu' in self.latest:
            self.loop.add_rate(*self.latest['imu'])
        if 'attitude' in self.latest:
            self.loop.add_attitude(*self.latest['attitude'])
        if 'joints' in self.latest:
            self._answer_when_complete(self.latest['joints'])
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish a zero torque, then nothing any more."""
        self._release()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the estimate and what was learnt."""
        if self.is_open:
            self.loop.set_estimate(None)
            self._estimates.clear()
            self._estimate_note = 'none received'
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish a zero torque if active."""
        self._release()
        return super().on_shutdown(state)

    def destroy_node(self) -> None:
        """Save the parameters in force, if that is asked for."""
        if self._in_force is not None:
            self._in_force.save_at_end()
        if self._learned is not None:
            self._learned.close()
        super().destroy_node()

    def retune(self, settings: Settings) -> None:
        """Take up gains, damping and limits, while the motion goes on."""
        if self.is_open:
            self.loop.retune(settings)
        super().retune(settings)

    def _release(self) -> None:
        if self._action is not None:
            self._action.stop('the controller was deactivated')
        if self.is_active and self.last_command is not None:
            self.is_active = False
            stamp = self.last_command.stamp_ns
            free = np.zeros(3) if self.loop.controller.controls_attitude else None
            self._send(stamp, np.zeros(len(self._names)), free)
        self.is_active = False
        if self.is_open:
            self._pairing.waiting = None

    def on_robot(self, robot: Robot) -> None:
        """Take up the robot; start by itself if that is asked for."""
        if not self.settings.simulator.lockstep:
            load_solvers()
        self.loop = ControlLoop(robot, self.settings)
        self._estimates = EstimateCheck(self.loop.robot, self.settings)
        self._names, self._base_link = list(robot.joints), robot.base_link
        idle = IdleTime(self._watch_period, lambda: self.wall_ns())
        self._pairing = Pairing(self.loop, self.settings.simulator, idle)
        self.is_open = True
        self._subscribe(robot)
        self.create_timer(self._watch_period, self._on_watch, clock=self.steady)
        if self.loop.adaptive is not None:
            self._in_force = ParameterPublisher(self, self.loop, self.settings)
            warning = self.loop.adaptive.health.sampling_warning
            if warning:
                self.get_logger().warning(warning)
        self._warn_of_reference()
        try:
            self._action = TrajectoryAction(self, self.loop, self._names)
        except ImportError:
            self.get_logger().debug('no FollowJointTrajectory: control_msgs is not installed')
        law = self.loop.controller
        if self.settings.controller.save_file and isinstance(law, FreeFlyingController):
            self._learned = AdaptationFile(self, law, self.loop.robot)
        self._watch()

    def _warn_of_reference(self) -> None:
        if self.loop.reference_warning:
            self.get_logger().warning(self.loop.reference_warning, once=True)

    def _subscribe(self, robot: Robot) -> None:
        self.listen('/estimate', EstimateMessage, LATCHED, self._on_estimate)
        self.listen('/reference', JointTrajectory, STATE, self._on_reference)
        if self.settings.monitor.on_event != 'report':
            self.listen('/events', DiagnosticArray, LATCHED, self._on_event)
        tracker = ('attitude',) if self.loop.controller.controls_attitude else ()
        self.follow(robot, ('imu', *tracker, 'joints'), STATE)

    # ------------------------------------------------------------ inputs

    def take(self, sensor: str, stamp_ns: int, *content: Any) -> None:
        """Answer joint states; a sample of the other sensors may be what they waited for."""
        if sensor == 'joints':
            last = self.latest.get('joints')
            if last is not None and stamp_ns <= last[0]:
                self._repeat(stamp_ns)
                check_later(stamp_ns, last[0])
            self.latest['joints'] = (stamp_ns, *content)
            self._arrived_ns = self.wall_ns()
            self._idle.clear()
            if self.is_active:
                self._answer_when_complete(self.latest['joints'])
            return
        add = self.loop.add_rate if sensor == 'imu' else self.loop.add_attitude
        add(stamp_ns, *content)
        if self._pairing.waiting is not None:
            self._answer_when_complete(self._pairing.waiting)

    def _on_estimate(self, message: EstimateMessage) -> None:
        if not message.valid:
            self._estimate_note = f'last one not valid: {message.reason}'
            return
        estimate = convert.estimate(message)
        self._estimates.check(estimate)
        if self.loop.controller.takes_estimates:
            self.loop.set_estimate(estimate)
        self._estimate_note = f'valid, stamped {estimate.stamp_ns * 1e-9:.3f} s'

    def _on_event(self, message: DiagnosticArray) -> None:
        reasons = [s.message for s in message.status if s.level in (WARN, ERROR)]
        self.loop.event.hear('; '.join(reasons), self.loop.joints_ns)

    def _on_reference(self, message: JointTrajectory) -> None:
        start = self.loop.setpoint()
        self.loop.set_reference(*convert.trajectory(message, self._names, start))
        if self._action is not None:
            self._action.replaced('a motion on /reference has taken its place')

    def restart(self, why: str) -> None:
        """Begin the motion anew."""
        self.get_logger().info(f'{why}: the motion starts again')
        self.loop.reset()
        self._pairing.waiting = self.last_command = None

    def begin_segment(self, why: str, jump_ns: int | None) -> None:
        """Go on with the motion in another time; where time itself goes back, begin it anew."""
        if jump_ns is None:
            self.restart(why)
            return
        self.get_logger().info(f'{why}: the motion goes on')
        self.loop.begin_segment()
        self._pairing.waiting = self.last_command = None

    # ------------------------------------------------------------ commands

    def _answer_when_complete(self, joints: tuple[Any, ...]) -> None:
        if not self._pairing.hold_back(joints):
            self._answer(joints)

    def _answer(self, joints: tuple[Any, ...]) -> None:
        self._pairing.waiting = None
        if self.is_active:
            try:
                self._answered = self.loop.add_joints(*joints)
            except MessageRejectedError as error:  # perhaps asked for by another sensor's sample
                self.health.reject(TOPICS['joints'][0], error)
                return
            self._takers = self._efforts.get_subscription_count()
            self._publish(self._answered)

    def _repeat(self, stamp: int) -> None:
        """Send the command for a stamp again: who repeats a sample has not got its answer."""
        if self.is_active and self._answered is not None and self._answered.stamp_ns == stamp:
            self._publish(self._answered)

    def _on_watch(self) -> None:
        self._idle.tick()
        if not self.is_active or 'joints' not in self.latest:
            return
        if self.settings.simulator.lockstep:
            self._watch_lockstep()
        if self._pairing.waiting is not None:
            return
        command = self.loop.blind(self._silent_ns())
        if command is not None:
            self.get_logger().warning('joint states are stale', throttle_duration_sec=2.0)
            self._publish(command)

    def _watch_lockstep(self) -> None:
        """Answer without a sensor that stopped, and again to a simulator that came late."""
        overdue = self._pairing.overdue()
        if overdue is not None:
            self._answer(overdue)
        elif self._efforts.get_subscription_count() > self._takers:
            self._takers = self._efforts.get_subscription_count()
            self._repeat(self.latest['joints'][0])

    def _silent_ns(self) -> int:
        """Time without joint states [ns], on a clock that does not stop with the simulator.

        A simulation may be slower than the wall, and in lockstep takes its time.
        """
        simulator = self.settings.simulator
        if simulator.lockstep:
            return round(self._idle.ns - simulator.lockstep_timeout * 1e9)
        silent = self.wall_ns() - self._arrived_ns
        is_simulated = self.get_clock().ros_time_is_active
        return round(silent * min(1.0, simulator.real_time_factor) if is_simulated else silent)

    def _publish(self, command: Command) -> None:
        if command.mode == 'damping' and command.reason:
            self.get_logger().warning(f'damping: {command.reason}', throttle_duration_sec=2.0)
        if self.last_command is None:  # the motion has begun, perhaps from elsewhere
            self._warn_of_reference()
        self.last_command = command
        self._send(command.stamp_ns, command.tau, command.base)
        if self._in_force is not None:
            self._in_force.publish(command.stamp_ns)
        if self._action is not None:
            self._action.follow(command)
        if self._learned is not None:
            self._learned.keep(command.stamp_ns)
        if self._trackings.get_subscription_count():
            law = self.settings.controller.law
            self._trackings.publish(convert.tracking_message(command, self._names, law))

    def _send(self, stamp: int, tau: np.ndarray, base: np.ndarray | None) -> None:
        if base is not None:
            self._wrenches.publish(compose.base_torque(stamp, self._base_link, base))
        self._efforts.publish(compose.joint_state(stamp, self._names, effort=tau))
        if self._arrays.get_subscription_count():
            self._arrays.publish(Float64MultiArray(data=convert.doubles(tau)))

    def _watch(self) -> None:
        """Say on /diagnostics how things are."""
        law, unit = self.settings.controller.law, self.loop.robot.unit_of('rad')
        self.health.watch(
            self._sensor_status,
            lambda: control_status(self.is_active, self.last_command, law, unit),
            lambda: estimate_status(self.loop, self._estimate_note),
        )
        controller = self.loop.controller
        if isinstance(controller, FreeFlyingController):  # an estimate gives it another law
            self.health.watch(
                lambda: adaptation_status(controller.adaptive.health, self.last_command)
            )

    def _sensor_status(self) -> Status:
        stamp = self.latest['joints'][0] if 'joints' in self.latest else None
        command = self.last_command
        is_damped = self.is_active and command is not None and not self.loop.event.words
        reason = command.reason if is_damped and command else ''
        return input_status(self.loop, stamp, self._silent_ns() * 1e-9, reason)
