"""Monitor node: sensors in, and whether the model still explains them.

See docs/nodes/monitor.md.
"""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from spacerobot_msgs.msg import Estimate as EstimateMessage

from ..diagnosis.events.event import Event
from ..diagnosis.flight.monitor import Monitor
from ..diagnosis.flight.monitor_state import MonitorState
from ..diagnosis.limits import EVENT
from ..effects.catalogue import believed_effects
from ..model.robot import Robot
from ..recording import messages
from ..recording.buffer import sensors_of
from ..recording.robot_inputs import own_wheels
from ..ros import convert
from ..ros.diagnostics import ERROR, OK, STALE, WARN, Status
from ..ros.qos import LATCHED, SAMPLES
from .sensor_node import TOPICS, SensorNode, outliers

if TYPE_CHECKING:
    from .event_recorder import EventRecorder

LEVELS = {'ok': OK, 'warn': WARN, 'error': ERROR, 'stale': STALE}


class MonitorNode(SensorNode):
    """Feeds the monitor, says and records what it finds."""

    monitor: Monitor
    recorder: EventRecorder | None = None

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('monitor', **node_kwargs)
        self._raised_ns: int | None = None
        self._event: Event | None = None
        self._events = self.create_publisher(DiagnosticArray, '/events', LATCHED)
        self.offer('~/reset', self._on_reset)
        self.find_robot()

    def destroy_node(self) -> None:
        """Finish a bag that is being written, then leave."""
        if self.recorder is not None:
            self.recorder.close()
        super().destroy_node()

    def restart(self, why: str) -> None:
        """Forget the flight."""
        if not self.is_open:
            return
        self.monitor.reset()
        self._raised_ns = None
        if self.recorder is not None:
            self.recorder.reset()
        self.get_logger().info(f'reset: {why}')

    def begin_segment(self, why: str, jump_ns: int | None) -> None:
        """Keep what was learned; the state is found anew in another time."""
        self.get_logger().info(f'{why}: the state is found anew')
        self.monitor.begin_segment()
        if self.recorder is not None:
            self.recorder.reset()

    def on_robot(self, robot: Robot) -> None:
        """Start to watch."""
        settings = self.settings
        effects = believed_effects(settings, robot)
        prior = settings.identifier.momentum_prior_std
        self.monitor = Monitor(robot, settings.monitor, effects, prior)
        self.is_open = True
        sensors = sensors_of(robot)
        kept = dict(TOPICS[sensor] for sensor in sensors)
        if robot.target_wheels:
            kept['/estimate'] = EstimateMessage
            self.listen('/estimate', EstimateMessage, LATCHED, self._on_estimate)
        if settings.monitor.record_folder:
            folder = Path(settings.monitor.record_folder)
            span = (settings.monitor.pre_trigger, settings.monitor.post_trigger)
            from .event_recorder import EventRecorder  # late: it loads what bags are written with

            self.recorder = EventRecorder(self, kept, folder, span, robot.urdf, self.newest_ns)
        self.follow(robot, sensors, SAMPLES, efforts=True)
        if robot.thrusters:
            self.listen('/thruster_commands', JointState, SAMPLES, self._on_commands)
        if own_wheels(robot):
            self.listen('/wheel_states', JointState, SAMPLES, self._on_wheels)
        if robot.is_free:
            self.listen('/base_torque', WrenchStamped, SAMPLES, self._on_wrench)
        channels = [partial(self._channel_status, k) for k in range(len(self.monitor.probes))]
        self.health.watch(self.input_status, self._model_status, self._event_status, *channels)

    def take(self, sensor: str, stamp_ns: int, *content: Any) -> None:
        """Add a sample and judge what is complete by now."""
        if not self.is_active:
            return
        add = {'imu': 'add_rate', 'attitude': 'add_attitude', 'joints': 'add_joints'}[sensor]
        getattr(self.monitor, add)(stamp_ns, *content)
        self._publish_alarm(self.monitor.step(self.wall_ns()))

    def _on_commands(self, message: JointState) -> None:
        names = [thruster.name for thruster in self.monitor.robot.thrusters]
        shares = messages.thruster_shares(message, names)
        self.monitor.add_commands(messages.stamp_ns(message.header.stamp), shares)

    def _on_wheels(self, message: JointState) -> None:
        names = own_wheels(self.monitor.robot)
        (rates,) = messages.joint_columns(message, names, 'velocity', others=True)
        self.monitor.add_wheels(messages.stamp_ns(message.header.stamp), np.asarray(rates))

    def _on_wrench(self, message: WrenchStamped) -> None:
        self.monitor.add_wrench(*messages.base_wrench(message, self.monitor.robot.base_link))

    def _on_estimate(self, message: EstimateMessage) -> None:
        self.monitor.believe(convert.estimate(message))

    def _on_reset(self) -> tuple[bool, str]:
        self.reset('as asked for')
        return True, 'the flight is forgotten'

    def _publish_alarm(self, state: MonitorState) -> None:
        if state.event is not self._event:
            self._publish_event(state)
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

    def _publish_event(self, state: MonitorState) -> None:
        """Say each part of an event on /events; its begin and end in the log, too."""
        was, event = self._event, state.event
        self._event = event
        message = self.health.message([self._event_status()])
        if event is not None:
            message.header.stamp = convert.compose.time(self._stamp_ns(event.end))
        self._events.publish(message)
        is_ongoing = event is not None and event.ongoing
        if is_ongoing != (was is not None and was.ongoing):
            self.get_logger().warning(self._event_status().message)
            self.health.publish()

    def _stamp_ns(self, seconds: float) -> int:
        return (self.monitor.samples.origin_ns or 0) + round(seconds * 1e9)

    def _event_status(self) -> Status:
        state = self.monitor.state
        event = state.event
        values: dict[str, object] = {'events': state.events, 'limit [std]': EVENT}
        if event is None:
            words = 'nothing acts from outside'
            return Status('events', STALE if state.judged_ns is None else OK, words, values)
        values |= {
            'effect': event.effect,
            'where': event.where or 'the whole system',
            'start [s]': f'{self._stamp_ns(event.start) * 1e-9:.3f}',
            'end [s]': f'{self._stamp_ns(event.end) * 1e-9:.3f}',
            'size by its std': event.z,
        }
        for name, size in event.peak.items():
            values[f'{name} [{event.units[name]}]'] = f'{size:.4g} +- {event.peak_std[name]:.2g}'
        if event.ongoing:
            return Status('events', WARN, event.in_words(), values)
        return Status('events', OK, f'over: {event.in_words()}', values)

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
        values |= outliers(self.monitor.left_out)
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
