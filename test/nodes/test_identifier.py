"""Identifier node: sensors in any order and rate, bad messages, resets."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.bench import MS, Bench

from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.nodes.identifier import IdentifierNode

pytestmark = pytest.mark.ros


@pytest.fixture
def bench(rig, servicer):
    return Bench(rig, servicer)


def test_says_what_is_missing_before_the_data_suffice(bench):
    assert bench.status('inputs').message == 'nothing received yet'
    bench.all(0, 1310)
    assert len(bench.estimates) == 1, [e.reason for e in bench.estimates]
    message = bench.estimates[0]
    assert not message.valid
    assert '4 s are needed' in message.reason
    assert len(message.covariance) == (3 + 19) ** 2
    assert set(message.parameter_units) == {'kg m^2'}
    assert bench.status('inputs').message == 'all sensors arrive'
    assert 'not valid' in bench.status('estimate').message


def test_a_sensor_that_never_comes_is_named(bench):
    stamps = iter(range(0, 100_000_000, 10))

    def more():
        ms = bench.wall.ms = next(stamps)
        bench.gyro(ms)
        bench.joint(ms)
        return bench.estimates

    bench.rig.until(more)  # the node waits for the tracker for a second of its clock, too
    assert bench.status('inputs').message == 'no samples from /attitude'
    assert 'no attitude' in bench.estimates[-1].reason


@pytest.mark.parametrize(
    ('send', 'topic', 'reason'),
    [
        (lambda b: b.gyro(2000, (np.nan, 0, 0)), '/imu/data', 'angular_velocity is not finite'),
        (lambda b: b.gyro(2000, frame='x'), '/imu/data', "frame_id is 'x', expected 'base_link'"),
        (lambda b: b.gyro(1990), '/imu/data', 'duplicate stamp'),
        (lambda b: b.gyro(1500), '/imu/data', 'duplicate stamp'),
        (lambda b: b.star(2000, (0, 0, 0, 0)), '/attitude', 'quaternion has norm #, not #'),
        (lambda b: b.star(2000, (0, 0, 0, 1.1)), '/attitude', 'quaternion has norm #, not #'),
        (lambda b: b.star(2000, (np.nan, 0, 0, 1)), '/attitude', 'quaternion is not finite'),
        (lambda b: b.joint(2000, (np.inf, 0, 0)), '/joint_states', 'position is not finite'),
        (lambda b: b.joint(2000, names='abc'), '/joint_states',
         'joint names: lacks joint_1, joint_2, joint_3'),
        (lambda b: b.joint(2000, (0, 0)), '/joint_states', 'position has # entries for # joints'),
    ],
)  # fmt: skip
def test_bad_samples_are_counted_and_the_rest_is_used(bench, send, topic, reason):
    bench.all(0, 2000)
    send(bench)
    bench.rig.deliver()
    assert bench.node.health.rejected[topic, reason] == 1
    before = len(bench.estimates)
    bench.all(2000, 3500)
    assert len(bench.estimates) > before
    assert bench.estimates[-1].rejected >= 1


def test_reset_forgets_and_says_so(bench):
    bench.all(0, 1310)
    assert bench.call('/identifier/reset').success
    bench.rig.until(lambda: len(bench.estimates) == 2)
    assert not bench.estimates[-1].valid
    assert bench.estimates[-1].samples == 0


def test_solve_answers_with_the_reason(bench):
    response = bench.call('/identifier/solve')
    assert not response.success
    assert response.message.startswith('not valid: no joint states')


def test_stamps_that_jump_begin_another_segment(bench):
    bench.rig.set_time(6400 * MS)
    bench.all(5000, 6400)
    count = len(bench.estimates)
    bench.all(0, 100)
    assert len(bench.estimates) == count + 1
    assert bench.node.health.count() == 0
    assert bench.node.latest['joints'][0] == 90 * MS


def test_a_clock_that_jumps_back_begins_another_segment(bench):
    bench.rig.set_time(6000 * MS)
    bench.all(5000, 5100)
    bench.rig.set_time(0)
    bench.all(0, 100)
    bench.rig.until(lambda: bench.estimates)
    assert 'no' in bench.estimates[-1].reason


@pytest.mark.parametrize('ms', [0, (2**31 - 1) * 1000, 36_000])
def test_one_wrong_stamp_is_refused_and_nothing_forgotten(bench, ms):
    bench.rig.set_time(7000 * MS)
    bench.all(5000, 7000)
    before = bench.node.identifier.samples
    bench.joint(ms)
    bench.gyro(ms)
    bench.all(7000, 8500)
    assert bench.node.identifier.samples is before
    reason = 'stamp jumps by # s, and none agrees with it; check the clock'
    assert bench.node.health.rejected['/joint_states', reason] == 1
    assert bench.node.health.rejected['/imu/data', reason] == 1
    assert bench.node.health.count() == 2
    assert len(before.streams['joints'].stamps) == 350


def test_samples_lost_under_load_do_not_silence_it(bench):
    bench.all(0, 2000)
    bench.all(102_000, 104_000)  # as after a queue that overflowed
    assert bench.node.health.count() == 0
    assert bench.node.latest['joints'][0] == 103_990 * MS
    assert len(bench.node.identifier.samples.streams['joints'].stamps) == 200


@pytest.mark.parametrize('late', ['joints', 'gyro'])
@pytest.mark.parametrize('rate', [(0.1, 0.1, 0.1), (0.0, 0.0, 0.0)], ids=['follows', 'stands'])
def test_a_sensor_that_starts_late_ends_nothing(bench, late, rate):
    """Every sample serves where the tracker follows the gyro; where it stands none of it fits."""
    for ms in range(0, 13_000, 20):
        if late != 'gyro' or ms >= 5500:
            bench.gyro(ms)
        if late != 'joints' or ms >= 5500:
            bench.joint(ms)
        if ms % 100 == 0:
            bench.star(ms, Rotation.from_rotvec(1e-3 * ms * np.array(rate)).as_quat())
            bench.rig.deliver()
    bench.node.flush()
    assert bench.node.estimate is not None
    if any(rate):
        assert bench.node.estimate.samples >= 50 * 6
    else:
        assert bench.node.estimate.reason == 'attitude: never changes, the gyro does'


def test_a_fixed_base_is_refused(rig, servicer):
    moving = {'initial.angular_velocity': [0.0, 0.0, 0.0], 'robot.base': 'fixed'}
    with pytest.raises(ConfigurationError):
        rig.add(IdentifierNode, servicer, **moving)
