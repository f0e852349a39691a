"""Serialized messages: what middlewares add is no damage; what is cut or foreign is refused."""

from __future__ import annotations

import numpy as np
import pytest
from rosbags.interfaces import Nodetype

from spacerobot_ros.errors import MessageRejectedError
from spacerobot_ros.recording.bags.message_types import (
    composer,
    decoded,
    encoded,
    message_folder,
    typestore,
)

STORE = typestore()
KINDS = [
    *(f'spacerobot_msgs/msg/{path.stem}' for path in sorted(message_folder().glob('*.msg'))),
    'sensor_msgs/msg/Imu',
    'sensor_msgs/msg/JointState',
    'geometry_msgs/msg/QuaternionStamped',
    'diagnostic_msgs/msg/DiagnosticArray',
    'tf2_msgs/msg/TFMessage',
    'trajectory_msgs/msg/JointTrajectory',
    'sensor_msgs/msg/CompressedImage',
    'std_msgs/msg/Float32MultiArray',
    'std_msgs/msg/Bool',
]
TEXTS = ['', 'a', 'ab', 'arm', 'joint_1', 'gyro\u00e9']


def drawn(kind, detail, rng, sizes):
    """A random value of a field; `sizes` draws texts and lengths."""
    if kind is Nodetype.NAME:
        fields = STORE.fielddefs[detail][1]
        content = [drawn(*field, rng, sizes) for _, field in fields]
        return STORE.types[detail](*content)
    if kind is Nodetype.BASE:
        if detail[0] == 'string':
            return TEXTS[sizes.integers(len(TEXTS))]
        return drawn(Nodetype.ARRAY, ((kind, detail), 1), rng, sizes)[0].item()
    (each, what), count = detail
    if kind is Nodetype.SEQUENCE:
        count = int(sizes.integers(5))
    if each is not Nodetype.BASE or what[0] == 'string':
        return [drawn(each, what, rng, sizes) for _ in range(count)]
    number = {'char': 'uint8', 'byte': 'uint8'}.get(what[0], what[0])
    if number == 'bool':
        return rng.integers(2, size=count).astype(bool)
    if number.startswith('float'):
        return rng.normal(size=count).astype(number)
    return rng.integers(100, size=count).astype(number)


def of_fast_dds(joints, *columns):
    """A JointState as rclpy's `serialize_message` gives it: 4 bytes more for each empty column."""
    values = [np.full(joints, 0.5) if name in columns else np.zeros(0) for name in COLUMNS]
    names = [f'joint_{k}' for k in range(joints)]
    cdr = encoded(composer().joint_state(7, names, *values))
    return cdr + b'\x70\x00\x00\x01' * (len(COLUMNS) - len(columns))


COLUMNS = ('position', 'velocity', 'effort')
STATE = 'sensor_msgs/msg/JointState'


@pytest.mark.parametrize('joints', [1, 2, 7])
@pytest.mark.parametrize('columns', [(), ('effort',), ('position', 'velocity'), COLUMNS])
def test_what_fast_dds_adds_for_empty_columns_is_no_damage(joints, columns):
    cdr = of_fast_dds(joints, *columns)
    message = decoded(STATE, cdr)
    for name in COLUMNS:
        wanted = [0.5] * joints if name in columns else []
        assert getattr(message, name).tolist() == wanted
    with pytest.raises(MessageRejectedError, match='bytes too long'):
        decoded(STATE, cdr + bytes(28))  # more of them than columns could be empty


@pytest.mark.parametrize('kind', KINDS)
def test_of_a_message_that_is_cut_or_foreign_no_number_is_taken(kind, rng):
    message = drawn(Nodetype.NAME, kind, rng, np.random.default_rng(3))
    cdr = encoded(message)
    swapped = bytes(STORE.serialize_cdr(message, kind, little_endian=False))
    assert encoded(decoded(kind, swapped)) == cdr
    # XCDR 1 of mutable types, XCDR 2 of all, XML (OMG DDS-XTypes 1.3, table 60)
    for head in (b'\0\2', b'\0\3', b'\0\4', b'\0\6', b'\0\7', b'\0\x08', b'\0\x09', b'\0\x0b'):
        with pytest.raises(MessageRejectedError, match='is not plain CDR'):
            decoded(kind, head + cdr[2:])
    for end in range(len(cdr) - 1):  # the last text's end may be a gap
        with pytest.raises(MessageRejectedError):
            decoded(kind, cdr[:end])
