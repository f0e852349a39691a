"""Flights for the monitor: closed loops in which something goes wrong, and may end again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
from scipy.spatial.transform import Rotation

from spacerobot_ros.diagnosis.flight.monitor import Monitor
from spacerobot_ros.diagnosis.flight.monitor_state import MonitorState
from spacerobot_ros.effects.catalogue import bind_effects, changed_robot
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.effects.robot_file import RobotFile
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.sensing.sensors import SensorSamples
from spacerobot_ros.simulation.closed_loop import ClosedLoop, Step
from spacerobot_ros.simulation.plant import Plant
from spacerobot_ros.types import Array

from .diagnosis_scenario import flown, fourier, packaged

_HARMONICS, _DURATION = 3, 20.0  # of the motion, which is repeated [s]
_ANGULAR_RATE = 0.15  # rad/s, spread of the first harmonic of a joint
_POSE = {'servicer': (0.3, -0.5, 0.4)}  # rad at the start, where the file has a stretched arm
_NEVER = 1e9  # s
_TIP = 0.5  # m from the last link's origin to a payload
_LEVER = {'at_x': 0.8, 'at_y': 0.3, 'at_z': -0.4}  # m, of the thruster


@dataclass(frozen=True, slots=True)
class Flight:
    """A flight of a robot of the package under its own controller.

    Args:
        robot: Name of a robot file in `config`.
        seed: Of the motion and of the sensors' noise.
        effects: Entries of `effects:` that set in at `onset` [s] and end at `end` [s].
        change: What else happens to what the sensors say from then to then.
    """

    robot: str = 'servicer'
    seed: int = 1
    effects: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    change: Callable[[SensorSamples], SensorSamples] = copy
    onset: float = _NEVER
    end: float = _NEVER

    @property
    def file(self) -> RobotFile:
        """The robot file with 100 Hz sensors, repeating a random motion of the seed."""
        settings, n = packaged(self.robot).settings, packaged(self.robot).robot.n_joints
        rng = np.random.default_rng(100 + self.seed)
        size = _ANGULAR_RATE / np.arange(1, _HARMONICS + 1)
        sine, cosine = rng.standard_normal((2, n, _HARMONICS)) * size
        pose = _POSE.get(self.robot, settings.initial.joint_position)
        return flown(
            self.robot,
            self.seed,
            initial=replace(settings.initial, joint_position=pose),
            reference=fourier(_DURATION, sine, cosine, repeat=True),
        )

    def samples(self, duration: float) -> Iterator[Step]:
        """What the sensors say, for a duration [s]."""
        file = self.file
        loop = ClosedLoop(file.robot, file.settings)
        robot = loop.plant.robot
        later = [_later(e, self.onset, self.end) for e in bind_effects(self.effects, robot)]
        onset, end = (round(t / loop.plant.period) for t in (self.onset, self.end))
        loop.plant = _moved(loop.plant, robot, later)
        for k, step in enumerate(loop.run(round(duration / loop.plant.period))):
            if k in (onset, end):
                loop.plant = _moved(loop.plant, changed_robot(robot, later[: k < end]), later)
            yield self.changed(step) if onset <= k < end else step

    def changed(self, step: Step) -> Step:
        """A step after the change."""
        return replace(step, measured=self.change(step.measured))


def monitor_of(flight: Flight, **settings: Any) -> Monitor:
    """A monitor of the flight's robot as its file says it is.

    Args:
        flight: The flight.
        settings: Of section `monitor`, where they are not the file's.
    """
    file = flight.file
    return Monitor(file.robot, replace(file.settings.monitor, **settings), file.effects)


def watch(monitor: Monitor, steps: Iterable[Step]) -> Iterator[MonitorState]:
    """Feed the monitor; yields each state that differs from the last."""
    last = None
    for step in steps:
        step.feed(monitor)
        state = monitor.step()
        if state is not last:
            yield state
        last = state


class _Later(Effect):
    """An effect whose force begins and ends at given times [s]."""

    onset: ClassVar[float]
    end: ClassVar[float]
    is_timed = True

    def force(self, motion: Motion, hidden: Array) -> Array:
        """As of the effect itself, by the time since its onset."""
        at = motion.time - self.onset
        if not 0.0 <= at[0] < self.end - self.onset:
            return motion.zeros()
        moved = motion.of(motion.robot)
        moved.time = at
        return super().force(moved, hidden)


def _later(effect: Effect, onset: float, end: float) -> Effect:
    kind = type('Later', (_Later, type(effect)), {'onset': onset, 'end': end})
    later: Effect = kind(name=effect.name, where=effect.where, values=effect.values)
    return later


def _moved(plant: Plant, robot: Robot, effects: Iterable[Effect]) -> Plant:
    """The plant with another robot in the same state."""
    new = Plant(robot, plant.state, plant.period, plant.substeps, tuple(effects))
    new.step_index, new.effort = plant.step_index, plant.effort
    return new


@dataclass(frozen=True, slots=True)
class Fault:
    """A kind of fault.

    Args:
        unit: Of its size.
        sizes: Worth flying, the largest last.
        channels: Beginnings of the names that may speak first.
        effect: Entry of `effects:` by the size and the name of the last link; empty for none.
        change: What the sensors say then, by the size.
        robots: Robots that can have it.
    """

    unit: str
    sizes: tuple[float, ...]
    channels: tuple[str, ...]
    effect: Callable[[float, str], dict[str, Any]] = lambda size, link: {}
    change: Callable[[SensorSamples, float], SensorSamples] = lambda measured, size: measured
    robots: tuple[str, ...] = ('servicer', 'minisat')


def in_flight(name: str, size: float, flight: Flight) -> Flight:
    """The flight with a fault of a size from its `onset` to its `end`."""
    fault = FAULTS[name]
    entry = fault.effect(size, flight.file.robot.bodies[-1].name)
    effects = {'fault': entry} if entry else {}
    return replace(flight, effects=effects, change=lambda measured: fault.change(measured, size))


def _payload(size: float, link: str) -> dict[str, Any]:
    second = _TIP**2 * size
    moments = {'mass': size, 'mx': _TIP * size, 'iyy': second, 'izz': second}
    return {'effect': 'inertial_parameters', 'where': link, **moments}


def _drag(size: float, link: str) -> dict[str, Any]:
    return {'effect': 'target_wheel_drag', 'where': link, 'time_constant': 1.0 / size}


def _gyro_bias(measured: SensorSamples, size: float) -> SensorSamples:
    if measured.omega is None:
        return measured
    return replace(measured, omega=measured.omega + np.array([size, 0.0, 0.0]))


def _star_turned(measured: SensorSamples, size: float) -> SensorSamples:
    if measured.attitude_xyzw is None:
        return measured
    turn = Rotation.from_rotvec([0.0, size, 0.0])
    turned = Rotation.from_quat(measured.attitude_xyzw) * turn
    return replace(measured, attitude_xyzw=turned.as_quat())


FAULTS = {
    'coulomb_friction': Fault(
        'N m',
        (0.03, 0.1, 0.3, 1.0),
        ('joint_2 torque',),
        lambda size, _: {'effect': 'joint_coulomb_friction', 'where': 'joint_2', 'torque': size},
    ),
    'payload': Fault('kg', (0.5, 2.0, 10.0), ('joint', 'angular momentum'), _payload),
    'gyro_bias': Fault('rad/s', (1e-5, 5e-5, 2e-4, 1e-3), ('gyro x',), change=_gyro_bias),
    'star_turned': Fault('rad', (1e-4, 1e-3, 1e-2), ('attitude y',), change=_star_turned),
    'thruster_leak': Fault(
        'N',
        (0.003, 0.01, 0.1),
        ('angular momentum',),
        lambda size, _: {'effect': 'thruster_leak', 'force_y': size, **_LEVER},
    ),
    'wheel_drag': Fault(
        '1/s', (1e-4, 1e-3, 3e-3), ('joint', 'angular momentum'), _drag, robots=('servicer',)
    ),
}
"""Every fault by its name."""
