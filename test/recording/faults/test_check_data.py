"""Every fault of the data is named as one; nothing physical is called a fault."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

pytest.importorskip('mujoco')

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.faults.data_faults import check_data, data_faults, with_known_faults
from spacerobot_ros.recording.faults.signals import torn_positions
from spacerobot_ros.recording.record import AttitudeSeries, RateSeries, Record, to_stamps
from validation.mujoco.truth import EXCITATIONS, ROBOTS, generate

FREE = ['servicer', 'sixdof']
DEGREES = 180.0 / np.pi


@pytest.fixture(scope='module')
def known(tmp_path_factory):
    """Record and robot by name."""
    out = {}
    for name in ROBOTS:
        case = generate(name, folder=tmp_path_factory.mktemp(name), seed=5, duration=8.0)
        out[name] = case.data, load_robot_file(case.robot).robot
    return out


def joints(record, position=1.0, velocity=1.0, effort=1.0):
    """The record with its joints' channels scaled."""
    j = record.joints
    scaled = j.position * position, j.velocity * velocity, j.effort * effort
    return chosen(record, dict(zip(('position', 'velocity', 'effort'), scaled, strict=True)))


def chosen(record, channels):
    """The record with some of its joints' channels exchanged for others."""
    return replace(record, joints=replace(record.joints, **channels))


def gyro(record, factor):
    return replace(record, rates=RateSeries(record.rates.stamp_ns, record.rates.omega * factor))


def attitude(record, q_xyzw):
    return replace(record, attitudes=AttitudeSeries(record.attitudes.stamp_ns, q_xyzw))


def swapped(record, *channels):
    """Columns of the first two joints exchanged."""
    order = [1, 0, *range(2, len(record.joints.names))]
    return chosen(record, {c: getattr(record.joints, c)[:, order] for c in channels})


def flipped(record):
    """Signs of one joint."""
    return np.where(np.arange(len(record.joints.names)) == 1, -1.0, 1.0)


def held(values, column):
    """One column that never changes."""
    out = values.copy()
    out[:, column] = values[0, column]
    return out


