"""All experiments of the adaptive-control paper on our own robot, and some of ours."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from spacerobot_ros.control.adaptive.law_signals import AdaptiveSettings

from ..campaigns import Results, TrialRecord, key, kinds, without
from .adaptive_judge import drawings, identities, shown  # noqa: F401  the campaign's
from .adaptive_run import TIMED, LoopCase, cycle_time, run_case

LAWS = (
    ('passivity', 'none'),
    ('adaptive_lyapunov_paper', 'none'),
    ('adaptive_lyapunov', 'none'),
    ('adaptive_rls_paper', 'none'),
    ('adaptive_rls', 'none'),
    ('adaptive_composite', 'none'),
    ('adaptive_composite', 'project'),
    ('adaptive_lyapunov', 'natural'),
)
"""Laws and their `controller.physical_consistency`."""
_UNMEASURED = (('passivity', 'none'), ('adaptive_rls', 'none'), ('adaptive_composite', 'project'))
_NOISY = (('adaptive_rls_paper', 'none'), *_UNMEASURED[1:])
_FIXED: dict[str, Any] = {'law': 'passivity', 'physical_consistency': 'none'}
_PAPER_ERROR = 0.016  # rad, of the paper's gradient law, whose step nothing bounds
_SHAPES = {'true': 'elements', 'iid': 'elements', 'physical': 'bodies'}
"""`adaptive.prior_shape` by the kind of wrong prior: the law believes what the draws are like."""
_WRONG = ('iid', 'physical')
_ETAS, _QUICK_ETAS = (0.1, 0.2, 0.3, 0.4), (0.2, 0.4)
_LARGEST = 0.4  # the paper's
_LAMBDAS = (0.4, 0.8, 1.2, 1.6, 2.0)
_SAMPLING = ((0.25, 0.4), (0.25, 2.0), (0.5, 1.0), (0.5, 2.0), (1.0, 0.4), (1.0, 0.8))
_PERIODS = (0.01, 0.02, 0.05, 0.1, 0.25)
_NOISE = (0.1, 1.0, 5.0)


def trials(runs: int, is_quick: bool) -> list[str]:
    """Cycle times, identities, and every closed loop.

    Args:
        runs: Wrong priors a law and size of error, and noise seeds.
        is_quick: Two sizes of error.
    """
    etas, seeds = _QUICK_ETAS if is_quick else _ETAS, range(runs)
    keys: list[tuple[Any, ...]] = [('cycle', *law) for law in TIMED]
    keys += [('identities',)]
    for law in LAWS:
        keys.append(('harmonic', 'true', 0.0, *law, 0))
        keys += [('harmonic', kind, eta, *law, s) for kind, eta, s in product(_WRONG, etas, seeds)]
    keys += [('unmeasured', *law, seed) for law, seed in product(_UNMEASURED, seeds)]
    keys += [('orientation', 'true', 0.0, 0)]
    keys += [('orientation', *of) for of in product(_WRONG, _QUICK_ETAS, seeds)]
    keys += [('lambda', rate) for rate in _LAMBDAS]
    keys += [('noise', scale, *law, seed) for scale, law, seed in product(_NOISE, _NOISY, seeds)]
    for of in _SAMPLING:
        keys.append(('sampling', *of, 'true', 0))
        keys += [('sampling', *of, 'iid', seed) for seed in seeds]
    keys += [('period', period) for period in _PERIODS]
    return [key(*parts) for parts in keys]


def run(key: str) -> TrialRecord:
    """Time, measure or simulate."""
    kind, *of = json.loads(key)
    if kind == 'cycle':
        law, consistency = of
        return {'law': law, 'physical_consistency': consistency, 'median': cycle_time(*of)}
    if kind == 'identities':
        return identities()
    is_drawn = kind == 'lambda' or (kind, *of[:2], of[-1]) == ('harmonic', 'iid', _LARGEST, 0)
    return {'key': [kind, *of], **run_case(_loop_case(kind, *of), is_drawn)}


def _loop_case(kind: str, *of: Any) -> LoopCase:
    """The closed loop of a trial, from its key."""
    match kind, *of:
        case 'harmonic', *drawn:
            return _harmonic(*drawn)
        case 'unmeasured', *law:
            return replace(_harmonic('iid', _LARGEST, *law), measures_velocity=False)
        case 'noise', scale, law, consistency, seed:
            exact = _harmonic('iid', _LARGEST, law, consistency, 0)
            return replace(exact, noise=scale, noise_seed=seed)
        case 'period', period:
            settings = AdaptiveSettings(**_FIXED, sampling_check='warn')
            return LoopCase(task='harmonic', settings=settings, period=period)
        case 'orientation', *drawn:
            return _set_point(*drawn)
        case 'lambda', rate:
            return _set_point('true', 0.0, 0, attitude_bandwidth=rate, joint_bandwidth=rate)
        case 'sampling', period, rate, prior, seed:
            eta = 0.0 if prior == 'true' else _LARGEST
            rates = {'kappa': 1.0, 'attitude_bandwidth': rate, 'joint_bandwidth': rate}
            still = _set_point(prior, eta, seed, **rates, sampling_check='warn')
            return replace(still, period=period, duration=60.0)
    raise AssertionError(kind)


def _harmonic(prior: str, eta: float, law: str, consistency: str, seed: int) -> LoopCase:
    shape = _SHAPES[prior]
    settings = AdaptiveSettings(law=law, physical_consistency=consistency, prior_shape=shape)
    if law == 'adaptive_lyapunov_paper':
        settings = replace(settings, adaptation_error=_PAPER_ERROR)
    return LoopCase(task='harmonic', settings=settings, prior=prior, eta=eta, seed=seed)


def _set_point(prior: str, eta: float, seed: int, **values: Any) -> LoopCase:
    settings, still = AdaptiveSettings(**_FIXED, **values), 'orientation'
    return LoopCase(task=still, settings=settings, prior=prior, eta=eta, seed=seed, duration=30.0)


def results(records: Sequence[TrialRecord]) -> Results:
    """All runs, cycle times [us] and identities."""
    of = kinds(records)
    (found,) = of['identities']
    return {
        'runs': [without(r, 'case', 'history') for r in records if 'key' in r],
        'cycle_us': [without(r, 'case') for r in of['cycle']],
        'identities': without(found, 'case'),
    }
