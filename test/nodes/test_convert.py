"""Every message that must not be used is rejected with the reason; good ones come through."""

import itertools

import numpy as np
import pytest
from geometry_msgs.msg import QuaternionStamped, WrenchStamped
from numpy.testing import assert_allclose
from rclpy.serialization import serialize_message
from sensor_msgs.msg import Imu, JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from spacerobot_ros.control.joint_reference import rest
from spacerobot_ros.errors import MessageRejectedError
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.recording import messages
from spacerobot_ros.recording.bags.message_types import composer, decoded, encoded, typestore
from spacerobot_ros.ros import convert
from spacerobot_ros.ros.convert import compose
from spacerobot_ros.ros.qos import SAMPLES
from spacerobot_ros.ros.session import Recorder

pytestmark = pytest.mark.ros

NAMES = ['a', 'b']


def joints(names=('a', 'b'), position=(1.0, 2.0), velocity=(3.0, 4.0), effort=(5.0, 6.0)):
    return JointState(name=names, position=position, velocity=velocity, effort=effort)


def test_joint_samples_are_put_in_order_and_others_left_out():
    message = joints(('x', 'b', 'a'), (9.0, 2.0, 1.0), (9.0, 4.0, 3.0))
    message.header.stamp = compose.time(3_000_000_007)
    stamp, q, qd = messages.joint_sample(message, NAMES)
    assert stamp == 3_000_000_007
    assert q.tolist() == [1.0, 2.0]
    assert qd.tolist() == [3.0, 4.0]


def test_a_stamp_is_one_that_a_message_holds():
    message = joints()
    message.header.stamp.nanosec = 1_000_000_000
    with pytest.raises(MessageRejectedError, match='has 1000000000 ns beside the seconds'):
        messages.joint_sample(message, NAMES)
    last = compose.time(2**63)  # a torque for after the last stamp that there is
    assert (last.sec, last.nanosec) == (2**31 - 1, 999_999_999)
    assert compose.time(-(2**63)).sec == -(2**31)


def test_efforts_of_samples_are_in_newton_metres():
    units = np.array([1.0, 12.5])  # b says amperes
    *_, effort = messages.joint_sample(joints(), NAMES, effort_units=units)
    assert effort.tolist() == [5.0, 75.0]
    for absent in ((), (np.nan, np.nan)):  # as drivers without torque sensors say it
        *_, effort = messages.joint_sample(joints(effort=absent), NAMES, effort_units=units)
        assert effort is None
    with pytest.raises(MessageRejectedError, match='effort is not finite'):
        messages.joint_sample(joints(effort=(np.nan, 1.0)), NAMES, effort_units=units)


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (joints(names=('a', 'c')), 'lacks b'),
        (joints(names=()), 'lacks a, b'),
        (joints(names=('a', 'a')), 'lacks b'),
        (joints(('a', 'b', 'a'), (1.0, 2.0, 3.0), (1.0, 2.0, 3.0)), 'one appears twice'),
        (joints(position=(1.0,)), 'position has 1 entries for 2 joints'),
        (joints(velocity=()), 'velocity has 0 entries'),
        (joints(position=(1.0, np.nan)), 'position is not finite'),
        (joints(velocity=(np.inf, 0.0)), 'velocity is not finite'),
    ],
)
def test_joint_samples_rejected(message, reason):
    with pytest.raises(MessageRejectedError, match=reason):
        messages.joint_sample(message, NAMES)


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (joints(names=('a', 'b', 'c'), effort=(1.0, 2.0, 3.0)), 'has foreign c'),
        (joints(names=('a',), effort=(1.0,)), 'lacks b'),
        (joints(effort=()), 'effort has 0 entries'),
        (joints(effort=(np.nan, 0.0)), 'effort is not finite'),
    ],
)
def test_commands_rejected(message, reason):
    with pytest.raises(MessageRejectedError, match=reason):
        messages.joint_efforts(message, NAMES)


def imu(frame='base_link', x=1.0, covariance=0.0):
    message = Imu()
    message.header.frame_id = frame
    message.angular_velocity.x = x
    message.angular_velocity_covariance[0] = covariance
    return message


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (imu(frame='imu_link'), "frame_id is 'imu_link', expected 'base_link'"),
        (imu(x=np.nan), 'not finite'),
        (imu(covariance=-1.0), 'no angular velocity'),
    ],
)
def test_rates_rejected(message, reason):
    with pytest.raises(MessageRejectedError, match=reason):
        messages.angular_rate(message, 'base_link')


@pytest.mark.parametrize(
    ('xyzw', 'reason'),
    [
        ((0.0, 0.0, 0.0, 0.0), 'norm 0'),
        ((0.0, 0.0, 0.0, 1.01), 'norm 1.01'),
        ((0.0, 0.0, np.nan, 1.0), 'not finite'),
    ],
)
def test_attitudes_rejected(xyzw, reason):
    message = compose.quaternion(0, np.array(xyzw))
    with pytest.raises(MessageRejectedError, match=reason):
        messages.attitude(message)


def test_attitude_keeps_the_order_xyzw():
    message = compose.quaternion(0, np.array([0.0, 0.0, 0.6, 0.8]))
    assert (message.quaternion.z, message.quaternion.w) == (0.6, 0.8)
    assert messages.attitude(message)[1].tolist() == [0.0, 0.0, 0.6, 0.8]
    assert isinstance(message, QuaternionStamped)


