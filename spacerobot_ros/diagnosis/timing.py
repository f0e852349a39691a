"""How recorded efforts act: as samples of a smooth torque, or held from sample to sample.

A torque that is held over the interval that ends at its stamp acts half an interval before it,
just as one that is stamped half an interval late. Recorders differ, so exactly half an interval is
taken for a convention and said; any other delay is a fault to be found.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..effects.effect import AppliedEffect, Effect
from ..model.robot import Robot
from .candidates import candidates
from .evidence import Gram
from .fit import Fit, Run
from .fit_test import fit_test
from .innovations import Columns
from .observations import Observations
from .reference import NoiseLevels

_SPAN = 20.0  # s of the record that decide
_FITS = 0.05  # probability of a fit that is left as it is where lateness says nothing
_HALVES = {'held_before': 0.5, 'held_after': -0.5}
_ALL_LATE = {'delay': 1.0}
_TOLERANCE = 0.08  # of an interval, about half of one
_SAID = {
    'held_before': 'efforts act over the interval that ends at their stamp (held torque)',
    'held_after': 'efforts act over the interval that begins at their stamp (held torque)',
}


def choose_timing(
    observed: Observations,
    robot: Robot,
    believed: Sequence[AppliedEffect],
    noise: NoiseLevels,
    effects: Iterable[Effect],
) -> str:
    """Key of `innovations.TIMINGS` that suits a record.

    The efforts' lateness is estimated beside every effect that needs no search, since friction
    alone may look like a delay.

    Args:
        observed: Observations.
        robot: The robot file's robot.
        believed: Its own effects.
        noise: Noise levels.
        effects: What else may be wrong.
    """
    if observed.effort is None:
        return 'sampled'
    short = observed.first(_SPAN)
    simple = [e for e in effects if _is_simple(e)]
    run = Run(short, robot, believed, noise)
    null = Fit(run, ())
    if fit_test(null.filter, null.data)[0] >= _FITS:
        return 'sampled'
    # a held torque fits as well as one that is late by any time, and as half an interval
    best, least = 'sampled', _misfit(run, simple, is_free=True)
    for timing in ('held_before', 'held_after'):
        held = Run(short, robot, believed, noise, timing)
        cost = _misfit(held, simple, is_free=False)
        if cost <= least:
            best, least = timing, cost
    return best


def _misfit(run: Run, effects: Sequence[Effect], *, is_free: bool) -> float:
    """Misfit that is left beside everything else.

    Args:
        run: The run, with a timing.
        effects: What else may be wrong, a few columns each.
        is_free: Whether the efforts may be late at all.
    """
    fit = Fit(run, ())
    pool = candidates(effects, fit.filter, fit.data)
    others = fit.signatures.whitened(
        [(c.applied(d), s) for c in pool for d, s in zip(c.directions, c.steps, strict=True)]
    )
    force = fit.filter.motion.zeros()
    force[:, 6:] = fit.filter.reference.effort(fit.filter.motion.time, 1)
    late = fit.filter.columns(Columns(fit.filter.accelerations(force[..., None]), {}))
    precision = np.concatenate([c.sizes for c in pool]) ** -2.0
    gram = Gram.of(np.concatenate([others, late], axis=1), fit.data)
    alone = gram.without(len(precision), precision)
    information, slope = float(alone.matrix[0, 0]), float(alone.vector[0])
    if not is_free or information <= 0.0:
        return alone.square
    return alone.square - slope**2 / information


def _is_simple(effect: Effect) -> bool:
    """Whether an effect is a few columns, other than the efforts' own lateness."""
    searched = any(p.role in ('search', 'phase') for p in effect.parameters)
    return not (searched or effect.hidden or effect.delay('effort', _ALL_LATE))


def held_after_all(fit: Fit) -> str | None:
    """Another timing, where a fit asks for efforts that are late by half an interval."""
    observed = fit.run.observed
    interval = float(np.median(np.diff(observed.effort_time)))
    late = sum(cause.delay('effort') for cause in fit.causes)
    timing = _timing(late + interval * _HALVES.get(fit.run.timing, 0.0), observed)
    return timing if timing not in ('sampled', fit.run.timing) else None


def said_of(timing: str) -> tuple[str, ...]:
    """What a user should know of a timing."""
    return (_SAID[timing],) if timing in _SAID else ()


def _timing(delay: float, observed: Observations) -> str:
    interval = float(np.median(np.diff(observed.effort_time)))
    for timing, half in _HALVES.items():
        if abs(delay / interval - half) < _TOLERANCE:
            return timing
    return 'sampled'
