"""From a search to an answer: what is named, how surely, what is left, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...effects.believed_friction import totals
from ...estimation.rows import ChannelFit
from ...estimation.scaling import is_relevant, value_std
from ...inference.decisive import MISFIT
from ...inference.validation import HeldOut
from ...types import Array
from ..answer.cause import Cause, Estimated, Evidence, Rival, with_values
from ..answer.residuals import residuals, series
from ..answer.result import Covariance, Diagnosis, Gain
from ..answer.words import cause_in_words, verdict_of
from .doubts import doubts
from .found import Found
from .search import MOST_CAUSES

_UNFINISHED = f'the search ended at {MOST_CAUSES} causes'


def conclude(found: Found, notes: tuple[str, ...]) -> Diagnosis:
    """What a search says.

    Args:
        found: Its result.
        notes: What else a user should know.
    """
    null, fit = found.null, found.fit
    null_p, white_before = null.rows.whiteness()
    fit_p, white_left = fit.rows.whiteness()
    hypotheses = found.hypotheses
    held_out = HeldOut(hypotheses, range(len(fit.causes)))
    before, after = held_out.squares()
    excess = max(float(np.sum(after)) - fit.gram.rows, 1.0)
    order = sorted(range(len(fit.causes)), key=lambda i: -found.causes[i].log_odds)
    alone = [_cause(found, i, excess) for i in order]
    causes = with_values(alone, totals([c.applied for c in alone], fit.run.believed))
    named = tuple(c for c in causes if c.relevant)
    minor = tuple(c for c in causes if not c.relevant)
    is_good = fit_p is not None and fit_p >= MISFIT
    slabs = [cause.slabs for cause in found.causes]
    doubt = next(doubts(fit, slabs), '') if is_good and named else ''
    verdict = verdict_of(is_good and not doubt, bool(named))
    # what is shown is the model that is written
    extended = found.only([i for i, c in zip(order, causes, strict=True) if c.relevant])
    channels = series(null.rows.channels(), extended.rows.channels())
    is_ended = len(fit.causes) >= MOST_CAUSES and not is_good
    return Diagnosis(
        verdict=verdict,
        sentence=sentence_of(verdict, named, minor, doubt, _left(white_left)),
        causes=named,
        minor=minor,
        residuals=residuals(
            channels, white_before, extended.rows.whiteness()[1], null.run.robot.joints
        ),
        series=channels,
        gain=_gain(before, after, fit.gram.rows) if len(before) else Gain(),
        fit_p=fit_p,
        null_p=null_p,
        next_motion=tuple(r.motion for c in named for r in c.rivals if r.motion),
        notes=(*notes, _UNFINISHED) if is_ended else notes,
        covariance=_covariance(found, named),
    )


def _cause(found: Found, i: int, excess: float) -> Cause:
    """A cause with what speaks for it beside all others.

    Args:
        found: The causes.
        i: One of them.
        excess: Squares that are left of held-out rows with all causes, beyond one a row.
    """
    fit, inferred, applied = found.fit, found.causes[i], found.fit.causes[i]
    own, deviations = fit.own(i), found.deviations
    elpd = float(np.sum(inferred.gains))
    return Cause(
        applied=applied,
        parameters={
            p.name: Estimated(
                value=applied.values[p.name],
                std=value_std(p, applied.values[p.name], float(deviations[k])),
                unit=applied.unit_at(fit.run.robot, applied.where, p),
            )
            for k, p in ((k, fit.free[k][1]) for k in own)
        },
        evidence=Evidence(
            held_out_gain=2.0 * elpd / (2.0 * elpd + excess),
            log_odds=inferred.log_odds,
            elpd_gain=elpd,
        ),
        rivals=tuple(
            Rival(effect=effect, where=where, log_odds=log_odds)
            for (effect, where), log_odds in found.rivals[applied.key].items()
        ),
        thresholds={fit.free[k][1].name: fit.free[k][1] for k in own},
        relevant=any(
            is_relevant(p, applied.values[p.name]) for p in (fit.free[k][1] for k in own)
        ),
    )


def _covariance(found: Found, named: Sequence[Cause]) -> Covariance | None:
    """Of the values of named causes, with the deviations that are said with them."""
    fit = found.fit
    places = {
        (fit.causes[i].key, p.name): (k, p, fit.causes[i].values[p.name])
        for k, (i, p) in enumerate(fit.free)
    }
    entries = [(c.applied, name) for c in named for name in c.parameters]
    told = [places[applied.key, name] for applied, name in entries]
    at = np.array([k for k, *_ in told], dtype=int)
    slopes = np.array([-1.0 if p.role == 'reciprocal' else 1.0 for _, p, _ in told])
    slopes *= [value_std(p, value, 1.0) for _, p, value in told]
    own = fit.covariance()
    wider = found.deviations / np.sqrt(np.maximum(np.diag(own), np.finfo(float).tiny))
    matrix = np.outer(slopes * wider[at], slopes * wider[at]) * own[np.ix_(at, at)]
    names = ('/'.join(filter(None, (a.id, a.where, name))) for a, name in entries)
    return Covariance(names=tuple(names), matrix=matrix) if entries else None


def _gain(before: Array, after: Array, count: int) -> Gain:
    """Held-out errors by the noise of the sensors, each part with values from the others."""
    return Gain(
        before=math.sqrt(float(np.sum(before)) / count),
        after=math.sqrt(float(np.sum(after)) / count),
    )


def sentence_of(
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
