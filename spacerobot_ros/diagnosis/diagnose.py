"""A run against a robot: what is wrong, what causes it, what remains."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from scipy.stats import chi2

from ..effects.catalogue import CATALOGUE
from ..effects.effect import Effect
from ..estimation.evidence import Gram, score
from ..estimation.noise_levels import noise_levels
from ..estimation.observations import observed
from ..estimation.placebo import held_out_gain
from ..estimation.prediction import TIMINGS
from ..estimation.refit import Fit, Run, refine
from ..estimation.scaling import is_relevant
from ..estimation.whiteness import ChannelFit, fit_test
from ..model.robot import Robot
from ..recording.faults.check import check_data
from ..recording.record import Record
from ..types import Array
from .answer.residuals import residuals, series
from .answer.result import Cause, Diagnosis, Estimated, Evidence, Gain, Ranked, Rival
from .inadequacy import diagnose_balance, is_of_unknown_noise, shows_no_noise
from .search import Choice, Found, Search, blocks
from .timing import first_timing, held_after_all, said_of

MISFIT = 1e-4
"""Probability below which a model does not fit."""
_INCONSTANT = 1e-4
_UNFINISHED = 'the search was ended before all that stands out was looked into'
_WINDOWS = 4


def diagnose(
    record: Record,
    robot: Robot,
    believed: Sequence[Effect] = (),
    catalogue: Iterable[type[Effect]] | None = None,
    report: Callable[[str, float], None] = lambda what, share: None,
) -> Diagnosis:
    """Compare a run with the robot's simulation and name what is different.

    Args:
        record: What was measured.
        robot: The robot file's robot, gyrostat view.
        believed: The robot file's own effects.
        catalogue: Effects that may be causes; the whole catalogue without it.
        report: Called with what is being done and the share done, from 0 to 1.

    Raises:
        RecordingError: a record from which nothing can be said, or only what is wrong.
    """
    check_data(record, robot)
    measured = observed(record, robot)
    noise, notes = noise_levels(robot.sensors, measured)
    report('finding how efforts act', 0.02)
    effects = list(CATALOGUE.values() if catalogue is None else catalogue)
    timing = first_timing(measured, robot, believed, noise, effects)
    run = Run(measured, robot, believed, noise, timing)
    if is_of_unknown_noise(run) and shows_no_noise(run):
        return diagnose_balance(run, effects, notes)
    found = Search(run, effects, report).find()
    if held := held_after_all(found.fit):
        found = Search(run.timed(held), effects, report, TIMINGS).find()
    report('measuring the gain', 0.9)
    if not found.is_complete:
        notes = (*notes, _UNFINISHED)
    diagnosis = _conclude(found, (*notes, *said_of(found.fit.run.timing)))
    if is_of_unknown_noise(run) and diagnosis.fit_p < MISFIT:
        return diagnose_balance(run, effects, notes)
    return diagnosis


def _conclude(found: Found, notes: tuple[str, ...]) -> Diagnosis:
    null = found.null
    causes = [_cause(found, i) for i in range(len(found.choices))]
    sound = [c for c in causes if _is_sound(c)]
    named = tuple(c for c in sound if c.relevant)
    minor = tuple(c for c in sound if not c.relevant)
    fit_p, white_left = _judged(_with(found, sound))
    extended = _with(found, named)  # what is shown is the model that is written
    verdict = _verdict(fit_p >= MISFIT, bool(named))
    channels = series(null.filter, extended.filter)
    null_p, white_before = _judged(null)
    white_after = _judged(extended)[1]
    return Diagnosis(
        verdict=verdict,
        sentence=_sentence(verdict, named, minor, white_left),
        causes=named,
        minor=minor,
        residuals=residuals(channels, white_before, white_after, null.run.robot.joints),
        series=channels,
        gain=_gain(null, extended, named),
        ranking=tuple(_ranked(found)),
        fit_p=fit_p,
        null_p=null_p,
        next_motion=tuple(r.motion for c in named for r in c.rivals if r.motion),
        notes=notes,
    )


def _judged(fit: Fit) -> tuple[float, tuple[ChannelFit, ...]]:
    return fit_test(fit.filter, fit.data)


def _with(found: Found, causes: Sequence[Cause]) -> Fit:
    """The fit with only some of the causes that were found."""
    if len(causes) == len(found.choices):
        return found.fit
    return refine(found.fit.run, [c.applied for c in causes]) if causes else found.null


def _is_sound(cause: Cause) -> bool:
    """Whether a cause beats placebos and stays the same along the record."""
    evidence = cause.evidence
    beats = not evidence.held_out_gain <= evidence.placebo_gain  # true where there is no placebo
    return beats and cause.constant_p >= _INCONSTANT


def _verdict(fits: bool, named: bool) -> str:
    if fits:
        return 'explained' if named else 'consistent'
    return 'partly_explained' if named else 'unexplained'


def _cause(found: Found, index: int) -> Cause:
    """A cause with what speaks for it beside all others."""
    fit, choice = found.fit, found.choices[index]
    applied = fit.causes[index]
    spread = fit.standard_deviations()[index]
    parameters = {
        p.name: Estimated(value=applied.values[p.name], std=spread[p.name], unit=p.unit)
        for p in applied.parameters
    }
    return Cause(
        applied=applied,
        parameters=parameters,
        evidence=_evidence(found, index, choice),
        rivals=tuple(
            Rival(effect=effect, where=where, bic_gap=2.0 * gap, motion='')
            for effect, where, gap in choice.rivals
        ),
        thresholds={p.name: p for i, p in fit.free if i == index},
        relevant=any(is_relevant(p, applied.values[p.name]) for i, p in fit.free if i == index),
        constant_p=_constancy(fit, index),
    )


def _evidence(found: Found, index: int, choice: Choice) -> Evidence:
    """Held-out gains are against the model with all other causes."""
    fit = found.fit
    others = [c for i, c in enumerate(fit.causes) if i != index]
    rest = refine(fit.run, others) if others else found.null
    before, after = (float(np.sum(_held_out(f) ** 2)) for f in (rest, fit))
    excess = max(before - len(rest.data), 1.0)
    own = np.array([k for k, (i, _) in enumerate(fit.free) if i == index])
    sizes = 1.0 / np.sqrt(np.maximum(fit.precision[own], 1e-12))
    placebo = math.nan  # where the cause moves stamps, rows are not the same
    if len(rest.data) == len(fit.data):
        parts, times = blocks(fit.filter), fit.filter.row_times
        placebo = held_out_gain(fit.tangents[:, own], rest.data, sizes, parts, times)
    return Evidence(
        log_likelihood_gain=0.5 * choice.score.gain,
        bic_gain=choice.score.bic_gain,
        p_value=choice.score.p_value,
        held_out_gain=(before - after) / excess,
        placebo_gain=placebo / excess,
    )


def _constancy(fit: Fit, index: int) -> float:
    """Probability that a cause's parameters are the same in each part of the record."""
    own = np.array([k for k, (i, _) in enumerate(fit.free) if i == index])
    columns, data = fit.tangents, fit.data
    pieces = np.array_split(np.arange(len(data)), _WINDOWS)
    others = np.array([k for k in range(columns.shape[1]) if k not in own], dtype=int)
    order = np.concatenate([others, own])
    total, dof = 0.0, 0.0
    unbounded = (np.full(len(own), -np.inf), np.full(len(own), np.inf))
    sizes = np.array([fit.free[k][1].size for k in own])
    sizes[~np.isfinite(sizes)] = 1.0
    for piece in pieces:
        gram = Gram.of(columns[piece][:, order], data[piece])
        alone = gram.without(len(others), fit.precision[others] + 1e-12)
        found = score(alone, sizes, unbounded, None)
        total, dof = total + found.gain, dof + found.dof
    return float(chi2.sf(total, max(dof - len(own), 1.0)))


