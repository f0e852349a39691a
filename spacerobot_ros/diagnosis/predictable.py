"""Whether an arm whose sensors have noise that nobody stated can be predicted to that noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effects.effect import Effect
from ..estimation.balance import noise_in_band
from ..estimation.reference import NoiseLevels
from ..estimation.refit import PASSES, Fit, refine
from ..estimation.runs import Run
from ..recording.record import Record
from .arm_found import ArmFound, rms
from .limits import LIKE_NOISE, MISFIT, MOST
from .search import Search
from .timing import better_timing, first_timing

_PART, _PASSES = 1000, 3
"""Samples of a record that are tried first, and steps of a fit there, which begins at what the
balance found: what does not explain these does not explain all. A UR10e's 53 s, of which no model
takes more than a hundredth a step, took 31 s of CPU until they were given up, and take 5."""


def is_predictable(found: ArmFound, noise: NoiseLevels, kinds: Sequence[type[Effect]]) -> bool:
    """Whether a search could explain a record to the noise of its sensors.

    It can where the causes that the balance of torques names do so, or where one effect with
    states of its own, which that balance does not judge, takes most of what they leave.
    """
    record = found.records[0]
    if not _is_like_noise(found, noise):
        return False
    if (part := _liveliest(record)) and not _may_fit(part, found, noise, kinds, _PASSES):
        return False
    return _may_fit(record, found, noise, kinds, PASSES)


def _is_like_noise(found: ArmFound, noise: NoiseLevels) -> bool:
    """Whether no more is left of the torques than sensor noise leaves in the band."""
    left = rms(found.extended)
    floor = noise_in_band(found.extended[0], noise.joint_position, noise.joint_effort)
    return bool((left <= LIKE_NOISE * floor)[left == left].all())


def _liveliest(record: Record) -> Record | None:
    """The part of a record in which its joints go furthest; None of a short one."""
    time = record.joint_time
    if len(time) < 3 * _PART:
        return None
    way = np.abs(np.diff(record.q, axis=0)) / np.ptp(record.q, axis=0).clip(1e-12)
    gone = np.append(0.0, np.cumsum(np.sum(way, axis=1)))
    k = int(np.argmax(gone[_PART:] - gone[:-_PART]))
    return record.between(float(time[k]), float(time[k + _PART]))


def _may_fit(
    record: Record,
    found: ArmFound,
    noise: NoiseLevels,
    kinds: Sequence[type[Effect]],
    passes: int,
) -> bool:
    """Whether named causes, or one more with states of its own, do so in a record."""
    robot, believed = found.robot, found.believed
    run = Run(record, robot, believed, noise, first_timing(record, robot, believed, noise, kinds))
    fit = refine(run, found.named, passes)
    if timing := better_timing(fit, (run.timing,), passes):
        fit = refine(run.timed(timing), found.named, passes)
    if (fit.rows.whiteness()[0] or 0.0) >= MISFIT:
        return True
    left = float(fit.data @ fit.data) - len(fit.data)
    return one_takes_most(fit, [kind for kind in kinds if kind.hidden], left)


def one_takes_most(fit: Fit, kinds: Sequence[type[Effect]], left: float) -> bool:
    """Whether one more cause may take most of a misfit."""
    judged = Search(fit.run, kinds, lambda what, share: None).judge(fit)
    return any(it.score.gain > MOST * left for it in judged)
