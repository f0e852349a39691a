"""Machines on which pulses of a known size are hidden: arms, free bases, lone bodies."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np

from spacerobot_ros.diagnosis.answer.extended_model import effects_section
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.events.arm_events import arm_events
from spacerobot_ros.diagnosis.events.base_templates import BaseTemplates
from spacerobot_ros.diagnosis.events.event import EventLimit, Events
from spacerobot_ros.diagnosis.events.impulses import steps_beside_usual, usual_causes
from spacerobot_ros.diagnosis.events.matched import MatchedFilter
from spacerobot_ros.diagnosis.events.transient import BASE, Shapes, Transient
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.robot_file import RobotFile
from spacerobot_ros.effects.surroundings.external import AngularImpulse, pulse_shape
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.recording.buffer import SampleBuffer
from spacerobot_ros.recording.record import Record
from spacerobot_ros.recording.robot_inputs import in_robot_order
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from spacerobot_ros.types import Array

from .diagnosis_scenario import ROBOTS, robot_file, simulated
from .hidden_laws import COLOURS, LawArm
from .real_arm import COULOMB, JOINTS, arm_file

AXES = 'xyz'
SNRS = (12.0, 20.0, 40.0)  # below, at and above what is promised
_LIMITS = (1.0, 1.5, 3.0)  # sizes of pushes of joints that stand, by the limit that is printed
_EDGE = 0.5  # share of a pulse in which it rises and falls


@dataclass(frozen=True, slots=True)
class HiddenPulse:
    """What is hidden.

    Args:
        where: Joint; None: the base.
        start: [s]. duration: [s].
        size: Torque [N m], or (3,) impulse along inertial axes [N m s].
        ratio: Of its size, by which it was drawn.
        std: Rms error that the noise leaves of it where the times of all are known, all axes
            together; NaN where friction decides.
    """

    where: str | None
    start: float
    duration: float
    size: Array
    ratio: float
    std: float = math.nan

    def torque(self, time: Array) -> Array:
        """(N,) on its joint [N m]."""
        return np.asarray(self.size * pulse_shape((time - self.start) / self.duration, _EDGE))

    def impulse(self, name: str) -> Effect:
        """On the base."""
        ends = {'start': self.start, 'end': self.start + self.duration, 'edge': _EDGE}
        sizes = dict(zip(AXES, self.size.tolist(), strict=True))
        return AngularImpulse(name=name, where=None, values=ends | sizes)


Finder = Callable[[Sequence[HiddenPulse]], Events]
Windows = Sequence[tuple[float, float]]
"""Starts and durations [s]."""
Draw = list[tuple[str | None, Array, float]] | None
Units = Callable[[np.random.Generator, Events, Windows], Draw]


@dataclass(frozen=True, slots=True)
class DrawnMachine:
    """One of a kind.

    Args:
        words: What it is. seconds: Length of its recordings.
        found: Events of a recording with pulses.
        units: Places and sizes, of ratio one, of pulses in one recording, by what was found in
            quiet, each with its `HiddenPulse.std`; None: nothing is said of one.
        ratios: Sizes of its pulses.
    """

    words: str
    seconds: float
    found: Finder
    units: Units
    ratios: tuple[float, ...] = SNRS


def _moving(seed: int) -> DrawnMachine:
    """An arm of which some joints move, what is left of its model of any colour."""
    rng = np.random.default_rng([seed, 3])
    moves = rng.choice(JOINTS, rng.integers(1, len(JOINTS) + 1), replace=False).tolist()
    colour = COLOURS[seed // 10 % len(COLOURS)]
    arm = LawArm(seed, leftover=float(rng.uniform(0.3, 1.0)), colour=colour)
    words = f'{colour}, {len(moves)} move'
    found = _held(arm.record(0, moves, 40.0), moves, rng)
    return DrawnMachine(words, 40.0, found, _torques(moves))


def _still(seed: int) -> DrawnMachine:
    """An arm of which a joint or more stand, or all, and are pushed."""
    rng = np.random.default_rng([seed, 3])
    moves = rng.choice(JOINTS, rng.choice([0, 0, 2, 4, 5]), replace=False).tolist()
    arm = LawArm(seed, leftover=float(rng.uniform(0.3, 1.0)))
    stand = [name for name in JOINTS if name not in moves]
    found = _held(arm.record(0, moves, 30.0), moves, rng)
    return DrawnMachine(f'{len(moves)} move', 30.0, found, _torques(stand, is_limit=True), _LIMITS)


def _held(quiet: Record, moves: Sequence[str], rng: np.random.Generator) -> Finder:
    """Events of the recording with pushes, whose motors hold against them.

    Where a joint stands its friction takes the load's changes as far as it goes, a share of its
    bound in each machine; motor torques follow what is beyond.
    """
    series = quiet.joints
    if series is None or series.effort is None:
        raise ValueError('an arm without efforts')
    shares, effort = rng.uniform(0.0, 1.0, len(JOINTS)) * COULOMB, series.effort

    def found(pulses: Sequence[HiddenPulse]) -> Events:
        torque = effort.copy()
        for p in pulses:
            torque[:, JOINTS.index(str(p.where))] -= p.torque(quiet.joint_time)
        for j in (j for j, name in enumerate(JOINTS) if name not in moves):
            ends = zip(torque[1:, j] - shares[j], torque[1:, j] + shares[j], strict=True)
            follow = accumulate(ends, lambda x, e: min(max(x, e[0]), e[1]), initial=torque[0, j])
            torque[:, j] = list(follow)
        return _of_arm(replace(quiet, joints=replace(series, effort=torque)))

    return found


def _of_arm(record: Record) -> Events:
    file = arm_file()
    balance = balance_of(observed(record, file.robot), file.robot, file.effects)
    is_moving = bool(balance.arm.is_moving.any())
    rows = ArmRows.of([balance], list(CATALOGUE.values())) if is_moving else None
    return arm_events([balance], rows).events


def _torques(names: Sequence[str], *, is_limit: bool = False) -> Units:
    """Torques on any of some joints of the size of their deviation, or of their limit."""

    def units(rng: np.random.Generator, events: Events, spans: Windows) -> Draw:
        out: list[tuple[str | None, Array, float]] = []
        for _, duration in spans:
            name, sign = str(rng.choice(names)), rng.choice([-1.0, 1.0])
            limit = events.limits[name]
            if limit is None:
                return None
            peak = _peak(limit, duration)
            std = peak / limit.snr
            out.append((name, np.asarray(sign * peak if is_limit else sign * std), std))
        return [(name, size, math.nan) for name, size, _ in out] if is_limit else out

    return units


def _peak(limit: EventLimit, duration: float) -> float:
    """Limit of a bell of a duration, in proportion between those of which it tells."""
    peaks = np.array(limit.peaks)
    seen = np.isfinite(peaks)
    ends = np.log(np.array(limit.durations)[seen]), np.log(peaks[seen])
    return float(np.exp(np.interp(np.log(duration), *ends)))


def _base(seed: int) -> DrawnMachine:
    """A free base with joints, whose wheels nobody knows."""
    name = ROBOTS[seed // 10 % len(ROBOTS)]
    known = robot_file(name).robot
    robot = known.with_target_momentum(np.zeros(3)) if np.any(known.target_momentum) else known

    def run(pulses: Sequence[HiddenPulse]) -> Run:
        return _run(simulated(name, 'default', seed, _impulses(pulses), 30.0), robot)

    def found(pulses: Sequence[HiddenPulse]) -> Events:
        return steps_beside_usual(run(pulses))[0]

    return DrawnMachine(name, 30.0, found, _impulse_units(run))


def _lone(seed: int) -> DrawnMachine:
    """A tumbling body without joints, all that is said of it."""
    file = _body_file(np.random.default_rng([seed, 3]))
    settings = replace(file.settings, simulator=replace(file.settings.simulator, seed=seed))

    def record(pulses: Sequence[HiddenPulse]) -> Record:
        samples = SampleBuffer(())
        effects = effects_section(_impulses(pulses))
        loop = ClosedLoop(file.robot, replace(settings, effects=effects))
        for step in loop.run(round(30.0 / settings.simulator.period)):
            step.feed(samples)
        return in_robot_order(samples.record(), file.robot)

    def found(pulses: Sequence[HiddenPulse]) -> Events:
        return diagnose(record(pulses), file.robot).events or Events()

    units = _impulse_units(lambda pulses: _run(record(pulses), file.robot))
    return DrawnMachine('body', 30.0, found, units)


def _run(record: Record, robot: Robot) -> Run:
    own = observed(record, robot)
    return Run(own, robot, (), noise_levels(robot.sensors, own)[0], 'held_before')


def _body_file(rng: np.random.Generator) -> RobotFile:
    """One body of any inertia and noise."""
    squares = rng.uniform(0.5, 1.5, 3) ** 2
    moments = zip(('ixx', 'iyy', 'izz'), 0.3 * (np.sum(squares) - squares), strict=True)
    inertia = ' '.join(f'{name}="{value}"' for name, value in moments)
    urdf = (
        '<robot name="body"><link name="base_link"><inertial><mass value="20"/>'
        f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
    )
    std = float(10.0 ** rng.uniform(-5.0, -3.5))
    content = {
        'robot': {'joints': []},
        'sensors': {'gyro_std': std, 'attitude_std': std},
        'initial': {'angular_velocity': rng.uniform(-0.3, 0.3, 3).tolist()},
        'simulator': {'joint_rate': 50.0, 'imu_rate': 50.0, 'period': 0.02},
    }
    settings = parse_settings(content)
    return RobotFile(build_robot(settings, urdf), settings, ())


def _impulse_units(run: Callable[[Sequence[HiddenPulse]], Run]) -> Units:
    """Of any directions, by what the noise leaves of each beside the others.

    A step is seen by what follows until the next: alone in a record it has half the deviation.
    """

    def units(rng: np.random.Generator, events: Events, spans: Windows) -> Draw:
        if not events.is_judged:
            return None
        quiet, one = run(()), (0.5, np.ones(3), np.eye(3), 1.0)
        templates = BaseTemplates(refine(quiet, usual_causes(quiet)))
        every = [Transient(BASE, 0, start, start + length, *one) for start, length in spans]
        out: list[tuple[str | None, Array, float]] = []
        for p in every:
            beside = MatchedFilter(templates, [q for q in every if q is not p])
            (own,) = beside.test(BASE, 0, Shapes.of(p)).covariance
            way = rng.standard_normal(3)
            size = way / math.sqrt(float(way @ np.linalg.solve(own, way)))
            out.append((None, size, math.sqrt(float(np.trace(own)))))
        return out

    return units


def _impulses(pulses: Sequence[HiddenPulse]) -> list[Effect]:
    return [p.impulse(f'pulse_{k}') for k, p in enumerate(pulses)]


MACHINES: Mapping[str, Callable[[int], DrawnMachine]] = {
    'moving': _moving,
    'still': _still,
    'base': _base,
    'lone': _lone,
}
"""By kind, of a seed."""
