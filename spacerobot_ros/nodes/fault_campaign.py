"""Campaign of faults: odd messages, damaged bags, malformed files, streams that go wrong."""

from __future__ import annotations

import json
import resource
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cache
from typing import Any

import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ..campaign.damage import damaged_bag, malformed_file
from ..campaign.description import Check, Record, Results, grouped, key, kinds
from ..campaign.packaged_robots import packaged
from ..display import Table, table_of
from ..identification.estimate import Estimate
from ..ros.convert import compose, estimate_message
from ..ros.session import Session
from ..simulation.closed_loop import ClosedLoop
from ..simulation.sample_messages import sample_messages
from .controller import ControllerNode
from .identifier import IdentifierNode
from .message_fuzz import Patient, interleaved
from .monitor import MonitorNode
from .simulator import SimulatorNode

NODES = {
    'identifier': IdentifierNode,
    'controller': ControllerNode,
    'monitor': MonitorNode,
    'simulator': SimulatorNode,
}
_MESSAGES = 5000  # odd ones of a trial, among 4200 good ones
_FEW = 400  # one odd message in ten, among which the identifier must do as well
_DURATION = 20.0  # s of flight
_FILES = 50  # of a trial
_STREAMS = ('starved', 'clock jumps', 'gyro starts late', 'joints pause', 'gyro repeats')
_SENSED = ('/imu/data', '/attitude', '/joint_states')
_SIMULATED = {'simulator.lockstep': True}  # all in the order of callbacks
_HARMLESS = {'refused', 'whole', 'in part', 'loaded'}
_WORSE, _OFF = 1.2, 5.0  # largest ratio of standard deviations; estimate's error in them