def test_wrench_is_force_then_torque_in_the_base_frame():
    message = WrenchStamped()
    message.wrench.force.x, message.wrench.torque.z = 1.0, 2.0
    assert messages.base_wrench(message, 'base_link')[1].tolist() == [1.0, 0, 0, 0, 0, 2.0]
    message.header.frame_id = 'inertial'
    with pytest.raises(MessageRejectedError, match='frame_id'):
        messages.base_wrench(message, 'base_link')


def estimate(rng):
    return Estimate(
        method='ml', valid=True, reason='', aam_links=('link_3',), aam=rng.normal(size=3),
        parameter_names=('x', 'y'), parameters=rng.normal(size=2),
        covariance=np.diag(rng.uniform(size=5)), rank=5, unknowns=9, condition=3.0,
        unexcited=('none',), total_momentum=rng.normal(size=3),
        total_momentum_covariance=np.eye(3), chi2_per_dof=1.1, samples=7,
        stamp_ns=12_000_000_003, units=('kg m', 'kg'), prior_factor=0.7,
        sources=('data', 'both', 'file', 'data', 'data'),
    )  # fmt: skip


def test_estimates_survive_the_round_trip(rng):
    want = estimate(rng)
    got = convert.estimate(convert.estimate_message(want, 2))
    for name in Estimate.__dataclass_fields__:
        if name != 'notes':
            assert np.array_equal(getattr(got, name), getattr(want, name)), name


@pytest.mark.parametrize(
    ('name', 'value', 'reason'),
    [
        ('covariance', [1.0], 'covariance has 1 entries, expected 25'),
        ('covariance', (-np.eye(5)).ravel(), 'negative variance'),
        ('aam', [np.nan, 0.0, 0.0], 'not finite'),
        ('aam_links', [], 'sizes'),
        ('parameter_names', ['x'], 'sizes'),
    ],
)
def test_estimates_rejected(rng, name, value, reason):
    message = convert.estimate_message(estimate(rng), 0)
    setattr(message, name, list(value))
    with pytest.raises(MessageRejectedError, match=reason):
        convert.estimate(message)


def trajectory(times=(1, 2), names=('b', 'a'), **kinds):
    message = JointTrajectory(joint_names=names)
    for i, t in enumerate(times):
        point = JointTrajectoryPoint(**{k: [float(x) for x in v[i]] for k, v in kinds.items()})
        point.time_from_start.sec = t
        message.points.append(point)
    return message


def test_trajectories_become_references():
    message = trajectory(positions=[(2, 1), (4, 3)], velocities=[(0, 0), (0, 0)])
    reference, start = convert.trajectory(message, NAMES, rest(np.zeros(2)))
    assert start is None
    assert_allclose(reference.at(1.0).q, [1.0, 2.0], atol=1e-12)
    assert_allclose(reference.at(0.0).q, [0.0, 0.0], atol=1e-12)
    assert reference.duration == 2.0


@pytest.mark.parametrize(
    ('message', 'reason'),
    [
        (trajectory(names=('a', 'c'), positions=[(0, 0), (1, 1)]), 'lacks b and has foreign c'),
        (trajectory(positions=[(0,), (1,)]), 'positions: every point needs 2'),
        (trajectory(), 'positions: every point needs 2'),
        (trajectory(times=()), 'no points'),
        (trajectory(times=(2, 2), positions=[(0, 0), (1, 1)]), 'increase'),
        (trajectory(positions=[(0, 0), (np.nan, 1)]), 'not finite'),
        (trajectory(positions=[(0, 0), (1, 1)], velocities=[(0, 0), ()]), 'velocities: every'),
    ],
)
def test_trajectories_rejected(message, reason):
    with pytest.raises(MessageRejectedError, match=reason):
        convert.trajectory(message, NAMES, None)


def test_messages_are_read_as_rclpy_serializes_them(rng):
    for joints in (1, 3):
        for columns in itertools.product((0, joints), repeat=3):
            position, velocity, effort = (rng.normal(size=size) for size in columns)
            names = [f'joint_{k}' for k in range(joints)]
            message = compose.joint_state(5, names, position, velocity, effort)
            read = decoded('sensor_msgs/msg/JointState', serialize_message(message))
            assert read.name == names
            assert read.position.tolist() == position.tolist()
            assert read.velocity.tolist() == velocity.tolist()
            assert read.effort.tolist() == effort.tolist()


def test_a_recorder_hears_both_endiannesses_and_leaves_out_what_has_no_stamp(rig):
    node, heard = rig.plain(), []
    Recorder(node, {'/imu/data': Imu}, lambda *message: heard.append(message))
    publisher = node.create_publisher(Imu, '/imu/data', SAMPLES)
    little = encoded(composer().imu(7_000_000_003, 'base_link', np.arange(3.0)))
    message = decoded('sensor_msgs/msg/Imu', little)
    big = typestore().serialize_cdr(message, 'sensor_msgs/msg/Imu', little_endian=False)
    for cdr in (b'\0\1\0\0', b'\0\7' + little[2:], bytes(big), little):
        publisher.publish(cdr)
    rig.drain()
    said = '/imu/data', 'sensor_msgs/msg/Imu', 7_000_000_003
    assert heard == [(*said, bytes(big)), (*said, little)]
