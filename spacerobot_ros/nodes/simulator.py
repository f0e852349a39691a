"""Simulator node: a physically right plant that publishes its sensors and takes torques.

Owns the time: stamps are step index times period, in whole nanoseconds.
See docs/nodes/simulator.md.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from ..dynamics.state import LEDGER_PERIOD
from ..errors import SimulationDivergedError
from ..model.control_settings import ADAPTIVE_LAWS
from ..model.robot import Robot
from ..recording import messages
from ..ros.convert import compose
from ..ros.diagnostics import ERROR, OK, WARN, Status
from ..ros.qos import LATCHED, SAMPLES, STATE
from ..simulation.firings import THRUSTERS, Firings
from ..simulation.plant import Plant
from ..simulation.truth import build_plant, build_sensors, wheels_of
from .base import RobotNode
from .commands import Answer, HeldCommands
from .pace import IdleTime, Pace
from .simulator_topics import SimulatorTopics

POLL_PERIOD = 0.05
REPEAT_NS = 1_000_000_000  # after which lockstep, waiting, says the time again: it may be lost
LOOKS_AT_ONE = 2  # before it starts: nodes find each other one by one; a controller is one node
LOOKS_AT_SEVERAL = 40  # where who gives commands is no node that takes joint states
KEPT = 1e-8  # relative momentum drift: far above round-off, far below what matters
CATCH_UP = 10  # steps in one tick of the real-time timer; beyond, the simulation falls behind


class SimulatorNode(RobotNode):
    """Steps the plant: in lockstep with the commands, or at a pace of wall time.

    Attributes:
        plant: The simulated machine, once the robot is known.
        answer: The command that lockstep waits for.
        waiting: Wall time for which it has waited.
        ledger_every: Steps from one momentum book to the next.
    """

    plant: Plant
    answer: Answer
    waiting: IdleTime
    ledger_every: int

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('simulator', **node_kwargs)
        self._options = self.settings.simulator
        self.stop_at: int | None = None  # step at which to stop by itself
        self.observers: list[Callable[[Plant], None]] = []  # shown the truth at every step
        self._is_started = False
        self._is_halted = False
        self._asked: set[bytes] = set()  # who gave commands when a sample was sent
        # a turn by 1 rad in an integrator's step is the most that it resolves
        self._fastest = self._options.substeps / self._options.period
        period_ns = round(self._options.period * 1e9)
        self._pace = Pace(period_ns, self._options.real_time_factor, CATCH_UP)
        self.offer('~/reset', self._on_reset)
        self.create_service(SetBool, '~/pause', self._on_pause)
        self.find_robot()

    # ------------------------------------------------------------ public state

    @property
    def step_index(self) -> int:
        """Steps done since the start or the last reset."""
        return self.plant.step_index if self.is_open else 0

    @property
    def is_connected(self) -> bool:
        """Whether all subscribers of the joint states are matched, and someone gives commands."""
        return (
            self.is_open
            and self._topics.is_heard
            and self.count_publishers(self._command_topic) > 0
        )

    @property
    def sent_ns(self) -> dict[str, int]:
        """Stamp of the last message of each topic [ns]."""
        return self._topics.sent_ns if self.is_open else {}

    def start(self) -> None:
        """Publish the samples of step 0, if that has not happened yet."""
        if not self._is_started and self.is_open:
            self._is_started = True
            self._begin()

    def _begin(self) -> None:
        self._pace.anchor(self.step_index)
        self._asked = self._answerers()
        self._publish()

    def step(self) -> None:
        """Advance by one control period and publish what the sensors say there."""
        if not self.is_open:
            return
        self.start()
        step, forever = self.step_index, self._options.lockstep
        wrench = self._held.wrench(step, forever=forever and self.answer.needs_base)
        if self.firings:
            thrust = self.firings.wrench(step)
            wrench = thrust if wrench is None else wrench + thrust
        try:
            self.plant.step(self._held.tau(step, forever=forever), wrench, fastest=self._fastest)
        except SimulationDivergedError as error:
            self.health.reject(self._command_topic, f'torques dropped: {error}')
            self._held.clear()
            if not self._goes_on():
                self.reset()
                return
        self._publish()

    def _goes_on(self) -> bool:
        """Step without torques; False where the plant is too fast for its integrator by now."""
        try:
            self.plant.step(np.zeros(len(self._names)))
        except SimulationDivergedError as error:
            self.get_logger().error(f'{error}; it begins anew')
            return False
        return True

    def reset(self) -> None:
        """Go back to step 0 with the same seed; time jumps back."""
        self._build()
        self._topics.forget()
        self.get_logger().info('reset: time starts again at zero')
        if self._is_started:
            self._begin()

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Let time go on."""
        result = super().on_activate(state)
        self.pause(self._is_halted)
        return result

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Back to the start."""
        self.reset()
        return super().on_cleanup(state)

    @property
    def _is_paused(self) -> bool:
        return self._is_halted or not self.is_active

    def pause(self, is_paused: bool) -> None:
        """Stop or go on."""
        self._is_halted = is_paused
        self._pace.anchor(self.step_index)
        if self.is_open:
            self._advance()

    # ------------------------------------------------------------ set-up

    def on_robot(self, robot: Robot) -> None:
        """Build the plant."""
        self._robot, options = robot, self._options
        self._names = list(robot.joints)
        self._held = HeldCommands(len(self._names), options.command_timeout / options.period)
        self.answer = Answer(needs_base=self.settings.controller.law in ADAPTIVE_LAWS)
        self._build()
        self.ledger_every = max(1, round(LEDGER_PERIOD / options.period))
        self._topics = SimulatorTopics(self, bool(wheels_of(self.plant)), self.ledger_every)
        if self.firings:
            self._thrust = self.create_publisher(JointState, THRUSTERS, SAMPLES)
        commands = self.listen('/joint_commands', JointState, STATE, self._on_command)
        self._command_topic = commands.topic_name
        self.listen('/base_torque', WrenchStamped, STATE, self._on_wrench)
        self.is_open = True
        if self.get_parameter('robot_description').value or self.settings.robot.urdf:
            self._descriptions = self.create_publisher(String, '/robot_description', LATCHED)
            self._descriptions.publish(String(data=robot.urdf))
        self.health.watch(self._time_status, self._command_status, self._momentum_status)
        period = POLL_PERIOD
        if not options.lockstep:
            period = options.period / options.real_time_factor
        self._timer = self.create_timer(period, self._on_timer, clock=self.steady)

    def _build(self) -> None:
        self.plant = build_plant(self._robot, self.settings)
        self._sensors = build_sensors(self.plant, self.settings)
        plant, section = self.plant, self.settings.firings
        self.firings = Firings(section, self._robot, plant.robot, plant.effects, plant.period)
        self._held.clear()
        self.answer.clear()
        self.waiting = IdleTime(POLL_PERIOD, lambda: self.wall_ns())
        self._repeated_ns = 0
        self._is_late = self._has_resent = False
        self._looks = 0

    # ------------------------------------------------------------ time

    def _on_timer(self) -> None:
        if self._options.lockstep:
            self._poll()
            return
        if not self.is_active:
            return
        self.start()
        if self._is_paused:
            return
        for _ in range(self._pace.due(self.step_index)):
            if not self._is_done():
                self.step()

    def _poll(self) -> None:
        """Lockstep: start once connected, and say when the command does not come."""
        if not self._is_started:
            self._looks = self._looks + 1 if self.is_connected and not self._is_paused else 0
            if self._looks >= (LOOKS_AT_ONE if self._answerers() else LOOKS_AT_SEVERAL):
                self.start()
            return
        if self.answer.stamp_ns is None or self._is_paused or self._is_done():
            return
        self.waiting.tick()
        waited = self.waiting.ns
        if waited > self._options.lockstep_timeout * 1e9 and not self._is_late:
            self._is_late = True
            self.get_logger().warning(
                f'lockstep: no command stamped {self.answer.stamp_ns * 1e-9:.3f} s on '
                f'{self._command_topic} for {self._options.lockstep_timeout:g} s; still waiting'
            )
        if waited < self._repeated_ns + REPEAT_NS:
            return
        self._repeated_ns = waited
        if self._answerers() <= self._asked:
            self._topics.repeat_clock()
        else:
            self._has_resent = True
            self._topics.resend(with_attitude=self.answer.needs_base)

    def _answerers(self) -> set[bytes]:
        """Publishers of commands whose nodes get every sample that is sent from now on."""
        if not self._topics.is_heard:
            return set()
        listeners = self.get_subscriptions_info_by_topic(self._topics.joint_topic)
        hear = {(taker.node_namespace, taker.node_name) for taker in listeners}
        return {
            bytes(giver.endpoint_gid)
            for giver in self.get_publishers_info_by_topic(self._command_topic)
            if (giver.node_namespace, giver.node_name) in hear
        }

    def _advance(self) -> None:
        """Lockstep: take the answer, and step until the joints are sampled again."""
        torques = self.answer.complete()
        if torques is None or self._is_paused or self._is_done():
            return
        tau, wrench = torques
        self._held.set_tau(tau, self.step_index)
        if wrench is not None:
            self._held.set_wrench(wrench, self.step_index)
        self.answer.clear()
        if self._has_resent:
            self._has_resent, self._asked = False, self._answerers()
        self.step()
        while self.answer.stamp_ns is None and not self._is_done():
            self.step()

    def _is_done(self) -> bool:
        return self.stop_at is not None and self.step_index >= self.stop_at

    def _publish(self) -> None:
        plant = self.plant
        sample = self._sensors.sample(plant.step_index, plant.state, plant.effort, plant.hidden)
        for observe in self.observers:
            observe(plant)
        if sample.joints is not None and self._options.lockstep:
            self.answer.ask(plant.time_ns)
            self.waiting.clear()
            self._repeated_ns = 0
            self._is_late = False
        if self.firings:
            shares = self.firings.commands(plant.step_index)
            self._thrust.publish(
                compose.joint_state(plant.time_ns, self.firings.names, effort=shares)
            )
        self._topics.publish(plant, sample)

    # ------------------------------------------------------------ commands in

    def _on_command(self, message: JointState) -> None:
        stamp, tau = messages.joint_efforts(message, self._names)
        if self._options.lockstep:
            self.answer.give_tau(stamp, tau)
            self._advance()
        else:
            self._held.set_tau(tau, self.step_index)

    def _on_wrench(self, message: WrenchStamped) -> None:
        stamp, wrench = messages.base_wrench(message, self._robot.base_link)
        if self._options.lockstep and self.answer.give_wrench(stamp, wrench):
            self._advance()
        else:
            self._held.set_wrench(wrench, self.step_index)

    def _on_reset(self) -> tuple[bool, str]:
        if not self.is_open:
            return False, 'no robot yet'
        self.reset()
        return True, 'time starts again at zero'

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.pause(request.data)
        response.success = True
        response.message = f'{"paused" if request.data else "running"} at step {self.step_index}'
        return response

    # ------------------------------------------------------------ health

    def _time_status(self) -> Status:
        """Whether the simulation runs, and how fast."""
        mode = 'lockstep' if self._options.lockstep else 'real time'
        time = self.plant.time_ns * 1e-9
        values: dict[str, object] = {'step': self.step_index, 'time [s]': time}
        slips = self._pace.take_slips()
        if not self._is_started:
            return Status('time', WARN, f'{mode}: waiting for a controller', values)
        if self._is_paused:
            return Status('time', OK, f'{mode}: paused', values)
        values['real-time factor'] = self._pace.reached(self.step_index)
        if slips:
            values['fell behind [times]'] = slips
            return Status('time', WARN, f'{mode}: slower than real_time_factor asks for', values)
        return Status('time', OK, mode, values)

    def _command_status(self) -> Status:
        """Whether commands arrive."""
        if self._options.lockstep and self._is_late and self.answer.stamp_ns is not None:
            values: dict[str, object] = {'awaited stamp [s]': self.answer.stamp_ns * 1e-9}
            return Status('commands', ERROR, 'no command for the last joint states', values)
        if self._options.lockstep:
            return Status('commands', OK, 'in step')
        if self._held.is_fresh(self.step_index):
            return Status('commands', OK, 'fresh')
        return Status('commands', WARN, 'none, or too old: joint torques are zero')

    def _momentum_status(self) -> Status:
        """Whether the plant keeps its momentum."""
        ledger = self.plant.ledger()
        values: dict[str, object] = {
            'angular momentum drift, relative': ledger.momentum_drift,
            'energy drift [J]': ledger.energy_drift,
        }
        if ledger.momentum_drift < KEPT:
            return Status('momentum', OK, 'kept', values)
        message = 'not kept: period or substeps are too coarse'
        return Status('momentum', WARN, message, values)
