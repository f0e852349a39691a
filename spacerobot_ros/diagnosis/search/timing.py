"""How recorded efforts act: as samples of a smooth torque, or held from sample to sample.

A torque that is held over the interval that ends at its stamp acts half an interval before it,
just as one that is stamped half an interval late. Recorders differ, so exactly half an interval is
taken for a convention and said; any other delay is a fault to be found.

Timings are compared by their misfit, not by likelihood: interpolation averages the noise of two
samples, so that it predicts a slow motion better even where it is wrong about the timing.
"""

from __future__ import annotations

from ...estimation.filters.measured_torque import TIMINGS
from ...estimation.fit import Fit

_HELD = -10.0
"""Log odds of efforts that are held between stamps, against samples of a smooth torque: where
noise hides how they act, means of two samples miss by some nats less, whatever is right."""
_IN_WORDS = {
    'held_before': 'efforts act over the interval that ends at their stamp (held torque)',
    'held_after': 'efforts act over the interval that begins at their stamp (held torque)',
    'held_about': 'efforts are means about their stamp of torques that are held between stamps',
}


def timings(fit: Fit) -> tuple[str, ...]:
    """Keys of `measured_torque.TIMINGS` that a record may have, that of a fit first."""
    now = fit.run.timing
    if fit.run.record.effort is None or not fit.run.robot.joints:
        return (now,)
    return (now, *(t for t in TIMINGS if t != now))


def log_odds_of(timing: str) -> float:
    """Prior log odds of a timing."""
    return 0.0 if timing == 'sampled' else _HELD


def in_words(timing: str) -> tuple[str, ...]:
    """What a user should know of a timing."""
    return (_IN_WORDS[timing],) if timing in _IN_WORDS else ()