def _gain(null: Fit, fit: Fit, causes: Sequence[Cause]) -> Gain:
    """Held-out error of the models, each fifth of the record with the values from the others."""
    placebos = [c.evidence.placebo_gain for c in causes]
    placebo = max((p for p in placebos if math.isfinite(p)), default=0.0)
    start, end = _rms(_held_out(null)), _rms(_held_out(fit))
    excess = max(start**2 - 1.0, 0.0)
    left = max(start**2 - placebo * excess, 0.0)  # shares of several causes are of other wholes
    return Gain(before=start, after=end, placebo=math.sqrt(left))


def _held_out(fit: Fit) -> Array:
    return fit.predicted(blocks(fit.filter))


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


def _sentence(
    verdict: str, named: Sequence[Cause], minor: Sequence[Cause], fits: Sequence[ChannelFit]
) -> str:
    """The verdict as a test engineer would say it."""
    what = ' and '.join(_in_words(c) for c in named)
    worst = min(fits, key=lambda fit: fit.p_value) if fits else None
    left = ''
    if worst is not None:
        kind = (
            f'a line at {worst.frequency:.3g} Hz' if worst.question == 'line' else 'a slow error'
        )
        left = f'{kind} in {worst.channel.replace("_", " ")} {worst.axis + 1}'
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


def _in_words(cause: Cause) -> str:
    where = f' at {cause.applied.where}' if cause.applied.where else ''
    values = ', '.join(
        f'{name} {e.value:.4g} +- {e.std:.2g}{f" {e.unit}" if e.unit else ""}'
        for name, e in cause.parameters.items()
    )
    return f'{cause.applied.title}{where} ({values})'
