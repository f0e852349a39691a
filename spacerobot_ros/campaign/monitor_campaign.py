"""Monitor campaign: false alarms in nominal flight, and delays of detection.

One line of JSON a finished flight in `monitor.jsonl`: a campaign that was interrupted goes on from
there, and more flights add to those there are.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .checks import Check
from .monitor_faults import FAULTS, in_flight
from .monitor_flights import Flight, monitor_of, watch
from .resumable import Line, run_resumable
from .tasks import Task

FILE = 'monitor.jsonl'
ROBOTS = ('servicer', 'minisat')
ONSET, END, DURATION = 30.0, 45.0, 75.0
"""Of a flight with a fault [s]."""
_LEARNT = 15.0  # s, after which processor time is counted
_TIMED = 60.0  # s of flight whose processor time is counted
_WITHIN = 5.0  # s, in which the largest size of a fault is to be raised


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How much is flown.

    Args:
        flights: Without a fault, of each robot.
        length: Of such a flight [s].
        seeds: Of every fault and size, on each robot.
        sizes: Largest sizes of a fault that are flown.
        robots: Some of `ROBOTS`.
        workers: Processes.
    """

    flights: int = 4
    length: float = 900.0
    seeds: int = 1
    sizes: int = 4
    robots: tuple[str, ...] = ROBOTS
    workers: int = 2

    @classmethod
    def quick(cls, workers: int, flights: int) -> Options:
        """Five minutes of one robot, and each fault's largest size."""
        return cls(flights=flights, length=150.0, sizes=1, robots=('servicer',), workers=workers)


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorScores:
    """A campaign.

    Args:
        nominal: By robot, what its flights without a fault came to.
        faults: By robot, fault and size, what the flights with it came to.
    """

    nominal: dict[str, Line]
    faults: dict[tuple[str, str, float], Line]


def tasks(options: Options) -> list[Task]:
    """Every flight of a campaign."""
    return list(_tasks(options))


def _tasks(options: Options) -> Iterator[Task]:
    for robot in options.robots:
        for seed in range(1, options.flights + 1):
            yield _task(nominal, robot, seed, options.length)
    for name, fault in FAULTS.items():
        for robot in options.robots:
            for size in fault.sizes[-options.sizes :] if robot in fault.robots else ():
                for seed in range(1, options.seeds + 1):
                    yield _task(faulty, robot, seed, name, size)


def _task(function: Callable[..., Line], *arguments: Any) -> Task:
    key = json.dumps([function.__name__, *arguments])
    return Task(key, function, (key, *arguments))


def run_campaign(folder: Path, options: Options, done: Callable[[], None]) -> list[Line]:
    """Make the flights that a folder lacks.

    Returns:
        Every flight of the campaign, in its order.

    Raises:
        RecordingError: the folder's file is not a campaign's.
    """
    return run_resumable(folder / FILE, tasks(options), options.workers, done)


def nominal(key: str, robot: str, seed: int, length: float) -> Line:
    """One flight without a fault: alarms, largest evidence, share of a core."""
    flight = Flight(robot=robot, seed=seed)
    monitor, largest = monitor_of(flight), 0.0
    for state in watch(monitor, flight.samples(length)):
        largest = max([largest, *(c.evidence for c in state.channels)])
    return {
        'case': key,
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


def faulty(key: str, robot: str, seed: int, name: str, size: float) -> Line:
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
        'case': key,
        'robot': robot,
        'fault': name,
        'size': size,
        'early': early,
        'raised': raised,
        'first': first,
        'cleared': cleared,
    }


def score_monitor(lines: Sequence[Line]) -> MonitorScores:
    """All scores of finished flights."""
    quiet: dict[str, list[Line]] = {}
    loud: dict[tuple[str, str, float], list[Line]] = {}
    for line in lines:
        if 'fault' in line:
            loud.setdefault((line['robot'], line['fault'], line['size']), []).append(line)
        else:
            quiet.setdefault(line['robot'], []).append(line)
    return MonitorScores(
        nominal={robot: _nominal_score(own) for robot, own in quiet.items()},
        faults={key: _fault_score(own) for key, own in loud.items()},
    )


def _nominal_score(lines: Sequence[Line]) -> Line:
    return {
        'flights': len(lines),
        'hours': sum(x['length'] for x in lines) / 3600.0,
        'alarms': sum(x['alarms'] for x in lines),
        'first': sorted({x['first'] for x in lines if x['first']}),
        'largest_evidence': max(x['largest_evidence'] for x in lines),
        'share_of_a_core': float(np.median([x['share_of_a_core'] for x in lines])),
    }


def _fault_score(lines: Sequence[Line]) -> Line:
    """Delays are medians, infinite where most flights have none."""
    return {
        'flights': len(lines),
        'raised': sum(x['raised'] is not None for x in lines),
        'early': sum(x['early'] for x in lines),
        'delay': _median(lines, 'raised'),
        'cleared': _median(lines, 'cleared'),
        'first': sorted({x['first'] for x in lines if x['first']}),
    }


def _median(lines: Sequence[Line], name: str) -> float:
    return float(np.median([math.inf if x[name] is None else x[name] for x in lines]))


def monitor_checks(s: MonitorScores) -> list[Check]:
    """The figures to reach."""
    out = [
        Check(f'alarms in {own["hours"]:.3g} h of nominal flight, {robot}', own['alarms'], 0, 0)
        for robot, own in s.nominal.items()
    ]
    early = sum(own['early'] for own in s.faults.values())
    out.append(Check('alarms before a fault', early, 0, 0))
    for (robot, name, size), own in s.faults.items():
        if size == FAULTS[name].sizes[-1]:
            what = f'delay of the alarm, {name} of {size:g} {FAULTS[name].unit}, {robot}'
            out.append(Check(what, own['delay'], 0.0, _WITHIN, 's'))
    return out
