"""Controller node (lifecycle): joint states in, torques on joints and base out.

See docs/nodes/controller.md.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Tracking
from trajectory_msgs.msg import JointTrajectory

from ..control.loop import Command, ControlLoop
from ..errors import MessageRejectedError
from ..model.robot import Robot
from ..recording import messages
from ..ros import convert
from ..ros.convert import compose
from ..ros.diagnostics import Health, Status
from ..ros.jumps import on_backward_jump
from ..ros.main import run_node
from ..ros.params import declare_settings, open_robot
from ..ros.qos import LATCHED, STATE
from .controller_status import (
    adaptation_status,
    control_status,
    estimate_status,
    input_status,
)
from .pairing import Joints, Pairing
from .parameters_in_force import ParametersInForce


class ControllerNode(LifecycleNode):
    """Answers every joint sample with a torque while active."""

    loop: ControlLoop
    _in_force: ParametersInForce | None = None

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('controller', **node_kwargs)
        self.settings = declare_settings(self)
        self.health = Health(self)
        self.is_open = False  # whether the robot is known
        self.last_command: Command | None = None
        self._is_active = False
        self._latest: Joints | None = None
        self._arrived_ns = 0
        self._estimate_note = 'none received'
        self._timeout_ns = round(self.settings.controller.state_timeout * 1e9)
        self._effort_publisher = self.create_lifecycle_publisher(
            JointState, '/joint_commands', STATE
        )
        self._tracking_publisher = self.create_lifecycle_publisher(Tracking, '/tracking', STATE)
        self._wrench_publisher = self.create_lifecycle_publisher(
            WrenchStamped, '/base_torque', STATE
        )
        open_robot(self, self.settings, self._open)

    # ------------------------------------------------------------ life cycle

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Take up the robot; fails while there is none."""
        if not self.is_open:
            self.get_logger().warning('no robot yet: waiting for /robot_description')
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the motion: at the last joint sample if there is one, it is owed an answer."""
        result = super().on_activate(state)
        self.loop.reset()
        self._is_active = True
        if self._latest_rate is not None:
            self.loop.add_rate(*self._latest_rate)
        if self._latest_attitude is not None:
            self.loop.add_attitude(*self._latest_attitude)
        if self._latest is not None:
            self._answer_when_complete(self._latest)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish a zero torque, then nothing any more."""
        self._release()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the estimate and what was learnt."""
        if self.is_open:
            self.loop.set_estimate(None)
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
        super().destroy_node()

    def _release(self) -> None:
        if self._is_active and self.last_command is not None:
            self._is_active = False
            stamp = self.last_command.stamp_ns
            free = np.zeros(3) if self.loop.controls_attitude else None
            self._send(stamp, np.zeros(len(self._names)), free)
        self._is_active = False
        if self.is_open:
            self._pairing.waiting = None

    def _open(self, robot: Robot) -> None:
        self.loop = ControlLoop(robot, self.settings)
        self._names = list(robot.joints)
        self._base_link = robot.base_link
        self._latest_rate: tuple[int, np.ndarray] | None = None
        self._latest_attitude: tuple[int, np.ndarray] | None = None
        self._pairing = Pairing(self.loop, self.settings.simulator, self._timeout_ns)
        self.is_open = True
        self._subscribe()
        self.create_timer(self.settings.controller.state_timeout / 4.0, self._on_watch)
        if self._pairing.is_lockstep:
            period = self.settings.controller.state_timeout
            self.create_timer(period, self._on_incomplete, clock=self._pairing.clock)
        self._jump = on_backward_jump(self, self._on_clock_jump)
        if self.loop.adaptive is not None:
            self._in_force = ParametersInForce(self, self.loop, self.settings)
            warning = self.loop.adaptive.health.sampling_warning
            if warning:
                self.get_logger().warning(warning)
        self._watch()
        if self.get_parameter('autostart').value:
            self.trigger_configure()
            self.trigger_activate()

    def _subscribe(self) -> None:
        self.create_subscription(Imu, '/imu/data', self._on_imu, STATE)
        if self.loop.controls_attitude:
            self.create_subscription(QuaternionStamped, '/attitude', self._on_attitude, STATE)
        self.create_subscription(EstimateMessage, '/estimate', self._on_estimate, LATCHED)
        self.create_subscription(JointTrajectory, '/reference', self._on_reference, STATE)
        self.create_subscription(JointState, '/joint_states', self._on_joints, STATE)

    # ------------------------------------------------------------ inputs

    def _on_imu(self, message: Imu) -> None:
        try:
            stamp, omega = messages.angular_rate(message, self._base_link)
            self._go_back(stamp, self._latest_rate and self._latest_rate[0], '/imu/data')
            self.loop.add_rate(stamp, omega)
        except MessageRejectedError as error:
            self.health.reject('/imu/data', error)
            return
        self._latest_rate = (stamp, omega)
        if self._pairing.waiting is not None:
            self._answer_when_complete(self._pairing.waiting)

    def _on_attitude(self, message: QuaternionStamped) -> None:
        try:
            stamp, attitude = messages.attitude(message)
            self._go_back(stamp, self._latest_attitude and self._latest_attitude[0], '/attitude')
            self.loop.add_attitude(stamp, attitude)
        except MessageRejectedError as error:
            self.health.reject('/attitude', error)
            return
        self._latest_attitude = (stamp, attitude)
        if self._pairing.waiting is not None:
            self._answer_when_complete(self._pairing.waiting)

    def _on_joints(self, message: JointState) -> None:
        try:
            joints = messages.joint_sample(message, self._names)
            last = self._latest[0] if self._latest else None
            self._go_back(joints[0], last, '/joint_states')
            if self._latest is not None and joints[0] <= self._latest[0]:
                self._repeat(joints[0])
                how = 'duplicate stamp' if joints[0] == self._latest[0] else 'stamp goes backwards'
                raise MessageRejectedError(how)
        except MessageRejectedError as error:
            self.health.reject('/joint_states', error)
            return
        self._latest = joints
        self._arrived_ns = self._now()
        if self._is_active:
            self._answer_when_complete(joints)

    def _on_estimate(self, message: EstimateMessage) -> None:
        if not message.valid:
            self._estimate_note = f'last one not valid: {message.reason}'
            return
        try:
            estimate = convert.estimate(message)
            if self.loop.takes_estimates:
                self.loop.set_estimate(estimate)
        except MessageRejectedError as error:
            self.health.reject('/estimate', error)
            return
        self._estimate_note = f'valid, stamped {estimate.stamp_ns * 1e-9:.3f} s'

    def _on_reference(self, message: JointTrajectory) -> None:
        try:
            start = self.loop.reference_point()
            self.loop.set_reference(*convert.trajectory(message, self._names, start))
        except MessageRejectedError as error:
            self.health.reject('/reference', error)

    def _go_back(self, stamp: int, last: int | None, topic: str) -> None:
        """Start anew where the stamps belong to another run: not late samples, but gone back."""
        if last is not None and stamp < last - self._timeout_ns:
            self._restart(f'stamps of {topic} went back by {(last - stamp) * 1e-9:.3f} s')

    def _on_clock_jump(self) -> None:
        joints = self._latest[0] if self._latest else 0
        newest = max(joints, self.loop.rate_ns or 0, self.loop.attitude_ns or 0)
        if newest > self._now():  # not if the stamps told already
            self._restart('/clock went back')

    def _restart(self, why: str) -> None:
        self.get_logger().info(f'{why}: the motion starts again')
        self.loop.reset()
        self._latest = self._latest_rate = self._latest_attitude = None
        self._pairing.waiting = self.last_command = None

    # ------------------------------------------------------------ commands

    def _answer_when_complete(self, joints: Joints) -> None:
        if not self._pairing.hold_back(joints):
            self._answer(joints)

    def _on_incomplete(self) -> None:
        """Lockstep with a sensor that stopped: answer without it."""
        joints = self._pairing.overdue()
        if joints is not None:
            self._answer(joints)

    def _answer(self, joints: Joints) -> None:
        self._pairing.waiting = None
        if self._is_active:
            self._publish(self.loop.add_joints(*joints))

    def _repeat(self, stamp: int) -> None:
        """Send the command for a stamp again: who repeats a sample has not got its answer."""
        if self._is_active and self.last_command and self.last_command.stamp_ns == stamp:
            self._publish(self.last_command)

    def _on_watch(self) -> None:
        if not self._is_active or self._latest is None or self._pairing.waiting is not None:
            return
        command = self.loop.blind(self._now() - self._arrived_ns)
        if command is not None:
            self.get_logger().warning('joint states are stale', throttle_duration_sec=2.0)
            self._publish(command)

    def _publish(self, command: Command) -> None:
        if command.mode == 'damping' and command.reason:
            self.get_logger().warning(f'damping: {command.reason}', throttle_duration_sec=2.0)
        self.last_command = command
        self._send(command.stamp_ns, command.tau, command.base)
        if self._in_force is not None:
            self._in_force.publish(command.stamp_ns)
        law = self.settings.controller.law
        self._tracking_publisher.publish(convert.tracking_message(command, self._names, law))

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _send(self, stamp: int, tau: np.ndarray, base: np.ndarray | None) -> None:
        if base is not None:
            self._wrench_publisher.publish(compose.base_torque(stamp, self._base_link, base))
        self._effort_publisher.publish(compose.joint_state(stamp, self._names, effort=tau))

    def _watch(self) -> None:
        """Say on /diagnostics how things are."""
        law = self.settings.controller.law
        self.health.watch(
            self._input_status,
            lambda: control_status(self._is_active, self.last_command, law),
            lambda: estimate_status(self.loop, self._estimate_note),
        )
        if self.loop.adaptive is not None:
            self.health.watch(lambda: adaptation_status(self.loop, self.last_command))

    def _input_status(self) -> Status:
        stamp = self._latest[0] if self._latest else None
        command = self.last_command
        reason = command.reason if self._is_active and command else ''
        return input_status(self.loop, stamp, (self._now() - self._arrived_ns) * 1e-9, reason)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(ControllerNode, args)


if __name__ == '__main__':
    sys.exit(main())
