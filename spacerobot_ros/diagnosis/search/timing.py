"""How recorded efforts act: as samples of a smooth torque, or held from sample to sample.

A torque that is held over the interval that ends at its stamp acts half an interval before it,
just as one that is stamped half an interval late. Recorders differ, so exactly half an interval is
taken for a convention and said; any other delay is a fault to be found.

Timings are compared by their misfit, not by likelihood: interpolation averages the noise of two
samples, so that it predicts a slow motion better even where it is wrong about the timing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence

import numpy as np

from ...effects.effect import Effect
from ...estimation.columns import candidates
from ...estimation.filters.measured_torque import TIMINGS
from ...estimation.fit import Fit
from ...estimation.inference.evidence import Gram, score
from ...estimation.refit import PASSES, refine
from ...estimation.runs import Run
from ...estimation.trajectory.reference import NoiseLevels
from ...model.robot import Robot
from ...recording.record import Record

_SPAN = 20.0  # s of the record that decide
_FITS = 0.05  # probability of a fit that asks for no effect beside it
_ALL_LATE = {'delay': 1.0}
_CLEARLY = 20.0  # gap in misfit from which another timing is taken
_PROMISED = 0.5  # of what a timing misses more; tangents of ten times a limit are 5 % wrong
_BY_CHANCE = 3.0  # standard deviations of a right model's misfit
_LATENESS = {'sampled': 0.0, 'held_before': 0.5, 'held_after': -0.5, 'held_about': 0.0}
_TOLERANCE = 0.08  # of an interval, about what a delay may differ from a convention's
_IN_WORDS = {
    'held_before': 'efforts act over the interval that ends at their stamp (held torque)',
    'held_after': 'efforts act over the interval that begins at their stamp (held torque)',
    'held_about': 'efforts are means about their stamp of torques that are held between stamps',
}


def first_timing(
    record: Record,
    robot: Robot,
    believed: Sequence[Effect],
    noise: NoiseLevels,
    effects: Iterable[type[Effect]],
) -> str:
    """Key of `measured_torque.TIMINGS` under which the model with at most one effect misses least.

    A timing under which the model fits as it stands asks for no effect: where noise hides the
    timing, another one may miss a little less and half an interval would pass for friction, and
    torques are said to be held only where that is clear. Else friction alone may look like a
    delay, so every effect that needs no search may stand beside the model. A large one is not in
    proportion to its column: `better_timing` asks again, once named.

    Args:
        record: What was measured.
        robot: The robot file's robot.
        believed: Its own effects.
        noise: Noise levels.
        effects: What may be wrong.
    """
    if record.effort is None or not robot.joints:
        return 'sampled'
    short = record.between(-np.inf, record.joint_time[0] + _SPAN)
    fits = {timing: Fit(Run(short, robot, believed, noise, timing), ()) for timing in TIMINGS}
    alone = {t: fit.misfit for t, fit in fits.items()}
    if fitting := [t for t in fits if (fits[t].rows.whiteness()[0] or 0.0) >= _FITS]:
        return _simplest({t: alone[t] for t in fitting}, _CLEARLY)
    simple = [e for e in effects if e.is_fitted and is_simple(e)]
    beside = {t: alone[t] - 2.0 * _gain(fit, simple) for t, fit in fits.items()}
    excess = max(1.0, min(float(fit.data @ fit.data) / len(fit.data) for fit in fits.values()))
    asks = min(beside.values()) < min(alone.values()) - _CLEARLY
    return _simplest(beside if asks else alone, _CLEARLY * excess)


def _simplest(misfits: Mapping[str, float], clearly: float) -> str:
    """The timing that misses least; samples of a smooth torque where none is clearly better."""
    return min(misfits, key=lambda t: misfits[t] - clearly * (t == 'sampled'))


def _gain(fit: Fit, effects: Sequence[type[Effect]]) -> float:
    """Log evidence that the best of some effects adds to a model without causes."""
    pool = candidates(effects, fit.rows)
    columns = fit.signatures.whitened([step for c in pool for step in c.small_steps])
    gram = Gram.of(columns, fit.data)
    best, start = 0.0, 0
    for c in pool:
        own = np.arange(start, start + len(c.steps))
        best = max(best, score(gram.part(own), c.sizes, (c.lower, c.upper), None).evidence)
        start += len(own)
    return best


def is_simple(effect: type[Effect]) -> bool:
    """Whether an effect is a few columns, other than the efforts' own lateness."""
    searched = any(p.role in ('search', 'phase') for p in effect.parameters)
    late = effect(name='', where=None, values=_ALL_LATE).delay('effort')
    return not (searched or effect.hidden or late)


def better_timing(fit: Fit, tried: Collection[str], passes: int = PASSES) -> str | None:
    """A timing under which the same causes, fitted again, clearly miss less; None: none.

    Args:
        fit: The causes so far.
        tried: Timings that are out of the question.
        passes: Largest number of steps of each fit.
    """
    others = [t for t in TIMINGS if t not in tried]
    if fit.run.record.effort is None or not fit.run.robot.joints or not others:
        return None
    started = {t: Fit(fit.run.timed(t), fit.causes) for t in others}
    fits = {
        t: refine(f.run, f.causes, passes, lambda other: _may_do(other, fit))
        for t, f in started.items()
        if _may_do(f, fit)
    }
    if not fits:
        return None
    best = min(fits, key=lambda t: np.nan_to_num(fits[t].misfit, nan=np.inf))
    return best if fits[best].misfit < fit.misfit - _CLEARLY else None


def _may_do(other: Fit, fit: Fit) -> bool:
    """Whether other values may bring a timing to what another one misses, by its tangents."""
    more = other.misfit - fit.misfit
    if more < 0.0 or not math.isfinite(other.evidence):
        return more < 0.0
    return other.promised > _PROMISED * more


def simpler_timing(fit: Fit) -> str | None:
    """Another timing under which a model fits without one of its causes; None: none.

    Half an interval of a smooth torque looks like friction, or like what bends it, beside causes
    that are real, too.
    """
    alike = fit.misfit + _BY_CHANCE * math.sqrt(2.0 * len(fit.data))
    for timing in _others(fit):
        run = fit.run.timed(timing)
        if Fit(run, fit.causes).misfit > alike:
            continue
        all_of_them = refine(run, fit.causes)
        for i in range(len(fit.causes)):
            fewer = refine(run, [*fit.causes[:i], *fit.causes[i + 1 :]])
            is_enough = fewer.evidence >= all_of_them.evidence
            if is_enough and (fewer.rows.whiteness()[0] or 0.0) >= _FITS:
                return timing
    return None


def _others(fit: Fit) -> list[str]:
    """Timings that a fit with causes has not, where there are efforts."""
    if fit.run.record.effort is None or not (fit.run.robot.joints and fit.causes):
        return []
    return [timing for timing in TIMINGS if timing != fit.run.timing]


def held_after_all(fit: Fit) -> str | None:
    """Another timing, where a fit's causes make efforts late by as much as that timing does."""
    late = sum(cause.delay('effort') for cause in fit.causes)
    if not late:
        return None
    interval = float(np.median(np.diff(fit.run.record.effort_time)))
    total = late / interval + _LATENESS[fit.run.timing]
    for timing, lateness in _LATENESS.items():
        if abs(total - lateness) < _TOLERANCE and timing != fit.run.timing:
            return timing
    return None


def in_words(timing: str) -> tuple[str, ...]:
    """What a user should know of a timing."""
    return (_IN_WORDS[timing],) if timing in _IN_WORDS else ()
