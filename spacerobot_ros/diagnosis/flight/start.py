"""What the first seconds of a flight tell: noise, how efforts act, the captured momentum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.effect import Effect
from ...estimation.filters.measured_torque import TIMINGS
from ...estimation.filters.prediction import Columns, Innovations, MeasuredMotion
from ...estimation.filters.torque_process import TorqueDriven
from ...estimation.noise_levels import noise_levels
from ...estimation.trajectory.reference import NoiseLevels
from ...estimation.trajectory.time_base import CHANNELS
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..search.timing import in_words
from .block_innovations import BlockInnovations
from .wheel_momentum import momentum_forces

_WIDEST = 1.5  # largest factor by which noise may exceed its stated level unnoticed


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """How a flight is to be judged.

    Args:
        process: The model, with the most probable momentum of the captured wheels.
        noise: Noise levels.
        timing: How efforts act, a key of `TIMINGS`.
        spread: (4,) rms of the whitened innovations of each of `CHANNELS`, 1 or more.
        notes: What a user should know.
    """

    process: TorqueDriven
    noise: NoiseLevels
    timing: str
    spread: Array
    notes: tuple[str, ...]


def learn(
    record: Record,
    robot: Robot,
    believed: Sequence[Effect],
    momentum_std: float,
) -> Start:
    """Settle how a flight is judged.

    Efforts act in the way under which the sensors are missed least, whatever the momentum
    (`timing` says why not by likelihood).

    Args:
        record: The first seconds, believed sensor effects undone.
        robot: The robot file's robot.
        believed: Its own effects.
        momentum_std: Of the captured wheels' momentum about the robot's, each axis [N m s]; zero
            where it is believed.
    """
    noise, notes = noise_levels(robot.sensors, record)
    model = TorqueDriven(robot, believed)
    process = model.under(record)
    measured = MeasuredMotion(record, noise, process)
    is_driven = record.effort is not None and bool(robot.joints)
    timings = tuple(TIMINGS) if is_driven else ('sampled',)
    tried = [
        _trial(BlockInnovations(measured, process, timing), momentum_std) for timing in timings
    ]
    best = min(tried, key=lambda trial: trial.misfit)
    if len(best.momentum):
        known = robot.with_target_momentum(robot.target_momentum + best.momentum)
        model = TorqueDriven(known, believed)
        process = model.under(record)
        best = _trial(BlockInnovations(measured, process, best.filtered.timing), momentum_std)
    timing = best.filtered.timing
    spread = _spread(best)
    return Start(model, noise, timing, spread, (*notes, *in_words(timing)))


@dataclass(frozen=True, slots=True, eq=False)
class _Trial:
    filtered: Innovations
    misfit: float
    momentum: Array
    left: Array


def _trial(filtered: Innovations, momentum_std: float) -> _Trial:
    """What is missed where the momentum takes its most probable value."""
    data = filtered.data
    force = momentum_forces(filtered.motion, filtered.process.robot)
    if not momentum_std or not force.shape[2]:
        return _Trial(filtered, float(data @ data), np.zeros(0), data)
    columns = filtered.columns(Columns(filtered.accelerations(force), {}))
    information = columns.T @ columns + np.eye(columns.shape[1]) / momentum_std**2
    momentum = np.asarray(np.linalg.solve(information, columns.T @ data))
    left = np.asarray(data - columns @ momentum)
    return _Trial(filtered, float(left @ left), momentum, left)


def _spread(trial: _Trial) -> Array:
    rows = trial.filtered.time_base.rows
    out = np.ones(len(CHANNELS))
    for c in range(len(CHANNELS)):
        values = trial.left[rows.channel == c]
        if len(values):
            out[c] = np.clip(np.sqrt(np.median(values**2) / _MEDIAN), 1.0, _WIDEST)
    return out


_MEDIAN = 0.4549  # of the square of a standard normal number
