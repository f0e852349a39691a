"""Flights for the monitor: closed loops in which something goes wrong, and may end again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import yaml

from spacerobot_ros.diagnosis.monitor import Monitor
from spacerobot_ros.dynamics.plant import Plant
from spacerobot_ros.effects.catalogue import changed_robot, parse_effects
from spacerobot_ros.effects.effect import AppliedEffect, Effect
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.simulation.closed_loop import ClosedLoop

from .mujoco_robots import ROBOTS


@dataclass(frozen=True)
class Sample:
    """What the sensors said at one stamp; None where one said nothing."""

    stamp_ns: int
    joints: tuple[np.ndarray, np.ndarray, np.ndarray] | None
    omega: np.ndarray | None
    attitude_xyzw: np.ndarray | None


@dataclass(frozen=True)
class Flight:
    """A robot's flight.

    Args:
        robot: Key of `ROBOTS`.
        seed: Of the sensors' noise.
        effects: Entries of `effects:` that set in at `onset` [s] and end at `end` [s].
        change: What else happens to a sample from then to then.
    """

    robot: str = 'servicer'
    seed: int = 1
    effects: Mapping[str, Mapping[str, Any]] | None = None
    change: Callable[[Sample], Sample] = lambda sample: sample
    onset: float = 1e9
    end: float = 1e9

    def parameters(self) -> dict[str, Any]:
        """Of the robot file."""
        robot = ROBOTS[self.robot]
        text = replace(robot, target_wheels=(0.0, 0.0, 0.0)).yaml('', {})
        file = yaml.safe_load(text.replace('sensors:', 'sensors: {}'))['/**']['ros__parameters']
        file['robot']['urdf'] = 'given.urdf'
        file['sensors'] = {**STDS, 'joint_effort_std': robot.effort_std}
        n = len(robot.joints)
        rng = np.random.default_rng(100 + self.seed)
        size = 0.15 / np.arange(1, 4)
        file['reference'] = {
            'kind': 'fourier', 'duration': 20.0, 'harmonics': 3, 'repeat': True,
            'sine': (rng.standard_normal((n, 3)) * size).ravel().tolist(),
            'cosine': (rng.standard_normal((n, 3)) * size).ravel().tolist(),
        }  # fmt: skip
        file['initial'] = {
            'joint_position': list(robot.q0),
            'angular_velocity': list(robot.omega) if robot.free else [0.0] * 3,
        }
        if robot.target_link:
            file['truth'] = {'target_momentum': list(robot.target_wheels)}
        file['simulator'] = {'period': 0.01, 'seed': self.seed}
        return file

    def loop(self) -> ClosedLoop:
        """The loop at its start."""
        settings = parse_settings(self.parameters())
        return ClosedLoop(build_robot(settings, ROBOTS[self.robot].urdf), settings)

    def samples(self, duration: float) -> Iterator[Sample]:
        """What the sensors say, for a duration [s]."""
        loop = self.loop()
        robot = loop.plant.robot
        later = [
            Later.of(e, self.onset, self.end) for e in parse_effects(self.effects or {}, robot)
        ]
        onset, end = (round(t / loop.plant.period) for t in (self.onset, self.end))
        loop.plant = moved(loop.plant, robot, later)
        for k, step in enumerate(loop.run(round(duration / loop.plant.period))):
            if k in (onset, end):
                loop.plant = moved(loop.plant, changed_robot(robot, later[: k < end]), later)
            sample = _sample(step)
            yield self.change(sample) if onset <= k < end else sample


STDS = {
    'joint_position_std': 2e-5,
    'joint_velocity_std': 2e-4,
    'gyro_std': 2e-5,
    'attitude_std': 3e-5,
}


@dataclass(frozen=True, kw_only=True)
class Later(Effect):
    """An effect whose force begins and ends at given times."""

    inner: Effect
    onset: float
    end: float

    @classmethod
    def of(cls, applied: AppliedEffect, onset: float, end: float) -> AppliedEffect:
        """The same effect, later."""
        e = applied.effect
        later = cls(
            id=e.id, title=e.title, group=e.group, parameters=e.parameters,
            is_external=e.is_external, is_timed=True, inner=e, onset=onset, end=end,
        )  # fmt: skip
        return replace(applied, effect=later)

    def change(self, robot, where, values):
        """See `Effect.change`; when, the flight says."""
        return self.inner.change(robot, where, values)

    def force(self, motion, where, values, hidden):
        """See `Effect.force`."""
        at = motion.time - self.onset
        if not 0.0 <= at[0] < self.end - self.onset:
            return motion.zeros()
        moved = motion.of(motion.robot)
        moved.time = at
        return self.inner.force(moved, where, values, hidden)


def moved(plant: Plant, robot: Any, effects: Iterable[AppliedEffect]) -> Plant:
    """The plant with another robot in the same state."""
    new = Plant(robot, plant.state, plant.period, plant.substeps, tuple(effects))
    new.step_index, new.effort = plant.step_index, plant.effort
    return new


def watch(monitor: Monitor, samples: Iterable[Sample]) -> Iterator[Any]:
    """Feed the monitor; yields each state that differs from the last."""
    last = None
    for sample in samples:
        if sample.joints is not None:
            monitor.add_joints(sample.stamp_ns, *sample.joints)
        if sample.omega is not None:
            monitor.add_rate(sample.stamp_ns, sample.omega)
        if sample.attitude_xyzw is not None:
            monitor.add_attitude(sample.stamp_ns, sample.attitude_xyzw)
        state = monitor.step()
        if state is not last:
            yield state
        last = state


def _sample(step: Any) -> Sample:
    m = step.measured
    joints = None
    if m.joints is not None:
        joints = (m.joints.position, m.joints.velocity, m.joints.effort)
    return Sample(step.stamp_ns, joints, m.omega, m.attitude_xyzw)


def monitor_of(flight: Flight, **settings: Any) -> Monitor:
    """A monitor of the flight's robot as its file says it is."""
    known = parse_settings({**flight.parameters(), 'monitor': settings})
    return Monitor(build_robot(known, ROBOTS[flight.robot].urdf), known.monitor)
