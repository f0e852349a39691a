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
from ...inference.decisive import MISFIT
from ...recording.record import Record
from ..arms.arm_found import ArmFound
from ..limits import LIKE_NOISE
from .linear_rows import CandidateColumns, LinearRows
from .timing import log_odds_of, timings

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
    fit = _fit_of(_liveliest(found.records[0]), found, noise)
    if (fit.rows.whiteness()[0] or 0.0) >= MISFIT:
        return True
    hidden = [kind for kind in kinds if kind.hidden]
    beside = LinearRows(fit, CandidateColumns.of(fit, hidden)).alone()
    guesses = [(*fit.causes, guess) for _, guess in beside[:_TRIED]]
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


def _fit_of(record: Record, found: ArmFound, noise: NoiseLevels) -> Fit:
    """The named causes in a record, its efforts acting as fits best."""
    fit = Fit(Run(record, found.robot, found.believed, noise), found.named)
    every = [fit, *(Fit(fit.run.timed(t), found.named) for t in timings(fit)[1:])]
    best = max(every, key=lambda f: log_odds_of(f.run.timing) - 0.5 * f.misfit)
    return refine(best.run, found.named, _PASSES)
