"""Plant, sensors and controller in one loop, without ROS: what the nodes do in lockstep.

A run can be recorded in a bag, on the topics of the nodes.

At each step the sensors measure, the controller answers the joint sample of that stamp, and the
plant moves on under that torque, and that on the base, held until the next joint sample.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from ..control.loop import Command, ControlLoop
from ..dynamics.state import LEDGER_PERIOD, State
from ..errors import ConfigurationError
from ..identification.estimate import Estimate
from ..model.robot import Robot
from ..model.settings import Settings
from ..recording.bags.bag_writer import BagWriter
from ..sensing.sensors import SensorSamples
from ..types import Array
from .firings import THRUSTERS, Firings
from .truth import build_plant, build_sensors, sample_messages


class Listener(Protocol):
    """Who takes what sensors measure, stamp by stamp."""

    def add_joints(self, stamp_ns: int, q: Array, qd: Array, effort: Array) -> None:
        """Positions [rad], rates [rad/s] and torques [N m] of the joints."""

    def add_rate(self, stamp_ns: int, omega_WB_B: Array) -> None:
        """Rate of the base [rad/s]."""

    def add_attitude(self, stamp_ns: int, q_WB_xyzw: Array) -> None:
        """Attitude of the base."""


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What happened at one stamp.

    Args:
        stamp_ns: Time since the start [ns].
        state: True state.
        measured: What the sensors said.
        command: Answer to the joint sample; None where there was none.
    """

    stamp_ns: int
    state: State
    measured: SensorSamples
    command: Command | None

    def feed(self, listener: Listener) -> None:
        """Give a filter, buffer or monitor what the sensors measured."""
        measured, joints = self.measured, self.measured.joints
        if joints is not None:
            listener.add_joints(self.stamp_ns, joints.position, joints.velocity, joints.effort)
        if measured.omega is not None:
            listener.add_rate(self.stamp_ns, measured.omega)
        if measured.attitude_xyzw is not None:
            listener.add_attitude(self.stamp_ns, measured.attitude_xyzw)


class ClosedLoop:
    """A simulated run, step by step.

    Args:
        robot: What the controller believes (`effects.robot_file.load_robot_file`).
        settings: All settings; the plant is the robot with their `truth` and `effects`.
        estimate: What the controller knows from an identification; None: the robot file alone.

    Raises:
        ConfigurationError: settings that don't fit the robot, or a reference that needs ROS.
        MessageRejectedError: an estimate that can't be used.
    """

    def __init__(self, robot: Robot, settings: Settings, estimate: Estimate | None = None) -> None:
        if settings.reference.kind == 'topic':
            why = "'topic' needs the nodes: use fourier, set_point or hold"
            raise ConfigurationError('reference.kind', why)
        self.plant = build_plant(robot, settings)
        self.joints = self.plant.robot.arm
        self.controller = ControlLoop(robot, settings)
        if estimate is not None:
            self.controller.set_estimate(estimate)
        self._sensors = build_sensors(self.plant, settings)
        self.firings = Firings(
            settings.firings, robot, self.plant.robot, self.plant.effects, self.plant.period
        )
        self._tau = np.zeros(self.plant.n_arm)
        self._wrench: Array | None = None

    def run(self, steps: int) -> Iterator[Step]:
        """Measure and move on.

        Args:
            steps: Number of control periods.

        Yields:
            steps + 1 results, from the present stamp on; the plant is left at the last one.
        """
        for k in range(steps + 1):
            yield self._measure()
            if k < steps:
                self.plant.step(self._tau, self._total_wrench())

    def _total_wrench(self) -> Array | None:
        """(6,) of the controller and the thrusters over the next period; None where none acts."""
        if not self.firings:
            return self._wrench
        thrust = self.firings.wrench(self.plant.step_index)
        return thrust if self._wrench is None else thrust + self._wrench

    def _measure(self) -> Step:
        plant = self.plant
        stamp, state = plant.time_ns, plant.state
        measured = self._sensors.sample(plant.step_index, state, plant.effort, plant.hidden)
        if measured.omega is not None and plant.robot.is_free:
            self.controller.add_rate(stamp, measured.omega)
        if measured.attitude_xyzw is not None and self.controller.controller.controls_attitude:
            self.controller.add_attitude(stamp, measured.attitude_xyzw)
        command = None
        if measured.joints is not None:
            joints = measured.joints
            command = self.controller.add_joints(stamp, joints.position, joints.velocity)
            self._tau = command.tau
            if command.base is not None:
                self._wrench = np.concatenate([np.zeros(3), command.base])
        return Step(stamp, state, measured, command)


