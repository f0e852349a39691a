"""What the campaign of unknown laws came to: variables, transfer, false discoveries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..campaigns import Check, Results, TrialRecord, grouped
from ..shares import share_of
from .hidden_laws import INSIDE

LOOPS = ('free base', 'fixed base')
"""In place of the noise's colour: robots in closed loop, their sensors' noise white."""

_OF_CAUSES = {
    'joint_coulomb_friction': ('rate',),
    'joint_viscous_friction': ('rate',),
    'joint_stribeck_friction': ('rate',),
    'joint_friction_curvature': ('rate',),
    'joint_load_friction': ('rate', 'load'),
    'joint_presliding_friction': ('angle',),
    'joint_stiffness': ('angle',),
    'joint_torque_ripple': ('angle',),
}
"""Variables of what the catalogue has, as the grammar has them: of a history the angle."""
_OUTCOMES = ('own', 'named', 'false', 'misnamed', 'line', 'missed')
"""A law with the right variables; causes in its place that have them all and no others, and hold
on another motion; a law of others; other causes; only the line of a noise that is one; none, or
a function of the time that may be of these variables as well."""

# figures to reach, of laws in the grammar by their size over what is left, and of others
_RIGHT = {3.0: (0.95, 1.0), 1.0: (0.7, 1.0)}  # shares with the right variables
_OUTSIDE = (0.7, 1.0)
_WRONG = {3.0: (0.0, 0.05), 1.0: (0.0, 0.0)}  # and with wrong ones
_WRONG_OUTSIDE = (0.0, 0.02)
_TRANSFER = {3.0: (0.95, 1.0)}  # median R2 on another motion
_TRANSFER_OUTSIDE = (0.8, 1.0)
_FALSE = (0.0, 0.01)  # of machines without a law: `discovery_limits.CHANCE`
_REMOVED = (0.8, 1.0)  # of the tracking error that a law causes, median
_BEYOND = (0.0, 1.5)  # of the largest trained torque, at three times the speed
_FED = (0.0, 1e-6)  # of what friction exchanges


def results(records: Sequence[TrialRecord]) -> Results:
    """As `discovery`: shares by machine, ratio and law, and of machines without a law."""
    hidden = [r for r in records if r['kind'] == 'law']
    clean = [r for r in records if r['kind'] == 'clean']
    return {
        'discovery': {
            'groups': [{'group': g, **_score(own)} for g, own in grouped(hidden, _group).items()],
            'laws': [
                {'law': ', '.join(own), 'ratio': ratio, **_score(some)}
                for (ratio, *own), some in grouped(hidden, _law).items()
            ],
            'applied': [
                {'machines': machines, **_applied(own)}
                for machines, own in grouped(hidden, _machine).items()
            ],
            'false': share_of(any(s['form'] is not None for s in r['claims']) for r in clean),
            'timed': share_of(
                any(s['depends_on'] == ['time'] for s in r['claims']) for r in clean
            ),
            'false_claims': [
                [r['colour'], s['channel'], s['form'], *s['depends_on']]
                for r in clean
                for s in r['claims']
                if s['form'] is not None
            ],
            'beside': share_of(_has_other(r) for r in hidden),
            'wall': float(np.median([r['wall_s'] for r in records])),
        }
    }


def _machine(record: TrialRecord) -> str:
    return f'{record["colour"]}, closed loop' if record['colour'] in LOOPS else 'arms'


def _group(record: TrialRecord) -> str:
    where = 'inside' if record['law'] in (*INSIDE, 'field') else 'outside'
    return f'{_machine(record)}, {where}, ratio {record["ratio"]:g}'


def _law(record: TrialRecord) -> tuple[float, str, str]:
    return record['ratio'], record['law'], _machine(record)


def _applied(records: Sequence[TrialRecord]) -> dict[str, Any]:
    """What learned laws do for a controller, and beyond their data."""
    removed = [r['removed'] for r in records if r['removed'] is not None and _is_right(r)]
    beyond = [r['beyond'] for r in records if r['beyond']]
    size, fed = np.max(beyond or [[np.nan, np.nan]], axis=0)
    return {
        'fed_forward': len(removed),
        'removed': float(np.median(removed or [np.nan])),
        'least': float(np.quantile(removed or [np.nan], 0.1)),
        'learned': len(beyond),
        'beyond': float(size),
        'fed_in': float(fed),
    }


def _is_claimed(claim: TrialRecord) -> bool:
    return claim['form'] is not None or claim['depends_on'] == ['time']


def _own(record: TrialRecord) -> list[TrialRecord]:
    claims = (s for s in record['claims'] if s['channel'] == record['where'])
    return [s for s in claims if _is_claimed(s)]


def _is_open(claim: TrialRecord, variables: Sequence[str]) -> bool:
    """Whether a function of the time is said to be one of the law's variables as well."""
    return any(set(own) == set(variables) for own in claim['rivals'])