def late(stamps, seconds=3.0):
    """A clock that is set forward half way."""
    return stamps + np.where(np.arange(len(stamps)) > len(stamps) // 2, int(seconds * 1e9), 0)


def part(record, count):
    channels = ('stamp_ns', 'position', 'velocity', 'effort')
    return chosen(record, {c: getattr(record.joints, c)[:count] for c in channels})


def slowed(record, factor):
    """Stamps in a smaller unit than was thought."""
    return chosen(record, {'stamp_ns': record.joints.stamp_ns * factor})


JOINT_FAULTS = {
    'rates in degrees': (lambda r: joints(r, velocity=DEGREES), 'degrees instead of radians'),
    'positions in degrees': (lambda r: joints(r, position=DEGREES), 'as if they were degrees'),
    'rates in milliradians': (lambda r: joints(r, velocity=1e3), 'a thousand times too large'),
    'all in degrees': (
        lambda r: joints(r, position=DEGREES, velocity=DEGREES),
        'degrees instead of radians',
    ),
    'efforts in milli': (lambda r: joints(r, effort=1e3), 'a thousand times too large'),
    'efforts in kilo': (lambda r: joints(r, effort=1e-3), 'a thousand times too small'),
    'rates exchanged': (lambda r: swapped(r, 'velocity'), 'joint_1 and joint_2 are exchanged'),
    'efforts exchanged': (lambda r: swapped(r, 'effort'), 'joint_1 and joint_2 are exchanged'),
    'joints exchanged': (
        lambda r: swapped(r, 'position', 'velocity', 'effort'),
        'joint_1 and joint_2 are exchanged',
    ),
    'a rate flipped': (lambda r: joints(r, velocity=flipped(r)), 'joint_2: rates against posi'),
    'an effort flipped': (lambda r: joints(r, effort=flipped(r)), 'joint_2: of the wrong sign'),
    'efforts flipped': (lambda r: joints(r, effort=-1.0), 'all efforts are of the wrong sign'),
    'a joint flipped': (
        lambda r: joints(r, flipped(r), flipped(r), flipped(r)),
        'joints/joint_2: position, rate and effort are of the wrong sign',
    ),
    'no effort': (lambda r: joints(r, effort=0.0), 'all efforts are zero'),
    'a dead effort': (
        lambda r: chosen(r, {'effort': held(r.joints.effort, 1)}),
        'joint_torque/joint_2: never changes',
    ),
    'a dead joint': (
        lambda r: chosen(
            r,
            {
                'position': held(r.joints.position, 1),
                'velocity': np.where(
                    np.arange(r.joints.velocity.shape[1]) == 1, 0.0, r.joints.velocity
                ),
            },
        ),
        'joint_position/joint_2: never changes',
    ),
    'a dead encoder': (
        lambda r: chosen(r, {'position': held(r.joints.position, 1)}),
        'joint_position/joint_2: never changes',
    ),
    'a clock set forward': (
        lambda r: chosen(r, {'stamp_ns': late(r.joints.stamp_ns)}),
        'the clock jumps by 3.01 s',
    ),
    'a clock set forward by years': (  # arrays over the span would take gigabytes
        lambda r: chosen(r, {'stamp_ns': late(r.joints.stamp_ns, 2e8)}),
        'the clock jumps by 200000000.01 s',
    ),
    'milliseconds for seconds': (lambda r: slowed(r, 1000), 'the stamps are not in seconds'),
    'stamps that run too fast': (
        lambda r: slowed(r, 2),
        'all rates are 2 times the derivative of the positions: is the clock off by that factor?',
    ),
    'stamps that run too slowly': (
        lambda r: chosen(r, {'stamp_ns': (0.8 * r.joints.stamp_ns).astype(int)}),
        'factor? Scale its stamps by 1.25, or the rates',
    ),
    'too few': (lambda r: part(r, 30), 'has 30 samples'),
    'too short': (lambda r: part(r, 100), 'a diagnosis needs 2 s or more'),
    'no joints': (lambda r: replace(r, joints=None), '/joint_states: is missing'),
}

BASE_FAULTS = {
    'gyro in degrees': (lambda r: gyro(r, DEGREES), 'gyro: rates against the attitude are deg'),
    'gyro flipped': (lambda r: gyro(r, -1.0), 'of the wrong sign'),
    'gyro axes flipped': (lambda r: gyro(r, np.array([1.0, -1.0, -1.0])), 'x, -y, -z'),
    'gyro dead': (lambda r: gyro(r, 0.0), 'never changes'),
    'gyro axis dead': (lambda r: gyro(r, np.array([1.0, 0.0, 1.0])), 'gyro/y: never changes'),
    'scalar first': (
        lambda r: attitude(r, np.roll(r.attitudes.q_xyzw, 1, axis=1)),
        'the quaternion has its scalar first',
    ),
    'inverse': (
        lambda r: attitude(r, r.attitudes.q_xyzw * np.array([-1.0, -1.0, -1.0, 1.0])),
        None,
    ),
    'attitude dead': (
        lambda r: attitude(r, np.tile(r.attitudes.q_xyzw[:1], (len(r.attitudes.q_xyzw), 1))),
        'attitude: never changes',
    ),
    'gyro set forward': (
        lambda r: replace(r, rates=RateSeries(late(r.rates.stamp_ns), r.rates.omega)),
        'gyro: the clock jumps by 3.0',
    ),
    'tracker set forward': (
        lambda r: replace(
            r, attitudes=AttitudeSeries(late(r.attitudes.stamp_ns), r.attitudes.q_xyzw)
        ),
        'attitude: the clock jumps by 3.1',
    ),
    'another epoch': (
        lambda r: replace(
            r, rates=RateSeries(r.rates.stamp_ns + 1_700_000_000_000_000_000, r.rates.omega)
        ),
        'gyro: begins 1700000000 s after the joints',
    ),
    'no base': (lambda r: replace(r, rates=None, attitudes=None), 'are both missing'),
}


@pytest.mark.parametrize('robot', FREE)
@pytest.mark.parametrize('fault', [*JOINT_FAULTS, *BASE_FAULTS])
def test_a_fault_of_a_free_robot_is_named(known, robot, fault):
    record, model = known[robot]
    spoil, words = {**JOINT_FAULTS, **BASE_FAULTS}[fault]
    faults = data_faults(spoil(record), model)
    assert faults
    assert words is None or words in '; '.join(faults)


@pytest.mark.parametrize('fault', [f for f in JOINT_FAULTS if f != 'joints exchanged'])
def test_a_fault_of_an_arm_on_the_ground_is_named(known, fault):
    record, model = known['ground']
    spoil, words = JOINT_FAULTS[fault]
    faults = data_faults(spoil(record), model)
    assert faults
    assert words is None or words in '; '.join(faults)


def test_recordings_that_were_joined_are_torn_and_lost_samples_are_not(known):
    record, model = known['ground']
    kept = np.r_[0:300, 500 : len(record.joints.stamp_ns)]
    channels = ('stamp_ns', 'position', 'velocity', 'effort')
    lost = chosen(record, {c: getattr(record.joints, c)[kept] for c in channels})
    assert data_faults(lost, model) == ()
    closed = np.where(np.arange(len(kept)) < 300, 0, 1_700_000_000)  # all but 0.3 s of the pause
    (fault,) = data_faults(chosen(lost, {'stamp_ns': lost.joints.stamp_ns - closed}), model)
    assert 'recordings that were joined? --split-gaps' in fault
    of_none = {'names': (), **{c: np.zeros((len(kept), 0)) for c in channels[1:]}}
    assert not list(torn_positions(chosen(lost, of_none)))  # a robot without joints


@pytest.fixture(scope='module')
def paused():
    """A free body that turns slowly, silent for 3 s, gyro and tracker."""
    time = np.delete(np.arange(0.0, 20.0, 0.02), np.s_[400:550])
    turned = Rotation.from_rotvec(np.outer(time, [0.02, -0.01, 0.03]))
    rates = RateSeries(to_stamps(time), np.tile([0.02, -0.01, 0.03], (len(time), 1)))
    return Record(rates=rates, attitudes=AttitudeSeries(rates.stamp_ns, turned.as_quat()))


def test_attitudes_that_were_joined_are_torn(paused):
    """A turn of a radian over a pause of 3 s, in which the body turns by 0.11 rad."""
    assert not list(torn_positions(paused))
    turned = paused.attitude
    beyond = Rotation.from_rotvec([0.0, 1.0, 0.0]) * turned[400:]
    torn = attitude(paused, np.vstack([turned[:400].as_quat(), beyond.as_quat()]))
    (fault,) = torn_positions(torn)
    assert 'recordings that were joined? --split-gaps' in fault.message
    # of a tracker that is blind while the gyro sees a slew nobody wonders
    slew = np.where(np.arange(len(paused.rates.omega)) // 100 == 5, 0.5, 0.01)
    seen = RateSeries(paused.rates.stamp_ns, slew[:, None] * [0.0, 1.0, 0.0])
    assert not list(torn_positions(replace(torn, rates=seen)))


def test_a_leap_from_sample_to_sample_is_no_motion(paused):
    """Half a radian in 0.02 s, of a body that turns by 0.0007 rad in that time."""
    turned = paused.attitude
    leapt = Rotation.from_rotvec([0.0, 0.5, 0.0]) * turned[200:]
    quaternions = np.vstack([turned[:200].as_quat(), leapt.as_quat()])
    (fault,) = torn_positions(attitude(paused, quaternions))
    assert 'jumps by 0.495 over 0.02 s, 3.98 s after the start' in fault.message
    assert 'cut it there' in fault.message
    # a fast slew that begins within a sample is a motion
    time = paused.attitude_time[:400]
    slewed = Rotation.from_rotvec(np.outer(np.maximum(time - 4.0, 0.0), [0.0, 3.0, 0.0]))
    quaternions = np.vstack([(slewed * turned[:400]).as_quat(), turned[400:].as_quat()])
    rates = RateSeries(paused.rates.stamp_ns, np.full((len(turned), 3), 3.0))
    assert not list(torn_positions(replace(attitude(paused, quaternions), rates=rates)))


def test_a_diagnosis_refuses_faulty_data_in_one_line(known):
    record, model = known['servicer']
    with pytest.raises(RecordingError, match='faulty data: gyro: rates against the att') as error:
        diagnose(gyro(record, DEGREES), model)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('robot', ['servicer', 'ground', 'pendulum'])
@pytest.mark.parametrize('excitation', EXCITATIONS)
def test_clean_data_have_no_fault(tmp_path, robot, excitation):
    case = generate(robot, folder=tmp_path, seed=9, duration=3.0, excitation=excitation)
    assert data_faults(case.data, load_robot_file(case.robot).robot) == ()


CAUSES = {
    'friction': [('joint_coulomb_friction', 'joint_2', {'torque': 3.0})],
    'ripple': [
        ('joint_torque_ripple', 'joint_2', {'amplitude': 2.0, 'harmonic': 24.0, 'phase': 0.3})
    ],
    'torque constant': [('joint_torque_constant', 'joint_1', {'gain': 0.7})],
    'encoder': [('encoder_offset', 'joint_2', {'offset': 0.05})],
    'scales': [
        ('encoder_scale', 'joint_1', {'gain': 1.05}),
        ('joint_rate_scale', 'joint_2', {'gain': 1.03}),
        ('gyro_scale', None, {'x': 0.02, 'y': -0.02, 'z': 0.03}),
    ],
    'angles': [
        ('gyro_misalignment', None, {'x': -0.03, 'y': 0.02, 'z': -0.05}),
        ('attitude_misalignment', None, {'x': 0.02, 'y': 0.05, 'z': -0.03}),
    ],
    'clocks': [
        ('imu_delay', None, {'delay': 0.02}),
        ('attitude_delay', None, {'delay': 0.1}),
        ('joint_delay', None, {'delay': 0.02}),
    ],
    'gyro bias': [('gyro_bias', None, {'x': 1e-3, 'y': 2e-3, 'z': -1e-3})],
    'torque': [('external_torque_body', None, {'x': 1.0, 'y': -0.5, 'z': 0.3})],
    'harness': [('joint_stiffness', 'joint_2', {'stiffness': 20.0, 'rest_angle': 0.3})],
}


@pytest.mark.parametrize('cause', CAUSES)
def test_a_physical_cause_is_no_fault(tmp_path, cause):
    case = generate('servicer', CAUSES[cause], folder=tmp_path, seed=8, duration=3.0)
    assert data_faults(case.data, load_robot_file(case.robot).robot) == ()


def test_degrees_are_seen_by_the_limits_without_any_effort(tmp_path):
    """Nothing else contradicts them where rates are in degrees, too."""
    case = generate('servicer', folder=tmp_path, seed=9, duration=3.0)
    robot = load_robot_file(case.robot).robot
    limited = replace(robot, position_limits=np.tile([-2.9, 2.9], (robot.n_joints, 1)))
    bare = chosen(case.data, {'effort': None})
    assert data_faults(bare, limited) == ()
    wrong = chosen(joints(case.data, position=DEGREES, velocity=DEGREES), {'effort': None})
    (line,) = data_faults(wrong, limited)
    assert 'rad, the limits of the URDF are 2.9 rad: degrees instead of radians?' in line


def test_known_faults_are_notes_and_what_is_missing_is_refused(known):
    record, model = known['servicer']
    taken = with_known_faults(joints(record, effort=-1.0), model)
    check_data(taken, model)
    assert 'all efforts are of the wrong sign (taken as it is, --force-data)' in taken.notes[-1]
    with pytest.raises(RecordingError, match='joint_states: is missing'):
        check_data(replace(taken, joints=None), model)
