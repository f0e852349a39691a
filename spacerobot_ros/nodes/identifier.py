"""Identifier node: samples in, wheel momentum and minimal parameters with covariance out.

See docs/nodes/identifier.md.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from geometry_msgs.msg import QuaternionStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from std_srvs.srv import Trigger

from ..effects.catalogue import bind_effects, changed_robot
from ..errors import IdentificationError, MessageRejectedError
from ..identification.estimate import Estimate
from ..identification.online import OnlineIdentifier
from ..model.robot import Robot
from ..recording import messages
from ..ros import convert
from ..ros.diagnostics import OK, STALE, WARN, Health, Status
from ..ros.jumps import STAMP_JUMP_NS, on_backward_jump
from ..ros.main import run_node
from ..ros.merge import Merger
from ..ros.params import declare_settings, open_robot
from ..ros.qos import LATCHED, SAMPLES
from ..sensing.faults import SensorFaults

TOPICS = ('/imu/data', '/attitude', '/joint_states')  # in the order in which equal stamps are used
RATE, ATTITUDE, JOINTS = range(3)
CLOCKS_OF = ('imu', 'attitude', 'joints')
PATIENCE_NS = 1_000_000_000
SLACK_NS = 50_000_000


class IdentifierNode(Node):
    """Orders the samples by stamp, feeds the online identifier and publishes its estimates."""

    identifier: OnlineIdentifier

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('identifier', **node_kwargs)
        self.settings = declare_settings(self)
        self.health = Health(self)
        self.is_open = False  # whether the robot is known
        self.estimate: Estimate | None = None
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._period_ns = round(self.settings.identifier.solve_period * 1e9)
        self._publisher = self.create_publisher(EstimateMessage, '/estimate', LATCHED)
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(Trigger, '~/solve', self._on_solve)
        self._clear()
        open_robot(self, self.settings, self._open)

    def reset(self, why: str) -> None:
        """Forget all samples, and say so in an estimate that is not valid."""
        self._clear()
        if not self.is_open:
            return
        self.identifier.reset()
        self.get_logger().info(f'reset: {why}')
        self._publish(self.identifier.solve())

    def solve(self) -> Estimate | None:
        """Use what has arrived and publish the estimate; None where nothing can be solved."""
        if not self.is_open:
            return None
        started = self._steady.now().nanoseconds
        try:
            estimate = self.identifier.solve()
        except IdentificationError as error:
            self._failure = str(error)
            self.get_logger().warning(f'no estimate: {error}', throttle_duration_sec=5.0)
            return None
        self._failure = ''
        self._solve_ms = (self._steady.now().nanoseconds - started) * 1e-6
        self._publish(estimate)
        return estimate

    def flush(self) -> None:
        """Use the samples that still wait for others to be put in order with."""
        for sample in self._merger.flush():
            self._use(*sample)

    # ------------------------------------------------------------ set-up

    def _open(self, robot: Robot) -> None:
        effects = bind_effects(self.settings.effects, robot)
        self._faults = SensorFaults(robot, effects)
        self.identifier = OnlineIdentifier(changed_robot(robot, effects), self.settings.identifier)
        self.is_open = True
        self._names = list(robot.joints[: robot.n_joints - robot.rotor_count])
        self._base_link = robot.base_link
        self.create_subscription(Imu, '/imu/data', self._on_imu, SAMPLES)
        self.create_subscription(QuaternionStamped, '/attitude', self._on_attitude, SAMPLES)
        self.create_subscription(JointState, '/joint_states', self._on_joints, SAMPLES)
        self._jump = on_backward_jump(self, self._on_clock_jump)
        self.health.watch(self._input_status, self._estimate_status)

    def _clear(self) -> None:
        self._merger = Merger(len(TOPICS), PATIENCE_NS, SLACK_NS)
        self._next_ns: int | None = None
        self._solve_ms = 0.0
        self._failure = ''
        self.estimate = None

    # ------------------------------------------------------------ samples in

    def _on_imu(self, message: Imu) -> None:
        self._take(RATE, messages.angular_rate, message, self._base_link)

    def _on_attitude(self, message: QuaternionStamped) -> None:
        self._take(ATTITUDE, messages.attitude, message)

    def _on_joints(self, message: JointState) -> None:
        self._take(JOINTS, messages.joint_sample, message, self._names)

    def _take(self, stream: int, to_arrays: Any, message: Any, *args: Any) -> None:
        try:
            stamp, *content = to_arrays(message, *args)
            stamp, content = self._without_faults(stream, stamp, content)
            newest = self._merger.newest[stream]
            if newest is not None and stamp < newest - STAMP_JUMP_NS:
                back = (newest - stamp) * 1e-9
                self.reset(f'stamps of {TOPICS[stream]} went back by {back:.3f} s')
            if self._merger.is_past(stamp):  # the core puts it in its place, if it still can
                released = [(stamp, stream, content)]
            else:
                now = self._steady.now().nanoseconds
                released = self._merger.add(stream, stamp, content, now)
        except MessageRejectedError as error:
            self.health.reject(TOPICS[stream], error)
            return
        for sample in released:
            self._use(*sample)

    def _without_faults(
        self, stream: int, stamp: int, content: list[np.ndarray]
    ) -> tuple[int, list[np.ndarray]]:
        """Stamp and content as a sensor without the believed faults would have given them."""
        faults = self._faults
        stamp -= round(faults.delay[CLOCKS_OF[stream]] * 1e9)
        if stream == JOINTS:
            q, qd = content
            return stamp, list(faults.undo_joints(q, qd, np.zeros(len(q))))[:2]
        undo = faults.undo_rate if stream == RATE else faults.undo_attitude
        return stamp, [undo(content[0])]

    def _use(self, stamp: int, stream: int, content: list[np.ndarray]) -> None:
        if self._next_ns is None:
            self._next_ns = stamp + self._period_ns
        if stamp > self._next_ns:
            self.solve()
            self._next_ns += self._period_ns * ((stamp - self._next_ns) // self._period_ns + 1)
        add = (self.identifier.add_rate, self.identifier.add_attitude, self.identifier.add_joints)
        try:
            add[stream](stamp, *content)
        except MessageRejectedError as error:
            self.health.reject(TOPICS[stream], error)

    def _on_clock_jump(self) -> None:
        newest = max((ns for ns in self._merger.newest if ns is not None), default=0)
        if newest > self.get_clock().now().nanoseconds:  # not if the stamps told already
            self.reset('/clock went back')

    # ------------------------------------------------------------ estimates out

    def _publish(self, estimate: Estimate) -> None:
        self.estimate = estimate
        self._publisher.publish(convert.estimate_message(estimate, self.health.count()))

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.reset('as asked for')
        response.success, response.message = True, 'all samples forgotten'
        return response

    def _on_solve(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        estimate = self.solve()
        response.success = estimate is not None and estimate.valid
        response.message = self._estimate_status().message
        return response

    # ------------------------------------------------------------ health

    def _input_status(self) -> Status:
        newest = self._merger.newest
        latest = max((ns for ns in newest if ns is not None), default=None)
        if latest is None:
            return Status('inputs', STALE, 'nothing received yet')
        values: dict[str, object] = {}
        late = []
        for topic, ns in zip(TOPICS, newest, strict=True):
            values[f'{topic} lag [s]'] = 'never received' if ns is None else (latest - ns) * 1e-9
            if ns is None or latest - ns > PATIENCE_NS:
                late.append(topic)
        if late:
            return Status('inputs', WARN, f'no samples from {", ".join(late)}', values)
        return Status('inputs', OK, 'all sensors arrive', values)

    def _estimate_status(self) -> Status:
        estimate = self.estimate
        if self._failure:
            return Status('estimate', WARN, self._failure)
        if estimate is None:
            return Status('estimate', STALE, 'none yet')
        values: dict[str, object] = {
            'rank': f'{estimate.rank} of {estimate.unknowns}',
            'condition': float(estimate.condition),
            'samples': estimate.samples,
            'squared residuals per degree of freedom': float(estimate.chi2_per_dof),
            'time to solve [ms]': self._solve_ms,
        }
        std = estimate.std[: len(estimate.aam)]
        for axis, (value, sigma) in enumerate(zip(estimate.aam, std, strict=True)):
            values[f'aam {axis} [N m s]'] = f'{value:.6g} +- {sigma:.2g}'
        if estimate.unexcited:
            values['not excited'] = '; '.join(estimate.unexcited)
        if estimate.valid:
            return Status('estimate', OK, 'valid', values)
        return Status('estimate', WARN, f'not valid: {estimate.reason}', values)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(IdentifierNode, args)


if __name__ == '__main__':
    sys.exit(main())