def _is_right(record: TrialRecord) -> bool:
    """Whether any claim of the law's joint has its variables, all of them and no others."""
    return any(set(s['depends_on']) == set(record['variables']) for s in _own(record))


def _is_explained(record: TrialRecord) -> bool:
    """Whether causes that are named at the joint have its variables, and hold elsewhere.

    What the catalogue has, or comes close to, has its best answer there.
    """
    place = record['where']
    own = [_OF_CAUSES.get(kind, ('other',)) for kind, where in record['named'] if where == place]
    named = {f'{quantity}/{place}' for quantities in own for quantity in quantities}
    return named == set(record['variables']) and record['r2'] > _TRANSFER_OUTSIDE[0]


def _outcome(record: TrialRecord) -> str:
    """What the answer says of the law's joint, see `_OUTCOMES`."""
    own, has_line = _own(record), record['colour'] == 'line'
    if _is_right(record):
        return 'own'
    own = [s for s in own if s['form'] is not None or not _is_open(s, record['variables'])]
    if any(s['form'] is not None or not has_line for s in own):
        return 'false'
    if _is_explained(record):
        return 'named'
    if any(where in (record['where'], None) for _, where in record['named']):
        return 'misnamed'
    return 'line' if own else 'missed'


def _has_other(record: TrialRecord) -> bool:
    claims = (s for s in record['claims'] if s['channel'] != record['where'])
    return any(map(_is_claimed, claims))


def _score(records: Sequence[TrialRecord]) -> dict[str, Any]:
    found = [r['r2'] for r in records if _is_right(r) and r['variables'] != ['time']]
    outcomes = [_outcome(r) for r in records]
    return {
        'right': share_of(outcome in ('own', 'named') for outcome in outcomes),
        'wrong': share_of(outcome in ('false', 'misnamed') for outcome in outcomes),
        **{name: outcomes.count(name) for name in _OUTCOMES},
        'transfer': float(np.median(found)) if found else float('nan'),
        'worst': float(np.quantile(found, 0.1)) if found else float('nan'),
    }


def judge(results: Results) -> list[Check]:
    """Right variables, laws that hold on other motions, few false ones."""
    out = []
    for s in results['discovery']['groups']:
        ratio, is_outside = float(s['group'].rpartition(' ')[2]), ', outside' in s['group']
        right = _OUTSIDE if is_outside else _RIGHT[ratio]
        wrong = _WRONG_OUTSIDE if is_outside else _WRONG[ratio]
        out.append(Check(f'{s["group"]}: variables right', s['right'].value, *right))
        out.append(Check(f'{s["group"]}: variables wrong', s['wrong'].value, *wrong))
        transfer = _TRANSFER_OUTSIDE if is_outside else _TRANSFER.get(ratio)
        if transfer and np.isfinite(s['transfer']):
            out.append(Check(f'{s["group"]}: median R2, other motion', s['transfer'], *transfer))
    for s in results['discovery']['applied']:
        if s['fed_forward']:
            what = f'{s["machines"]}: tracking error by the law that is removed, median'
            out.append(Check(what, s['removed'], *_REMOVED))
        if s['learned']:
            what = f'{s["machines"]}: torque at three times the speed, by the largest trained'
            out.append(Check(what, s['beyond'], *_BEYOND))
            out.append(Check(f'{s["machines"]}: power that friction feeds in', s['fed_in'], *_FED))
    if results['discovery']['false'].total:
        value = results['discovery']['false'].value
        out.append(Check('machines without a law with a discovery', value, *_FALSE))
    return out


def shown(results: Results) -> Results:
    """With false claims as text."""
    claims = (', '.join(map(str, claim)) for claim in results['discovery']['false_claims'])
    return {**results, 'claims': '; '.join(claims) or '-'}
