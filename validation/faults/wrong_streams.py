"""A flight's good messages, what a node makes of them, and streams in which they go astray."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.nodes.program import node_class
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.session import Session
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from spacerobot_ros.simulation.truth import sample_messages

from ..campaigns import TrialRecord
from ..hidden.diagnosis_scenario import packaged
from .message_fuzz import Patient

STREAMS = (
    'starved',
    'clock jumps',
    'gyro starts late',
    'joints pause',
    'gyro repeats',
    'gyro of another clock',
    'clock runs away',
    'stamps stand still',
)
_DURATION = 20.0  # s of flight
_SENSED = ('/imu/data', '/attitude', '/joint_states')
_DRIFT = 1.02  # of a clock that runs away from the others
_EPOCH = 2000  # s at the start of a flight whose clock jumps: room for the largest jump back


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
        patient = patient_of(session, 'identifier')
        for topic, message in flight():
            if patient.hears(topic):
                patient.give(topic, message)
        patient.node.flush()
        found: Estimate = patient.node.estimate
        return found


def patient_of(session: Session, node: str) -> Patient:
    """A node of the servicer, whose callbacks are called by hand, in their order alone.

    All nodes are in lockstep but the simulator, which would wait for its own plant's commands.
    """
    file = packaged('servicer')
    settings = file.settings.changed({'simulator.lockstep': node != 'simulator'})
    return Patient(session, node_class(node), settings, file.robot.urdf)


def give(
    patient: Patient, topic: str, message: Any, raised: Counter[str], *, is_good: bool = True
) -> None:
    """Have a node take a message; count what it raises."""
    try:
        patient.give(topic, message, is_good=is_good)
    except Exception as error:  # noqa: BLE001  what it is, the table says
        raised[f'{type(error).__name__}: {error}'[:200]] += 1


def compared(found: Estimate | None) -> TrialRecord:
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


def wrong_stream(what: str, seed: int) -> TrialRecord:
    """A flight whose messages go astray, for the identifier and the monitor."""
    rng = np.random.default_rng(seed)
    raised: Counter[str] = Counter()
    record: TrialRecord = {}
    with Session() as session:
        patients = {name: patient_of(session, name) for name in ('identifier', 'monitor')}
        for topic, message, is_good in _astray(what, flight(), rng):
            for patient in patients.values():
                if patient.hears(topic):
                    give(patient, topic, message, raised, is_good=is_good)
        identifier = patients['identifier'].node
        identifier.flush()
        record |= compared(identifier.estimate)
        record['alarms'] = patients['monitor'].node.monitor.state.alarms
        record['not_finite'] = dict(
            Counter(t for patient in patients.values() for t in patient.not_finite)
        )
    return {'raised': dict(raised), **record}


def _astray(
    what: str, stream: list[tuple[str, Any]], rng: np.random.Generator
) -> Iterator[tuple[str, Any, bool]]:
    """Messages of a stream that are late, gone, repeated, or not of /clock: whether they are."""
    start, length = rng.uniform(6.0, 12.0), rng.uniform(0.05, 3.0)
    jump = int(rng.choice([-1000, -5, 3, 100, 100_000]))
    gone = {'gyro starts late': '/imu/data', 'joints pause': '/joint_states'}.get(what)
    clocks: dict[str, Callable[[float], float]] = {
        'clock jumps': lambda t: _EPOCH + (t + jump if t >= start else t),
        'gyro of another clock': lambda t: t + 100.0 * abs(jump),
        'clock runs away': lambda t: t * _DRIFT,
        'stamps stand still': lambda t: start if start <= t < start + length else t,
    }
    clock = clocks.get(what)
    turned = '/imu/data' if what in ('gyro of another clock', 'clock runs away') else ''
    last: Any = None
    for topic, message in stream:
        if topic not in _SENSED:
            continue
        time = message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
        is_within = start <= time < start + length
        if what == 'starved' and rng.random() < (0.9 if is_within else 0.05):
            continue
        if topic == gone and (is_within if what == 'joints pause' else time < length + 2.0):
            continue
        if clock is not None and topic.startswith(turned):
            message = _stamped(message, clock(time))
        if what == 'gyro repeats' and topic == '/imu/data':
            if is_within and last is not None:
                message = last
            last = message
        yield topic, message, not (turned and topic == turned)


def _stamped(message: Any, time: float) -> Any:
    header = message.header
    stamp = compose.time(max(0, round(time * 1e9)))
    fields = {name: getattr(message, name) for name in message.get_fields_and_field_types()}
    kind = type(message)
    return kind(**fields | {'header': type(header)(stamp=stamp, frame_id=header.frame_id)})
