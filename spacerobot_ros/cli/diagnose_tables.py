"""Rows and sentences that `spacerobot diagnose` prints and reports alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..diagnosis.answer.appearance import Appearance
    from ..diagnosis.answer.closed_loop_gain import ClosedLoopGain
    from ..diagnosis.answer.result import Cause, Diagnosis, Residual
    from ..diagnosis.answer.score_on import JointScore

PARAMETER_HEAD = ('cause', 'where', 'parameter', 'value', '+- std', 'unit', 'matters from')
EVIDENCE_HEAD = ('cause', 'log L gain', 'BIC gain', 'p', 'held out', 'placebo', 'constant p')
RESIDUAL_HEAD = (
    'channel',
    'unit',
    'rms before',
    'rms after',
    'noise floor',
    'after/floor',
    'white p',
)
RANKING_HEAD = ('effect', 'where', 'log evidence', 'log L gain', 'p')
APPEARANCE_HEAD = ('channel', 'largest at [s]', 'goes with', 'correlation')
RANKING_LENGTH = 10

Rows = list[tuple[str, ...]]

_CLEAR = 0.5  # correlation from which it is worth a word
_SMALLEST = 1e-99  # probability that is worth its digits
_ABOVE_NOISE = 1.05  # of the noise floor: what a residual may have and still be called noise
_SCATTER = 4.0  # standard deviations
_IMPROBABLE = 1e-3  # of whiteness, over all channels


def parameter_rows(causes: Sequence[Cause]) -> Rows:
    """One row a parameter of each cause."""
    from ..diagnosis.answer.output import relevance

    rows: Rows = []
    for cause in causes:
        title, where = cause.applied.effect.title, cause.applied.where or ''
        for name, estimated in cause.parameters.items():
            threshold = relevance(cause.thresholds[name])
            rows.append(
                (
                    title,
                    where,
                    name,
                    value_with(estimated.value, estimated.std),
                    number(estimated.std, 2),
                    estimated.unit or '1',
                    '' if threshold is None else number(threshold),
                )
            )
            title = where = ''
    return rows


def evidence_rows(causes: Sequence[Cause]) -> Rows:
    """One row a cause."""
    return [
        (
            label(cause),
            number(cause.evidence.log_likelihood_gain),
            number(cause.evidence.bic_gain),
            probability(cause.evidence.p_value),
            percent(cause.evidence.held_out_gain),
            percent(cause.evidence.placebo_gain),
            probability(cause.constant_p),
        )
        for cause in causes
    ]


def residual_rows(diagnosis: Diagnosis) -> Rows:
    """One row a channel."""
    return [
        (
            r.channel,
            r.unit,
            number(r.rms_before, 3),
            number(r.rms_after, 3),
            number(r.noise_floor, 3),
            f'{r.rms_after / r.noise_floor:.2f}' if r.noise_floor > 0.0 else '',
            probability(r.whiteness_p),
        )
        for r in diagnosis.residuals
    ]


def ranking_rows(diagnosis: Diagnosis) -> Rows:
    """The best candidates, each alone against the model as it stands."""
    return [
        (
            r.effect,
            r.where or '',
            number(r.evidence),
            number(r.log_likelihood_gain),
            probability(r.p_value),
        )
        for r in diagnosis.ranking[:RANKING_LENGTH]
    ]


def appearance_rows(appearances: Mapping[str, Appearance]) -> Rows:
    """One row a channel whose error stands out."""
    return [
        (
            channel,
            f'{seen.time:.1f}',
            seen.motion if abs(seen.correlation) > _CLEAR else 'no single motion',
            f'{seen.correlation:+.2f}' if abs(seen.correlation) > _CLEAR else '',
        )
        for channel, seen in appearances.items()
    ]


def rival_lines(causes: Sequence[Cause]) -> list[str]:
    """What this motion can't tell from the named causes, and the motion that can."""
    lines = []
    for cause in causes:
        for rival in cause.rivals:
            where = f' at {rival.where}' if rival.where else ''
            lines.append(
                f'{label(cause)} can not be told from {rival.effect}{where} with this motion '
                f'(BIC gap {number(rival.bic_gap, 2)}); to separate them: {rival.motion}'
            )
    return lines


