"""Simulator node: a physically right plant that publishes its sensors and takes torques.

Owns the time: stamps are step index times period, in whole nanoseconds.
See docs/nodes/simulator.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import Imu, JointState
from spacerobot_msgs.msg import Ledger
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from ..dynamics.plant import Plant
from ..dynamics.state import initial_state
from ..errors import MessageRejectedError
from ..model.loader import true_robot
from ..model.robot import Robot
from ..ros import convert
from ..ros.diagnostics import ERROR, OK, WARN, Health, Status
from ..ros.main import run_node
from ..ros.params import declare_settings, open_robot
from ..ros.qos import LATCHED, STATE
from ..sensing.sensors import SensorSuite

LEDGER_PERIOD = 0.1
POLL_PERIOD = 0.05
RESEND_PERIOD_NS = 1_000_000_000
NEWS_DELAY_NS = 200_000_000
CATCH_UP = 10  # steps in one tick of the real-time timer; beyond, the simulation falls behind


class SimulatorNode(Node):
    """Steps the plant: in lockstep with the commands, or at a pace of wall time."""

    plant: Plant

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('simulator', **node_kwargs)
        self.settings = declare_settings(self)
        self._options = self.settings.simulator
        self.health = Health(self)
        self.is_open = False  # whether the robot is known
        self.stop_at: int | None = None  # step at which to stop by itself
        self.observers: list[Callable[[Plant], None]] = []  # shown the truth at every step
        self._is_started = False
        self._is_paused = False
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_service(Trigger, '~/reset', self._on_reset)
        self.create_service(SetBool, '~/pause', self._on_pause)
        open_robot(self, self.settings, self._open)

    # ------------------------------------------------------------ public state

    @property
    def step_index(self) -> int:
        """Steps done since the start or the last reset."""
        return self.plant.step_index if self.is_open else 0

    @property
    def is_connected(self) -> bool:
        """Whether someone takes the joint states and someone gives commands."""
        return self.is_open and min(self._peers()) > 0

    @property
    def awaited_ns(self) -> int | None:
        """Stamp of the command that lockstep waits for [ns]; None while it waits for none."""
        return self._awaited

    def start(self) -> None:
        """Publish the samples of step 0, if that has not happened yet."""
        if not self._is_started and self.is_open:
            self._is_started = True
            self._sent_to = self._peers()
            self._anchor()
            self._publish()

    def step(self) -> None:
        """Advance by one control period and publish what the sensors say there."""
        if not self.is_open:
            return
        self.start()
        wrench = self._wrench if self._is_fresh(self._wrench_step) else None
        self.plant.step(self._torque(), wrench)
        self._publish()

    def reset(self) -> None:
        """Go back to step 0 with the same seed; time jumps back."""
        self._build()
        self.get_logger().info('reset: time starts again at zero')
        if self._is_started:
            self._sent_to = self._peers()
            self._anchor()
            self._publish()

    def pause(self, is_paused: bool) -> None:
        """Stop or go on."""
        self._is_paused = is_paused
        self._anchor()
        if self.is_open:
            self._advance()

    # ------------------------------------------------------------ set-up

    def _open(self, robot: Robot) -> None:
        self._robot = robot
        self._truth = true_robot(robot, self.settings)
        self._names = list(robot.joints)
        self._wheels = [r.joint for r in self._truth.rotors if not r.is_target]
        self._ledger_every = max(1, round(LEDGER_PERIOD / self._options.period))
        self._build()
        self._make_topics()
        self.is_open = True
        if self.get_parameter('robot_description').value or self.settings.robot.urdf:
            self._description_publisher = self.create_publisher(
                String, '/robot_description', LATCHED
            )
            self._description_publisher.publish(String(data=robot.urdf))
        self.health.watch(self._time_status, self._command_status, self._momentum_status)
        period = POLL_PERIOD
        if not self._options.lockstep:
            period = self._options.period / self._options.real_time_factor
        self._timer = self.create_timer(period, self._on_timer, clock=self._steady)

    def _build(self) -> None:
        options, robot = self._options, self._truth
        state = initial_state(robot, self.settings.initial)
        plant = Plant(robot, state, options.period, options.substeps)
        self.plant = Plant(
            robot, plant.dynamics.at_rest_centre(state), options.period, options.substeps
        )
        self._sensors = SensorSuite(
            self.settings.sensors, options, len(self._names), len(self._wheels)
        )
        self._tau = np.zeros(len(self._names))
        self._wrench = np.zeros(6)
        self._tau_step = self._wrench_step = -sys.maxsize
        self._awaited: int | None = None
        self._answer: np.ndarray | None = None
        self._last_joints: JointState | None = None
        self._last_imu: Imu | None = None
        self._waiting_since = 0
        self._is_late = False
        self._is_answered = False
        self._sent_ns, self._sent_to = 0, (0, 0)

    def _make_topics(self) -> None:
        self._clock_publisher = self.create_publisher(ClockMessage, '/clock', STATE)
        self._imu_publisher = self.create_publisher(Imu, '/imu/data', STATE)
        self._attitude_publisher = self.create_publisher(QuaternionStamped, '/attitude', STATE)
        self._joint_publisher = self.create_publisher(JointState, '/joint_states', STATE)
        self._ledger_publisher = self.create_publisher(Ledger, '~/ledger', STATE)
        if self._wheels:
            self._wheel_publisher = self.create_publisher(JointState, '/wheel_states', STATE)
        subscription = self.create_subscription(
            JointState, '/joint_commands', self._on_command, STATE
        )
        self._command_topic = subscription.topic_name
        self.create_subscription(WrenchStamped, '/base_torque', self._on_wrench, STATE)

    # ------------------------------------------------------------ time

    def _on_timer(self) -> None:
        if self._options.lockstep:
            self._poll()
            return
        self.start()
        if self._is_paused:
            return
        period_ns = self.plant.period_ns / self._options.real_time_factor
        due = self._anchor_step + int((self._now() - self._anchor_ns) / period_ns)
        behind = due - self.step_index
        for _ in range(min(behind, CATCH_UP)):
            if not self._is_done():
                self.step()
        if behind > CATCH_UP:
            self._slips += 1
            self._anchor()

    def _poll(self) -> None:
        """Lockstep: start once connected, and say when the command does not come."""
        if not self._is_started:
            if self.is_connected and not self._is_paused:
                self.start()
            return
        waited = self._now() - self._waiting_since
        if self._awaited is None or self._is_paused or self._is_done():
            return
        if waited > self._options.lockstep_timeout * 1e9 and not self._is_late:
            self._is_late = True
            self.get_logger().warning(
                f'lockstep: no command stamped {self._awaited * 1e-9:.3f} s on '
                f'{self._command_topic} for {self._options.lockstep_timeout:g} s; still waiting'
            )
        has_news = waited > NEWS_DELAY_NS and self._peers() != self._sent_to
        if has_news or (not self._is_answered and self._now() - self._sent_ns > RESEND_PERIOD_NS):
            self._resend()  # to who came late: a command is owed for these samples

    def _peers(self) -> tuple[int, int]:
        takers = self._joint_publisher.get_subscription_count()
        return takers, self.count_publishers(self._command_topic)

    def _resend(self) -> None:
        self._sent_ns, self._sent_to = self._now(), self._peers()
        if self._last_imu is not None:
            self._imu_publisher.publish(self._last_imu)
        if self._last_joints is not None:
            self._joint_publisher.publish(self._last_joints)

    def _advance(self) -> None:
        """Lockstep: take the answer, and step until the joints are sampled again."""
        if self._answer is None or self._is_paused or self._is_done():
            return
        self._tau, self._answer, self._awaited = self._answer, None, None
        self.step()
        while self._awaited is None and not self._is_done():
            self.step()

    def _is_done(self) -> bool:
        return self.stop_at is not None and self.step_index >= self.stop_at

    def _anchor(self) -> None:
        self._anchor_ns, self._anchor_step, self._slips = self._now(), self.step_index, 0

    def _now(self) -> int:
        return int(self._steady.now().nanoseconds)

    # ------------------------------------------------------------ samples out

    def _publish(self) -> None:
        plant = self.plant
        ns = plant.time_ns
        sample = self._sensors.sample(plant.step_index, plant.state, plant.effort)
        for observe in self.observers:
            observe(plant)
        self._clock_publisher.publish(ClockMessage(clock=convert.to_time(ns)))
        if sample.omega is not None and self._robot.is_free:
            std = self.settings.sensors.gyro_std
            self._last_imu = convert.imu(ns, self._robot.base_link, sample.omega, std)
            self._imu_publisher.publish(self._last_imu)
        if sample.attitude_xyzw is not None:
            self._attitude_publisher.publish(convert.quaternion(ns, sample.attitude_xyzw))
        if sample.wheel_rates is not None:
            message = convert.joint_state(ns, self._wheels, velocity=sample.wheel_rates)
            self._wheel_publisher.publish(message)
        if plant.step_index % self._ledger_every == 0:
            self._ledger_publisher.publish(convert.ledger_message(ns, plant.ledger()))
        if sample.joints is not None:
            j = sample.joints
            if self._options.lockstep:
                self._awaited, self._waiting_since, self._is_late = ns, self._now(), False
                self._sent_ns = self._waiting_since
            self._last_joints = convert.joint_state(
                ns, self._names, j.position, j.velocity, j.effort
            )
            self._joint_publisher.publish(self._last_joints)

    # ------------------------------------------------------------ commands in

    def _torque(self) -> np.ndarray:
        if self._options.lockstep or self._is_fresh(self._tau_step):
            return self._tau
        return np.zeros(len(self._names))

    def _is_fresh(self, step: int) -> bool:
        return (self.step_index - step) * self._options.period <= self._options.command_timeout

    def _on_command(self, message: JointState) -> None:
        try:
            stamp, tau = convert.joint_efforts(message, self._names)
            if self._options.lockstep and stamp != self._awaited:
                raise MessageRejectedError(_not_awaited(stamp, self._awaited))
        except MessageRejectedError as error:
            self.health.reject('/joint_commands', error)
            return
        self._tau_step = self.step_index
        if self._options.lockstep:
            self._answer, self._is_answered = tau, True
            self._advance()
        else:
            self._tau = tau

    def _on_wrench(self, message: WrenchStamped) -> None:
        try:
            self._wrench = convert.base_wrench(message, self._robot.base_link)
        except MessageRejectedError as error:
            self.health.reject('/base_torque', error)
            return
        self._wrench_step = self.step_index

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        if not self.is_open:
            response.success, response.message = False, 'no robot yet'
            return response
        self.reset()
        response.success, response.message = True, 'time starts again at zero'
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.pause(request.data)
        response.success = True
        response.message = f'{"paused" if request.data else "running"} at step {self.step_index}'
        return response

    # ------------------------------------------------------------ health

    def _time_status(self) -> Status:
        mode = 'lockstep' if self._options.lockstep else 'real time'
        values: dict[str, object] = {
            'step': self.step_index,
            'time [s]': self.plant.time_ns * 1e-9,
        }
        if not self._is_started:
            return Status('time', WARN, f'{mode}: waiting for a controller', values)
        if self._is_paused:
            return Status('time', OK, f'{mode}: paused', values)
        elapsed = max(self._now() - self._anchor_ns, 1)
        done = (self.step_index - self._anchor_step) * self.plant.period_ns
        values['real-time factor'] = done / elapsed
        if self._slips:
            values['fell behind [times]'] = self._slips
            return Status('time', WARN, f'{mode}: slower than real_time_factor asks for', values)
        return Status('time', OK, mode, values)

    def _command_status(self) -> Status:
        if self._options.lockstep:
            if self._awaited is None or not self._is_late:
                return Status('commands', OK, 'in step')
            values: dict[str, object] = {'awaited stamp [s]': self._awaited * 1e-9}
            return Status('commands', ERROR, 'no command for the last joint states', values)
        if self._is_fresh(self._tau_step):
            return Status('commands', OK, 'fresh')
        return Status('commands', WARN, 'none, or too old: joint torques are zero')

    def _momentum_status(self) -> Status:
        ledger = self.plant.ledger()
        values: dict[str, object] = {
            'angular momentum drift, relative': ledger.momentum_drift,
            'energy drift [J]': ledger.energy_drift,
        }
        is_kept = ledger.momentum_drift < 1e-8  # far above round-off, far below what matters
        message = 'kept' if is_kept else 'not kept: period or substeps are too coarse'
        return Status('momentum', OK if is_kept else WARN, message, values)


def _not_awaited(stamp: int, awaited: int | None) -> str:
    if awaited is None:
        return 'lockstep: no command is awaited'
    return f'lockstep: stamp {stamp * 1e-9:.6f} s, awaited is {awaited * 1e-9:.6f} s'


def main(args: list[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(SimulatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
