"""The adaptive-control results held against the figures that are to be reached."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from .adaptive_identities import LIMITS as IDENTITY_LIMITS
from .description import Check, Record, Results

# figures to reach: what docs/adaptive.md shows of six priors, with a margin for other seeds
_RANKS = {
    'rank, ten rows': ('rank', 38),
    'rank, the seven rows of the paper': ('rank_without_force', 37),
}
_SETTLING, _REBOUND = 7.0, 0.1  # s, deg: poles of 0.8 and 1 a second, that do not overshoot
_FLOOR = (0.003, 0.0083)  # deg, attitude and joints: what torques held for 50 ms leave; no seed
_LEARNT = (0.0035, 0.012)  # deg, almost the floor
_HARMONIC = {
    ('iid', 'adaptive_rls', 'none'): _LEARNT,
    ('iid', 'adaptive_composite', 'none'): _LEARNT,
    ('iid', 'adaptive_composite', 'project'): _LEARNT,
    ('iid', 'adaptive_lyapunov', 'none'): (0.045, 0.25),  # of 0.009 and 0.08, which scatter most
    ('physical', 'adaptive_composite', 'project'): (0.009, 0.11),  # of 0.006 and 0.025
}
_BASE = {'Ixx': 2.0, 'mass': 1.0}  # %, after a run, from 10.8 and 12.8
_TORQUE = 0.5  # %, of 0.39
_HELD = ((0.25, 0.4, 3e-4), (0.25, 2.0, 3e-4), (0.5, 1.0, 1e-5))  # s, 1/s, deg of the last 10 s
_CYCLE = {'adaptive_lyapunov': 15.0, 'adaptive_rls': 30.0}  # us, of an idle core


def judge(results: Results) -> list[Check]:
    """All figures to reach."""
    return [
        *_identity_checks(results),
        *_set_point_checks(results),
        *_harmonic_checks(results),
        *_learning_checks(results),
        *_sampling_checks(results),
    ]


def select(results: Results, *key: object) -> list[Record]:
    """Runs whose key starts with this."""
    return [run for run in results['runs'] if run['key'][: len(key)] == list(key)]


def worst(runs: Sequence[Record]) -> tuple[float, float]:
    """Largest root mean squares of attitude and joints [deg]; infinite where a run diverged."""
    attitude, joints = np.max(_errors(runs), axis=0)
    return float(attitude), float(joints)


def median(runs: Sequence[Record]) -> tuple[float, float]:
    """Median root mean squares of attitude and joints [deg]; a diverged run's are infinite."""
    attitude, joints = np.median(_errors(runs), axis=0)
    return float(attitude), float(joints)


def _errors(runs: Sequence[Record]) -> list[tuple[float, float]]:
    gone = (np.inf, np.inf)
    return [gone if r['diverged'] else (r['attitude_rms_deg'], r['joint_rms_deg']) for r in runs]


def or_infinite(value: float | None) -> float:
    """A time that is null in plain data because it is infinite."""
    return float('inf') if value is None else value


def mean_base_errors(runs: Sequence[Record]) -> dict[str, np.ndarray]:
    """Mean relative errors of the base's parameters before and after [%], by name."""
    mean = 100.0 * np.mean([run['base_errors'] for run in runs], axis=0)
    return dict(zip(('Ixx', 'Iyy', 'Izz', 'mass'), mean.T, strict=True))


def _both(name: str, reached: tuple[float, float], limits: tuple[float, float]) -> list[Check]:
    return [
        Check(f'{name}: {what}', value, 0.0, limit, 'deg')
        for what, value, limit in zip(('attitude', 'joints'), reached, limits, strict=True)
    ]


def _identity_checks(results: Results) -> list[Check]:
    found = results['identities']
    return [
        *(
            Check(what, found[n], 0.0, limit, unit)
            for n, (what, limit, unit) in IDENTITY_LIMITS.items()
        ),
        *(Check(what, found[name], rank, rank) for what, (name, rank) in _RANKS.items()),
    ]


def _set_point_checks(results: Results) -> list[Check]:
    true = select(results, 'orientation', 'true')[0]
    name, settling = 'orientation, true parameters', or_infinite(true['settling_s'])
    times = [or_infinite(run['settling_s']) for run in select(results, 'lambda')]
    slower = max(after - before for before, after in pairwise(times))
    return [
        Check(f'{name}: below 0.1 deg', settling, 0.0, _SETTLING, 's'),
        Check(f'{name}: rebound', true['rebound_deg'], 0.0, _REBOUND, 'deg'),
        Check('settling time, change with larger Lambda', slower, -100.0, 0.0, 's'),
    ]


def _harmonic_checks(results: Results) -> list[Check]:
    true = worst(select(results, 'harmonic', 'true', 0.0, 'passivity'))
    what = ('harmonic, true parameters, attitude', 'harmonic, true parameters, joints')
    out = [Check(w, x, 0.0, limit, 'deg') for w, x, limit in zip(what, true, _FLOOR, strict=True)]
    for (kind, law, consistency), limits in _HARMONIC.items():
        runs = select(results, 'harmonic', kind, 0.4, law, consistency)
        name = f'harmonic, {law}, {consistency}, {kind} priors 40 %, worst of {len(runs)}'
        out += _both(name, worst(runs), limits)
        if consistency == 'project':
            share = max(run['indefinite'] for run in runs)
            out.append(Check(f'{name}: indefinite estimates', 100.0 * share, 0.0, 0.0, '%'))
    name = 'harmonic, adaptive_rls, base velocity not measured'
    return out + _both(name, worst(select(results, 'unmeasured', 'adaptive_rls')), _LEARNT)


def _learning_checks(results: Results) -> list[Check]:
    """The base's parameters that the motion tells, after a run; torques learnt with noise."""
    runs = select(results, 'harmonic', 'iid', 0.4, 'adaptive_rls', 'none')
    name, errors = f'adaptive_rls, iid priors 40 %, mean of {len(runs)}', mean_base_errors(runs)
    noisy = [run['torque_error'] for run in select(results, 'noise', 1.0, 'adaptive_rls')]
    error = 100.0 * (sum(noisy) / len(noisy))
    return [
        *(Check(f'{name}: base {x}', errors[x][1], 0.0, most, '%') for x, most in _BASE.items()),
        Check('noise x1, adaptive_rls: torque error', error, 0.0, _TORQUE, '%'),
    ]


def _sampling_checks(results: Results) -> list[Check]:
    """Below the sampling limit, the set-point is reached; true parameters. Time of a cycle."""
    out = []
    for period, rate, limit in _HELD:
        run = select(results, 'sampling', period, rate, 'true')[0]
        name = f'held for {period:g} s, Lambda {rate:g}/s: attitude of the last 10 s'
        last = np.inf if run['diverged'] else run['last_deg']
        out.append(Check(name, last, 0.0, limit, 'deg'))
    times = {(t['law'], t['physical_consistency']): t['median'] for t in results['cycle_us']}
    for law, limit in _CYCLE.items():
        out.append(Check(f'cycle, {law}', times[law, 'none'], 0.0, limit, 'us'))
    return out