@dataclass(frozen=True, slots=True)
class RunSummary:
    """Key figures of a run.

    Args:
        steps: Control periods.
        duration: Simulated time [s].
        messages: Messages in the bag.
        max_joint_error: Largest |reference - true position| of any joint that turns [rad]; None
            where all slide.
        max_slide_error: Of any joint that slides [m]; None where all turn.
        momentum_drift: Relative, see `MomentumLedger`.
        energy_drift: [J].
        saturated: Commands that a limit changed.
        max_attitude_error: Largest measured attitude error [rad]; None where the law leaves the
            base free.
    """

    steps: int
    duration: float
    messages: int
    max_joint_error: float | None
    max_slide_error: float | None
    momentum_drift: float
    energy_drift: float
    saturated: int
    max_attitude_error: float | None


def record_run(
    loop: ClosedLoop,
    steps: int,
    path: str | Path,
    *,
    overwrite: bool = False,
    progress: Callable[[int], None] = lambda _: None,
) -> RunSummary:
    """Run and write.

    Args:
        loop: The run, at its start.
        steps: Number of control periods.
        path: Folder of the bag.
        overwrite: Replace a bag that is there.
        progress: Called with the number of steps done.

    Raises:
        RecordingError: the bag can't be written; then none is.
        SimulationDivergedError: the run diverged; no bag is written.
    """
    plant = loop.plant
    every = max(1, round(LEDGER_PERIOD / plant.period))
    slides = np.array([b.is_prismatic for b in loop.controller.robot.bodies[1:]], dtype=bool)
    error, saturated = np.zeros(len(slides)), 0
    attitude_error: float | None = None
    with BagWriter(path, overwrite=overwrite) as bag:
        if plant.robot.urdf:
            bag.text('/robot_description', plant.time_ns, plant.robot.urdf)
        for k, step in enumerate(loop.run(steps)):
            _write(bag, loop, step)
            if k % every == 0 or k == steps:
                book = bag.compose.ledger(step.stamp_ns, plant.ledger())
                bag.add('/simulator/ledger', book)
            if step.command is not None:
                gap = step.command.setpoint.q - step.state.q[: len(error)]
                error = np.maximum(error, np.abs(gap))
                saturated += bool(step.command.saturated.any() or step.command.base_saturated)
                if step.command.attitude_error is not None:
                    angle = float(np.linalg.norm(step.command.attitude_error))
                    attitude_error = max(attitude_error or 0.0, angle)
            progress(k)
    ledger = plant.ledger()
    return RunSummary(
        steps=steps,
        duration=steps * plant.period,
        messages=bag.message_count,
        max_joint_error=_largest(error[~slides]),
        max_slide_error=_largest(error[slides]),
        momentum_drift=ledger.momentum_drift,
        energy_drift=ledger.energy_drift,
        saturated=saturated,
        max_attitude_error=attitude_error,
    )


def _largest(errors: Array) -> float | None:
    return float(errors.max()) if len(errors) else None


def _write(bag: BagWriter, loop: ClosedLoop, step: Step) -> None:
    compose, ns = bag.compose, step.stamp_ns
    for topic, message in sample_messages(compose, loop.plant, step.measured):
        bag.add(topic, message)
    if loop.firings:
        shares = loop.firings.commands(ns // loop.plant.period_ns)
        bag.add(THRUSTERS, compose.joint_state(ns, loop.firings.names, effort=shares))
    if step.command is not None:
        command = compose.joint_state(ns, loop.joints, effort=step.command.tau)
        bag.add('/joint_commands', command)
        if step.command.base is not None:
            link = loop.plant.robot.base_link
            bag.add('/base_torque', compose.base_torque(ns, link, step.command.base))
