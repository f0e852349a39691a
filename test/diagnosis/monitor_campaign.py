"""False alarms in hours of nominal flight, and delays of detection, of the monitor.

python test/diagnosis/monitor_campaign.py nominal --hours 10 --out out/monitor_nominal.jsonl
python test/diagnosis/monitor_campaign.py faults --runs 10 --out out/monitor_faults.jsonl

Flights are seeded; each leaves one line in the file, and those that are there are not flown again.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1])]

from support.faults_in_flight import FAULTS, in_flight  # noqa: E402
from support.flights import Flight, monitor_of, watch  # noqa: E402

HOUR = 3600.0
PART = 900.0  # s; of one nominal flight
ONSET, END, DURATION = 30.0, 45.0, 75.0


def nominal(seed: int, robot: str, duration: float) -> dict:
    """One flight without a fault: alarms, largest evidence, share of a core."""
    flight = Flight(robot=robot, seed=seed)
    monitor, worst = monitor_of(flight), 0.0
    for state in watch(monitor, flight.samples(duration)):
        worst = max([worst, *(c.evidence for c in state.channels)])
    return {
        'robot': robot, 'seed': seed, 'duration': duration,
        'alarms': monitor.state.alarms, 'reason': monitor.state.first,
        'largest_evidence': worst, 'share_of_a_core': monitor_seconds(flight) / 60.0,
    }  # fmt: skip


def monitor_seconds(flight: Flight) -> float:
    """CPU time that the monitor takes for 60 s of flight, once it has learned [s]."""
    samples = list(flight.samples(75.0))
    monitor = monitor_of(flight)
    for _ in watch(monitor, samples[:1500]):
        pass
    start = time.process_time()
    for _ in watch(monitor, samples[1500:]):
        pass
    return time.process_time() - start


def fault(name: str, size: float, seed: int, robot: str) -> dict:
    """One flight with a fault: when it was raised, what spoke first, when it was cleared."""
    flight = in_flight(name, size, Flight(robot=robot, seed=seed, onset=ONSET, end=END))
    monitor = monitor_of(flight)
    raised, early, cleared, first, reason = None, 0, None, '', ''
    for state in watch(monitor, flight.samples(DURATION)):
        now = (state.judged_ns or 0) * 1e-9
        if state.raised_ns is not None and now < ONSET:
            early += 1
        elif state.raised_ns is not None and raised is None:
            raised, first, reason = now - ONSET, state.first, state.reason
        elif raised is not None and state.raised_ns is None and now > END and cleared is None:
            cleared = now - END
    return {
        'fault': name, 'size': size, 'robot': robot, 'seed': seed, 'delay': raised,
        'first': first, 'reason': reason, 'cleared': cleared, 'early': early,
    }  # fmt: skip


def main() -> int:
    """Fly what is not yet in the file."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('what', choices=('nominal', 'faults'))
    parser.add_argument('--hours', type=float, default=1.0, help='nominal flight, each robot')
    parser.add_argument('--seed', type=int, default=1, help='first seed')
    parser.add_argument('--flight', type=float, default=PART, help='length of a nominal one [s]')
    parser.add_argument('--runs', type=int, default=3, help='seeds of every fault and size')
    parser.add_argument('--robots', nargs='+', default=['servicer', 'sixdof'])
    parser.add_argument('--only', nargs='+', default=list(FAULTS))
    parser.add_argument('--out', type=Path, required=True)
    args = parser.parse_args()
    plan = []
    for robot in args.robots:
        if args.what == 'nominal':
            parts = round(args.hours * HOUR / args.flight)
            seeds = range(args.seed, args.seed + parts)
            plan += [(nominal, (seed, robot, args.flight)) for seed in seeds]
        else:
            plan += [
                (fault, (name, size, seed, robot))
                for name in args.only
                for size in FAULTS[name].sizes
                for seed in range(args.seed, args.seed + args.runs)
            ]
    args.out.parent.mkdir(parents=True, exist_ok=True)
    done = set()
    if args.out.exists():
        lines = args.out.read_text(encoding='utf-8').splitlines()
        done = {json.loads(line)['key'] for line in lines}
    for run, values in plan:
        key = json.dumps([run.__name__, *values])
        if key not in done:
            line = json.dumps({'key': key, **run(*values)})
            with args.out.open('a', encoding='utf-8') as file:
                file.write(line + '\n')
            sys.stdout.write(line + '\n')
            sys.stdout.flush()
    return 0


if __name__ == '__main__':
    sys.exit(main())
