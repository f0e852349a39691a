"""All experiments of the adaptive-control paper on our own robot, and some of ours."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

from ..control.adaptive.settings import AdaptiveSettings
from .adaptive_identities import identities
from .adaptive_judge import judge as judge
from .adaptive_run import TIMED, LoopCase, cycle_time, run_case
from .adaptive_tables import drawings as drawings
from .adaptive_tables import tables as tables
from .description import Record, Results, key, kinds, without

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
"""Laws and their `adaptive.physical_consistency`."""
_UNMEASURED = (('passivity', 'none'), ('adaptive_rls', 'none'), ('adaptive_composite', 'project'))
_NOISY = (('adaptive_rls_paper', 'none'), *_UNMEASURED[1:])
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


def run(key: str) -> Record:
    """Time, measure or simulate."""
    kind, *of = json.loads(key)
    if kind == 'cycle':
        law, consistency = of
        return {'law': law, 'physical_consistency': consistency, 'median': cycle_time(*of)}
    if kind == 'identities':
        return identities()
    is_drawn = kind == 'lambda' or (kind, *of[:2], of[-1]) == ('harmonic', 'iid', _LARGEST, 0)
    return {'key': [kind, *of], **run_case(_CASES[kind](*of), is_drawn)}


def _settings(law: str, consistency: str = 'none', **values: Any) -> AdaptiveSettings:
    """A law at the benchmark's gains."""
    if law == 'adaptive_lyapunov_paper':
        values.setdefault('adaptation_error', _PAPER_ERROR)
    return AdaptiveSettings(law=law, physical_consistency=consistency, **values)


def _harmonic(
    prior: str, eta: float, law: str, consistency: str, seed: int, **more: Any
) -> LoopCase:
    settings = _settings(law, consistency, prior_shape=_SHAPES[prior])
    return LoopCase(task='harmonic', settings=settings, prior=prior, eta=eta, seed=seed, **more)


def _unmeasured(law: str, consistency: str, seed: int) -> LoopCase:
    return _harmonic('iid', _LARGEST, law, consistency, seed, measures_velocity=False)


def _noisy(scale: float, law: str, consistency: str, seed: int) -> LoopCase:
    return _harmonic('iid', _LARGEST, law, consistency, 0, noise=scale, noise_seed=seed)


def _set_point(prior: str, eta: float, seed: int, **rates: Any) -> LoopCase:
    return LoopCase(
        task='orientation',
        settings=_settings('passivity', **rates),
        prior=prior,
        eta=eta,
        seed=seed,
        duration=30.0,
    )


def _lambda(rate: float) -> LoopCase:
    return _set_point('true', 0.0, 0, attitude_bandwidth=rate, joint_bandwidth=rate)


def _sampled(period: float, rate: float, prior: str, seed: int) -> LoopCase:
    rates: Any = {'kappa': 1.0, 'attitude_bandwidth': rate, 'joint_bandwidth': rate}
    settings = _settings('passivity', sampling_check='warn', **rates)
    still = _set_point(prior, 0.0 if prior == 'true' else _LARGEST, seed)
    return replace(still, settings=settings, period=period, duration=60.0)


def _period(period: float) -> LoopCase:
    settings = _settings('passivity', sampling_check='warn')
    return LoopCase(task='harmonic', settings=settings, period=period)


_CASES: dict[str, Callable[..., LoopCase]] = {
    'harmonic': _harmonic,
    'unmeasured': _unmeasured,
    'orientation': _set_point,
    'lambda': _lambda,
    'noise': _noisy,
    'sampling': _sampled,
    'period': _period,
}


def results(records: Sequence[Record]) -> Results:
    """All runs, cycle times [us] and identities."""
    of = kinds(records)
    (found,) = of['identities']
    return {
        'runs': [without(r, 'case', 'history') for r in records if 'key' in r],
        'cycle_us': [without(r, 'case') for r in of['cycle']],
        'identities': without(found, 'case'),
    }
