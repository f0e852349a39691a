"""Bags: written deterministically, read whatever their storage, order or damage."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from support.models import robot_of, table_one

from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.bags.bag import Topics, read_bag
from spacerobot_ros.recording.bags.bag_writer import BagWriter
from spacerobot_ros.recording.bags.message_types import message_folder, typestore
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.simulation.plant import Plant

STORE = get_typestore(Stores.ROS2_HUMBLE)  # not the product's: bags of other distributions
T = STORE.types
ROBOT = robot_of(table_one())
JOINTS = list(ROBOT.joints)
JOINT_STATE = 'sensor_msgs/msg/JointState'
IMU = 'sensor_msgs/msg/Imu'
ATTITUDE = 'geometry_msgs/msg/QuaternionStamped'


def digest(folder):
    """SHA-256 over names and bytes of a folder's files."""
    content = hashlib.sha256()
    for path in sorted(Path(folder).iterdir()):
        content.update(path.name.encode() + b'\0' + path.read_bytes())
    return content.hexdigest()


# ---------------------------------------------------------------- messages by hand


def header(ns, frame=''):
    return T['std_msgs/msg/Header'](
        T['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9), frame
    )


def joint_state(ns, names=None, position=None, velocity=None, effort=None):
    n = len(JOINTS if names is None else names)
    columns = [
        np.asarray(np.arange(n) + 10.0 * i if c is None else c, dtype=float)
        for i, c in enumerate((position, velocity, effort))
    ]
    return T[JOINT_STATE](header(ns), list(JOINTS if names is None else names), *columns)


def imu(ns, omega=(0.1, 0.2, 0.3), frame='base_link', absent=False):
    vector, quaternion = T['geometry_msgs/msg/Vector3'], T['geometry_msgs/msg/Quaternion']
    covariance = np.zeros(9)
    covariance[0] = -1.0 if absent else 0.0
    zero = vector(0.0, 0.0, 0.0)
    return T[IMU](
        header(ns, frame),
        quaternion(0.0, 0.0, 0.0, 1.0),
        np.zeros(9),
        vector(*omega),
        covariance,
        zero,
        np.zeros(9),
    )


def attitude(ns, q=(0.0, 0.0, 0.0, 1.0), frame='world'):
    return T[ATTITUDE](header(ns, frame), T['geometry_msgs/msg/Quaternion'](*q))


def write(path, messages, plugin=StoragePlugin.MCAP, version=9):
    """A bag by hand: (topic, message or bytes, type) in order, logged one ms apart."""
    with Writer(path, version=version, storage_plugin=plugin) as writer:
        connections = {}
        for i, (topic, message, *msgtype) in enumerate(messages):
            kind = msgtype[0] if msgtype else message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            data = message if isinstance(message, bytes) else STORE.serialize_cdr(message, kind)
            writer.write(connections[topic], 10**18 + i * 10**6, data)
    return path


def good(n=3):
    return [
        entry
        for k in range(n)
        for entry in (
            ('/joint_states', joint_state(k * 10**7)),
            ('/imu/data', imu(k * 10**7)),
            ('/attitude', attitude(k * 10**7)),
        )
    ]


# ---------------------------------------------------------------- reading


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('version', [8, 9])
def test_reads_both_storages_with_header_stamps(tmp_path, plugin, version):
    record = read_bag(write(tmp_path / 'bag', good(), plugin, version), ROBOT)
    for series in (record.joints, record.rates, record.attitudes):
        np.testing.assert_array_equal(series.stamp_ns, [0, 10**7, 2 * 10**7])
    np.testing.assert_array_equal(record.joints.position[1], [0.0, 1.0, 2.0])
    np.testing.assert_array_equal(record.joints.velocity[1], [10.0, 11.0, 12.0])
    np.testing.assert_array_equal(record.joints.effort[1], [20.0, 21.0, 22.0])
    np.testing.assert_array_equal(record.rates.omega[0], [0.1, 0.2, 0.3])
    assert record.wheels is None
    own, unseen = record.notes  # rosbags writes mcap without checksums, sqlite3 has none
    assert own == 'sample times are header stamps'
    assert unseen.endswith('has no checksums: damage to its numbers would not be noticed')
    assert record.source == str(tmp_path / 'bag')


def test_reads_a_bare_mcap_file(tmp_path):
    folder = write(tmp_path / 'bag', good())
    record = read_bag(next(folder.glob('*.mcap')), ROBOT)
    assert len(record.joints.stamp_ns) == 3


def test_joint_columns_are_put_in_order_by_name(tmp_path):
    names = [JOINTS[2], JOINTS[0], JOINTS[1]]
    message = joint_state(0, names, [2.0, 0.0, 1.0], [12.0, 10.0, 11.0], [22.0, 20.0, 21.0])
    record = read_bag(write(tmp_path / 'bag', [('/joint_states', message)]), ROBOT)
    np.testing.assert_array_equal(record.joints.position, [[0.0, 1.0, 2.0]])
    np.testing.assert_array_equal(record.joints.velocity, [[10.0, 11.0, 12.0]])
    np.testing.assert_array_equal(record.joints.effort, [[20.0, 21.0, 22.0]])
    assert '/joint_states: joint columns reordered by name' in record.notes
    assert '/imu/data: absent' in record.notes
    assert record.rates is None


def test_joints_that_the_robot_file_holds_may_be_there(tmp_path):
    message = joint_state(0, ['finger', *JOINTS])
    robot = replace(ROBOT, held={'finger': 0.04, 'thumb': 0.04})
    record = read_bag(write(tmp_path / 'bag', [('/joint_states', message)]), robot)
    assert record.joints.names == tuple(JOINTS)
    note = '/joint_states: finger, thumb: left out, as the robot file holds them'
    assert note in record.notes


def test_other_topics_and_wheels(tmp_path):
    wheels = joint_state(5, ['w1', 'w2'], position=[], velocity=[1.0, 2.0], effort=[])
    messages = [('/arm', joint_state(0)), ('/wheel_states', wheels), ('/gyro', imu(0, frame=''))]
    path = write(tmp_path / 'bag', messages)
    record = read_bag(path, ROBOT, Topics(joints='/arm', imu='/gyro'))
    assert record.joints.names == ROBOT.joints
    assert record.wheels.names == ('w1', 'w2')
    np.testing.assert_array_equal(record.wheels.velocity, [[1.0, 2.0]])
    assert record.wheels.effort is None
    assert "/gyro: no frame given, taken as 'base_link'" in record.notes


def test_what_acts_and_the_robot_file_does_not_know_is_said(tmp_path):
    """Wheels that turn, thrusters that fire: they stay in the bag, and a note says so."""
    wheels = joint_state(5, ['w1'], position=[], velocity=[1.0], effort=[])
    fired = joint_state(5, ['T1'], position=[], velocity=[], effort=[1.0])
    messages = [('/joint_states', joint_state(0)), ('/wheel_states', wheels)]
    path = write(tmp_path / 'bag', [*messages, ('/thruster_commands', fired)])
    record = read_record(path, ROBOT)
    assert 'thrusters' not in record.inputs
    said = '; '.join(record.notes)
    assert 'rates of w1 are left out: robot.servicer_wheels.joints of the robot file names' in said
    assert '/thruster_commands: left out, as robot.thrusters of the robot file names none' in said


def test_messages_without_velocity_or_effort(tmp_path):
    messages = [
        ('/joint_states', joint_state(0, velocity=[], effort=[])),
        ('/joint_states', joint_state(1, effort=[])),
    ]
    record = read_bag(write(tmp_path / 'bag', messages), ROBOT)
    assert record.joints.velocity is None
    assert record.joints.effort is None
    assert '/joint_states: 1 of 2 messages have no velocity: not used' in record.notes


def test_a_minority_without_effort_is_left_out(tmp_path):
    messages = [
        ('/joint_states', joint_state(k, effort=[] if k % 5 == 1 else None)) for k in range(20)
    ]
    record = read_bag(write(tmp_path / 'bag', messages), ROBOT)
    assert record.joints.stamp_ns.tolist() == [k for k in range(20) if k % 5 != 1]
    assert record.joints.effort.shape == (16, 3)
    note = (
        '/joint_states: 4 of 20 messages lack efforts or velocities that the others have: left out'
    )
    assert note in record.notes


@pytest.mark.parametrize('apart', [0, 4_000_000], ids=['one stamp', 'by turns'])
def test_joint_states_in_parts_are_merged_by_stamp(tmp_path, apart):
    """What a slower publisher says is interpolated; where it pauses there is nothing."""
    period, messages = 10_000_000, []

    def value(ns, joint):
        return 1e-9 * ns * (1.0 + joint)

    def part(ns, joints):
        values = [value(ns, k) for k in joints]
        return joint_state(ns, [JOINTS[k] for k in joints], values, values, values)

    for k in range(200):
        messages.append(('/joint_states', part(k * period, [2, 0])))
        if k >= 10 and k % 2 == 0 and not 100 <= k < 150:
            messages.append(('/joint_states', part(k * period + apart, [1])))
    record = read_bag(write(tmp_path / 'bag', messages), ROBOT)
    stamps = record.joints.stamp_ns
    own = [k * period + apart for k in range(10, 200, 2) if not 100 <= k < 150]
    known = [k * period for k in range(200) if own[0] <= k * period <= own[-1]]
    known = [t for t in known if not (own[44] < t < own[45])]
    assert stamps.tolist() == known
    expected = [[value(t, k) for k in range(3)] for t in known]
    for column in (record.joints.position, record.joints.velocity, record.joints.effort):
        np.testing.assert_allclose(column, expected, rtol=1e-12)
    (note,) = (note for note in record.notes if 'merged by stamp' in note)
    assert note.endswith(f'merged by stamp: {len(known)} samples of all')


def test_parts_that_lack_a_joint_are_refused(tmp_path):
    messages = [('/joint_states', joint_state(k, JOINTS[:2])) for k in range(9)]
    with pytest.raises(RecordingError, match=f'no usable message: joint names: lacks {JOINTS[2]}'):
        read_bag(write(tmp_path / 'bag', messages), ROBOT)


BAD = {
    'nan': ('/joint_states', joint_state(99, position=[0.0, np.nan, 0.0]),
            'position is not finite'),
    'infinite rate': ('/joint_states', joint_state(99, velocity=[0.0, np.inf, 0.0]),
                      'velocity is not finite'),
    'missing joint': ('/joint_states', joint_state(99, JOINTS[:2]),
                      f'joint names: lacks {JOINTS[2]}'),
    'foreign joint': ('/joint_states', joint_state(99, [*JOINTS, 'gripper']),
                      'joint names: has foreign gripper'),
    'joint twice': ('/joint_states', joint_state(99, [*JOINTS, JOINTS[0]]),
                    'joint names: one appears twice'),
    'short column': ('/joint_states', joint_state(99, effort=[1.0]),
                     'effort has 1 entries for 3 joints'),
    'no position': ('/joint_states', joint_state(99, position=[]),
                    'position has 0 entries for 3 joints'),
    'duplicate stamp': ('/joint_states', joint_state(0), 'stamp seen before'),
    'gyro of no machine': ('/imu/data', imu(99, (0.0, 1e300, 0.0)),
                           'angular_velocity has a number of no machine, beyond 1e+12'),
    'gyro nan': ('/imu/data', imu(99, (0.0, np.nan, 0.0)), 'angular_velocity is not finite'),
    'gyro frame': ('/imu/data', imu(99, frame='imu_link'),
                   "frame_id is 'imu_link', expected 'base_link'"),
    'gyro absent': ('/imu/data', imu(99, absent=True),
                    'holds no angular velocity (covariance[0] is -1)'),
    'zero quaternion': ('/attitude', attitude(99, (0.0,) * 4), 'quaternion has norm 0, not 1'),
    'long quaternion': ('/attitude', attitude(99, (0.0, 0.0, 0.0, 1.002)),
                        'quaternion has norm 1.002, not 1'),
    'nan quaternion': ('/attitude', attitude(99, (np.nan, 0.0, 0.0, 1.0)),
                       'quaternion is not finite'),
    'attitude frame': ('/attitude', attitude(99, frame='base_link'),
                       "frame_id is 'base_link', the base itself, expected the inertial frame"),
    'garbage': ('/attitude', b'\x00\x05\x00\x00' + bytes(60),
                'not a geometry_msgs/msg/QuaternionStamped: encapsulation 0005 is not plain CDR'),
}  # fmt: skip
TYPE_OF = {'/joint_states': JOINT_STATE, '/imu/data': IMU, '/attitude': ATTITUDE}


@pytest.mark.parametrize(('topic', 'message', 'reason'), BAD.values(), ids=BAD.keys())
def test_a_bad_message_is_left_out_and_counted(tmp_path, topic, message, reason):
    bag = write(tmp_path / 'bag', [*good(), (topic, message, TYPE_OF[topic])])
    record = read_bag(bag, ROBOT)
    assert f'{topic}: 1 left out: {reason}' in record.notes
    assert {len(s.stamp_ns) for s in (record.joints, record.rates, record.attitudes)} == {3}


@pytest.mark.parametrize(
    ('topic', 'message', 'reason'),
    [v for k, v in BAD.items() if k != 'duplicate stamp'],
    ids=[k for k in BAD if k != 'duplicate stamp'],
)
def test_nothing_but_bad_messages_is_refused(tmp_path, topic, message, reason):
    messages = [e for e in good() if e[0] != topic] + [(topic, message, TYPE_OF[topic])] * 2
    bag = write(tmp_path / 'bag', messages)
    with pytest.raises(RecordingError) as error:
        read_bag(bag, ROBOT)
    assert str(error.value) == f'{bag}: {topic}: no usable message: {reason} (2 messages)'


def test_a_clock_too_coarse_for_its_messages_is_refused(tmp_path):
    rates = [('/imu/data', imu(k // 4, (float(k), 0.0, 0.0))) for k in range(40)]
    with pytest.raises(RecordingError, match='30 of 40 messages have the stamp of another one'):
        read_bag(write(tmp_path / 'bag', rates), ROBOT)
    again = [rates[k - k % 4] for k in range(40)]  # the same messages, as of two recorders
    record = read_bag(write(tmp_path / 'again', again), ROBOT)
    assert len(record.rates.stamp_ns) == 10
    assert '/imu/data: 30 left out: stamp seen before' in record.notes


def test_messages_out_of_order_are_sorted(tmp_path):
    messages = [('/imu/data', imu(k, (float(k), 0.0, 0.0))) for k in (3, 1, 2)]
    record = read_bag(write(tmp_path / 'bag', messages), ROBOT)
    np.testing.assert_array_equal(record.rates.stamp_ns, [1, 2, 3])
    np.testing.assert_array_equal(record.rates.omega[:, 0], [1.0, 2.0, 3.0])
    assert '/imu/data: messages out of order, sorted by stamp' in record.notes


def test_quaternions_of_single_precision_pass_and_rougher_ones_are_noted(tmp_path):
    single = np.array([0.2, 0.1, 0.3, 0.927])
    single = (single / np.linalg.norm(single)).astype(np.float32).astype(float)
    record = read_bag(write(tmp_path / 'a', [('/attitude', attitude(0, single))]), ROBOT)
    np.testing.assert_array_equal(record.attitudes.q_xyzw[0], single)
    rough = attitude(0, (0.0, 0.0, 0.0, 1.0005))
    record = read_bag(write(tmp_path / 'b', [('/attitude', rough)]), ROBOT)
    np.testing.assert_array_equal(record.attitudes.q_xyzw, [[0.0, 0.0, 0.0, 1.0]])
    assert any('quaternions normalized' in note for note in record.notes)


# ---------------------------------------------------------------- unreadable bags


def one_line(path, match):
    with pytest.raises(RecordingError, match=match) as error:
        read_bag(path, ROBOT)
    assert '\n' not in str(error.value)


def test_what_is_no_bag(tmp_path):
    one_line(tmp_path / 'nothing', 'no such file or folder')
    one_line(tmp_path, 'has no metadata.yaml')
    (tmp_path / 'notes.txt').write_text('hello')
    one_line(tmp_path / 'notes.txt', 'can not be read as a rosbag2 recording')
    (tmp_path / 'metadata.yaml').write_text('a: [1')
    one_line(tmp_path, 'can not be read as a rosbag2 recording')


def test_an_empty_bag_and_a_bag_of_other_things(tmp_path):
    one_line(write(tmp_path / 'empty', []), r'has no message on .* \(it has nothing\)')
    other = [('/chatter', T['std_msgs/msg/String']('hi'))]
    one_line(write(tmp_path / 'other', other), r'\(it has /chatter\)')
    wrong = [('/imu/data', T['std_msgs/msg/String']('hi'))]
    one_line(
        write(tmp_path / 'wrong', wrong),
        '/imu/data: carries std_msgs/msg/String, expected sensor_msgs/msg/Imu',
    )


@pytest.mark.parametrize('plugin', list(StoragePlugin))
@pytest.mark.parametrize('keep', [0.0, 0.3, 0.9])
def test_a_truncated_bag_is_one_line(tmp_path, plugin, keep):
    folder = write(tmp_path / 'bag', good(300), plugin)
    path = next(p for p in folder.iterdir() if p.suffix in ('.mcap', '.db3'))
    path.write_bytes(path.read_bytes()[: int(keep * path.stat().st_size)])
    one_line(folder, 'can not be read as a rosbag2 recording|has no message')


def test_random_damage_never_escapes_as_another_error(tmp_path, rng):
    folder = write(tmp_path / 'bag', good(20))
    path = next(folder.glob('*.mcap'))
    clean = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    for _ in range(60):
        damaged = clean.copy()
        damaged[rng.integers(0, len(clean), 5)] = rng.integers(0, 256, 5)
        path.write_bytes(damaged.tobytes())
        with contextlib.suppress(RecordingError):  # or it is read: not every bit matters
            read_bag(folder, ROBOT)


# ---------------------------------------------------------------- writing


def fill(bag, n=50, order=1):
    for k in range(n):
        ns, v, make = k * 10**7, np.full(3, 0.1 * k), bag.compose
        messages = [
            ('/joint_states', make.joint_state(ns, JOINTS, v, v + 1, v + 2)),
            ('/imu/data', make.imu(ns, 'base_link', v, 2e-5)),
            ('/attitude', make.quaternion(ns, np.array([0.6, 0.0, 0.0, 0.8]))),
            ('/wheel_states', make.joint_state(ns, ['w'], velocity=v[:1])),
        ]
        for topic, message in messages[::order]:
            bag.add(topic, message)


def test_round_trip(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        fill(bag)
    record = read_bag(tmp_path / 'bag', ROBOT)
    expected = 0.1 * np.arange(50)[:, None] * np.ones(3)
    stamps = np.arange(50) * 10**7
    np.testing.assert_array_equal(record.joints.stamp_ns, stamps)
    np.testing.assert_array_equal(record.joints.position, expected)
    np.testing.assert_array_equal(record.joints.velocity, expected + 1)
    np.testing.assert_array_equal(record.joints.effort, expected + 2)
    np.testing.assert_array_equal(record.rates.omega, expected)
    np.testing.assert_array_equal(record.attitudes.q_xyzw, np.tile([0.6, 0, 0, 0.8], (50, 1)))
    np.testing.assert_array_equal(record.wheels.velocity, expected[:, :1])
    assert record.notes == ('sample times are header stamps',)


def test_same_content_same_bytes_in_whatever_order_and_folder(tmp_path):
    with BagWriter(tmp_path / 'a') as bag:
        fill(bag)
    with BagWriter(tmp_path / 'b') as bag:
        fill(bag, order=-1)
    with BagWriter(tmp_path / 'c') as bag:
        fill(bag, n=49)
    assert digest(tmp_path / 'a') == digest(tmp_path / 'b')
    assert digest(tmp_path / 'a') != digest(tmp_path / 'c')


def test_header_conventions_of_the_imu(tmp_path):
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add('/imu/data', bag.compose.imu(1_500_000_000, 'hull', np.ones(3), 0.5))
    with Reader(tmp_path / 'bag') as reader:
        connection, stamp, data = next(reader.messages())
    message = STORE.deserialize_cdr(data, connection.msgtype)
    assert stamp == 1_500_000_000
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_000)
    assert message.header.frame_id == 'hull'
    assert message.orientation_covariance[0] == -1.0
    assert message.linear_acceleration_covariance[0] == -1.0
    np.testing.assert_array_equal(np.diag(message.angular_velocity_covariance.reshape(3, 3)), 0.25)


def test_metadata_names_types_hashes_and_latched_topics(tmp_path):
    plant = Plant(ROBOT, State(np.zeros(3), np.array([0, 0, 0, 1.0]), *[np.zeros(3)] * 4), 0.1, 1)
    with BagWriter(tmp_path / 'bag') as bag:
        bag.add('/simulator/ledger', bag.compose.ledger(0, plant.ledger()))
        bag.text('/robot_description', 0, '<robot/>')
    with Reader(tmp_path / 'bag') as reader:
        topics = {c.topic: c for c in reader.connections}
        assert topics['/simulator/ledger'].digest.startswith('RIHS01_')
        assert 'float64 momentum_drift' in topics['/simulator/ledger'].msgdef.data
        qos = topics['/robot_description'].ext.offered_qos_profiles[0]
        assert qos.durability.name == 'TRANSIENT_LOCAL'
        assert (
            topics['/simulator/ledger'].ext.offered_qos_profiles[0].durability.name == 'VOLATILE'
        )
        assert reader.message_count == 2


def installed(msgtype):
    """The type description that the genuine tools installed, or None."""
    package, _, name = msgtype.split('/')
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        path = Path(prefix) / 'share' / package / 'msg' / f'{name}.json'
        if prefix and path.is_file():
            return json.loads(path.read_text())
    return None


@pytest.mark.parametrize(
    'msgtype',
    [JOINT_STATE, IMU, ATTITUDE, 'std_msgs/msg/String', 'rosgraph_msgs/msg/Clock']
    + [f'spacerobot_msgs/msg/{path.stem}' for path in sorted(message_folder().glob('*.msg'))],
)
def test_type_hashes_are_those_of_the_genuine_tools(msgtype):
    description = installed(msgtype)
    if description is None:
        pytest.skip(f'no type description of {msgtype} is installed')
    hashes = {e['type_name']: e['hash_string'] for e in description['type_hashes']}
    assert typestore().hash_rihs01(msgtype) == hashes[msgtype]


def test_what_a_middleware_gave_is_written_as_it_came(tmp_path):
    good = STORE.serialize_cdr(joint_state(5, JOINTS, *np.ones((3, 3))), JOINT_STATE)
    with BagWriter(tmp_path / 'bag') as bag:
        bag.message('/joint_states', JOINT_STATE, 5, good)
        bag.message('/joint_states', JOINT_STATE, 6, b'\0\1\0\0\5')
    with Reader(tmp_path / 'bag') as reader:
        assert [bytes(data) for _, _, data in reader.messages()] == [good, b'\0\1\0\0\5']
    record = read_bag(tmp_path / 'bag', ROBOT)
    assert record.joints.stamp_ns.tolist() == [5]
    assert any('/joint_states: 1 left out: not a' in note for note in record.notes)


def put(path, *calls, overwrite=False):
    """Write a bag by calls on its writer."""
    with BagWriter(path, overwrite=overwrite) as bag:
        for call in calls:
            call(bag)


@pytest.mark.parametrize(
    ('calls', 'message'),
    [
        ([lambda b: b.message('/x', 'no/msg/Such', 0, b'\0\1\0\0')], '/x: not a no/msg/Such'),
        (
            [
                lambda b: b.text('/x', 0, 'a'),
                lambda b: b.add('/x', b.compose.joint_state(0, JOINTS)),
            ],
            '/x: carries std_msgs/msg/String and sensor_msgs/msg/JointState',
        ),
    ],
    ids=['type', 'two types'],
)
def test_messages_that_can_not_be_written(tmp_path, calls, message):
    with pytest.raises(RecordingError, match=message):
        put(tmp_path / 'bag', *calls)
    assert not list(tmp_path.iterdir())


def failing(_):
    raise KeyError


def test_an_error_leaves_nothing_and_keeps_what_was_there(tmp_path):
    path = tmp_path / 'bag'
    with pytest.raises(KeyError):
        put(path, fill, failing)
    assert not list(tmp_path.iterdir())
    put(path, fill)
    before = digest(path)
    with pytest.raises(KeyError):
        put(path, failing, overwrite=True)
    assert digest(path) == before
    assert list(tmp_path.iterdir()) == [path]


def test_replaces_only_bags_and_only_when_asked(tmp_path):
    path = tmp_path / 'bag'
    with BagWriter(path) as bag:
        fill(bag)
    with pytest.raises(RecordingError, match=r'exists already \(--force replaces it\)'):
        BagWriter(path)
    with BagWriter(path, overwrite=True) as bag:
        fill(bag, 5)
    assert len(read_bag(path, ROBOT).joints.stamp_ns) == 5
    (tmp_path / 'thesis').mkdir()
    with pytest.raises(RecordingError, match='is not a bag, so it is not replaced'):
        BagWriter(tmp_path / 'thesis', overwrite=True)
    file = tmp_path / 'file'
    file.write_text('x')
    with pytest.raises(RecordingError, match='is not a bag'):
        BagWriter(file, overwrite=True)
    with pytest.raises(RecordingError, match='can not be written'), BagWriter(file / 'bag') as bag:
        fill(bag, 1)


def test_makes_the_folders_above(tmp_path):
    with BagWriter(tmp_path / 'out' / 'demo' / 'bag') as bag:
        fill(bag, 1)
    assert (tmp_path / 'out' / 'demo' / 'bag' / 'metadata.yaml').is_file()


def test_a_clock_that_jumps_back_is_refused_with_its_place(tmp_path):
    stamps = [k * 10**7 - (3 * 10**9 if k >= 400 else 0) for k in range(600)]
    bag = write(tmp_path / 'bag', [('/imu/data', imu(k)) for k in stamps])
    one_line(
        bag, r'/imu/data, message 400: the clock jumps back by 2.99 s, 3.99 s after the first'
    )
