"""Runs of a Monte Carlo campaign: the closed loop as it is, or its dynamics alone."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..control.computed_torque import torque_limits
from ..control.joint_reference import build_reference
from ..control.loop import ControlLoop
from ..errors import ConfigurationError, SpaceRobotError
from ..simulation.closed_loop import ClosedLoop
from ..simulation.plant import Plant
from ..simulation.smooth_loops import Followed, TrackingLaw, follow, rotated, steps_for
from ..simulation.truth import build_plant
from ..types import Array
from .ranges import MIDDLE, Ranges, load_ranges

Row = dict[str, Any]
RUN = 'run'
LARGEST = 'joint_error_max [rad]'
ACCURACY = 1e-5
"""Of the largest joint error [rad]: what doubling the steps of dynamics alone may change."""
_TRIED = 8  # runs for that
_DOUBLINGS = 6
_OF_DYNAMICS = ('inertia.', 'truth.', 'effects.', 'initial.angular_velocity', 'initial.attitude')
_LAW = 'computed_torque'


def trial_block(key: str) -> dict[str, list[Row]]:
    """Results of a block of runs.

    Args:
        key: JSON of a map: `ranges` and `robot` (paths), `first` and `last` (runs), `is_dynamics`,
            and `asked`: what else the numbers depend on.
    """
    asked = json.loads(key)
    ranges = _loaded(asked['ranges'], asked['robot'], asked['asked'])
    numbers = range(asked['first'], asked['last'])
    if asked['is_dynamics']:
        return {'rows': dynamics_rows(ranges, numbers)}
    return {'rows': [closed_loop_row(ranges, run) for run in numbers]}


def block_keys(path: str, ranges: Ranges, is_dynamics: bool, size: int) -> list[str]:
    """Keys of all runs, as `trial_block` takes them.

    Args:
        path: The file of the ranges.
        ranges: What stands there.
        is_dynamics: Whether the dynamics run alone.
        size: Runs of a block.
    """
    files = {'ranges': path, 'robot': ranges.robot_path}
    parts = [__version__, *(Path(file).read_text(encoding='utf-8') for file in files.values())]
    parts.append(ranges.robot_file.robot.urdf)
    asked = hashlib.sha256('\0'.join(parts).encode()).hexdigest()[:16]
    paths = {name: str(Path(file).absolute()) for name, file in files.items()}
    same = {**paths, 'is_dynamics': is_dynamics, 'asked': asked}
    firsts = range(0, ranges.runs, size)
    return [json.dumps({**same, 'first': k, 'last': min(k + size, ranges.runs)}) for k in firsts]


def failed_rows(key: str, why: str) -> list[Row]:
    """Rows of the runs of a block that failed."""
    block = json.loads(key)
    return [{RUN: run, 'error': why} for run in range(block['first'], block['last'])]


@lru_cache(maxsize=4)
def _loaded(path: str, robot: str, _: str) -> Ranges:
    return load_ranges(path, robot)


def closed_loop(ranges: Ranges, run: int) -> tuple[ClosedLoop, int]:
    """The loop of a run, whose controller believes the robot file; and its number of periods.

    Raises:
        ConfigurationError: drawn values that can't be.
    """
    settings, robot = ranges.machine(run)
    loop = ClosedLoop(robot, settings)
    loop.controller = ControlLoop(robot, ranges.believed(settings))
    return loop, max(1, round(ranges.duration / loop.plant.period))


def closed_loop_row(ranges: Ranges, run: int) -> Row:
    """What came of a run."""
    row: Row = {RUN: run, **ranges.values(run)}
    try:
        loop, steps = closed_loop(ranges, run)
        return {**row, **_measured(loop, steps), 'error': None}
    except SpaceRobotError as error:  # diverged, or values that can't be
        return {**row, 'error': ' '.join(str(error).split())}


def _measured(loop: ClosedLoop, steps: int) -> Row:
    n, count = loop.plant.n_arm, 0
    largest, squares, last, torque = np.zeros((4, n))
    turned, is_limited = 0.0, False
    attitude: float | None = None
    start = loop.plant.state.q_WB_xyzw
    for step in loop.run(steps):
        turned = max(turned, float(rotated(start, step.state.q_WB_xyzw[None])[0]))
        if (command := step.command) is None:
            continue
        last = command.setpoint.q - step.state.q[:n]
        largest, torque = np.fmax(largest, abs(last)), np.fmax(torque, abs(command.tau))
        squares, count = squares + last**2, count + 1
        is_limited |= bool(command.saturated.any() or command.base_saturated)
        if command.attitude_error is not None:
            attitude = max(attitude or 0.0, float(np.linalg.norm(command.attitude_error)))
    rms = np.sqrt(squares / max(count, 1))
    return {
        **_outcome(largest, rms, last, torque, turned, is_limited),
        'attitude_error_max [rad]': attitude,
        'momentum_drift [1]': loop.plant.ledger().momentum_drift,
    }


def _outcome(
    largest: Array, rms: Array, last: Array, torque: Array, turned: float, is_limited: bool
) -> Row:
    return {
        LARGEST: float(np.max(largest)),
        'joint_error_rms [rad]': float(np.max(rms)),
        'joint_error_end [rad]': float(np.max(np.abs(last))),
        'torque_max [N m]': float(np.max(torque)),
        'base_rotation_max [rad]': float(turned),
        'torque_limited [1]': float(is_limited),
    }


# ---------------------------------------------------------------- dynamics alone


def dynamics_rows(ranges: Ranges, runs: Sequence[int]) -> list[Row]:
    """What came of runs under the computed torque in continuous time, sensors exact.

    Raises:
        ConfigurationError: what dynamics alone do not have.
    """
    law = _law(ranges)
    machines = {run: _plant_or_why(ranges, run) for run in runs}
    rows = [{RUN: k, **ranges.values(k), 'error': why} for k, (_, why) in machines.items()]
    plants = [plant for plant, _ in machines.values() if plant is not None]
    if not plants:
        return rows
    found = _followed(plants, law, ranges.duration, steps_of(ranges))
    results = found.largest, found.rms, found.last, found.torque, found.turned, found.is_limited
    good = [row for row in rows if row['error'] is None]
    for row, state, *own in zip(good, found.states, *results, strict=True):
        if np.isfinite(state).all():
            row.update(_outcome(*own))
        else:
            row['error'] = 'the simulation diverged'
    return rows


def check_dynamics(ranges: Ranges) -> None:
    """Refuse what dynamics alone do not have.

    Raises:
        ConfigurationError: noise, forces of effects, or laws other than the computed torque.
    """
    for key in ranges.draw:
        if not key.startswith(_OF_DYNAMICS):
            why = f'means nothing to dynamics alone (what does: {", ".join(_OF_DYNAMICS)})'
            raise ConfigurationError(f'draw.{key}', why)
    settings = ranges.robot_file.settings
    if settings.controller.law != _LAW:
        why = f'{settings.controller.law!r}: dynamics alone have {_LAW!r}'
        raise ConfigurationError('controller.law', why)
    for effect in _plant(ranges, MIDDLE).effects:
        if effect.acts('force') or effect.hidden:
            why = 'is a force, which dynamics alone do not have: leave --dynamics out'
            raise ConfigurationError(f'effects.{effect.name}', why)


@lru_cache(maxsize=4)
def steps_of(ranges: Ranges) -> int:
    """Integration steps: doubled until that changes no error of the first runs any more."""
    law = _law(ranges)
    tried = (_plant_or_why(ranges, run)[0] for run in range(_TRIED))
    plants = [plant for plant in tried if plant is not None]
    steps = steps_for(law, ranges.duration)
    before = _followed(plants, law, ranges.duration, steps).largest
    for _ in range(_DOUBLINGS):
        after = _followed(plants, law, ranges.duration, 2 * steps).largest
        if not np.nanmax(np.abs(after - before), initial=0.0) > ACCURACY:
            break
        steps, before = 2 * steps, after
    return steps


def _followed(plants: Sequence[Plant], law: TrackingLaw, duration: float, steps: int) -> Followed:
    states = np.stack([plant.state.to_vector() for plant in plants])
    return follow([plant.robot for plant in plants], states, law, duration, steps)


def _law(ranges: Ranges) -> TrackingLaw:
    file = ranges.robot_file
    check_dynamics(ranges)
    options, model = file.settings.controller, file.believed
    start = _plant(ranges, MIDDLE).state.q[: len(model.arm)]
    limits = torque_limits(options.torque_limit, model.effort_limits, 'torque_limit', 'a joint')
    return TrackingLaw(
        model=model,
        reference=build_reference(file.settings.reference, start),
        bandwidth=options.bandwidth,
        limits=np.asarray(limits, dtype=float),
    )


def _plant(ranges: Ranges, run: int) -> Plant:
    settings, robot = ranges.machine(run)
    return build_plant(robot, settings)


def _plant_or_why(ranges: Ranges, run: int) -> tuple[Plant | None, str | None]:
    """The machine of a run, or why there is none."""
    try:
        return _plant(ranges, run), None
    except SpaceRobotError as error:
        return None, ' '.join(str(error).split())
