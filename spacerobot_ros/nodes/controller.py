"""Controller node (lifecycle): joint states in, joint torques out, by the latest valid estimate.

See docs/nodes/controller.md.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from rclpy.clock import Clock, ClockType
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from spacerobot_msgs.msg import Tracking
from trajectory_msgs.msg import JointTrajectory

from ..control.loop import Command, ControlLoop
from ..errors import MessageRejectedError
from ..model.robot import Robot
from ..ros import convert
from ..ros.diagnostics import ERROR, OK, STALE, WARN, Health, Status
from ..ros.jumps import on_backward_jump
from ..ros.main import run_node
from ..ros.params import declare_settings, open_robot
from ..ros.qos import LATCHED, STATE
from ..sensing.sensors import steps_between

Joints = tuple[int, np.ndarray, np.ndarray]


class ControllerNode(LifecycleNode):
    """Answers every joint sample with a torque while active."""

    loop: ControlLoop

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('controller', **node_kwargs)
        self.settings = declare_settings(self)
        self.health = Health(self)
        self.is_open = False  # whether the robot is known
        self.last_command: Command | None = None
        self._is_active = False
        self._latest: Joints | None = None
        self._deferred: Joints | None = None
        self._deferred_since = 0
        self._arrived_ns = 0
        self._estimate_note = 'none received'
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timeout_ns = round(self.settings.controller.state_timeout * 1e9)
        self._effort_publisher = self.create_lifecycle_publisher(
            JointState, '/joint_commands', STATE
        )
        self._tracking_publisher = self.create_lifecycle_publisher(Tracking, '/tracking', STATE)
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
        if self._latest is not None:
            self._answer_when_complete(self._latest)
        return result

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish a zero torque, then nothing any more."""
        self._release()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Forget the estimate."""
        if self.is_open:
            self.loop.set_estimate(None)
            self._estimate_note = 'none received'
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Publish a zero torque if active."""
        self._release()
        return super().on_shutdown(state)

    def _release(self) -> None:
        if self._is_active and self.last_command is not None:
            self._is_active = False
            stamp = self.last_command.stamp_ns
            zero = convert.joint_state(stamp, self._names, effort=np.zeros(len(self._names)))
            self._effort_publisher.publish(zero)
        self._is_active = False
        self._deferred = None

    def _open(self, robot: Robot) -> None:
        self.loop = ControlLoop(robot, self.settings)
        self._names = list(robot.joints[: robot.n_joints - robot.rotor_count])
        self._base_link = robot.base_link
        self._latest_rate: tuple[int, np.ndarray] | None = None
        simulator = self.settings.simulator
        self._imu_period_ns = round(simulator.period * 1e9) * steps_between(
            simulator.imu_rate, simulator.period, 'simulator.imu_rate'
        )
        self.is_open = True
        self._is_lockstep = simulator.lockstep and robot.is_free
        self.create_subscription(Imu, '/imu/data', self._on_imu, STATE)
        self.create_subscription(EstimateMessage, '/estimate', self._on_estimate, LATCHED)
        self.create_subscription(JointTrajectory, '/reference', self._on_reference, STATE)
        self.create_subscription(JointState, '/joint_states', self._on_joints, STATE)
        self.create_timer(self.settings.controller.state_timeout / 4.0, self._on_watch)
        if self._is_lockstep:
            period = self.settings.controller.state_timeout
            self.create_timer(period, self._on_incomplete, clock=self._steady)
        self._jump = on_backward_jump(self, self._on_clock_jump)
        self.health.watch(self._input_status, self._control_status, self._estimate_status)
        if self.get_parameter('autostart').value:
            self.trigger_configure()
            self.trigger_activate()

    # ------------------------------------------------------------ inputs

    def _on_imu(self, message: Imu) -> None:
        try:
            stamp, omega = convert.angular_rate(message, self._base_link)
            self._go_back(stamp, self._latest_rate and self._latest_rate[0], '/imu/data')
            self.loop.add_rate(stamp, omega)
        except MessageRejectedError as error:
            self.health.reject('/imu/data', error)
            return
        self._latest_rate = (stamp, omega)
        if self._deferred is not None:
            self._answer_when_complete(self._deferred)

    def _on_joints(self, message: JointState) -> None:
        try:
            joints = convert.joint_sample(message, self._names)
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
        newest = max(self._latest[0] if self._latest else 0, self.loop.rate_ns or 0)
        if newest > self._now():  # not if the stamps told already
            self._restart('/clock went back')

    def _restart(self, why: str) -> None:
        self.get_logger().info(f'{why}: the motion starts again')
        self.loop.reset()
        self._latest = self._latest_rate = self._deferred = self.last_command = None

    # ------------------------------------------------------------ commands

    def _answer_when_complete(self, joints: Joints) -> None:
        """Answer now; in lockstep only with the gyro sample that belongs to these joint states.

        Otherwise the torque would depend on which of two messages was handled first.
        """
        expected = joints[0] // self._imu_period_ns * self._imu_period_ns
        if self._is_lockstep and (self.loop.rate_ns is None or self.loop.rate_ns < expected):
            if self._deferred is None:
                self._deferred_since = self._steady.now().nanoseconds
            self._deferred = joints
            return
        self._answer(joints)

    def _on_incomplete(self) -> None:
        """Lockstep with a gyro that stopped: time would stand still, so answer without it."""
        waited = self._steady.now().nanoseconds - self._deferred_since
        if self._deferred is not None and waited > self._timeout_ns:
            self._answer(self._deferred)

    def _answer(self, joints: Joints) -> None:
        self._deferred = None
        if self._is_active:
            self._publish(self.loop.add_joints(*joints))

    def _repeat(self, stamp: int) -> None:
        """Send the command for a stamp again: who repeats a sample has not got its answer."""
        if self._is_active and self.last_command and self.last_command.stamp_ns == stamp:
            self._publish(self.last_command)

    def _on_watch(self) -> None:
        if not self._is_active or self._latest is None or self._deferred is not None:
            return
        command = self.loop.blind(self._now() - self._arrived_ns)
        if command is not None:
            self.get_logger().warning('joint states are stale', throttle_duration_sec=2.0)
            self._publish(command)

    def _publish(self, command: Command) -> None:
        if command.mode == 'damping' and command.reason:
            self.get_logger().warning(f'damping: {command.reason}', throttle_duration_sec=2.0)
        self.last_command = command
        message = convert.joint_state(command.stamp_ns, self._names, effort=command.tau)
        self._effort_publisher.publish(message)
        law = self.settings.controller.law
        self._tracking_publisher.publish(convert.tracking_message(command, self._names, law))

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    # ------------------------------------------------------------ health

    def _input_status(self) -> Status:
        if self._latest is None:
            return Status('inputs', STALE, 'no joint states yet')
        age = (self._now() - self._arrived_ns) * 1e-9
        values: dict[str, object] = {'age of joint states [s]': age}
        rate_ns = self.loop.rate_ns
        if rate_ns is not None:
            values['gyro behind joint states [s]'] = (self._latest[0] - rate_ns) * 1e-9
        command = self.last_command
        if self._is_active and command is not None and command.reason:
            return Status('inputs', ERROR, command.reason, values)
        return Status('inputs', OK, 'fresh', values)

    def _control_status(self) -> Status:
        if not self._is_active:
            return Status('control', OK, 'inactive: no torque is commanded')
        command = self.last_command
        if command is None:
            return Status('control', STALE, 'active, nothing to answer yet')
        values: dict[str, object] = {
            'law': self.settings.controller.law,
            'largest joint error [rad]': float(np.abs(command.error).max()),
            'saturated joints': int(np.count_nonzero(command.saturated)),
        }
        if command.mode == 'damping':
            return Status('control', WARN, f'damping to zero: {command.reason}', values)
        if command.saturated.any():
            return Status('control', WARN, f'{command.mode}, torque at its limit', values)
        return Status('control', OK, command.mode, values)

    def _estimate_status(self) -> Status:
        if not self.loop.takes_estimates:
            return Status('estimate', OK, 'not used by this law')
        is_used = self.loop.estimate is not None
        source = 'an estimate' if is_used else "the robot file's model"
        level = OK if is_used else WARN
        return Status('estimate', level, f'running on {source}; {self._estimate_note}')


def main(args: list[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(ControllerNode, args)


if __name__ == '__main__':
    sys.exit(main())
