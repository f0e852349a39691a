"""What the campaign of unknown laws came to: variables, transfer, false discoveries."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from ..display import Table, table_of
from .description import Check, Record, Results, grouped
from .hidden_laws import INSIDE
from .shares import share_of

FLIGHT = 'in flight'
"""In place of the noise's colour: free bases, their sensors' noise white."""

# figures to reach
_RIGHT = {3.0: (0.95, 1.0), 1.0: (0.7, 1.0)}
_OUTSIDE = (0.7, 1.0)
_WRONG = {3.0: (0.0, 0.05), 1.0: (0.0, 0.0)}
_WRONG_OUTSIDE = (0.0, 0.02)
_TRANSFER = {3.0: (0.95, 1.0)}
_TRANSFER_OUTSIDE = (0.8, 1.0)
_FALSE = (0.0, 0.01)


def results(records: Sequence[Record]) -> Results:
    """As `discovery`: shares by ratio, law and colour, and of machines without a law."""
    hidden = [r for r in records if r['kind'] == 'law']
    clean = [r for r in records if r['kind'] == 'clean']
    flown = [r for r in hidden if r['colour'] == FLIGHT]
    held = [r for r in hidden if r['colour'] != FLIGHT]
    inside = [r for r in held if r['law'] in INSIDE]
    outside = [r for r in held if r['law'] not in INSIDE]
    groups = {
        **{f'inside, ratio {ratio:g}': own for ratio, own in grouped(inside, _RATIO).items()},
        **({'outside, ratio 3': outside} if outside else {}),
        **({'free bases, ratio 3': flown} if flown else {}),
    }
    return {
        'discovery': {
            'groups': [{'group': name, **_score(own)} for name, own in groups.items()],
            'laws': [
                {'law': law + where, 'ratio': ratio, **_score(own)}
                for where, some in (('', held), (f', {FLIGHT}', flown))
                for (law, ratio), own in grouped(some, itemgetter('law', 'ratio')).items()
            ],
            'false': share_of(any(s['form'] is not None for s in r['said']) for r in clean),
            'timed': share_of(any(s['depends_on'] == ['time'] for s in r['said']) for r in clean),
            'false_claims': [
                [r['colour'], s['channel'], s['form'], *s['depends_on']]
                for r in clean
                for s in r['said']
                if s['form'] is not None
            ],
            'beside': share_of(_has_other(r) for r in hidden),
            'wall': float(np.median([r['wall_s'] for r in records])),
        }
    }


_RATIO = itemgetter('ratio')


def _is_claimed(said: Record) -> bool:
    return said['form'] is not None or said['depends_on'] == ['time']


def _own(record: Record) -> list[Record]:
    claims = (s for s in record['said'] if s['channel'] == record['where'])
    return [s for s in claims if _is_claimed(s)]


def _is_right(record: Record) -> bool:
    """Whether any claim of the law's joint has its variables, all of them and no others."""
    return any(set(s['depends_on']) == set(record['variables']) for s in _own(record))


def _is_wrong(record: Record) -> bool:
    return bool(_own(record)) and not _is_right(record)


def _is_taken(record: Record) -> bool:
    """Whether a cause of the catalogue at the joint stands in the law's place."""
    return not _own(record) and any(where == record['where'] for _, where in record['named'])


def _has_other(record: Record) -> bool:
    claims = (s for s in record['said'] if s['channel'] != record['where'])
    return any(map(_is_claimed, claims))


def _score(records: Sequence[Record]) -> dict[str, Any]:
    found = [r['r2'] for r in records if _is_right(r) and r['variables'] != ['time']]
    return {
        'right': share_of(map(_is_right, records)),
        'wrong': share_of(map(_is_wrong, records)),
        'taken': share_of(map(_is_taken, records)),
        'transfer': float(np.median(found)) if found else float('nan'),
        'worst': float(np.quantile(found, 0.1)) if found else float('nan'),
    }


def judge(results: Results) -> list[Check]:
    """Right variables, laws that hold on other motions, few false ones."""
    out = []
    for s in results['discovery']['groups']:
        ratio, is_outside = float(s['group'].rpartition(' ')[2]), s['group'].startswith('outside')
        right = _OUTSIDE if is_outside else _RIGHT[ratio]
        wrong = _WRONG_OUTSIDE if is_outside else _WRONG[ratio]
        out.append(Check(f'{s["group"]}: variables right', s['right'].value, *right))
        out.append(Check(f'{s["group"]}: variables wrong', s['wrong'].value, *wrong))
        transfer = _TRANSFER_OUTSIDE if is_outside else _TRANSFER.get(ratio)
        if transfer and np.isfinite(s['transfer']):
            out.append(Check(f'{s["group"]}: median R2, other motion', s['transfer'], *transfer))
    if results['discovery']['false'].total:
        value = results['discovery']['false'].value
        out.append(Check('machines without a law with a discovery', value, *_FALSE))
    return out


def tables(results: Results) -> list[Table]:
    """Groups, laws, machines without one."""
    s = results['discovery']
    columns = 'variables right | wrong | a named cause instead | median R2 | tenth'
    form = '{right} | {wrong} | {taken} | {transfer:.3f} | {worst:.2f}'
    return [
        table_of(
            'Laws',
            'variables of the law at its joint; R2 of its torque on another motion, where found; '
            'shares with their 95 % intervals (Wilson)',
            s['groups'],
            f'laws | {columns}',
            '{group} | ' + form,
        ),
        table_of(
            'Every law', '', s['laws'], f'law | ratio | {columns}', '{law} | {ratio:g} | ' + form
        ),
        table_of(
            'Machines without a law',
            "laws or clocks claimed at any of their joints, and at other joints than the law's",
            [{**s, 'claims': _listed(s['false_claims'])}],
            'with a law | which | with a function of time | a law, and a claim elsewhere | '
            'median time [s]',
            '{false} | {claims} | {timed} | {beside} | {wall:.2g}',
        ),
    ]


def _listed(claims: Iterable[Sequence[str | None]]) -> str:
    return '; '.join(', '.join(str(word) for word in claim) for claim in claims) or '-'
