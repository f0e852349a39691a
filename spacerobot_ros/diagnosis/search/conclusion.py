"""From a search to an answer: what is named, how surely, what is left, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ...estimation.fit import Fit
from ...estimation.rows import ChannelFit
from ...estimation.scaling import is_relevant
from ..answer.cause import Cause, Estimated, Evidence, Ranked, Rival
from ..answer.residuals import residuals, rms, series
from ..answer.result import Diagnosis, Gain
from ..answer.words import at, cause_in_words, verdict_of
from ..limits import DRIFTING, MISFIT, RESOLVED
from .found import Found
from .soundness import drift_p, least_needed

_STANDS = 'something that is not in the catalogue may be what they stand for'
_CANCEL = f'but these undo most of what each of them does: {_STANDS}'
_DRIFT = f'but the values drift along the record, if only together: {_STANDS}'
_POOR = f'but a right model nearly always leaves less: {_STANDS}'
_LITTLE = f'but what {{}} adds is so little that a wrong name may have left it: {_STANDS}'
_UNHELD = f'but the frequency of a mode may as well be none: {_STANDS}'
_UNFINISHED = 'the search was ended before all that stands out was looked into'


def conclude(found: Found, notes: tuple[str, ...]) -> Diagnosis:
    """What a search says.

    Args:
        found: Its result.
        notes: What else a user should know.
    """
    null = found.null
    sound = {i: _cause(found, i) for i, check in enumerate(found.checks) if check.is_sound}
    null_p, white_before = null.rows.whiteness()
    named = tuple(c for c in sound.values() if c.relevant)
    minor = tuple(c for c in sound.values() if not c.relevant)
    fit_p, white_left = found.sound.rows.whiteness()
    # what is shown is the model that is written
    extended = found.only([i for i, c in sound.items() if c.relevant]) if minor else found.sound
    fits = fit_p is not None and fit_p >= MISFIT
    doubt = _doubt(found, named, fit_p or 0.0) if fits and named else ''
    verdict = verdict_of(fits and not doubt, bool(named))
    channels = series(null.rows.channels(), extended.rows.channels())
    joints = null.run.robot.joints
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, named, minor, doubt, _left(white_left)),
        causes=named,
        minor=minor,
        residuals=residuals(channels, white_before, extended.rows.whiteness()[1], joints),
        series=channels,
        gain=_gain(null, extended, named),
        ranking=tuple(_ranked(found)),
        fit_p=fit_p,
        null_p=null_p,
        next_motion=tuple(r.motion for c in named for r in c.rivals if r.motion),
        notes=notes if found.is_complete else (*notes, _unfinished(white_left)),
    )


def _unfinished(fits: Sequence[ChannelFit]) -> str:
    """That a search was ended, and every channel in which something still stands out."""
    left = [fit for fit in fits if fit.p_value * len(fits) < MISFIT]
    listed = ', '.join(_stands_out(fit) for fit in sorted(left, key=lambda fit: fit.p_value))
    return f'{_UNFINISHED}: {listed}' if left else _UNFINISHED


def _cause(found: Found, index: int) -> Cause:
    """A cause with what speaks for it beside all others."""
    fit, choice, check = found.fit, found.choices[index], found.checks[index]
    applied = fit.causes[index]
    spread = fit.standard_deviations()[index]
    own = [p for i, p in fit.free if i == index]
    return Cause(
        applied=applied,
        parameters={
            p.name: Estimated(
                value=applied.values[p.name],
                std=spread[p.name],
                unit=applied.unit_at(fit.run.robot, applied.where, p),
            )
            for p in own
        },
        evidence=Evidence(
            log_likelihood_gain=0.5 * choice.score.gain,
            bic_gain=choice.score.bic_gain,
            p_value=choice.score.p_value,
            held_out_gain=check.held_out_gain,
            placebo_gain=check.placebo_gain,
        ),
        rivals=tuple(
            Rival(effect=effect, where=where, bic_gap=2.0 * gap)
            for effect, where, gap in choice.rivals
        ),
        thresholds={p.name: p for p in own},
        relevant=any(is_relevant(p, applied.values[p.name]) for p in own),
        constant_p=check.constant_p,
    )


def _gain(null: Fit, fit: Fit, causes: Sequence[Cause]) -> Gain:
    """Held-out error of the models, each fifth of the record with the values from the others."""
    placebos = [c.evidence.placebo_gain for c in causes]
    start, end = (rms(f.held_out()) for f in (null, fit))
    excess = max(start**2 - 1.0, 0.0)
    # shares of several causes are of other wholes
    left = [max(start**2 - p * excess, 0.0) for p in placebos if math.isfinite(p)]
    placebo = math.sqrt(min(left)) if left else math.nan
    return Gain(before=start, after=end, placebo=placebo)


def _ranked(found: Found) -> Iterable[Ranked]:
    for judged in found.first:
        yield Ranked(
            effect=judged.candidate.kind.id,
            where=judged.candidate.where,
            values=judged.applied.values,
            evidence=judged.score.evidence,
            log_likelihood_gain=0.5 * judged.score.gain,
            p_value=judged.score.p_value,
        )


def _doubt(found: Found, named: Sequence[Cause], fit_p: float) -> str:
    """Why causes that leave nothing may not be what they are named; empty for no reason.

    Probabilities of the fit and of the drift are of different questions: the smaller one, doubled,
    is what a right model has by chance (Tippett 1931). Their product (Fisher 1932) would be less
    sharp: that of the fit is the least of many, corrected for their number, and 1 as a rule.
    """
    if found.is_cancelled:
        return _CANCEL
    modes = [c.parameters['frequency'] for c in named if 'frequency' in c.parameters]
    if any(mode.std > RESOLVED * mode.value for mode in modes):
        return _UNHELD
    if (least := least_needed(found.sound)) is not None:
        cause = found.sound.causes[least]
        return _LITTLE.format(f'{cause.title}{at(cause.where)}')
    if 2.0 * fit_p < DRIFTING:
        return _POOR
    return _DRIFT if 2.0 * drift_p(found.sound) < DRIFTING else ''


def _sentence(
    verdict: str, named: Sequence[Cause], minor: Sequence[Cause], doubt: str, left: str
) -> str:
    """The verdict as a test engineer would say it; nothing is left where there is a doubt."""
    what = ' and '.join(cause_in_words(c) for c in named)
    if verdict == 'consistent' and minor:
        small = ' and '.join(cause_in_words(c) for c in minor)
        return f'The model explains the data but for effects too small to matter: {small}.'
    if verdict == 'consistent':
        return 'The model explains the data within the noise of the sensors.'
    if verdict == 'explained':
        return f'The data differ from the model by {what}; nothing else is left.'
    if doubt:
        return f'The data differ from the model as by {what}, {doubt}.'
    if verdict == 'partly_explained':
        return f'The data differ from the model by {what}, but {left} remains unexplained.'
    return f'The model does not explain the data ({left}), and no known effect does.'


def _left(fits: Sequence[ChannelFit]) -> str:
    """What stands out most of what is left."""
    return _stands_out(min(fits, key=lambda fit: fit.p_value))


def _stands_out(fit: ChannelFit) -> str:
    is_line = fit.question == 'line'
    kind = f'a spectral line at {fit.frequency:.3g} Hz' if is_line else 'a slow error'
    return f'{kind} in {fit.channel.replace("_", " ")} {fit.axis + 1}'