def trials(runs: int, is_quick: bool) -> list[str]:
    """Odd messages for each node, streams that go wrong, damaged and malformed files."""
    return list(_trials(runs, _MESSAGES // 10 if is_quick else _MESSAGES))


def _trials(runs: int, messages: int) -> Iterator[str]:
    for seed in range(1, runs + 1):
        for node in NODES:
            yield key('messages', node, seed, messages)
        yield key('messages', 'identifier', seed, _FEW)
        for what in ('cut', 'flipped'):
            yield key('bags', what, seed)
        for what in ('robot file', 'URDF'):
            yield key('files', what, seed)
        for what in _STREAMS:
            yield key('streams', what, seed)


def run(key: str) -> Record:
    """One trial."""
    kind, what, *arguments = json.loads(key)
    if kind == 'messages':
        few = ', few' if arguments[1] == _FEW else ''
        return {'what': what + few, **odd_messages(what, *arguments)}
    if kind == 'streams':
        return {'what': what, **wrong_stream(what, *arguments)}
    judge = damaged_bag if kind == 'bags' else malformed_file
    first = arguments[0] * _FILES
    return {'what': what, 'ends': dict(Counter(judge(what, first + k) for k in range(_FILES)))}


@cache
def flight() -> list[tuple[str, Any]]:
    """Good messages of a flight, with what else is sent to nodes now and then."""
    file = packaged('servicer')
    loop = ClosedLoop(file.robot, file.settings.changed({'reference.repeat': True}))
    out: list[tuple[str, Any]] = []
    names = list(file.robot.joints)
    for k, step in enumerate(loop.run(round(_DURATION / loop.plant.period))):
        out += sample_messages(compose, loop.plant, step.measured)
        effort = np.zeros(len(names))
        out.append(('/joint_commands', compose.joint_state(step.stamp_ns, names, effort=effort)))
        if k % 50 == 0:
            point = JointTrajectoryPoint(positions=[0.1] * len(names))
            point.time_from_start.sec = 2
            out.append(('/reference', JointTrajectory(joint_names=names, points=[point])))
            out.append(
                ('/base_torque', compose.base_torque(step.stamp_ns, 'base_link', np.zeros(3)))
            )
    return out


@cache
def undisturbed() -> Estimate:
    """What the identifier finds in the flight as it is."""
    with Session() as session:
        patient = _patient(session, 'identifier')
        for topic, message in flight():
            if patient.hears(topic):
                patient.give(topic, message)
        patient.node.flush()
        found: Estimate = patient.node.estimate
        return found


def _patient(session: Session, node: str) -> Patient:
    file = packaged('servicer')
    return Patient(session, NODES[node], file.settings.changed(_SIMULATED), file.robot.urdf)


def odd_messages(node: str, seed: int, count: int) -> Record:
    """Odd messages among good ones: what they end or spoil."""
    rng = np.random.default_rng(seed)
    stream = [*flight()]
    stream.insert(len(stream) // 2, ('/estimate', estimate_message(undisturbed(), 0)))
    raised: Counter[str] = Counter()
    with Session() as session:
        patient = _patient(session, node)
        stream = [(topic, message) for topic, message in stream if patient.hears(topic)]
        before = _megabytes()
        for k, (topic, message, is_odd) in enumerate(interleaved(stream, count, rng)):
            _give(patient, topic, message, raised, is_good=not is_odd)
            if node == 'simulator' and k % 10 == 0:
                patient.node.step()
            if k % 500 == 0:
                patient.node.health.publish()
        record: Record = {
            'odd': count,
            'raised': dict(raised),
            'not_finite': dict(Counter(patient.not_finite)),
            'rejected': patient.node.health.count(),
            'megabytes': round(_megabytes() - before, -1),
        }
        if node == 'identifier':
            patient.node.flush()
            record |= _compared(patient.node.estimate)
        return record


def _give(
    patient: Patient, topic: str, message: Any, raised: Counter[str], *, is_good: bool = True
) -> None:
    try:
        patient.give(topic, message, is_good=is_good)
    except Exception as error:  # noqa: BLE001  what it is, the table says
        raised[f'{type(error).__name__}: {error}'[:200]] += 1


def _megabytes() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _compared(found: Estimate | None) -> Record:
    """An estimate beside the undisturbed one: its error and its spread by that one's."""
    if found is None or not found.valid:
        return {'valid': False, 'reason': '' if found is None else found.reason}
    wanted = undisturbed()
    std = wanted.std[: len(wanted.aam)]
    return {
        'valid': True,
        'off': float(np.max(np.abs(found.aam - wanted.aam) / std)),
        'spread': float(np.max(found.std[: len(wanted.aam)] / std)),
    }


def wrong_stream(what: str, seed: int) -> Record:
    """A flight whose messages go astray, for the identifier and the monitor."""
    rng = np.random.default_rng(seed)
    raised: Counter[str] = Counter()
    record: Record = {}
    with Session() as session:
        patients = {name: _patient(session, name) for name in ('identifier', 'monitor')}
        for topic, message in _astray(what, flight(), rng):
            for patient in patients.values():
                if patient.hears(topic):
                    _give(patient, topic, message, raised)
        identifier = patients['identifier'].node
        identifier.flush()
        record |= _compared(identifier.estimate)
        record['alarms'] = patients['monitor'].node.monitor.state.alarms
        record['not_finite'] = dict(
            Counter(t for patient in patients.values() for t in patient.not_finite)
        )
    return {'raised': dict(raised), **record}


def _astray(
    what: str, stream: list[tuple[str, Any]], rng: np.random.Generator
) -> Iterator[tuple[str, Any]]:
    """Messages of a stream that are late, gone, repeated, or of another clock."""
    start, length = rng.uniform(6.0, 12.0), rng.uniform(0.05, 3.0)
    jump = int(rng.choice([-1000, -5, 3, 100, 100_000]))
    gone = {'gyro starts late': '/imu/data', 'joints pause': '/joint_states'}.get(what)
    last: Any = None
    for topic, message in stream:
        if not hasattr(message, 'header') or topic not in (
            '/imu/data',
            '/attitude',
            '/joint_states',
        ):
            continue
        time = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        is_within = start <= time < start + length
        if what == 'starved' and rng.random() < (0.9 if is_within else 0.05):
            continue
        if topic == gone and (is_within if what == 'joints pause' else time < length + 2.0):
            continue
        if what == 'clock jumps' and time >= start:
            message = _moved(message, jump)
        if what == 'gyro repeats' and topic == '/imu/data':
            if is_within and last is not None:
                message = last
            last = message
        yield topic, message


def _moved(message: Any, seconds: int) -> Any:
    header = message.header
    stamp = compose.time(max(0, header.stamp.sec + seconds) * 10**9 + header.stamp.nanosec)
    fields = {name: getattr(message, name) for name in message.get_fields_and_field_types()}
    kind = type(message)
    return kind(**fields | {'header': type(header)(stamp=stamp, frame_id=header.frame_id)})


def results(records: Sequence[Record]) -> Results:
    """By kind of fault and what it was done to."""
    rows = []
    for kind, own in kinds(records).items():
        for what, those in grouped(own, lambda record: record['what']).items():
            rows.append({'fault': kind, 'of': what, **_score(those)})
    return {'faults': rows}


def _score(records: Sequence[Record]) -> Record:
    ends: Counter[str] = Counter()
    raised: Counter[str] = Counter()
    for r in records:
        ends.update(r.get('ends', {}))
        raised.update(r.get('raised', {}))
    off = [r['off'] for r in records if 'off' in r]
    return {
        'trials': len(records),
        'tried': sum(r.get('odd', 0) for r in records) or sum(ends.values()) or len(records),
        'raised': dict(raised),
        'harmful': {k: n for k, n in ends.items() if k not in _HARMLESS},
        'harmless': {k: n for k, n in ends.items() if k in _HARMLESS},
        'not_finite': sum(sum(r.get('not_finite', {}).values()) for r in records),
        'megabytes': max((r.get('megabytes', 0.0) for r in records), default=0.0),
        'invalid': sum(not r['valid'] for r in records if 'valid' in r),
        'off': max(off, default=None),
        'spread': max((r['spread'] for r in records if 'spread' in r), default=None),
        'alarms': sum(r.get('alarms', 0) for r in records),
    }


def judge(results: Results) -> list[Check]:
    """Nothing ends, hangs or spoils a node; no damage passes for data."""
    out = []
    for row in results['faults']:
        name = f'{row["fault"]}, {row["of"]}'
        out.append(Check(f'{name}: raised', sum(row['raised'].values()), 0, 0))
        out.append(Check(f'{name}: numbers not finite', row['not_finite'], 0, 0))
        if row['fault'] in ('bags', 'files'):
            out.append(Check(f'{name}: harmful', sum(row['harmful'].values()), 0, 0))
        if row['of'].endswith(', few') and row['off'] is not None:
            out.append(Check(f'{name}: estimates not valid', row['invalid'], 0, 0))
            out.append(Check(f'{name}: spread of the estimate', row['spread'], 0.0, _WORSE))
            out.append(Check(f'{name}: error in standard deviations', row['off'], 0.0, _OFF))
    return out


def tables(results: Results) -> list[Table]:
    """One line a fault."""
    shown = [
        {
            **row,
            'ended': _listed(row['raised']) or _listed(row['harmful']) or '-',
            'ends': _listed(row['harmless']) or '-',
            'estimate': '-' if row['off'] is None else f'{row["off"]:.2f}, {row["spread"]:.2f}',
        }
        for row in results['faults']
    ]
    return [
        table_of(
            'Faults',
            'estimate: largest error, and spread, in standard deviations of the undisturbed one',
            shown,
            'fault | of | tried | raised, or harmful | harmless | not finite | '
            'memory grown [MB] | estimate | not valid | alarms',
            '{fault} | {of} | {tried} | {ended} | {ends} | {not_finite} | {megabytes:.0f} | '
            '{estimate} | {invalid} | {alarms}',
        )
    ]


def _listed(counts: dict[str, int]) -> str:
    return ', '.join(f'{name}: {count}' for name, count in sorted(counts.items()))
