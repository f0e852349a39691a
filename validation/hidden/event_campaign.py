"""Campaign of events: pulses of a known size on machines that are drawn, and none.

Every machine is recorded in quiet first. What is named there is false, and its limits give the
standard deviation by which the pulses of a second recording are sized. A push of an arm that
stands is sized by the limit itself: its friction takes as much of each as it can.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from itertools import chain
from operator import itemgetter
from typing import Any

import numpy as np

from spacerobot_ros.diagnosis.events.event import Event, Events, PossibleEvent
from spacerobot_ros.diagnosis.events.naming_rule import ROOM
from spacerobot_ros.diagnosis.limits import EVENT

from ..campaigns import Results, TrialRecord, grouped, key
from ..shares import share_of
from .event_machines import AXES, MACHINES, DrawnMachine, HiddenPulse

_UNSURE = 2.5  # standard deviations of a middle
_WORDS = {
    'moving': ('arms that move', 'snr'),
    'still': ('joints that stand', 'limits'),
    'base': ('free bases, wheels unknown', 'snr'),
    'lone': ('bodies without joints', 'snr'),
}


def results(records: Sequence[TrialRecord]) -> Results:
    """As `events`: names, times and sizes by machine and size of the pulse, and false events."""
    groups, quiet = [], []
    for kind, own in grouped(records, itemgetter('kind')).items():
        machines, by = _WORDS[kind]
        quiet.append({'machines': machines, **_quiet(own)})
        pulses = grouped(chain.from_iterable(r['pulses'] for r in own), itemgetter('ratio'))
        groups += [
            {'kind': kind, 'what': f'{machines}, {by} {ratio:g}', 'ratio': ratio, **_score(some)}
            for ratio, some in sorted(pulses.items())
        ]
    return {'events': {'groups': groups, 'quiet': quiet}}


def _score(pulses: Sequence[TrialRecord]) -> dict[str, Any]:
    reasons = Counter(p['reason'] for p in pulses if not p['is_named'])
    out = {
        'named': share_of(p['is_named'] for p in pulses),
        'reasons': ', '.join(f'{reason} {n}' for reason, n in reasons.most_common()) or '-',
    }
    named = [p for p in pulses if p['is_named']]
    values = {name: [abs(p[name]) for p in named] for name in ('off', 'error')}
    values['allowed'] = [p['allowed'] for p in pulses if p['allowed']]
    values['by_std'] = [abs(p['off']) / p['off_std'] for p in named if p['off_std']]
    for name, own in values.items():
        out |= {f'{name}_{q}': float(np.percentile(own or [np.nan], q)) for q in (50, 95)}
    return out


def _quiet(records: Sequence[TrialRecord]) -> dict[str, Any]:
    hours = sum(r['seconds'] for r in records) / 3600.0
    false = [e['z'] for r in records for e in r['false']]
    return {
        'records': len(records),
        'hours': hours,
        'false': len(false),
        'per_hour': len(false) / hours,
        'largest': max(false, default=float('nan')),
        'beside': sum(len(r['beside']) for r in records),
        'unjudged': sum(not r['pulses'] for r in records),
    }


def shown(results: Results) -> Results:
    """With which figures are asked of a group: names, sizes, and times."""
    groups = []
    for g in results['events']['groups']:
        is_sized = g['kind'] != 'still' and g['ratio'] >= ROOM * EVENT
        timed = is_sized and bool(g['named'].hits)
        named = {'is_named': g['kind'] == 'still' or is_sized, 'is_timed': timed}
        groups.append({**g, **named, 'by_end': timed and bool(np.isnan(g['by_std_95']))})
    return {'events': {**results['events'], 'groups': groups}}


_KINDS = ('moving', 'still', 'base', 'moving', 'lone')
_SHORTEST, _LONGEST = 0.3, 2.0  # s
_ENDS, _APART = 2.5, 0.5  # s: of a recording without pulses, and at least between two


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every kind of machine in turn."""
    return [key(kind, 10 * s + n) for s in range(runs) for n, kind in enumerate(_KINDS)]


def run(key: str) -> TrialRecord:
    """Ask about a quiet recording, hide pulses, ask again."""
    kind, seed = json.loads(key)
    machine: DrawnMachine = MACHINES[kind](seed)
    quiet = machine.found(())
    pulses = _drawn(machine, quiet, np.random.default_rng([seed, 17]))
    found = machine.found(pulses)
    matched = [_match(p, found) for p in pulses]
    return {
        'kind': kind,
        'machine': machine.words,
        'seconds': machine.seconds,
        'false': [_event_row(e) for e in quiet.named],
        'beside': [_event_row(e) for e in found.named if not any(e is m for m in matched)],
        'pulses': [_judged(p, m, found) for p, m in zip(pulses, matched, strict=True)],
    }


def _drawn(machine: DrawnMachine, quiet: Events, rng: np.random.Generator) -> list[HiddenPulse]:
    """Pulses of all sizes one after another; none where nothing is said of quiet times."""
    count = len(machine.ratios)
    length = (machine.seconds - 2.0 * _ENDS) / count
    ratios, spans = rng.permutation(machine.ratios).tolist(), []
    for k in range(count):
        duration = float(rng.uniform(_SHORTEST, _LONGEST))
        start = _ENDS + length * k + float(rng.uniform(0.0, length - _APART - duration))
        spans.append((start, duration))
    units = machine.units(rng, quiet, spans) or ()
    return [
        HiddenPulse(where, start, duration, ratio * size, ratio, std)
        for (where, size, std), (start, duration), ratio in zip(units, spans, ratios, strict=False)
    ]


def _match(p: HiddenPulse, found: Events) -> Event | None:
    """The named event that is nearest in time and felt where the pulse acts."""
    near = [e for e in found.named if _is_meant(p, e, _UNSURE * (e.middle_std or 0.0))]
    return min(near, key=lambda e: abs(_off(p, e)), default=None)


def _is_meant(p: HiddenPulse, e: Event | PossibleEvent, unsure: float = 0.0) -> bool:
    """Whether they overlap, as far as times are known, and are felt at one place."""
    overlaps = e.start - unsure < p.start + p.duration and p.start < e.end + unsure
    return overlaps and (p.where is None or p.where in e.joints)


def _off(p: HiddenPulse, e: Event) -> float:
    return 0.5 * (e.start + e.end) - p.start - 0.5 * p.duration


def _event_row(e: Event) -> TrialRecord:
    return {'start': e.start, 'end': e.end, 'joints': list(e.joints), 'z': e.z}


def _judged(p: HiddenPulse, e: Event | None, found: Events) -> TrialRecord:
    """A pulse and what was said of it; without a name the reason with which it was listed."""
    listed = (o.reason for o in found.possible if _is_meant(p, o))
    size, names = np.atleast_1d(p.size), AXES if p.where is None else (p.where,)
    error = e and float(np.linalg.norm([e.peak[n] for n in names] - size) / np.linalg.norm(size))
    return {
        'where': p.where,
        'start': p.start,
        'duration': p.duration,
        'size': size.tolist(),
        'ratio': p.ratio,
        'allowed': None if np.isnan(p.std) else p.std / float(np.linalg.norm(size)),
        'is_named': e is not None,
        'z': e and e.z,
        'off': e and _off(p, e),
        'off_std': e and e.middle_std,
        'error': error,
        'reason': None if e else next(listed, 'unseen'),
    }
