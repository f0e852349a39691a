"""Data that no known model explains to the noise of their sensors: what may still be said of them.

Real joints have torques that are in no catalogue, links are not as in the file, and sensors are
filtered before they are logged, so that next to no noise is left by which to judge: every effect
would be significant. Where the robot file does not say how noisy efforts are, what the whole
catalogue together leaves of the balance of torques is taken for noise (the inadequacy of a model:
Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001); here its level alone is estimated), and an
effect is named if it explains more than that. The verdict is then at most `partly_explained`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
from scipy.stats import chi2

from ..effects.effect import Effect
from ..effects.parameter import Parameter
from ..estimation.balance import TorqueBalance, band_limited, band_terms, missed_torque
from ..estimation.columns import is_possible
from ..estimation.reference import NoiseLevels, ReferenceTrajectory
from ..estimation.refit import Run
from ..estimation.scaling import PROPORTIONAL, is_relevant, spread_of, value_std
from ..model.robot import Robot
from ..types import Array
from .answer.result import Cause, Diagnosis, Estimated, Evidence, Gain, Ranked, Residual, Series
from .search import Judged, wanted_of

_MOST_CAUSES = 16
_SIMPLER = 0.85  # of the best evidence: enough for a cause of fewer numbers
_LEAST_ANGLE = 1e-5  # rad; few encoders are as good
_FILTERED = 1e-4  # of the efforts' spread: noise below it is no sensor's
_LEAST_MASS = 0.1  # of a body's, that it is left
_SHOWN = 25.0  # Hz, of the series
NOTE = (
    'the robot file states no joint_effort_std, and the efforts say more than noise of their own '
    'allows: what the whole catalogue leaves of the torques is taken for noise instead'
)


def is_of_unknown_noise(run: Run) -> bool:
    """Whether torques are measured on a fixed base, and nobody says how well."""
    stated = run.robot.sensors.joint_effort_std is not None
    return not (run.robot.is_free or stated or run.record.effort is None)


def shows_no_noise(run: Run) -> bool:
    """Whether the efforts were filtered before they were logged, so that no noise is left."""
    effort = run.record.effort
    return effort is not None and run.noise.joint_effort < _FILTERED * float(np.std(effort))


def settled(run: Run) -> Run:
    """The run with rates no surer than positions allow, and positions no surer than encoders are.

    Rates are often made of positions by a filter, smooth and late.
    """
    record = run.record
    noise = replace(run.noise, joint_position=max(run.noise.joint_position, _LEAST_ANGLE))
    if record.joints is None or record.qd is None:
        return _with_noise(run, noise)
    positions = ReferenceTrajectory(
        replace(record, joints=replace(record.joints, velocity=None)), noise, record.joint_time
    )
    missed = record.qd - positions.at(record.joint_time).qd
    level = np.mean(band_terms(missed, record.joint_time) ** 2, axis=0)
    rate = max(noise.joint_velocity, float(np.sqrt(np.max(level))))
    return _with_noise(run, replace(noise, joint_velocity=rate))


def _with_noise(run: Run, noise: NoiseLevels) -> Run:
    return Run(run.record, run.robot, run.believed, noise, run.timing)


def diagnose_balance(
    run: Run, effects: Sequence[type[Effect]], notes: tuple[str, ...]
) -> Diagnosis:
    """Name what explains more of the torques than is left by all effects.

    Args:
        run: A run of which `is_of_unknown_noise` is true.
        effects: The catalogue.
        notes: What has been said already.
    """
    run = settled(run)
    balance = TorqueBalance(run, effects)
    found: list[Judged] = []
    first = ranking = balance.judge(found)
    while len(found) < _MOST_CAUSES and (wanted := wanted_of(ranking)):
        found.append(_simplest(wanted))
        ranking = balance.judge(found)
    causes = _causes(balance, found)
    named = tuple(c for c in causes if c.relevant)
    channels = _series(run, [c.applied for c in causes], balance.unexplained)
    return Diagnosis(
        verdict='partly_explained' if named else 'unexplained',
        sentence=_sentence(named, channels),
        causes=named,
        minor=tuple(c for c in causes if not c.relevant),
        residuals=tuple(_residual(s) for s in channels),
        series=channels,
        gain=_gain(balance, found),
        ranking=tuple(_ranked(j) for j in first),
        fit_p=0.0,
        null_p=0.0,
        next_motion=(),
        notes=(*notes, NOTE),
    )


def _simplest(wanted: Sequence[Judged]) -> Judged:
    """The cause of fewest numbers that does nearly as well as the best at the same place.

    Evidence is overstated where the rest is not white, and with it what finer shapes are worth.
    """
    best = wanted[0]
    good = [
        j
        for j in wanted
        if j.candidate.where == best.candidate.where
        and j.score.evidence > _SIMPLER * best.score.evidence
    ]
    return min(good, key=lambda j: (len(j.candidate.kind.parameters), -j.score.evidence))


def _causes(balance: TorqueBalance, found: Sequence[Judged]) -> list[Cause]:
    if not found:
        return []
    values, covariance = balance.estimate(found, balance.grams)
    halves = [balance.estimate(found, [part]) for part in balance.grams]
    excess = max(balance.grams[1].square - balance.grams[1].rows, 1.0)
    out, start = [], 0
    for judged in found:
        own = slice(start, start + len(judged.candidate.steps))
        c = judged.candidate
        applied = c.applied(c.values(np.clip(values[own], c.lower, c.upper)))
        applied = _of_a_body(applied, balance.robot)
        std = np.sqrt(np.maximum(np.diag(covariance)[own], 0.0))
        change = halves[0][0][own] - halves[1][0][own]
        spread = halves[0][1][own, own] + halves[1][1][own, own]
        thresholds = applied.parameters_at(balance.robot, applied.where)
        constant_p = _same(change, spread)
        out.append(_cause(judged, applied, thresholds, std, excess, constant_p))
        start = own.stop
    return out


def _of_a_body(applied: Effect, robot: Robot) -> Effect:
    """Inertial parameters whose mass and centre are as found, the inertia about it as in the file.

    Torques of a slow arm tell weights; inertias that fit them as well need not be any body's.
    """
    if applied.id != 'inertial_parameters' or is_possible(applied, robot):
        return applied
    index = [body.name for body in robot.bodies].index(str(applied.where))
    row = robot.inertial_parameters[index]
    file = pin.Inertia.FromDynamicParameters(row)
    mass = max(row[0] + applied.values['mass'], _LEAST_MASS * row[0])
    first = row[1:4] + np.array([applied.values[name] for name in ('mx', 'my', 'mz')])
    new = pin.Inertia(mass, first / mass, file.inertia).toDynamicParameters()
    change = dict(zip(applied.values, (new - row).tolist(), strict=True))
    return replace(applied, values=change)


def _same(change: Array, covariance: Array) -> float:
    """Probability that the two parts of the record differ as much by chance."""
    square = float(change @ np.linalg.pinv(covariance, hermitian=True) @ change)
    return float(chi2.sf(square, len(change)))


def _cause(
    judged: Judged,
    applied: Effect,
    at: Sequence[Parameter],
    std: Array,
    excess: float,
    constant_p: float,
) -> Cause:
    parameters, known, scored = {}, iter(std), judged.score
    for p in at:
        value = applied.values[p.name]
        spread = float(next(known)) if p.role in PROPORTIONAL else spread_of(p)
        parameters[p.name] = Estimated(value=value, std=value_std(p, value, spread), unit=p.unit)
    return Cause(
        applied=applied,
        parameters=parameters,
        evidence=Evidence(
            log_likelihood_gain=0.5 * scored.gain,
            bic_gain=scored.bic_gain,
            p_value=scored.p_value,
            held_out_gain=scored.held_out / excess,
            placebo_gain=0.0,
        ),
        rivals=(),
        thresholds={p.name: p for p in at},
        relevant=any(is_relevant(p, applied.values[p.name]) for p in at),
        constant_p=constant_p,
    )


def _gain(balance: TorqueBalance, found: Sequence[Judged]) -> Gain:
    """On the held-out part, with the values that the first part alone gives."""
    train, test = balance.grams
    before = balance.error([], np.zeros(0), test)
    if not found:
        return Gain(before=before, after=before, placebo=before)
    values = balance.estimate(found, [train])[0]
    return Gain(before=before, after=balance.error(found, values, test), placebo=before)


def _series(run: Run, causes: Sequence[Effect], unexplained: Array) -> tuple[Series, ...]:
    """Missing torque of every joint in the band, with and without the causes."""
    times, before = missed_torque(run)
    later, after = missed_torque(run, causes)
    before, after = band_limited(before, times), band_limited(after, later)
    stride = max(1, round(len(times) / (times[-1] - times[0]) / _SHOWN))
    return tuple(
        Series(
            f'joint_torque/{name}',
            'N m',
            times[::stride],
            np.zeros(0),
            before[::stride, i],
            np.interp(times[::stride], later, after[:, i]),
            float(unexplained[i]),
        )
        for i, name in enumerate(run.robot.joints)
    )


def _residual(s: Series) -> Residual:
    return Residual(
        channel=s.channel,
        unit=s.unit,
        rms_before=float(np.sqrt(np.mean(s.before**2))),
        rms_after=float(np.sqrt(np.mean(s.after**2))),
        noise_floor=s.noise_floor,
        whiteness_p=float('nan'),
        whiteness_p_before=float('nan'),
    )


def _ranked(judged: Judged) -> Ranked:
    return Ranked(
        effect=judged.candidate.kind.id,
        where=judged.candidate.where,
        values=judged.applied.values,
        evidence=judged.score.evidence,
        log_likelihood_gain=0.5 * judged.score.gain,
        p_value=judged.score.p_value,
    )


def _sentence(named: Sequence[Cause], channels: Sequence[Series]) -> str:
    """The verdict as a test engineer would say it."""
    before, after = (
        float(np.sqrt(np.mean([np.mean(v**2) for v in values])))
        for values in zip(*((s.before, s.after) for s in channels), strict=True)
    )
    if not named:
        return f'The model misses {before:.3g} N m (rms), and no known effect explains much of it.'
    what = ' and '.join(
        c.applied.title + (f' at {c.applied.where}' if c.applied.where else '') for c in named
    )
    return (
        f'The data differ from the model by {what}: it misses {before:.3g} N m (rms) without and '
        f'{after:.3g} N m with them, which no known effect explains.'
    )
