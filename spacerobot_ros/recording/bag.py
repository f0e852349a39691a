"""Reading rosbag2 recordings (mcap or sqlite3) into a `Record`, without ROS.

Sample times are the header stamps, not the times at which the recorder happened to write. A bad
message is left out and counted in the notes; a topic without one good message is refused with the
reason of its first bad one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Reader
from rosbags.typesys.store import Typestore

from ..errors import MessageRejectedError, RecordingError
from ..model.robot import Robot
from ..types import Array, IntArray
from .bag_writer import BagWriter, check_target
from .message_types import typestore
from .record import UNIT_TOLERANCE, AttitudeSeries, JointSeries, RateSeries, Record

__all__ = ['BagWriter', 'Topics', 'check_target', 'read_bag']

LATE_LIMIT = 10  # messages in a row behind the newest stamp: more is a clock that jumped back
NORM_LIMIT = 1e-3  # a quaternion further from unit norm is a bad message
_TYPES = {
    'joints': 'sensor_msgs/msg/JointState',
    'imu': 'sensor_msgs/msg/Imu',
    'attitude': 'geometry_msgs/msg/QuaternionStamped',
    'wheels': 'sensor_msgs/msg/JointState',
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Topics:
    """Where the sensors are found in a bag."""

    joints: str = '/joint_states'
    imu: str = '/imu/data'
    attitude: str = '/attitude'
    wheels: str = '/wheel_states'


@dataclass(slots=True)
class _Channel:
    """Rows of one topic while it is read."""

    topic: str
    stamps: list[int] = field(default_factory=list)
    rows: list[tuple[Array, ...]] = field(default_factory=list)
    bad: Counter[str] = field(default_factory=Counter)
    remarks: dict[str, None] = field(default_factory=dict)


def read_bag(path: str | Path, robot: Robot, topics: Topics | None = None) -> Record:
    """Read a recording.

    Args:
        path: A rosbag2 folder, or one mcap or db3 file.
        robot: Gives the joints' names and order, and the base's frame.
        topics: Where the sensors are found; those of the simulator by default.

    Returns:
        The record; a sensor whose topic is absent is None, and a note says so.

    Raises:
        RecordingError: not readable, none of the topics, a topic of another type, one without a
            good message, or one whose clock jumps back.
    """
    topics = topics or Topics()
    path = Path(path)
    convert: dict[str, Callable[[Any, _Channel], tuple[Array, ...]]] = {
        'joints': lambda m, c: _joint_row(
            m, c, robot.joints[: robot.n_joints - robot.rotor_count]
        ),
        'imu': lambda m, c: _rate_row(m, c, robot.base_link),
        'attitude': lambda m, c: _attitude_row(m, c, robot.base_link),
        'wheels': _wheel_row,
    }
    channels = {kind: _Channel(getattr(topics, kind)) for kind in _TYPES}
    wheel_names: list[str] = []
    for kind, message in _messages(path, topics, channels):
        channel = channels[kind]
        try:
            if kind == 'wheels':
                wheel_names = wheel_names or list(message.name)
                _check_names(list(message.name), wheel_names)
            row = convert[kind](message, channel)
            channel.stamps.append(_stamp(message))
            channel.rows.append(row)
        except MessageRejectedError as error:
            channel.bad[str(error)] += 1
    return _build(path, robot, channels, tuple(wheel_names))


def _messages(
    path: Path, topics: Topics, channels: dict[str, _Channel]
) -> Iterator[tuple[str, Any]]:
    """Every decodable message of the wanted topics with its kind."""
    store = typestore(with_package=False)
    _check_path(path)
    kinds = {getattr(topics, kind): kind for kind in _TYPES}
    try:
        with Reader(path) as reader:
            wanted = [c for c in reader.connections if c.topic in kinds]
            for connection in wanted:
                _check_type(
                    path, connection.topic, connection.msgtype, _TYPES[kinds[connection.topic]]
                )
            if not any(kinds[c.topic] != 'wheels' and c.msgcount for c in wanted):
                present = ', '.join(sorted({c.topic for c in reader.connections})) or 'nothing'
                raise RecordingError(
                    str(path),
                    f'has no message on {topics.joints}, {topics.imu} or {topics.attitude} '
                    f'(it has {present})',
                )
            for connection, _, data in reader.messages(wanted):
                message = _decode(store, data, connection.msgtype)
                if message is None:
                    channels[kinds[connection.topic]].bad['can not be decoded'] += 1
                else:
                    yield kinds[connection.topic], message
    except RecordingError:
        raise
    except Exception as error:  # a damaged file makes the storage readers raise nearly anything
        reason = ' '.join(str(error).split()) or type(error).__name__
        raise RecordingError(
            str(path), f'can not be read as a rosbag2 recording: {reason}'
        ) from error


def _check_path(path: Path) -> None:
    if not path.exists():
        raise RecordingError(str(path), 'no such file or folder')
    if path.is_dir() and not (path / 'metadata.yaml').is_file():
        raise RecordingError(str(path), 'has no metadata.yaml, so it is no rosbag2 folder')


def _check_type(path: Path, topic: str, msgtype: str, expected: str) -> None:
    if msgtype != expected:
        raise RecordingError(f'{path}: {topic}', f'carries {msgtype}, expected {expected}')


def _decode(store: Typestore, data: bytes, msgtype: str) -> Any | None:
    try:
        return store.deserialize_cdr(data, msgtype)
    except Exception:  # noqa: BLE001  bytes that are no such message make the generated decoder raise anything
        return None


def _stamp(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def _joint_row(message: Any, channel: _Channel, names: tuple[str, ...]) -> tuple[Array, ...]:
    """Position, velocity and effort in the order of `names`; an absent column is all NaN."""
    given = list(message.name)
    _check_names(given, list(names))
    order = [given.index(name) for name in names]
    if order != sorted(order):
        channel.remarks['joint columns reordered by name'] = None
    return _joint_columns(message, order)


def _wheel_row(message: Any, _: _Channel) -> tuple[Array, ...]:
    position, velocity, effort = _joint_columns(
        message, list(range(len(message.name))), required='velocity'
    )
    return np.nan_to_num(position), velocity, effort


def _joint_columns(
    message: Any, order: list[int], required: str = 'position'
) -> tuple[Array, ...]:
    columns = []
    for name in ('position', 'velocity', 'effort'):
        values = np.asarray(getattr(message, name), dtype=float)
        if not len(values) and name != required:
            columns.append(np.full(len(order), np.nan))
            continue
        if len(values) != len(order):
            raise MessageRejectedError(f'{len(values)} entries in {name}, expected {len(order)}')
        _check_finite(values, name)
        columns.append(values[order])
    return tuple(columns)


def _rate_row(message: Any, channel: _Channel, base_link: str) -> tuple[Array, ...]:
    frame = message.header.frame_id
    if frame not in ('', base_link):
        raise MessageRejectedError(f'frame {frame!r} is not the base link {base_link!r}')
    if not frame:
        channel.remarks[f'no frame given, taken as {base_link!r}'] = None
    if message.angular_velocity_covariance[0] == -1.0:
        raise MessageRejectedError('angular velocity is marked absent')
    omega = np.array([getattr(message.angular_velocity, axis) for axis in 'xyz'])
    _check_finite(omega, 'angular velocity')
    return (omega,)


def _attitude_row(message: Any, channel: _Channel, base_link: str) -> tuple[Array, ...]:
    if message.header.frame_id == base_link:
        raise MessageRejectedError(
            f'frame {base_link!r} is the base itself, expected the inertial frame'
        )
    q = np.array([getattr(message.quaternion, axis) for axis in 'xyzw'])
    _check_finite(q, 'quaternion')
    norm = float(np.linalg.norm(q))
    if abs(norm - 1.0) > NORM_LIMIT:
        raise MessageRejectedError('quaternion is not normalised')
    if abs(norm - 1.0) > UNIT_TOLERANCE:
        channel.remarks[f'quaternions normalised (norms off by up to {NORM_LIMIT:g})'] = None
        q = q / norm
    return (q,)


def _check_names(given: list[str], names: list[str]) -> None:
    missing = [name for name in names if name not in given]
    foreign = [name for name in given if name not in names]
    if missing or foreign or len(given) != len(names):
        parts = [f'lacks {", ".join(missing)}'] if missing else []
        parts += [f'has foreign {", ".join(foreign)}'] if foreign else []
        raise MessageRejectedError(f'joint names: {" and ".join(parts) or "one appears twice"}')


def _check_finite(values: Array, what: str) -> None:
    if not np.all(np.isfinite(values)):
        raise MessageRejectedError(f'{what} is not finite')


def _build(
    path: Path, robot: Robot, channels: dict[str, _Channel], wheel_names: tuple[str, ...]
) -> Record:
    notes = ['sample times are header stamps']
    series: dict[str, tuple[IntArray, list[Array]] | None] = {}
    for kind, channel in channels.items():
        series[kind] = _columns(path, channel)
        notes += _notes(channel, optional=kind == 'wheels')
    joints, imu, attitude, wheels = (series[kind] for kind in _TYPES)
    arm = robot.joints[: robot.n_joints - robot.rotor_count]
    return Record(
        joints=_joint_series(arm, joints, channels['joints'], notes),
        rates=RateSeries(imu[0], imu[1][0]) if imu else None,
        attitudes=AttitudeSeries(attitude[0], attitude[1][0]) if attitude else None,
        wheels=_joint_series(wheel_names, wheels, channels['wheels'], []),
        source=str(path),
        notes=tuple(notes),
    )


def _columns(path: Path, channel: _Channel) -> tuple[IntArray, list[Array]] | None:
    """Stamps in order and the stacked columns; later messages with a stamp seen before are bad."""
    if not channel.rows:
        if channel.bad:
            reason, count = channel.bad.most_common(1)[0]
            raise RecordingError(
                f'{path}: {channel.topic}', f'no usable message: {reason} ({count} messages)'
            )
        return None
    stamps = np.array(channel.stamps, dtype=np.int64)
    if np.any(np.diff(stamps) < 0):
        _check_clock(f'{path}: {channel.topic}', stamps)
        channel.remarks['messages out of order, sorted by stamp'] = None
    unique, first = np.unique(stamps, return_index=True)
    if len(unique) < len(stamps):
        channel.bad['stamp seen before'] += len(stamps) - len(unique)
    return unique, [
        np.array([channel.rows[i][c] for i in first]) for c in range(len(channel.rows[0]))
    ]


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
        f'the clock jumps back by {back:.6g} s, {(newest[first] - stamps[0]) / 1e9:.6g} s '
        'after the first message',
    )


def _joint_series(
    names: tuple[str, ...],
    columns: tuple[IntArray, list[Array]] | None,
    channel: _Channel,
    notes: list[str],
) -> JointSeries | None:
    """Joint series; velocity or effort is absent unless every message has it."""
    if columns is None:
        return None
    stamps, (position, velocity, effort) = columns
    optional: list[Array | None] = []
    for name, values in (('velocity', velocity), ('effort', effort)):
        gaps = int(np.isnan(values).any(axis=1).sum())
        if gaps:
            notes.append(
                f'{channel.topic}: {gaps} of {len(values)} messages have no {name}: not used'
            )
        optional.append(None if gaps else values)
    return JointSeries(names, stamps, position, optional[0], optional[1])


def _notes(channel: _Channel, optional: bool) -> list[str]:
    if not channel.rows and not optional:
        return [f'{channel.topic}: absent']
    notes = [f'{channel.topic}: {remark}' for remark in channel.remarks]
    return notes + [
        f'{channel.topic}: {count} left out: {reason}'
        for reason, count in sorted(channel.bad.items())
    ]
