r"""The answer of a record that was diagnosed in K pieces, each as a record of its own.

A cause is named where more pieces name it than false names would: in m of K pieces where

    P(m' >= m | K, FALSE_ALARMS) < FALSE_ALARMS                                    (binomial)

Its values are means over the pieces that name it, all numbers of a cause by one weight, so that
bodies stay bodies (they are a convex set); standard deviations go along, widened as far as the
pieces scatter (Birge), which is also asked whether the cause is constant.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
from scipy.special import bdtrc

from ..effects.effect import Key
from ..estimation.inference.evidence import chi_square_tail
from ..formats import counted
from ..inference.decisive import MISFIT
from ..types import Array
from .answer.cause import Cause, Estimated, Evidence, Rival
from .answer.result import Diagnosis, Gain, RecordingMisfit, Residual, Series
from .answer.words import cause_in_words, verdict_of
from .events.event import Events
from .limits import FALSE_ALARMS

_GOOD = ('consistent', 'explained')


def combined(
    answers: Sequence[Diagnosis], spans: Sequence[tuple[float, float]], notes: Sequence[str]
) -> Diagnosis:
    """One answer.

    Args:
        answers: Of the K pieces.
        spans: (K) first and last time of each [s].
        notes: What else a user should know.
    """
    keys = _by_count(cause for answer in answers for cause in answer.causes)
    named, rare = [], []
    for key in keys:
        at = [i for i, a in enumerate(answers) if _find(a.causes, key)]
        if bdtrc(len(at) - 1, len(answers), FALSE_ALARMS) < FALSE_ALARMS:
            named.append((_cause([_found(answers[i].causes, key) for i in at]), at))
        else:
            rare.append((key, at))
    causes = tuple(cause for cause, _ in named)
    events = _events(answers)
    words = [cause_in_words(cause) for cause in causes]
    if events is not None and events.named:
        words.append(counted(len(events.named), 'event'))
    verdict = _verdict(answers, bool(words))
    where = [_place(c.applied.key, at, spans) for c, at in named if len(at) < len(answers)]
    where += [f'{_place(key, at, spans)}: as many as by chance, not named' for key, at in rare]
    others = dict.fromkeys(note for answer in answers for note in answer.notes)
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, ' and '.join(words))
        + ('' if verdict in _GOOD else _left_over(answers, spans)),
        causes=causes,
        residuals=tuple(map(_residual, _common(answers, 'residuals'))),
        series=tuple(map(_joined, _common(answers, 'series'))),
        gain=_gain([answer.gain for answer in answers]),
        fit_p=_smallest([answer.fit_p for answer in answers]),
        null_p=_smallest([answer.null_p for answer in answers]),
        notes=(*notes, *where, *others),
        recordings=tuple(_misfits(answers, spans)),
        events=events,
        method=next((a.method for a in answers if a.fit_p is not None), answers[0].method),
    )


def _events(answers: Sequence[Diagnosis]) -> Events | None:
    """Those of all pieces that were looked through."""
    looked = [answer.events for answer in answers if answer.events is not None]
    return reduce(Events.with_more, looked) if looked else None


def _verdict(answers: Sequence[Diagnosis], is_named: bool) -> str:
    """Of all pieces: of tests of the fit where there are any, else each must be good."""
    fit_p = _smallest(answer.fit_p for answer in answers)
    if fit_p is None:
        is_good = all(answer.verdict in _GOOD for answer in answers)
    else:
        is_good = fit_p >= MISFIT
    return verdict_of(is_good, is_named)


def _sentence(verdict: str, what: str) -> str:
    return {
        'consistent': 'The model explains every piece of the data.',
        'explained': f'The data differ from the model by {what}; nothing else is left.',
        'partly_explained': f'The data differ from the model by {what}, but pieces of them have '
        'something left.',
        'unexplained': 'The model does not explain the data, and no cause is named in more pieces '
        'than by chance.',
    }[verdict]


def _left_over(answers: Sequence[Diagnosis], spans: Sequence[tuple[float, float]]) -> str:
    """What the first piece says that has something left, if one has."""
    for answer, (start, end) in zip(answers, spans, strict=True):
        if answer.verdict not in _GOOD:
            return f' From {start:.0f} to {end:.0f} s: {answer.sentence}'
    return ''


def _by_count(causes: Iterable[Cause]) -> list[Key]:
    """Causes, those of most pieces first, then those of most evidence."""
    count: dict[Key, int] = {}
    gain: dict[Key, float] = {}
    for cause in causes:
        key = cause.applied.key
        count[key] = count.get(key, 0) + 1
        gain[key] = gain.get(key, 0.0) + float(np.nan_to_num(cause.evidence.elpd_gain))
    return sorted(count, key=lambda key: (-count[key], -gain[key], str(key)))


def _find(causes: Iterable[Cause], key: Key) -> list[Cause]:
    return [cause for cause in causes if cause.applied.key == key]


def _found(causes: Iterable[Cause], key: Key) -> Cause:
    return _find(causes, key)[0]


def _place(key: Key, at: Sequence[int], spans: Sequence[tuple[float, float]]) -> str:
    name = key[0] if key[1] is None else f'{key[0]}@{key[1]}'
    first, last = spans[at[0]][0], spans[at[-1]][1]
    return f'{name}: in {len(at)} of {len(spans)} pieces, from {first:.0f} to {last:.0f} s'


def _cause(same: Sequence[Cause]) -> Cause:
    """A cause of several pieces."""
    names = list(same[0].parameters)
    values, stds = (
        np.array([[getattr(c.parameters[n], what) for n in names] for c in same], dtype=float)
        for what in ('value', 'std')
    )
    weight = _weights(stds)
    mean = weight @ values
    with np.errstate(all='ignore'):
        spread = np.sqrt(weight**2 @ stds**2)
        misfit = np.nansum(((values - mean) / stds) ** 2)
    freedom = max(1, (len(same) - 1) * len(names))
    birge = math.sqrt(max(1.0, misfit / freedom)) if len(same) > 1 else 1.0
    found = dict(zip(names, mean.tolist(), strict=True))
    first = same[0]
    return replace(
        first,
        applied=replace(first.applied, values={**first.applied.values, **found}),
        parameters={
            name: Estimated(value=value, std=birge * float(std), unit=first.parameters[name].unit)
            for (name, value), std in zip(found.items(), spread, strict=True)
        },
        evidence=_evidence([cause.evidence for cause in same]),
        rivals=_rivals(same),
        relevant=any(cause.relevant for cause in same),
        constant_p=chi_square_tail(misfit, freedom) if len(same) > 1 else first.constant_p,
        held_out_recordings=None,
    )


def _weights(stds: Array) -> Array:
    """(K,) of K causes with standard deviations (K, P), their sum 1."""
    usual = np.nanmedian(stds, axis=0)
    with np.errstate(all='ignore'):
        weight = 1.0 / np.nanmean((stds / usual) ** 2, axis=1)
    if not np.isfinite(weight).all():
        weight = np.ones(len(stds))
    return np.asarray(weight / weight.sum())


def _evidence(each: Sequence[Evidence]) -> Evidence:
    """Of pieces that do not know of each other."""
    return Evidence(
        held_out_gain=float(np.mean([e.held_out_gain for e in each])),
        log_odds=sum(e.log_odds for e in each),
        elpd_gain=sum(e.elpd_gain for e in each),
    )


def _rivals(same: Sequence[Cause]) -> tuple[Rival, ...]:
    """What no piece can tell from the cause, by how much worse it fits all of them."""
    each = [{r.key: r for r in cause.rivals} for cause in same]
    common = [key for key in each[0] if all(key in one for one in each)]
    return tuple(
        replace(each[0][key], log_odds=sum(one[key].log_odds for one in each)) for key in common
    )


def _residual(same: Sequence[Residual]) -> Residual:
    def rms(name: str) -> float:
        return float(np.sqrt(np.mean([getattr(r, name) ** 2 for r in same])))

    return replace(
        same[0],
        rms_before=rms('rms_before'),
        rms_after=rms('rms_after'),
        noise_floor=rms('noise_floor'),
        whiteness_p=_least(r.whiteness_p for r in same),
        whiteness_p_before=_least(r.whiteness_p_before for r in same),
    )


def _smallest(values: Iterable[float | None]) -> float | None:
    """Probability of the least of independent ones (Sidak); None where none was computed."""
    known = [p for p in values if p is not None and not math.isnan(p)]
    return -math.expm1(len(known) * math.log1p(-min(*known, 1.0 - 1e-16))) if known else None


def _least(values: Iterable[float]) -> float:
    """The same, nan where none was computed."""
    p = _smallest(values)
    return math.nan if p is None else p


def _common(answers: Sequence[Diagnosis], name: str) -> Iterator[tuple[Any, ...]]:
    """Residuals or series of every channel that all pieces have."""
    each = [{one.channel: one for one in getattr(answer, name)} for answer in answers]
    for channel in each[0]:
        if all(channel in one for one in each):
            yield tuple(one[channel] for one in each)


def _joined(same: Sequence[Series]) -> Series:
    curves = ('time', 'measured', 'before', 'after')
    whole: dict[str, Any] = {n: np.concatenate([getattr(s, n) for s in same]) for n in curves}
    return replace(same[0], **whole)


def _gain(gains: Sequence[Gain]) -> Gain:
    """Root mean squares; a piece without a cause has no placebo."""
    with np.errstate(all='ignore'):
        before, after = (
            float(np.sqrt(np.mean([getattr(g, name) ** 2 for g in gains])))
            for name in ('before', 'after')
        )
    placebos = [g.placebo**2 for g in gains if not math.isnan(g.placebo)]
    placebo = float(np.sqrt(np.mean(placebos))) if placebos else math.nan
    return Gain(before=before, after=after, placebo=placebo)


def _misfits(
    answers: Sequence[Diagnosis], spans: Sequence[tuple[float, float]]
) -> Iterator[RecordingMisfit]:
    for answer, (start, end) in zip(answers, spans, strict=True):
        for misfit in answer.recordings:
            yield replace(misfit, source=f'{start:.0f} to {end:.0f} s')
