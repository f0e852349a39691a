"""Monitor campaign: false alarms in nominal flight, and delays of detection."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Sequence
from operator import itemgetter

import numpy as np

from ..campaigns import Results, TrialRecord, grouped, key
from .monitor_flights import FAULTS, Flight, in_flight, monitor_of, watch

ROBOTS = ('servicer', 'minisat')
ONSET, END, DURATION = 30.0, 45.0, 75.0
"""Of a flight with a fault [s]."""
_LENGTH, _QUICK_LENGTH = 900.0, 150.0  # s, of a flight without one
_SIZES, _QUICK_SIZES = 4, 1  # largest sizes of a fault that are flown
_LEARNT = 15.0  # s, after which processor time is counted
_TIMED = 60.0  # s of flight whose processor time is counted


def trials(runs: int, is_quick: bool) -> list[str]:
    """Quarter hours without a fault of each robot, and a flight with each fault of each size."""
    robots = ROBOTS[:1] if is_quick else ROBOTS
    length, sizes = (_QUICK_LENGTH, _QUICK_SIZES) if is_quick else (_LENGTH, _SIZES)
    quiet = [key('nominal', robot, seed + 1, length) for robot in robots for seed in range(runs)]
    return quiet + [
        key('faulty', robot, 1, name, size)
        for name, fault in FAULTS.items()
        for robot in robots
        for size in (fault.sizes[-sizes:] if robot in fault.robots else ())
    ]


def run(key: str) -> TrialRecord:
    """One flight."""
    kind, *arguments = json.loads(key)
    return (nominal if kind == 'nominal' else faulty)(*arguments)


def nominal(robot: str, seed: int, length: float) -> TrialRecord:
    """One flight without a fault: alarms, largest evidence, share of a core."""
    flight = Flight(robot=robot, seed=seed)
    monitor, largest = monitor_of(flight), 0.0
    for state in watch(monitor, flight.samples(length)):
        largest = max([largest, *(c.evidence for c in state.channels)])
    return {
        'robot': robot,
        'length': length,
        'alarms': monitor.state.alarms,
        'first': monitor.state.first,
        'largest_evidence': largest,
        'share_of_a_core': _processor_time(flight) / _TIMED,
    }


def _processor_time(flight: Flight) -> float:
    """What the monitor takes for `_TIMED` of flight, once it has learnt [s]."""
    samples = list(flight.samples(_LEARNT + _TIMED))
    monitor = monitor_of(flight)
    learnt = next(k for k, s in enumerate(samples) if s.stamp_ns >= _LEARNT * 1e9)
    for _ in watch(monitor, samples[:learnt]):
        pass
    start = time.process_time()
    for _ in watch(monitor, samples[learnt:]):
        pass
    return time.process_time() - start


def faulty(robot: str, seed: int, name: str, size: float) -> TrialRecord:
    """One flight with a fault: when it was raised, what spoke first, when it was cleared [s]."""
    flight = in_flight(name, size, Flight(robot=robot, seed=seed, onset=ONSET, end=END))
    raised, early, cleared, first = None, 0, None, ''
    for state in watch(monitor_of(flight), flight.samples(DURATION)):
        now, is_raised = (state.judged_ns or 0) * 1e-9, state.raised_ns is not None
        early += is_raised and now < ONSET
        if is_raised and now >= ONSET and raised is None:
            raised, first = now - ONSET, state.first
        if raised is not None and cleared is None and not is_raised and now > END:
            cleared = now - END
    return {
        'robot': robot,
        'fault': name,
        'size': size,
        'early': early,
        'raised': raised,
        'first': first,
        'cleared': cleared,
    }


def results(records: Sequence[TrialRecord]) -> Results:
    """As `monitor`, by robot what its flights without a fault came to, and of each fault."""
    quiet = grouped((x for x in records if 'fault' not in x), itemgetter('robot'))
    loud = grouped((x for x in records if 'fault' in x), itemgetter('robot', 'fault', 'size'))
    nominal = {robot: _nominal_score(own) for robot, own in quiet.items()}
    names = ('robot', 'fault', 'size', 'unit')
    faults = [
        {**dict(zip(names, (*of, FAULTS[of[1]].unit), strict=True)), **_fault_score(own)}
        for of, own in loud.items()
    ]
    return {'monitor': {'nominal': nominal, 'faults': faults}}


def _nominal_score(flights: Sequence[TrialRecord]) -> TrialRecord:
    return {
        'flights': len(flights),
        'hours': sum(x['length'] for x in flights) / 3600.0,
        'alarms': sum(x['alarms'] for x in flights),
        'first': _first(flights),
        'largest_evidence': max(x['largest_evidence'] for x in flights),
        'share_of_a_core': float(np.median([x['share_of_a_core'] for x in flights])),
    }


def _fault_score(flights: Sequence[TrialRecord]) -> TrialRecord:
    """Delays are medians, infinite where most flights have none."""
    return {
        'flights': len(flights),
        'raised': sum(x['raised'] is not None for x in flights),
        'early': sum(x['early'] for x in flights),
        'delay': _median(flights, 'raised'),
        'cleared': _median(flights, 'cleared'),
        'first': _first(flights),
    }


def _first(flights: Sequence[TrialRecord]) -> list[str]:
    return sorted({x['first'] for x in flights if x['first']})


def _median(flights: Sequence[TrialRecord], name: str) -> float:
    return float(np.median([math.inf if x[name] is None else x[name] for x in flights]))


def shown(results: Results) -> Results:
    """With alarms before any fault, and which faults are the largest."""
    nominal, faults = results['monitor']['nominal'], results['monitor']['faults']
    largest = [f['size'] == FAULTS[f['fault']].sizes[-1] for f in faults]
    rows = [{**f, 'is_largest': x} for f, x in zip(faults, largest, strict=True)]
    early = sum(f['early'] for f in faults)
    return {'monitor': {'nominal': nominal, 'faults': rows, 'early': early}}
