"""Campaign of faults: odd messages, damaged bags, malformed files, streams that go wrong."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from spacerobot_ros.nodes.program import NODES
from spacerobot_ros.ros.convert import estimate_message
from spacerobot_ros.ros.session import Session

from ..campaigns import Results, TrialRecord, grouped, key, kinds
from .damage import damaged_bag, malformed_file
from .message_fuzz import interleaved
from .process_faults import FLOODED, RELEASED, STOPPED, broken_in_the_loop, flooded
from .process_loop import resident
from .wrong_streams import STREAMS, compared, flight, give, patient_of, undisturbed, wrong_stream

_MESSAGES = 5000  # odd ones of a trial, among 4200 good ones
_FEW = 400  # one odd message in ten, among which the identifier must do as well
_FILES = 50  # of a trial
_KILLS = 5  # of a trial
_FLOOD = 60.0  # s
_HARMLESS = {'refused', 'whole', 'in part', 'loaded'}


_PLACES = {
    'bags': ('cut', 'flipped'),
    'files': ('robot file', 'URDF', 'mapping'),
    'streams': STREAMS,
}


def trials(runs: int, is_quick: bool) -> list[str]:
    """Odd messages and kills for each node, streams that go wrong, damaged, malformed files."""
    return [key(*parts) for parts in _trials(runs, 10 if is_quick else 1)]


def _trials(runs: int, part: int) -> Iterator[tuple[Any, ...]]:
    messages, kills, flood = _MESSAGES // part, max(1, _KILLS // part), _FLOOD / part
    for seed in range(1, runs + 1):
        for node in NODES:
            yield 'kills', node, seed, kills
            yield 'starved', node, seed, kills
        yield 'kills', 'controller in real time', seed, kills
        yield from (('floods', topic, seed, flood) for topic in FLOODED if seed == 1)
        yield from (('messages', node, seed, messages) for node in NODES)
        yield 'messages', 'identifier', seed, _FEW
        for kind, places in _PLACES.items():
            yield from ((kind, what, seed) for what in places)


def run(key: str) -> TrialRecord:
    """One trial."""
    kind, what, *arguments = json.loads(key)
    if kind in _ENDS:
        first = arguments[0] * _FILES
        ends = Counter(_ENDS[kind](what, first + k) for k in range(_FILES))
        return {'what': what, 'ends': dict(ends)}
    few = ', few' if kind == 'messages' and arguments[1] == _FEW else ''
    return {'what': what + few, **_HARM[kind](what, *arguments)}


def odd_messages(node: str, seed: int, count: int) -> TrialRecord:
    """Odd messages among good ones: what they end or spoil."""
    rng = np.random.default_rng(seed)
    stream = [*flight()]
    stream.insert(len(stream) // 2, ('/estimate', estimate_message(undisturbed(), 0)))
    raised: Counter[str] = Counter()
    with Session() as session:
        patient = patient_of(session, node)
        stream = [(topic, message) for topic, message in stream if patient.hears(topic)]
        half = (len(stream) + count) // 2
        before = np.nan
        for k, (topic, message, is_odd) in enumerate(interleaved(stream, count, rng)):
            if k == half:
                before = resident('self')
            give(patient, topic, message, raised, is_good=not is_odd)
            if node == 'simulator' and k % 10 == 0:
                patient.node.step()
            if k % 500 == 0:
                patient.node.health.publish()
        record: TrialRecord = {
            'odd': count,
            'raised': dict(raised),
            'not_finite': dict(Counter(patient.not_finite)),
            'rejected': patient.node.health.count(),
            'grown': resident('self') / before - 1.0,
        }
        if node == 'identifier':
            patient.node.flush()
            record |= compared(patient.node.estimate)
        return record


_ENDS = {'bags': damaged_bag, 'files': malformed_file}
_HARM: dict[str, Callable[..., TrialRecord]] = {
    'messages': odd_messages,
    'floods': flooded,
    'streams': wrong_stream,
    'kills': partial(broken_in_the_loop, 'kills'),
    'starved': partial(broken_in_the_loop, 'starved'),
}


def results(records: Sequence[TrialRecord]) -> Results:
    """By kind of fault and what it was done to."""
    rows = []
    for kind, own in kinds(records).items():
        for what, those in grouped(own, lambda record: record['what']).items():
            rows.append({'fault': kind, 'of': what, **_score(those)})
    return {'faults': rows}


def _score(records: Sequence[TrialRecord]) -> TrialRecord:
    ends: Counter[str] = Counter()
    raised: Counter[str] = Counter()
    for r in records:
        ends.update(r.get('ends', {}))
        raised.update(r.get('raised', {}))
    tried = sum(r.get('odd', 0) for r in records) or sum(ends.values()) or len(records)
    largest = {
        name: max((r[name] for r in records if r.get(name) is not None), default=None)
        for name in ('grown', 'off', 'spread', 'zero', 'known', 'following', 'error')
    }
    return {
        'trials': len(records),
        'tried': tried,
        'raised': dict(raised),
        'harmful': {k: n for k, n in ends.items() if k not in _HARMLESS},
        'harmless': {k: n for k, n in ends.items() if k in _HARMLESS},
        'not_finite': sum(sum(r.get('not_finite', {}).values()) for r in records),
        'invalid': sum(not r['valid'] for r in records if 'valid' in r),
        'alarms': sum(r.get('alarms', 0) for r in records),
        **largest,
    }


def shown(results: Results) -> Results:
    """Messages, streams and files; and what is done to processes."""
    rows = [
        {
            **row,
            **_asked(row['fault'], row['of']),
            **{f'n_{what}': sum(row[what].values()) for what in ('raised', 'harmful')},
            'ended': _listed(row['raised']) or _listed(row['harmful']) or '-',
            'ends': _listed(row['harmless']) or '-',
            'estimate': '-' if row['off'] is None else f'{row["off"]:.2f}, {row["spread"]:.2f}',
        }
        for row in results['faults']
    ]
    loops = [row for row in rows if row['fault'] in ('kills', 'starved')]
    return {'faults': rows, 'loops': loops, 'others': [row for row in rows if row not in loops]}


def _asked(fault: str, of: str) -> TrialRecord:
    """Which figures are asked of a row."""
    is_few = of.endswith(', few')
    return {
        'is_few': is_few,
        'is_estimated': is_few or fault == 'floods',
        'is_long': fault in ('messages', 'floods'),
        'is_killed': fault == 'kills',
        'zero_within': STOPPED if of == 'simulator' else RELEASED,
    }


def _listed(counts: dict[str, int]) -> str:
    return ', '.join(f'{name}: {count}' for name, count in sorted(counts.items()))
