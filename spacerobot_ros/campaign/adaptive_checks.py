"""The adaptive-control results held against the figures that are to be reached."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..control.adaptive.tree import parameter_values
from .adaptive_control import (
    LAMBDAS,
    Adaptation,
    base_errors,
    last_deg,
    rebound_deg,
    settling_time,
    worst,
)
from .adaptive_scenario import minisat
from .checks import Check


def checks(results: Adaptation) -> list[Check]:
    """All figures to reach."""
    return [
        *_identity_checks(results),
        *_set_point_checks(results),
        *_harmonic_checks(results),
        *_inertia_checks(results),
        *_noise_checks(results),
        *_sampling_checks(results),
        *_time_checks(results),
    ]


def _identity_checks(results: Adaptation) -> list[Check]:
    found = results.identities
    return [
        Check('Y pi against RNEA', found.rnea, 0.0, 1e-12, 'N m'),
        Check('Slotine-Li regressor against two calls', found.slotine_li, 0.0, 1e-12),
        Check('Y_SL pi against M A_r + C V_r', found.coriolis, 0.0, 1e-12, 'N m'),
        Check('Lyapunov identity, random estimates', found.lyapunov, 0.0, 1e-11, 'W'),
        Check('rank, ten rows', found.rank, 38, 38),
        Check('rank, the seven rows of the paper', found.rank_without_force, 37, 37),
    ]


def _set_point_checks(results: Adaptation) -> list[Check]:
    true = results.of('orientation', 'true')[0]
    times = [settling_time(results.of('lambda', rate)[0]) for rate in LAMBDAS]
    slower = max(after - before for before, after in pairwise(times))
    return [
        Check('orientation, true parameters: below 0.1 deg', settling_time(true), 0.0, 7.0, 's'),
        Check('orientation, true parameters: rebound', rebound_deg(true), 0.0, 0.1, 'deg'),
        Check('settling time, change with larger Lambda', slower, -100.0, 0.0, 's'),
    ]


def _harmonic_checks(results: Adaptation) -> list[Check]:
    limits = {
        ('iid', 'adaptive_rls', 'none'): (0.0035, 0.012),
        ('iid', 'adaptive_composite', 'none'): (0.0035, 0.012),
        ('iid', 'adaptive_composite', 'project'): (0.0035, 0.012),
        ('iid', 'adaptive_lyapunov', 'none'): (0.045, 0.25),
        ('physical', 'adaptive_composite', 'project'): (0.009, 0.11),
    }
    floor = worst(results.of('harmonic', 'true', 0.0, 'passivity'))
    out = [
        Check('harmonic, true parameters, attitude', floor[0], 0.0, 0.003, 'deg'),
        Check('harmonic, true parameters, joints', floor[1], 0.0, 0.0083, 'deg'),
    ]
    for (kind, law, consistency), limit in limits.items():
        runs = results.of('harmonic', kind, 0.4, law, consistency)
        name = f'harmonic, {law}, {consistency}, {kind} priors 40 %, worst of {len(runs)}'
        reached = worst(runs)
        out.append(Check(f'{name}: attitude', reached[0], 0.0, limit[0], 'deg'))
        out.append(Check(f'{name}: joints', reached[1], 0.0, limit[1], 'deg'))
        if consistency == 'project':
            share = max(run.indefinite for run in runs)
            out.append(Check(f'{name}: indefinite estimates', 100.0 * share, 0.0, 0.0, '%'))
    reached = worst(results.of('unmeasured', 'adaptive_rls'))
    name = 'harmonic, adaptive_rls, base velocity not measured'
    out.append(Check(f'{name}: attitude', reached[0], 0.0, 0.0035, 'deg'))
    out.append(Check(f'{name}: joints', reached[1], 0.0, 0.012, 'deg'))
    return out


def _inertia_checks(results: Adaptation) -> list[Check]:
    """The base's parameters that the motion tells: mean relative errors after a run."""
    truth = parameter_values(minisat())[:10]
    runs = results.of('harmonic', 'iid', 0.4, 'adaptive_rls', 'none')
    Ixx, _, _, mass = 100.0 * np.mean([base_errors(run, truth)[-1] for run in runs], axis=0)
    name = f'adaptive_rls, iid priors 40 %, mean of {len(runs)}: base'
    return [
        Check(f'{name} Ixx', float(Ixx), 0.0, 2.0, '%'),
        Check(f'{name} mass', float(mass), 0.0, 1.0, '%'),
    ]


def _noise_checks(results: Adaptation) -> list[Check]:
    runs = results.of('noise', 1.0, 'adaptive_rls')
    error = sum(run.torque_error for run in runs) / len(runs)
    return [Check('noise x1, adaptive_rls: torque error', 100.0 * error, 0.0, 0.5, '%')]


def _sampling_checks(results: Adaptation) -> list[Check]:
    """Below the sampling limit, the set-point is reached; true parameters."""
    out = []
    for period, rate, limit in ((0.25, 0.4, 3e-4), (0.25, 2.0, 3e-4), (0.5, 1.0, 1e-5)):
        run = results.of('sampling', period, rate, 'true')[0]
        name = f'held for {period:g} s, Lambda {rate:g}/s: attitude of the last 10 s'
        out.append(Check(name, last_deg(run), 0.0, limit, 'deg'))
    return out


def _time_checks(results: Adaptation) -> list[Check]:
    limits = {('adaptive_lyapunov', 'none'): 15.0, ('adaptive_rls', 'none'): 30.0}
    return [
        Check(f'cycle, {law[0]}', results.times[law], 0.0, limit, 'us')
        for law, limit in limits.items()
    ]
