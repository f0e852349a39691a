"""Spinning bodies that have a gyro and a magnetometer, and no attitude: what their means tell.

Effects are chosen one by one where they lower the Bayesian information criterion; every
second window must be predicted by the others. What both sensors see of the axis is the body's, or
that of a board on which both sit: it is said to be likely, with that rival.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.catalogue import CATALOGUE
from ...errors import RecordingError
from ...estimation.inference.evidence import chi_square_tail
from ...estimation.spin import LONGEST, TURNS, SpinWindow, nutation, spin_windows
from ...formats import counted
from ...inference.decisive import CONFOUNDED
from ...model.robot import Robot
from ...recording.record import Record
from ..answer.cause import Cause, Evidence, Rival
from ..answer.residuals import residuals
from ..answer.result import Diagnosis, Gain, Series
from ..answer.words import cause_in_words
from ..limits import FALSE_ALARMS
from .lone_causes import cause_of, evidence_of
from .spin_axis import Tilt, tilt_of
from .spin_means import KINDS, MeanFit, SpinMeans

_FEWEST = 4  # windows
_NEXT = (
    'Spin it about another axis and record again: a board that is tilted stays so, a principal '
    'axis does not follow.'
)


def is_spinning(records: Sequence[Record], robot: Robot) -> bool:
    """Whether recordings are judged by the spin: a lone body's gyro and magnetometer alone."""
    return not robot.joints and all(
        r.attitudes is None and r.rates is not None and 'magnetic_field' in r.inputs
        for r in records
    )


def diagnose_spin(records: Sequence[Record], robot: Robot, notes: Sequence[str]) -> Diagnosis:
    """What gyro and magnetometer of a spinning body tell, of all its recordings together.

    Raises:
        RecordingError: too few windows in which it spins.
    """
    windows = spin_windows(records)
    if len(windows) < _FEWEST:
        raise RecordingError(
            records[0].source,
            f'{counted(len(windows), "window")} in which the magnetometer sees the body spin, at '
            f'least {_FEWEST} of {TURNS:g} turns are needed: without an attitude nothing else is '
            'judged',
        )
    means = SpinMeans(windows, robot)
    rows = 3 * len(windows)
    null, (best, rivals) = means.fit(()), _chosen(means)
    causes = [replace(_cause(means, best, kind), rivals=rivals[kind]) for kind in best.kinds]
    tilt = _tilt(windows, means, best, robot)
    if tilt is not None:
        causes.append(_tilt_cause(tilt, robot))
    named = tuple(c for c in causes if c.relevant)
    channels = _series(means, null, best)
    before, after = (math.sqrt(means.held_out(k) / rows) for k in ((), best.kinds))
    tilted = () if tilt is None else (tilt.in_words,)
    count = len({w.recording for w in windows})
    spans = f'{counted(len(windows), "window")} of up to {LONGEST:g} s of '
    spans += counted(count, 'recording')
    return Diagnosis(
        verdict='partly_explained' if named else 'consistent',
        sentence=_sentence(named, tilt),
        causes=named,
        minor=tuple(c for c in causes if not c.relevant),
        residuals=residuals(channels, (), (), ()),
        series=channels,
        gain=Gain(before=before, after=after),
        ranking=tuple(_cause(means, means.fit((kind,)), kind).ranked for kind in KINDS),
        next_motion=(_NEXT,) if tilt is not None and tilt.is_tilted else (),
        notes=(*notes, f'judged by the spin that the magnetometer sees: {spans}', *tilted),
        method='spin',
    )


