"""Whether an arm whose sensors have noise that nobody stated can be predicted to that noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.effect import Effect
from ...estimation.balance.balance import noise_in_band, rms
from ...estimation.fit import Fit
from ...estimation.refit import refine
from ...estimation.runs import Run
from ...estimation.trajectory.reference import NoiseLevels
from ...recording.record import Record
from ..arms.arm_found import ArmFound
from ..limits import LIKE_NOISE, MISFIT
from .search import Search
from .timing import better_timing, first_timing

_PART, _PASSES, _TRIED, _LEFT = 1000, 3, 3, 2.0
"""Samples that are tried; steps of a fit there, which begins at what the balance found; effects
with states of their own beside that; variance of what may be left by that of the noise, after so
few steps. What does not explain a part does not explain all: the whole of a UR10e's 53 s took 31 s
of CPU until it was given up, the part takes 5."""


def is_predictable(found: ArmFound, noise: NoiseLevels, kinds: Sequence[type[Effect]]) -> bool:
    """Whether a search may explain a record to the noise of its sensors.

    It may where the causes that the balance of torques names do so in a part of it, or they and
    one effect with states of its own, which that balance does not judge.
    """
    if not _is_like_noise(found, noise):
        return False
    fit = _fit_of(_liveliest(found.records[0]), found, noise, kinds)
    if (fit.rows.whiteness()[0] or 0.0) >= MISFIT:
        return True
    hidden = [kind for kind in kinds if kind.hidden]
    judged = Search(fit.run, hidden, lambda what, share: None).judge(fit)
    guesses = [(*fit.causes, j.guess(fit.rows.robot)) for j in judged[:_TRIED]]
    data = [refine(fit.run, guess, _PASSES).data for guess in guesses]
    return any(float(x @ x) <= _LEFT * len(x) for x in data)


def _is_like_noise(found: ArmFound, noise: NoiseLevels) -> bool:
    """Whether no more is left of the torques than sensor noise leaves in the band."""
    left = rms(found.extended)
    floor = noise_in_band(found.extended[0], noise.joint_position, noise.joint_effort)
    return bool((left <= LIKE_NOISE * floor)[left == left].all())


def _liveliest(record: Record) -> Record:
    """The part of a record in which its joints go furthest; all of a short one."""
    time = record.joint_time
    if len(time) <= _PART:
        return record
    way = np.abs(np.diff(record.q, axis=0)) / np.ptp(record.q, axis=0).clip(1e-12)
    gone = np.append(0.0, np.cumsum(np.sum(way, axis=1)))
    k = int(np.argmax(gone[_PART:] - gone[:-_PART]))
    return record.between(float(time[k]), float(time[k + _PART]))


def _fit_of(
    record: Record, found: ArmFound, noise: NoiseLevels, kinds: Sequence[type[Effect]]
) -> Fit:
    """The named causes in a record, its efforts held as fits best."""
    robot, believed = found.robot, found.believed
    run = Run(record, robot, believed, noise, first_timing(record, robot, believed, noise, kinds))
    fit = refine(run, found.named, _PASSES)
    if timing := better_timing(fit, (run.timing,), _PASSES):
        fit = refine(run.timed(timing), found.named, _PASSES)
    return fit
