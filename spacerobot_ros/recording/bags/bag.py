"""Reading rosbag2 recordings (mcap or sqlite3) into a `Record`, without ROS.

Sample times are the header stamps, not the times at which the recorder happened to write. A bad
message is left out and counted in the notes, which also say what damage to the file took; a topic
without one good message is refused with the reason of its first bad one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import MessageRejectedError, RecordingError
from ...formats import counted
from ...model.robot import Robot
from ...types import Array, IntArray
from .. import messages
from ..record import UNIT_TOLERANCE, AttitudeSeries, JointSeries, RateSeries, Record, shown
from ..series import InputSeries
from ..tables.units import INPUTS, SI_UNITS
from .bag_storage import StoredMessages, read_messages
from .message_types import decoded
from .partial_states import merged

MINORITY = 0.25
"""Share of messages up to which those without what the others have are left out."""
UNUSABLE = 0.05  # of the messages; with more of one stamp most of the motion would be left out
LATE_LIMIT = 10  # messages in a row behind the newest stamp: more is a clock that jumped back
_TYPES = {
    'joints': 'sensor_msgs/msg/JointState',
    'imu': 'sensor_msgs/msg/Imu',
    'attitude': 'geometry_msgs/msg/QuaternionStamped',
    'wheels': 'sensor_msgs/msg/JointState',
    'thrusters': 'sensor_msgs/msg/JointState',
    'base_wrench': 'geometry_msgs/msg/WrenchStamped',
}
_DESCRIPTION = '/robot_description'
_OPTIONAL = ('wheels', 'thrusters', 'base_wrench')


@dataclass(frozen=True, slots=True, kw_only=True)
class Topics:
    """Where the sensors are found in a bag."""

    joints: str = '/joint_states'
    imu: str = '/imu/data'
    attitude: str = '/attitude'
    wheels: str = '/wheel_states'
    thrusters: str = '/thruster_commands'
    base_wrench: str = '/base_torque'


@dataclass(slots=True)
class _Channel:
    """One topic while it is read.

    Args:
        topic: Its name.
        names: Joints or wheels of its columns; wheels are named by their first message.
        stamps: Of the good messages [ns].
        rows: Their numbers; NaN for an absent column of joints.
        bad: Bad messages by kind of reason.
        reasons: The first reason of each kind.
        remarks: What was mended or assumed.
        effort_units: (n,) N m of one unit of effort of each joint.
        in_amperes: Joints whose efforts stay currents [A].
        held: Joints that do not move, which messages may have or not.
        parts: Stamps and rows of messages with some of the joints, by their columns.
        may_lack_positions: Whether some joints may say NaN throughout, wheels on a fixed base.
    """

    topic: str
    names: tuple[str, ...] = ()
    stamps: list[int] = field(default_factory=list)
    rows: list[Array] = field(default_factory=list)
    bad: Counter[str] = field(default_factory=Counter)
    reasons: dict[str, str] = field(default_factory=dict)
    remarks: dict[str, None] = field(default_factory=dict)
    effort_units: Array | float = 1.0
    in_amperes: tuple[str, ...] = ()
    held: frozenset[str] = frozenset()
    parts: dict[tuple[int, ...], list[tuple[int, Array]]] = field(default_factory=dict)
    may_lack_positions: bool = False

    def reject(self, reason: object, count: int = 1) -> None:
        """Count messages that are left out."""
        kind = messages.kind_of(reason)
        self.reasons.setdefault(kind, str(reason))
        self.bad[kind] += count


def read_bag(path: str | Path, robot: Robot | None, topics: Topics | None = None) -> Record:
    """Read a recording.

    Args:
        path: A rosbag2 folder, or one mcap or db3 file.
        robot: Gives the joints' names and order, and the base's frame; without it the first
            messages do, and efforts are taken as torques.
        topics: Where the sensors are found; those of the simulator by default.

    Returns:
        The record; a sensor whose topic is absent is None, and a note says so.

    Raises:
        RecordingError: not readable, none of the topics, a topic of another type, one without a
            good message, or one whose clock jumps back.
    """
    topics, path = topics or Topics(), Path(path)
    channels = {kind: _Channel(getattr(topics, kind)) for kind in _TYPES}
    joints = channels['joints']
    if robot is not None:
        joints.names, joints.effort_units = robot.arm, robot.known_effort_units
        joints.held = frozenset(robot.held)
        joints.in_amperes, joints.may_lack_positions = robot.without_constant, not robot.is_free
        if 'current' in robot.effort_kinds:
            how = 'in A' if robot.without_constant else 'times robot.motor_constant'
            joints.remarks[f'efforts are currents, {how}'] = None
    kinds = {channel.topic: kind for kind, channel in channels.items()}
    stored = read_messages(path, [*kinds, _DESCRIPTION])
    _check_topics(path, stored, channels)
    description = ''
    for topic, msgtype, data in stored.messages:
        if topic == _DESCRIPTION:
            if msgtype == 'std_msgs/msg/String':
                with suppress(MessageRejectedError):
                    description = str(decoded(msgtype, data).data)
            continue
        kind = kinds[topic]
        channel = channels[kind]
        try:
            message = decoded(msgtype, data, with_package=False)
            if kind == 'joints' and robot is not None and _takes_part(message, channel):
                continue
            row = _row(kind, message, channel, None if robot is None else robot.base_link)
            channel.stamps.append(messages.stamp_ns(message.header.stamp))
            channel.rows.append(row)
        except MessageRejectedError as error:
            channel.reject(error)
    _with_parts(joints)
    record = replace(_build(path, channels, stored.notes), description=description)
    if robot is None or robot.thrusters or 'thrusters' not in record.inputs:
        return record
    note = f'{topics.thrusters}: left out, as robot.thrusters of the robot file names none'
    others = {name: given for name, given in record.inputs.items() if name != 'thrusters'}
    return replace(record, inputs=others, notes=(*record.notes, note))


def _check_topics(path: Path, stored: StoredMessages, channels: dict[str, _Channel]) -> None:
    """Refuse a wanted topic of another type, and a bag without messages of any."""
    kinds = {channel.topic: kind for kind, channel in channels.items()}
    for topic, msgtype in sorted(stored.channels):
        expected = _TYPES[kinds[topic]] if topic in kinds else msgtype
        if msgtype != expected:
            raise RecordingError(f'{path}: {topic}', f'carries {msgtype}, expected {expected}')
    if not any(kinds.get(topic, 'wheels') not in _OPTIONAL for topic, *_ in stored.messages):
        present = ', '.join(sorted({topic for topic, _ in stored.channels})) or 'nothing'
        joints, imu, attitude, *_ = kinds
        raise RecordingError(
            str(path), f'has no message on {joints}, {imu} or {attitude} (it has {present})'
        )


def _row(kind: str, message: Any, channel: _Channel, base_link: str | None) -> Array:
    """The numbers of a message: joints as (3, n) position, velocity and effort."""
    if base_link is None:  # whatever the sensors say
        base_link = message.header.frame_id if kind == 'imu' else 'base_link'
        channel.names = channel.names or tuple(getattr(message, 'name', ()))
    if kind == 'imu':
        if not message.header.frame_id:
            channel.remarks[f'no frame given, taken as {base_link!r}'] = None
        return messages.angular_rate(message, base_link)[1]
    if kind == 'attitude':
        q = messages.attitude(message, base_link)[1]
        if abs(float(np.linalg.norm(q)) - 1.0) <= UNIT_TOLERANCE:
            return q
        limit = f'{messages.NORM_LIMIT:g}'
        channel.remarks[f'quaternions normalized (norms off by up to {limit})'] = None
        return messages.unit(q)
    if kind == 'base_wrench':
        return messages.base_wrench(message, base_link)[1]
    if kind == 'thrusters':
        channel.names = channel.names or tuple(message.name)
        return messages.thruster_shares(message, channel.names)
    if kind == 'wheels':
        names = channel.names or tuple(message.name)
        columns = messages.joint_columns(message, names, 'position?', 'velocity', 'effort?')
        channel.names = names
        return _stacked(columns, len(names), missing=(0.0, 0.0, np.nan))
    return _joint_row(message, channel)


def _takes_part(message: Any, channel: _Channel) -> bool:
    """Whether a message has some of the joints; its row is kept then."""
    given = set(message.name)
    own = tuple(k for k, name in enumerate(channel.names) if name in given)
    is_own = channel.held.issuperset(given.difference(channel.names))
    if not (is_own and 0 < len(own) < len(channel.names)):
        return False
    names = [channel.names[k] for k in own]
    columns = messages.joint_columns(
        message, names, 'position', 'velocity?', 'effort?', others=True, partly=True
    )
    row = np.full((3, len(channel.names)), np.nan)
    row[:, own] = _stacked(columns, len(own), missing=(np.nan, np.nan, np.nan))
    kept = channel.parts.setdefault(own, [])
    kept.append((messages.stamp_ns(message.header.stamp), row))
    return True


def _with_parts(channel: _Channel) -> None:
    """Take joint states in parts for whole ones, where most are in parts; else they are bad."""
    count = sum(map(len, channel.parts.values()))
    every = {
        own: (np.array([stamp for stamp, _ in part]), np.array([row for _, row in part]))
        for own, part in channel.parts.items()
    }
    whole = merged(every) if count > MINORITY * (count + len(channel.rows)) else None
    if whole is None:
        for own, part in channel.parts.items():
            lacking = (name for k, name in enumerate(channel.names) if k not in own)
            channel.reject(f'joint names: lacks {", ".join(lacking)}', len(part))
        return
    if channel.rows:
        channel.reject('has all joints, where most have some', len(channel.rows))
    channel.stamps, channel.rows = whole[0].tolist(), list(whole[1])
    how = f'{counted(count, "message")} with some of the joints, merged by stamp'
    channel.remarks[f'{how}: {counted(len(channel.rows), "sample")} of all'] = None


def _joint_row(message: Any, channel: _Channel) -> Array:
    """(3, n) position, velocity and effort of the joints that move."""
    first = channel.rows[0][0] if channel.rows else np.asarray(message.position)
    is_partly = channel.may_lack_positions and np.isnan(first).any()
    position = 'position?' if is_partly else 'position'
    others = channel.held.issuperset(set(message.name).difference(channel.names))
    columns = messages.joint_columns(
        message, channel.names, position, 'velocity?', 'effort?', others=others, partly=True
    )
    if columns[0] is None or (channel.rows and np.any(np.isnan(columns[0]) != np.isnan(first))):
        raise MessageRejectedError('position is not finite')
    if channel.held.intersection(message.name):
        channel.remarks[
            f'{", ".join(sorted(channel.held))}: left out, as the robot file holds them'
        ] = None
    if list(channel.names) != list(message.name):
        channel.remarks['joint columns reordered by name'] = None
    return _stacked(columns, len(channel.names), missing=(0.0, np.nan, np.nan))


def _stacked(columns: Sequence[Array | None], n: int, missing: Sequence[float]) -> Array:
    return np.array(
        [np.full(n, m) if c is None else c for c, m in zip(columns, missing, strict=True)]
    )


def _build(path: Path, channels: dict[str, _Channel], lost: list[str]) -> Record:
    notes = ['sample times are header stamps', *lost]
    sensors: dict[str, Any] = {}
    inputs: dict[str, InputSeries] = {}
    for kind, channel in channels.items():
        samples = _sorted(path, channel)
        if samples is None:
            pass
        elif kind in ('joints', 'wheels'):
            optional = kind == 'joints'
            sensors[kind] = _joint_series(channel, *samples, notes if optional else [])
        elif kind == 'imu':
            sensors['rates'] = RateSeries(*samples)
        elif kind == 'attitude':
            sensors['attitudes'] = AttitudeSeries(*samples)
        elif samples[1].any():  # commands or wrenches that ever are other than zero
            names, quantities = INPUTS.get(kind, (channel.names, ('',) * len(channel.names)))
            units = tuple(SI_UNITS[quantity] for quantity in quantities)
            inputs[kind] = InputSeries(names, *samples, units)
        notes += _notes(channel, optional=kind in _OPTIONAL)
    return Record(**sensors, source=str(path), notes=tuple(notes), inputs=inputs)


def _sorted(path: Path, channel: _Channel) -> tuple[IntArray, Array] | None:
    """Stamps in order with their rows; later messages with a stamp seen before are bad."""
    place = f'{path}: {channel.topic}'
    if not channel.rows:
        if channel.bad:
            kind, count = channel.bad.most_common(1)[0]
            reason = f'no usable message: {channel.reasons[kind]} ({counted(count, "message")})'
            raise RecordingError(place, reason)
        return None
    stamps = np.array(channel.stamps, dtype=np.int64)
    if np.any(np.diff(stamps) < 0):
        _check_clock(place, stamps)
        channel.remarks['messages out of order, sorted by stamp'] = None
    unique, first, own = np.unique(stamps, return_index=True, return_inverse=True)
    rows = np.array(channel.rows)
    if len(unique) < len(stamps):
        same = np.isclose(rows, rows[first][own], rtol=0.0, atol=0.0, equal_nan=True)
        count = int(np.count_nonzero(~same.reshape(len(rows), -1).all(axis=1)))
        if count > UNUSABLE * len(stamps):
            reason = f'{count} of {len(stamps)} messages have the stamp of another one'
            raise RecordingError(place, f'{reason}: a clock too coarse for them? Stamp them anew')
        channel.reject('stamp seen before', len(stamps) - len(unique))
    return unique, rows[first]


def _check_clock(place: str, stamps: IntArray) -> None:
    """Refuse stamps that stay behind the newest one: not messages out of order, another clock."""
    newest = np.maximum.accumulate(stamps)
    on_time = np.flatnonzero(stamps == newest)
    late = np.diff(np.append(on_time, len(stamps))) - 1
    if late.max() <= LATE_LIMIT:
        return
    first = int(on_time[np.argmax(late)]) + 1
    back = (newest[first] - stamps[first]) / 1e9
    raise RecordingError(
        f'{place}, message {first}',
        f'the clock jumps back by {shown(back)}, {shown((newest[first] - stamps[0]) / 1e9)} '
        'after the first message',
    )


def _joint_series(
    channel: _Channel, stamps: IntArray, rows: Array, notes: list[str]
) -> JointSeries:
    """Joint series; a joint's velocity or effort is absent where more than few messages lack it.

    Those few are left out.
    """
    columns: dict[str, Any] = {}
    lacking = np.isnan(rows[:, 1:])
    share = np.mean(lacking, axis=0)
    few = np.any(lacking & (share > 0.0) & (share <= MINORITY), axis=(1, 2))
    if few.any():
        notes.append(
            f'{channel.topic}: {int(few.sum())} of {len(rows)} messages lack efforts or '
            'velocities that the others have: left out'
        )
        stamps, rows = stamps[~few], rows[~few]
    for k, name in enumerate(('velocity', 'effort'), start=1):
        missing = np.isnan(rows[:, k])
        absent = missing.any(axis=0)
        of = '' if absent.all() else ' of ' + ', '.join(np.array(channel.names)[absent])
        if absent.any():
            gaps = int(missing.any(axis=1).sum())
            notes.append(
                f'{channel.topic}: {gaps} of {len(rows)} messages have no {name}{of}: not used'
            )
        if not absent.all():
            columns[name] = np.where(absent, np.nan, rows[:, k])
    if 'effort' in columns:
        columns['effort'] = columns['effort'] * channel.effort_units
        columns['in_amperes'] = channel.in_amperes
    return JointSeries(channel.names, stamps, rows[:, 0], **columns)


def _notes(channel: _Channel, optional: bool) -> list[str]:
    if not channel.rows and not optional:
        return [f'{channel.topic}: absent']
    notes = [f'{channel.topic}: {remark}' for remark in channel.remarks]
    return notes + [
        f'{channel.topic}: {channel.bad[kind]} left out: {reason}'
        for kind, reason in sorted(channel.reasons.items())
    ]
