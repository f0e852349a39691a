"""From a search to an answer: what is named, how surely, what is left, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from scipy.stats import chi2

from ..estimation.evidence import Gram, score
from ..estimation.placebo import held_out_gain
from ..estimation.refit import Fit, refine
from ..estimation.rows import ChannelFit, blocks
from ..estimation.scaling import is_relevant
from ..types import Array
from .answer.residuals import residuals, series
from .answer.result import (
    Cause,
    Diagnosis,
    Estimated,
    Evidence,
    Gain,
    Ranked,
    Rival,
)
from .limits import INCONSTANT, MISFIT
from .search import Choice, Found


def conclude(found: Found, notes: tuple[str, ...]) -> Diagnosis:
    """What a search says.

    Args:
        found: Its result.
        notes: What else a user should know.
    """
    null = found.null
    causes = [_cause(found, i) for i in range(len(found.choices))]
    null_p, white_before = null.rows.whiteness()
    sound = [c for c in causes if _is_sound(c)]
    named = tuple(c for c in sound if c.relevant)
    minor = tuple(c for c in sound if not c.relevant)
    fit_p, white_left = _with(found, sound).rows.whiteness()
    extended = _with(found, named)  # what is shown is the model that is written
    verdict = _verdict(fit_p, bool(named))
    channels = series(null.rows.channels(), extended.rows.channels())
    joints = null.run.robot.joints
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, named, minor, _left(white_left)),
        causes=named,
        minor=minor,
        residuals=residuals(channels, white_before, extended.rows.whiteness()[1], joints),
        series=channels,
        gain=_gain(null, extended, named),
        ranking=tuple(_ranked(found)),
        fit_p=fit_p,
        null_p=null_p,
        next_motion=tuple(r.motion for c in named for r in c.rivals if r.motion),
        notes=notes,
    )


def _with(found: Found, causes: Sequence[Cause]) -> Fit:
    """The fit with only some of the causes that were found."""
    if len(causes) == len(found.choices):
        return found.fit
    return refine(found.fit.run, [c.applied for c in causes]) if causes else found.null


def _is_sound(cause: Cause) -> bool:
    """Whether a cause beats placebos, and stays the same along the record."""
    evidence = cause.evidence
    return evidence.held_out_gain > evidence.placebo_gain and cause.constant_p >= INCONSTANT


def _verdict(fit_p: float | None, named: bool) -> str:
    if fit_p is not None and fit_p >= MISFIT:
        return 'explained' if named else 'consistent'
    return 'partly_explained' if named else 'unexplained'


def _cause(found: Found, index: int) -> Cause:
    """A cause with what speaks for it beside all others."""
    fit, choice = found.fit, found.choices[index]
    applied = fit.causes[index]
    spread = fit.standard_deviations()[index]
    own = [p for i, p in fit.free if i == index]
    return Cause(
        applied=applied,
        parameters={
            p.name: Estimated(value=applied.values[p.name], std=spread[p.name], unit=p.unit)
            for p in applied.parameters
        },
        evidence=_evidence(found, index, choice),
        rivals=tuple(
            Rival(effect=effect, where=where, bic_gap=2.0 * gap, motion='')
            for effect, where, gap in choice.rivals
        ),
        thresholds={p.name: p for p in own},
        relevant=any(is_relevant(p, applied.values[p.name]) for p in own),
        constant_p=_constant_p(fit, index),
    )


def _evidence(found: Found, index: int, choice: Choice) -> Evidence:
    """Held-out gains are against the model with all other causes."""
    fit, own = found.fit, found.fit.own(index)
    parts = blocks(fit.rows.row_times)
    without = fit.held_out(index)
    before, after = (float(np.sum(x**2)) for x in (without, fit.held_out()))
    excess = max(before - len(fit.data), 1.0)
    sizes = 1.0 / np.sqrt(np.maximum(fit.precision[own], 1e-12))
    placebo = held_out_gain(fit.tangents[:, own], without, sizes, parts, fit.rows.row_times)
    return Evidence(
        log_likelihood_gain=0.5 * choice.score.gain,
        bic_gain=choice.score.bic_gain,
        p_value=choice.score.p_value,
        held_out_gain=(before - after) / excess,
        placebo_gain=placebo / excess,
    )


def _constant_p(fit: Fit, index: int) -> float:
    """Probability that a cause's parameters scatter so between the parts of the record."""
    own = fit.own(index)
    others = np.setdiff1d(np.arange(len(fit.free)), own)
    order = np.concatenate([others, own])
    unbounded = (np.full(len(own), -np.inf), np.full(len(own), np.inf))
    sizes = np.array([fit.free[k][1].size for k in own])
    sizes[~np.isfinite(sizes)] = 1.0
    total, dof = 0.0, 0.0
    for part in blocks(fit.rows.row_times):
        gram = Gram.of(fit.tangents[part][:, order], fit.data[part])
        alone = gram.without(len(others), fit.precision[others] + 1e-12)
        found = score(alone, sizes, unbounded, None)
        total, dof = total + found.gain, dof + found.dof
    return float(chi2.sf(total, max(dof - len(own), 1.0)))


def _gain(null: Fit, fit: Fit, causes: Sequence[Cause]) -> Gain:
    """Held-out error of the models, each fifth of the record with the values from the others."""
    placebos = [c.evidence.placebo_gain for c in causes]
    start, end = (_rms(f.held_out()) for f in (null, fit))
    excess = max(start**2 - 1.0, 0.0)
    # shares of several causes are of other wholes
    left = [max(start**2 - p * excess, 0.0) for p in placebos if math.isfinite(p)]
    placebo = math.sqrt(min(left)) if left else math.nan
    return Gain(before=start, after=end, placebo=placebo)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


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


def _sentence(verdict: str, named: Sequence[Cause], minor: Sequence[Cause], left: str) -> str:
    """The verdict as a test engineer would say it."""
    what = ' and '.join(_in_words(c) for c in named)
    if verdict == 'consistent' and minor:
        small = ' and '.join(_in_words(c) for c in minor)
        return f'The model explains the data but for effects too small to matter: {small}.'
    if verdict == 'consistent':
        return 'The model explains the data within the noise of the sensors.'
    if verdict == 'explained':
        return f'The data differ from the model by {what}; nothing else is left.'
    if verdict == 'partly_explained':
        return f'The data differ from the model by {what}, but {left} remains unexplained.'
    return f'The model does not explain the data ({left}), and no known effect does.'


def _left(fits: Sequence[ChannelFit]) -> str:
    """What stands out most of what is left."""
    worst = min(fits, key=lambda fit: fit.p_value)
    is_line = worst.question == 'line'
    kind = f'a spectral line at {worst.frequency:.3g} Hz' if is_line else 'a slow error'
    return f'{kind} in {worst.channel.replace("_", " ")} {worst.axis + 1}'


def _in_words(cause: Cause) -> str:
    where = f' at {cause.applied.where}' if cause.applied.where else ''
    values = ', '.join(
        f'{name} {e.value:.4g} +- {e.std:.2g}{f" {e.unit}" if e.unit else ""}'
        for name, e in cause.parameters.items()
    )
    return f'{cause.applied.title}{where} ({values})'
