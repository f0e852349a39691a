"""Simulator node: a physically right plant that publishes its sensors and takes torques.

Owns the time: stamps are step index times period, in whole nanoseconds.
See docs/nodes/simulator.md.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool

from ..model.robot import Robot
from ..model.settings import ADAPTIVE_LAWS
from ..recording import messages
from ..ros.qos import LATCHED, STATE
from ..ros.run_node import run_node
from ..sensing.faults import SensorFaults
from ..sensing.sensors import SensorSuite
from ..simulation.plant import Plant
from ..simulation.truth import build_plant
from .base import RobotNode
from .commands import Answer, HeldCommands
from .pace import Pace
from .simulator_status import Progress, command_status, momentum_status, time_status
from .simulator_topics import SimulatorTopics

LEDGER_PERIOD = 0.1
POLL_PERIOD = 0.05
RESEND_PERIOD_NS = 1_000_000_000
NEWS_DELAY_NS = 200_000_000
CATCH_UP = 10  # steps in one tick of the real-time timer; beyond, the simulation falls behind


class SimulatorNode(RobotNode):
    """Steps the plant: in lockstep with the commands, or at a pace of wall time."""

    plant: Plant

    def __init__(self, **node_kwargs: Any) -> None:
        """Take the node arguments of rclpy; raise ConfigurationError for bad parameters."""
        super().__init__('simulator', **node_kwargs)
        self._options = self.settings.simulator
        self.stop_at: int | None = None  # step at which to stop by itself
        self.observers: list[Callable[[Plant], None]] = []  # shown the truth at every step
        self._is_started = False
        self._is_paused = False
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
        """Whether someone takes the joint states and someone gives commands."""
        return self.is_open and min(self._peers()) > 0

    @property
    def awaited_ns(self) -> int | None:
        """Stamp of the command that lockstep waits for [ns]; None while it waits for none."""
        return self._answer.stamp_ns

    def start(self) -> None:
        """Publish the samples of step 0, if that has not happened yet."""
        if not self._is_started and self.is_open:
            self._is_started = True
            self._sent_to = self._peers()
            self._pace.anchor(self.step_index)
            self._publish()

    def step(self) -> None:
        """Advance by one control period and publish what the sensors say there."""
        if not self.is_open:
            return
        self.start()
        step, forever = self.step_index, self._options.lockstep
        wrench = self._held.wrench(step, forever=forever and self._answer.needs_base)
        self.plant.step(self._held.tau(step, forever=forever), wrench)
        self._publish()

    def reset(self) -> None:
        """Go back to step 0 with the same seed; time jumps back."""
        self._build()
        self.get_logger().info('reset: time starts again at zero')
        if self._is_started:
            self._sent_to = self._peers()
            self._pace.anchor(self.step_index)
            self._publish()

    def pause(self, is_paused: bool) -> None:
        """Stop or go on."""
        self._is_paused = is_paused
        self._pace.anchor(self.step_index)
        if self.is_open:
            self._advance()

    # ------------------------------------------------------------ set-up

    def on_robot(self, robot: Robot) -> None:
        """Build the plant."""
        self._robot = robot
        self._names = list(robot.joints)
        options = self._options
        self._held = HeldCommands(len(self._names), options.command_timeout / options.period)
        self._answer = Answer(needs_base=self.settings.controller.law in ADAPTIVE_LAWS)
        self._make_topics()
        self._build()
        self.is_open = True
        if self.get_parameter('robot_description').value or self.settings.robot.urdf:
            self._description_publisher = self.create_publisher(
                String, '/robot_description', LATCHED
            )
            self._description_publisher.publish(String(data=robot.urdf))
        self.health.watch(
            lambda: time_status(self._progress(), self._pace.take_slips()),
            lambda: command_status(self._progress()),
            lambda: momentum_status(self.plant.ledger()),
        )
        period = POLL_PERIOD
        if not self._options.lockstep:
            period = self._options.period / self._options.real_time_factor
        self._timer = self.create_timer(period, self._on_timer, clock=self._pace.clock)

    def _build(self) -> None:
        self.plant = build_plant(self._robot, self.settings)
        self._sensors = SensorSuite(
            self.settings.sensors,
            self._options,
            len(self._names),
            self._topics.n_wheels,
            SensorFaults(self.plant.robot, self.plant.effects),
        )
        self._held.clear()
        self._answer.clear()
        self._topics.forget()
        self._waiting_since = 0
        self._is_late = False
        self._is_answered = False
        self._sent_ns, self._sent_to = 0, (0, 0)

    def _make_topics(self) -> None:
        wheels = [r.joint for r in self._robot.rotors if not r.is_target]
        self._topics = SimulatorTopics(
            self,
            self._names,
            wheels,
            self._robot.base_link,
            self.settings.sensors.gyro_std,
            ledger_every=max(1, round(LEDGER_PERIOD / self._options.period)),
        )
        subscription = self.listen('/joint_commands', JointState, STATE, self._on_command)
        self._command_topic = subscription.topic_name
        self.listen('/base_torque', WrenchStamped, STATE, self._on_wrench)

    # ------------------------------------------------------------ time

    def _on_timer(self) -> None:
        if self._options.lockstep:
            self._poll()
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
            if self.is_connected and not self._is_paused:
                self.start()
            return
        waited = self._pace.now() - self._waiting_since
        if self._answer.stamp_ns is None or self._is_paused or self._is_done():
            return
        if waited > self._options.lockstep_timeout * 1e9 and not self._is_late:
            self._is_late = True
            self.get_logger().warning(
                f'lockstep: no command stamped {self._answer.stamp_ns * 1e-9:.3f} s on '
                f'{self._command_topic} for {self._options.lockstep_timeout:g} s; still waiting'
            )
        has_news = waited > NEWS_DELAY_NS and self._peers() != self._sent_to
        if has_news or (
            not self._is_answered and self._pace.now() - self._sent_ns > RESEND_PERIOD_NS
        ):
            self._resend()  # to who came late: a command is owed for these samples

    def _peers(self) -> tuple[int, int]:
        return self._topics.takers, self.count_publishers(self._command_topic)

    def _resend(self) -> None:
        self._sent_ns, self._sent_to = self._pace.now(), self._peers()
        self._topics.resend(with_attitude=self._answer.needs_base)

    def _advance(self) -> None:
        """Lockstep: take the answer, and step until the joints are sampled again."""
        torques = self._answer.complete()
        if torques is None or self._is_paused or self._is_done():
            return
        tau, wrench = torques
        self._held.set_tau(tau, self.step_index)
        if wrench is not None:
            self._held.set_wrench(wrench, self.step_index)
        self._answer.clear()
        self.step()
        while self._answer.stamp_ns is None and not self._is_done():
            self.step()

    def _is_done(self) -> bool:
        return self.stop_at is not None and self.step_index >= self.stop_at

    def _publish(self) -> None:
        plant = self.plant
        sample = self._sensors.sample(plant.step_index, plant.state, plant.effort, plant.hidden)
        for observe in self.observers:
            observe(plant)
        if sample.joints is not None and self._options.lockstep:
            self._answer.ask(plant.time_ns)
            self._waiting_since = self._sent_ns = self._pace.now()
            self._is_late = False
        self._topics.publish(plant, sample)

    # ------------------------------------------------------------ commands in

    def _on_command(self, message: JointState) -> None:
        stamp, tau = messages.joint_efforts(message, self._names)
        if self._options.lockstep:
            self._answer.give_tau(stamp, tau)
            self._is_answered = True
            self._advance()
        else:
            self._held.set_tau(tau, self.step_index)

    def _on_wrench(self, message: WrenchStamped) -> None:
        stamp, wrench = messages.base_wrench(message, self._robot.base_link)
        if self._options.lockstep and self._answer.give_wrench(stamp, wrench):
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

    def _progress(self) -> Progress:
        step = self.step_index
        return Progress(
            is_lockstep=self._options.lockstep,
            is_started=self._is_started,
            is_paused=self._is_paused,
            step=step,
            time_ns=self.plant.time_ns,
            reached=self._pace.reached(step),
            late_ns=self._answer.stamp_ns if self._is_late else None,
            is_fresh=self._held.is_fresh(step),
        )


def main(args: list[str] | None = None) -> int:
    """Run the node until it is stopped."""
    return run_node(SimulatorNode, args)


if __name__ == '__main__':
    sys.exit(main())
