"""Campaign of events: pulses of a known size on machines that are drawn, and none.

Every machine is recorded in quiet first. What is named there is false, and its limits give the
standard deviation by which the pulses of a second recording are sized. A push of an arm that
stands is sized by the limit itself: its friction takes as much of each as it can.
"""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from ..diagnosis.events.event import Event, Events
from .description import Record, key
from .event_campaign_tables import judge as judge
from .event_campaign_tables import results as results
from .event_campaign_tables import tables as tables
from .event_machines import AXES, MACHINES, DrawnMachine, HiddenPulse

_KINDS = ('moving', 'still', 'base', 'moving', 'lone')
_SHORTEST, _LONGEST = 0.3, 2.0  # s
_ENDS, _APART = 2.5, 0.5  # s: of a recording without pulses, and at least between two


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every kind of machine in turn."""
    return [key(kind, 10 * s + n) for s in range(runs) for n, kind in enumerate(_KINDS)]


def run(key: str) -> Record:
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
        'false': [_said(e) for e in quiet.named],
        'beside': [_said(e) for e in found.named if not any(e is m for m in matched)],
        'pulses': [_judged(p, m, found) for p, m in zip(pulses, matched, strict=True)],
    }


def _drawn(machine: DrawnMachine, quiet: Events, rng: np.random.Generator) -> list[HiddenPulse]:
    """Pulses of all sizes one after another; none where nothing is said of quiet times."""
    count = len(machine.ratios)
    length = (machine.seconds - 2.0 * _ENDS) / count
    out = []
    for k, ratio in enumerate(rng.permutation(machine.ratios).tolist()):
        duration = float(rng.uniform(_SHORTEST, _LONGEST))
        start = _ENDS + length * k + float(rng.uniform(0.0, length - _APART - duration))
        unit = machine.unit(rng, quiet, duration)
        if unit is not None:
            out.append(HiddenPulse(unit[0], start, duration, ratio * np.asarray(unit[1]), ratio))
    return out


def _match(p: HiddenPulse, found: Events) -> Event | None:
    """The named event that is nearest in time and felt where the pulse acts."""
    near = [e for e in found.named if _is_meant(p, e.start, e.end, e.joints)]
    return min(near, key=lambda e: abs(_off(p, e)), default=None)


def _is_meant(p: HiddenPulse, start: float, end: float, joints: Sequence[str]) -> bool:
    overlaps = start < p.start + p.duration and p.start < end
    return overlaps and (p.where is None or p.where in joints)


def _off(p: HiddenPulse, e: Event) -> float:
    return 0.5 * (e.start + e.end) - p.start - 0.5 * p.duration


def _said(e: Event) -> Record:
    return {'start': e.start, 'end': e.end, 'joints': list(e.joints), 'z': e.z}


def _judged(p: HiddenPulse, e: Event | None, found: Events) -> Record:
    """A pulse and what was said of it; without a name the reason with which it was listed."""
    listed = (o.reason for o in found.possible if _is_meant(p, o.start, o.end, o.joints))
    size, names = np.atleast_1d(p.size), AXES if p.where is None else (p.where,)
    error = e and float(np.linalg.norm([e.peak[n] for n in names] - size) / np.linalg.norm(size))
    return {
        'where': p.where,
        'start': p.start,
        'duration': p.duration,
        'size': size.tolist(),
        'ratio': p.ratio,
        'is_named': e is not None,
        'z': e and e.z,
        'off': e and _off(p, e),
        'off_std': e and e.middle_std,
        'error': error,
        'reason': None if e else next(listed, 'unseen'),
    }
