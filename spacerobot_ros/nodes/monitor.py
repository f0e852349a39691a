"""Monitor node: sensors in, and whether the model still explains them.

See docs/nodes/monitor.md.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from geometry_msgs.msg import QuaternionStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage
from std_srvs.srv import Trigger

from ..diagnosis.flight.monitor import Monitor
from ..diagnosis.flight.state import MonitorState
from ..effects.catalogue import bind_effects
from ..errors import MessageRejectedError
from ..model.robot import Robot
from ..recording import messages
from ..ros import convert
from ..ros.diagnostics import ERROR, OK, STALE, WARN, Health, Status
from ..ros.jumps import STAMP_JUMP_NS, on_backward_jump
from ..ros.main import run_node
from ..ros.merge import Merger
from ..ros.params import declare_settings, open_robot
from ..ros.qos import LATCHED, SAMPLES
from .event_recorder import EventRecorder

PATIENCE_NS = 1_000_000_000
SLACK_NS = 50_000_000
LEVELS = {'ok': OK, 'warn': WARN, 'error': ERROR, 'stale': STALE}
JOINTS, IMU, ATTITUDE = '/joint_states', '/imu/data', '/attitude'


class MonitorNode(Node):
    """Orders the samples by stamp, feeds the monitor, says and records what it finds."""

    monitor: Monitor

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('monitor', **node_kwargs)
        self.settings = declare_settings(self)
        self.health = Health(self)
        self.recorder: EventRecorder | None = None
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_service(Trigger, '~/reset', self._on_reset)
        self._topics: tuple[str, ...] = ()
        self._raised_ns: int | None = None
        open_robot(self, self.settings, self._open)

    def destroy_node(self) -> None:
        """Finish a bag that is being written, then leave."""
        if self.recorder is not None:
            self.recorder.close()
        super().destroy_node()

    def reset(self, why: str) -> None:
        """Forget the flight."""
        if not self._topics:
            return
        self._merger = Merger(len(self._topics), PATIENCE_NS, SLACK_NS)
        self.monitor.reset()
        self._raised_ns = None
        if self.recorder is not None:
            self.recorder.reset()
        self.get_logger().info(f'reset: {why}')

    def flush(self) -> None:
        """Use the samples that still wait for others to be put in order with."""
        for sample in self._merger.flush():
            self._use(*sample)

    # ------------------------------------------------------------ set-up

    def _open(self, robot: Robot) -> None:
        settings = self.settings
        effects = bind_effects(settings.effects, robot)
        prior = settings.identifier.momentum_prior_std
        self.monitor = Monitor(robot, settings.monitor, effects, prior)
        self._names, self._base_link = list(robot.joints), robot.base_link
        kinds: dict[str, Any] = {JOINTS: JointState}
        if robot.is_free:
            kinds = {IMU: Imu, ATTITUDE: QuaternionStamped, **kinds}
        # in this order samples of equal stamps are used
        self._topics = tuple(kinds)
        self._merger = Merger(len(kinds), PATIENCE_NS, SLACK_NS)
        folder, kept = settings.monitor.record_folder, dict(kinds)
        if robot.target_wheels:
            kept['/estimate'] = EstimateMessage
            self.create_subscription(EstimateMessage, '/estimate', self._on_estimate, LATCHED)
        if folder:
            span = (settings.monitor.pre_trigger, settings.monitor.post_trigger)
            self.recorder = EventRecorder(self, kept, Path(folder), span, robot.urdf)
        for topic, kind in kinds.items():
            self.create_subscription(kind, topic, partial(self._on_sample, topic), SAMPLES)
        self._jump = on_backward_jump(self, self._on_clock_jump)
        channels = [partial(self._channel_status, k) for k in range(len(self.monitor.probes))]
        self.health.watch(self._input_status, self._model_status, *channels)

    # ------------------------------------------------------------ samples in

    def _on_sample(self, topic: str, message: Any) -> None:
        try:
            stamp, content = self._to_arrays(topic, message)
            stream = self._topics.index(topic)
            newest = self._merger.newest[stream]
            if newest is not None and stamp < newest - STAMP_JUMP_NS:
                self.reset(f'stamps of {topic} went back by {(newest - stamp) * 1e-9:.3f} s')
            now = self._steady.now().nanoseconds
            released = self._merger.add(stream, stamp, content, now)
        except MessageRejectedError as error:
            self.health.reject(topic, error)
            return
        for sample in released:
            self._use(*sample)

    def _to_arrays(self, topic: str, message: Any) -> tuple[int, tuple[Any, ...]]:
        if topic == IMU:
            stamp, omega = messages.angular_rate(message, self._base_link)
            return stamp, (omega,)
        if topic == ATTITUDE:
            stamp, q_xyzw = messages.attitude(message)
            return stamp, (q_xyzw,)
        stamp, *columns = messages.joint_sample(message, self._names, efforts=True)
        return stamp, tuple(columns)

    def _use(self, stamp_ns: int, stream: int, content: tuple[Any, ...]) -> None:
        topic = self._topics[stream]
        add: dict[str, Callable[..., None]] = {
            IMU: self.monitor.add_rate,
            ATTITUDE: self.monitor.add_attitude,
            JOINTS: self.monitor.add_joints,
        }
        try:
            add[topic](stamp_ns, *content)
        except MessageRejectedError as error:
            self.health.reject(topic, error)
            return
        self._say(self.monitor.step())

    def _on_estimate(self, message: EstimateMessage) -> None:
        try:
            self.monitor.believe(convert.estimate(message))
        except MessageRejectedError as error:
            self.health.reject('/estimate', error)

    def _on_clock_jump(self) -> None:
        newest = max((ns for ns in self._merger.newest if ns is not None), default=0)
        if newest > self.get_clock().now().nanoseconds:  # not if the stamps told already
            self.reset('/clock went back')

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self.reset('as asked for')
        response.success, response.message = True, 'the flight is forgotten'
        return response

    # ------------------------------------------------------------ alarms out

    def _say(self, state: MonitorState) -> None:
        if state.raised_ns == self._raised_ns:
            return
        self._raised_ns = state.raised_ns
        if state.raised_ns is None:
            self.get_logger().info('the model explains the data again')
        else:
            self.get_logger().error(state.reason)
            if self.recorder is not None:
                self.recorder.trigger(state.raised_ns)
        self.health.publish()

    def _input_status(self) -> Status:
        newest = self._merger.newest
        latest = max((ns for ns in newest if ns is not None), default=None)
        if latest is None:
            return Status('inputs', STALE, 'nothing received yet')
        values: dict[str, object] = {}
        late = []
        for topic, ns in zip(self._topics, newest, strict=True):
            values[f'{topic} lag [s]'] = 'never received' if ns is None else (latest - ns) * 1e-9
            if ns is None or latest - ns > PATIENCE_NS:
                late.append(topic)
        if late:
            return Status('inputs', WARN, f'no samples from {", ".join(late)}', values)
        return Status('inputs', OK, 'all sensors arrive', values)

    def _model_status(self) -> Status:
        state = self.monitor.state
        values: dict[str, object] = {
            'alarms': state.alarms,
            'threshold [nats]': self.monitor.threshold,
        }
        if state.judged_ns is not None:
            values['judged up to [s]'] = f'{state.judged_ns * 1e-9:.3f}'
        if state.raised_ns is not None:
            values['raised at [s]'] = f'{state.raised_ns * 1e-9:.3f}'
        if state.first:
            values['spoke first'] = state.first
        for axis, (h, std) in enumerate(zip(state.momentum, state.momentum_std, strict=True)):
            values[f'aam {axis} [N m s]'] = f'{h:.6g} +- {std:.2g}'
        if state.notes:
            values['notes'] = '; '.join(state.notes)
        return Status('model', LEVELS[state.level], state.reason, values)

    def _channel_status(self, k: int) -> Status:
        channels = self.monitor.state.channels
        if not channels:
            return Status(self.monitor.probes[k].name, STALE, 'not judged yet')
        c = channels[k]
        values: dict[str, object] = {
            f'unexplained [{c.unit}]': c.unexplained,
            f'std of unexplained [{c.unit}]': c.std,
            'evidence over threshold': c.evidence,
        }
        if math.isfinite(c.rms):
            values['rms over noise floor'] = c.rms
            values['whiteness p'] = c.whiteness_p
        return Status(c.name, LEVELS[c.level], c.reason or 'as the model says', values)


def main(args: list[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(MonitorNode, args)


if __name__ == '__main__':
    sys.exit(main())
