r"""Thrusters of a lone body whose pose is measured and whose rate is not: one by one, by windows.

All unknowns of `estimation.momentum_windows` are fitted at once; the delay is where the windows
miss least. What disturbs such a platform is slow and belongs to a window: standard deviations come
from how windows scatter (Liang and Zeger, Biometrika 73 (1986)), that of the delay from leaving
out a tenth of the windows at a time.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.catalogue import CATALOGUE
from ...errors import RecordingError
from ...estimation.momentum_windows import MomentumWindows, Name, WindowGrams, all_grams
from ...formats import counted
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array, IntArray
from ..answer.cause import Cause, Evidence
from ..answer.result import Diagnosis, Gain, Residual
from ..answer.words import cause_in_words
from ..limits import FALSE_ALARMS
from .lone_causes import cause_of, evidence_of

_DELAYS = np.linspace(0.0, 0.5, 26)  # s; tried
_PARTS = 10  # of the windows, each left out once
_FEWEST = 20  # windows: two a part


def has_pose_and_thrust(records: Sequence[Record], robot: Robot) -> bool:
    """Whether recordings are judged by windows: pose and commands, and no gyro."""
    return not robot.joints and all(
        r.rates is None
        and r.attitudes is not None
        and {'base_position', 'thrusters'} <= set(r.inputs)
        for r in records
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """Unknowns under one delay.

    Args:
        delay: [s].
        values: (P,) differences from the file.
        covariance: (P, P) by the scatter of windows.
        levels: (2,) rms of what is left of positions [m] and angles [rad].
        misfit: (W,) of every window, over the levels given.
    """

    delay: float
    values: Array
    covariance: Array
    levels: Array
    misfit: Array


def _solve(
    grams: WindowGrams, delay: float, levels: Array, used: IntArray, kept: IntArray | None = None
) -> _Solution:
    """Least squares over some windows; all others are predicted.

    Args:
        grams: Products under the delay.
        delay: [s].
        levels: (2,) of the noise.
        used: Windows that are fitted.
        kept: Unknowns that are; None: all.
    """
    each = grams.position / levels[0] ** 2 + grams.angle / levels[1] ** 2
    size = len(grams.names)
    free = np.arange(size) if kept is None else kept
    values = np.zeros(size)
    total = np.sum(each[used], axis=0)
    inverse = np.linalg.pinv(total[np.ix_(free, free)], hermitian=True)
    values[free] = inverse @ total[free, -1]
    pointer = np.append(-values, 1.0)
    slopes = np.einsum('wij,j->wi', each, pointer)[used][:, free]
    covariance = np.zeros((size, size))
    covariance[np.ix_(free, free)] = inverse @ (slopes.T @ slopes) @ inverse
    squares = [float(pointer @ np.sum(g, axis=0) @ pointer) for g in (grams.position, grams.angle)]
    left = np.sqrt(np.maximum(squares, 0.0) / np.maximum(grams.counts, 1.0))
    misfit = np.einsum('i,wij,j->w', pointer, each, pointer)
    return _Solution(delay, values, covariance, np.maximum(left, 1e-12), misfit)


class _Search:
    """All windows under all delays."""

    def __init__(self, records: Sequence[Record], robot: Robot) -> None:
        windows = [MomentumWindows(record, robot) for record in records]
        self._windows = windows
        self.grams = [all_grams(windows, float(d)) for d in _DELAYS]
        self.count = len(self.grams[0].position)
        if self.count < _FEWEST:
            raise RecordingError(
                records[0].source,
                f'{counted(self.count, "window")} with a pose, at least {_FEWEST} are needed',
            )
        self.every = np.arange(self.count)
        self.levels = np.ones(2)
        for _ in range(3):
            self.levels = self.solved(self.every).levels
        self.best = self.solved(self.every)

    def solved(self, used: IntArray, kept: IntArray | None = None) -> _Solution:
        """The best over all delays, the delay between those tried by a parabola."""
        tried = [
            _solve(g, float(d), self.levels, used, kept)
            for g, d in zip(self.grams, _DELAYS, strict=True)
        ]
        costs = np.array([float(np.sum(s.misfit[used])) for s in tried])
        k = int(np.clip(np.argmin(costs), 1, len(costs) - 2))
        bend = costs[k - 1] - 2.0 * costs[k] + costs[k + 1]
        shift = 0.5 * (costs[k - 1] - costs[k + 1]) / bend if bend > 0.0 else 0.0
        delay = max(0.0, float(_DELAYS[k] + np.clip(shift, -1.0, 1.0) * (_DELAYS[1] - _DELAYS[0])))
        grams = all_grams(self._windows, delay) if len(used) == self.count else self.grams[k]
        return _solve(grams, delay, self.levels, used, kept) if kept is None else tried[k]

    def at(self, delay: float, used: IntArray, kept: IntArray | None = None) -> _Solution:
        """Under the delay that was tried next to one."""
        k = int(np.argmin(np.abs(_DELAYS - delay)))
        return _solve(self.grams[k], float(_DELAYS[k]), self.levels, used, kept)

    def delay_std(self) -> float:
        """By leaving out a tenth of the windows at a time (jackknife)."""
        parts = np.array_split(self.every, _PARTS)
        delays = np.array([self.solved(np.setdiff1d(self.every, part)).delay for part in parts])
        spread = float(np.sum((delays - np.mean(delays)) ** 2))
        return math.sqrt((_PARTS - 1) / _PARTS * spread)

    def held_out(self, delay: float, without: int | None = None) -> float:
        """Misfit of every second window by what the others give."""
        size, total = len(self.best.values), 0.0
        kept = None if without is None else np.setdiff1d(np.arange(size), [without])
        for odd in (0, 1):
            used = self.every[self.every % 2 == odd]
            others = self.every[self.every % 2 != odd]
            total += float(np.sum(self.at(delay, used, kept).misfit[others]))
        return total


def diagnose_thrust(records: Sequence[Record], robot: Robot, notes: Sequence[str]) -> Diagnosis:
    """What pose and commands tell of the thrusters, of all recordings together.

    Raises:
        RecordingError: too few windows.
    """
    search = _Search(records, robot)
    best = search.best
    names = search.grams[0].names
    nothing = np.zeros(0, dtype=int)
    null = search.at(0.0, search.every, nothing)
    after = search.held_out(best.delay)
    causes = [_delay_cause(search, robot, after)]
    causes += [_cause(search, i, name, robot, after) for i, name in enumerate(names)]
    causes.sort(key=lambda c: -c.evidence.log_likelihood_gain)
    named = tuple(c for c in causes if _is_sure(c, len(causes)))
    minor = tuple(c for c in causes if not _is_sure(c, len(causes)))
    rows = float(np.sum(search.grams[0].counts))
    return Diagnosis(
        verdict='partly_explained' if named else 'consistent',
        sentence=_sentence(named),
        causes=named,
        minor=minor,
        residuals=tuple(_residuals(null, best)),
        gain=Gain(
            before=math.sqrt(float(np.sum(null.misfit)) / rows),
            after=math.sqrt(after / rows),
        ),
        ranking=tuple(c.ranked for c in causes),
        notes=(
            *notes,
            f'judged by {counted(search.count, "window")} of pose, start and rate of each free; '
            'thrust is told by mass and inertia of the file, of which only ratios to it are seen',
            _gains_in_words(names, best),
        ),
        method='pose',
    )


def _is_sure(cause: Cause, count: int) -> bool:
    """Whether a cause is named, one of so many that were looked at."""
    evidence = cause.evidence
    is_seen = evidence.p_value * count < FALSE_ALARMS and evidence.held_out_gain > 0.0
    return is_seen and cause.relevant


def _cause(search: _Search, index: int, name: Name, robot: Robot, after: float) -> Cause:
    kind, where, parameter = name
    (p,) = (p for p in CATALOGUE[kind].parameters_at(robot, where) if p.name == parameter)
    change = float(search.best.values[index])
    std = math.sqrt(float(search.best.covariance[index, index]))
    without = search.held_out(search.best.delay, index)
    evidence = _evidence(change, std, search, after, without)
    estimates = {parameter: (max(p.minimum, p.nominal + change), std)}
    return cause_of(kind, where, estimates, evidence, robot)


def _delay_cause(search: _Search, robot: Robot, after: float) -> Cause:
    delay, std = search.best.delay, search.delay_std()
    evidence = _evidence(delay, std, search, after, search.held_out(0.0))
    return cause_of('command_delay', None, {'delay': (delay, std)}, evidence, robot)


def _evidence(
    change: float, std: float, search: _Search, after: float, without: float
) -> Evidence:
    square, removed = (change / std) ** 2 if std > 0.0 else 0.0, without - after
    excess = max(without - float(np.sum(search.grams[0].counts)), removed, 1.0)
    return evidence_of(square, 1, search.count, removed / excess)


def _residuals(null: _Solution, best: _Solution) -> list[Residual]:
    channels = (('position', 'm'), ('attitude', 'rad'))
    return [
        Residual(
            channel=channel,
            unit=unit,
            rms_before=float(null.levels[i]),
            rms_after=float(best.levels[i]),
        )
        for i, (channel, unit) in enumerate(channels)
    ]


def _gains_in_words(names: Sequence[Name], best: _Solution) -> str:
    stds = np.sqrt(np.diag(best.covariance))
    gains = [
        f'{where} {max(0.0, 1.0 + best.values[i]):.2f} +- {stds[i]:.2f}'
        for i, (kind, where, _) in enumerate(names)
        if kind == 'thruster_gain'
    ]
    return f"thrust over the file's: {', '.join(gains)}"


def _sentence(named: Sequence[Cause]) -> str:
    if not named:
        return 'The model explains the motion under the commands, within what windows scatter by.'
    return f'The data differ from the model by {" and ".join(map(_in_words, named))}.'


def _in_words(cause: Cause) -> str:
    (found,) = cause.parameters.values()
    is_dead = cause.applied.id == 'thruster_gain' and found.value < 2.0 * found.std
    return cause_in_words(cause) + ' (it gives no force)' * is_dead