def minor_lines(causes: Sequence[Cause]) -> list[str]:
    """What is significant, but too small to matter."""
    return [f'{label(cause)}: {_values(cause)}' for cause in causes]


def _values(cause: Cause) -> str:
    return ', '.join(
        f'{name} {value_with(e.value, e.std)} +- {number(e.std, 2)} {e.unit}'.rstrip()
        for name, e in cause.parameters.items()
    )


def score_line(scores: Sequence[JointScore]) -> str:
    """What the extended model is worth on another record, in a line."""
    from ..diagnosis.answer.score_on import BAND, total

    before, after = total(scores)
    return (
        f'on the other recording the model misses {before:.3g} N m (rms over joints, below '
        f'{BAND:g} Hz), the extended one {after:.3g} N m'
    )


def gain_line(diagnosis: Diagnosis) -> str:
    """Held-out error before and after, beside the best placebo's."""
    gain = diagnosis.gain
    return (
        f'held-out prediction error, in standard deviations of the noise: {number(gain.before)} '
        f'before, {number(gain.after)} after ({number(gain.placebo)} with the best placebo)'
    )


def closed_loop_line(closed: ClosedLoopGain) -> str:
    """Tracking error before and after."""
    return (
        f'closed loop in simulation, {closed.task}, {closed.duration:g} s: rms joint error '
        f'{number(closed.rms_before, 3)} rad with the old model, {number(closed.rms_after, 3)} '
        'rad with the extended one'
    )


def remaining(diagnosis: Diagnosis) -> list[str]:
    """Channels that even the extended model does not bring down to noise.

    Torques are no sensor's: half seconds share their errors, so only their whiteness counts.
    """
    counts = {series.channel: len(series.measured) for series in diagnosis.series}
    share = _IMPROBABLE / max(1, len(diagnosis.residuals))
    return [
        _remains(r)
        for r in diagnosis.residuals
        if r.whiteness_p < share or _is_above_noise(r, counts.get(r.channel, 0))
    ]


def _is_above_noise(residual: Residual, count: int) -> bool:
    """Whether its rms is more than noise and the scatter of an rms of so many samples allow."""
    if not count:
        return False
    allowed = max(_ABOVE_NOISE, 1.0 + _SCATTER / math.sqrt(2.0 * count))
    return residual.rms_after > allowed * residual.noise_floor


def _remains(residual: Residual) -> str:
    floors = residual.rms_after / residual.noise_floor if residual.noise_floor > 0.0 else math.inf
    return (
        f'{residual.channel}: {number(residual.rms_after, 3)} {residual.unit} rms, '
        f'{floors:.2f} noise floors, white p {probability(residual.whiteness_p)}'
    )


def label(cause: Cause) -> str:
    """A cause in a few words."""
    where = f' at {cause.applied.where}' if cause.applied.where else ''
    return f'{cause.applied.effect.id}{where}'


def number(value: float, digits: int = 4) -> str:
    """A number with so many digits; a dash where there is none."""
    return f'{value:.{digits}g}' if math.isfinite(value) else ('never' if value > 0.0 else '-')


def probability(p: float) -> str:
    """A probability; very small ones without their digits."""
    return f'< {_SMALLEST:g}' if p < _SMALLEST else number(p, 2)


def value_with(value: float, std: float) -> str:
    """A value as far as its standard deviation lets it be known: two digits of that."""
    if not (math.isfinite(value) and math.isfinite(std)) or value == 0.0 or std <= 0.0:
        return number(value)
    digits = math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2
    return f'{value:#.{min(max(digits, 2), 12)}g}'.rstrip('.')


def percent(share: float) -> str:
    """A share as a percentage."""
    return f'{100.0 * share:.1f} %' if math.isfinite(share) else '-'
