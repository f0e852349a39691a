"""Plant, sensors and controller in one loop, without ROS: what the nodes do in lockstep.

At each step the sensors measure, the controller answers the joint sample of that stamp, and the
plant moves on under that torque, and that on the base, held until the next joint sample.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..control.loop import Command, ControlLoop
from ..dynamics.state import State
from ..errors import ConfigurationError
from ..identification.estimate import Estimate
from ..model.robot import Robot
from ..model.settings import Settings
from ..sensing.sensors import SensorSamples
from ..types import Array
from .plant import Firings
from .truth import build_plant, build_sensors


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
        robot: What the controller believes (`model.loader.load_robot_file`).
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