def _chosen(means: SpinMeans) -> tuple[MeanFit, dict[str, tuple[Rival, ...]]]:
    """Effects that the means want, one by one, and what each can not be told from."""
    best, rows = means.fit(()), means.error.size
    rivals: dict[str, tuple[Rival, ...]] = {}
    while len(best.kinds) < len(KINDS):
        trials = [means.fit((*best.kinds, kind)) for kind in KINDS if kind not in best.kinds]
        least = min(fit.bic(rows) for fit in trials)
        alike = [fit for fit in trials if fit.bic(rows) - least < 2.0 * CONFOUNDED]
        ahead = min(alike, key=lambda fit: fit.extent)  # the least that does
        is_better = least < best.bic(rows)
        if not (is_better and means.held_out(ahead.kinds) < means.held_out(best.kinds)):
            break
        rivals[ahead.kinds[-1]] = tuple(
            Rival(effect=t.kinds[-1], where=None, bic_gap=max(t.bic(rows) - ahead.bic(rows), 0.0))
            for t in alike
            if t is not ahead
        )
        best = ahead
    observable = means.fit(KINDS).names
    for kind in best.kinds:  # at one rate of one sense a bias, a scale and a tilt are alike
        if any(name not in observable for name in best.names if name[0] == kind):
            others = (k for k in KINDS if k != kind)
            rivals[kind] = tuple(Rival(effect=k, where=None, bic_gap=0.0) for k in others)
    return best, rivals


def _tilt(
    windows: Sequence[SpinWindow], means: SpinMeans, fit: MeanFit, robot: Robot
) -> Tilt | None:
    bias = np.zeros(3)
    for (kind, name), value in zip(fit.names, fit.values, strict=True):
        if kind == 'gyro_bias':
            bias['xyz'.index(name)] = value
    gyro = np.array([w.mean for w in windows]) - bias
    line = nutation(windows)
    is_line = chi_square_tail(2.0 * line.gain, 2 * len(windows)) * line.trials < FALSE_ALARMS
    return tilt_of(means.seen, gyro, (line.share, line.std) if is_line else None, robot)


def _cause(means: SpinMeans, fit: MeanFit, kind: str) -> Cause:
    rest = tuple(k for k in fit.kinds if k != kind)
    own = [i for i, (k, _) in enumerate(fit.names) if k == kind]
    rows, stds = fit.left.size, np.sqrt(np.diag(fit.covariance))
    held, held_without = means.held_out(fit.kinds), means.held_out(rest)
    evidence = evidence_of(
        means.fit(rest, among=fit.names).misfit - fit.misfit,
        len(own),
        rows,
        (held_without - held) / max(held_without - rows, 1.0),
    )
    estimates = {fit.names[i][1]: (float(fit.values[i]), float(stds[i])) for i in own}
    return cause_of(kind, None, estimates, evidence, means.robot)


def _tilt_cause(tilt: Tilt, robot: Robot) -> Cause:
    estimates = {name: (value, tilt.stds[name]) for name, value in tilt.change.items()}
    cause = cause_of('inertial_parameters', robot.base_link, estimates, Evidence(), robot)
    board = Rival(
        effect='gyro_misalignment',
        where='gyro and magnetometer on one board',
        bic_gap=0.0,
    )
    return replace(cause, rivals=(board,) if tilt.is_tilted else (), relevant=True)


def _series(means: SpinMeans, null: MeanFit, best: MeanFit) -> tuple[Series, ...]:
    measured = np.array([w.mean for w in means.windows])
    place = np.arange(len(means.windows), dtype=float)
    return tuple(
        Series(
            f'gyro/{axis}', 'rad/s', place, measured[:, i], null.left[:, i], best.left[:, i],
            float(means.noise[i]),
        )
        for i, axis in enumerate('xyz')
    )  # fmt: skip


def _with_rivals(cause: Cause) -> str:
    others = [CATALOGUE[rival.effect].title for rival in cause.rivals]
    alike = f' or {" or ".join(others)}, which these spins do not tell apart,' * bool(others)
    return f'{cause_in_words(cause)}{alike}'


def _sentence(named: Sequence[Cause], tilt: Tilt | None) -> str:
    gyro = [c for c in named if c.applied.group == 'sensor']
    what = ' and '.join(map(_with_rivals, gyro))
    parts = [f'The data differ from the model by {what}' * bool(gyro)]
    parts += [tilt.likely] if tilt is not None else []
    sentence = '; '.join(part.removesuffix(',') for part in parts if part)
    return f'{sentence}.' if sentence else 'The model explains the mean rates of the gyro.'
