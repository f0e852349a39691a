"""How recorded efforts act: as samples of a smooth torque, or held from sample to sample.

A torque that is held over the interval that ends at its stamp acts half an interval before it,
just as one that is stamped half an interval late. Recorders differ, so exactly half an interval is
taken for a convention and said; any other delay is a fault to be found.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ..effects.effect import AppliedEffect
from ..model.robot import Robot
from .fit import Fit, Run, refine
from .innovations import TIMINGS
from .observations import Observations
from .reference import NoiseLevels

_SPAN = 20.0  # s of the record that decide
_CLEARLY = 10.0  # gap in log evidence from which another timing is taken
_LATENESS = {'sampled': 0.0, 'held_before': 0.5, 'held_after': -0.5}
_TOLERANCE = 0.08  # of an interval, about what a delay may differ from a convention's
_SAID = {
    'held_before': 'efforts act over the interval that ends at their stamp (held torque)',
    'held_after': 'efforts act over the interval that begins at their stamp (held torque)',
}


def first_timing(
    observed: Observations,
    robot: Robot,
    believed: Sequence[AppliedEffect],
    noise: NoiseLevels,
) -> str:
    """Key of `innovations.TIMINGS` under which the model as it stands is the likeliest.

    What is wrong with the model may look like a delay: `better_timing` asks again, once named.

    Args:
        observed: Observations.
        robot: The robot file's robot.
        believed: Its own effects.
        noise: Noise levels.
    """
    if observed.effort is None:
        return 'sampled'
    short = observed.first(_SPAN)
    fits = {timing: Fit(Run(short, robot, believed, noise, timing), ()) for timing in TIMINGS}
    return max(fits, key=lambda timing: fits[timing].evidence)


def better_timing(fit: Fit, tried: Collection[str]) -> str | None:
    """A timing under which the same causes, fitted again, are clearly likelier; None: none.

    Args:
        fit: The causes so far.
        tried: Timings that are out of the question.
    """
    others = [t for t in TIMINGS if t not in tried]
    if fit.run.observed.effort is None or not others:
        return None
    fits = {t: refine(fit.run.timed(t), fit.causes) for t in others}
    best = max(fits, key=lambda t: fits[t].evidence)
    return best if fits[best].evidence > fit.evidence + _CLEARLY else None


def held_after_all(fit: Fit) -> str | None:
    """Another timing, where a fit's causes make efforts late by as much as that timing does."""
    late = sum(cause.delay('effort') for cause in fit.causes)
    if not late:
        return None
    interval = float(np.median(np.diff(fit.run.observed.effort_time)))
    total = late / interval + _LATENESS[fit.run.timing]
    for timing, lateness in _LATENESS.items():
        if abs(total - lateness) < _TOLERANCE and timing != fit.run.timing:
            return timing
    return None


def said_of(timing: str) -> tuple[str, ...]:
    """What a user should know of a timing."""
    return (_SAID[timing],) if timing in _SAID else ()
