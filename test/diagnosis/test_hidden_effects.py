"""One effect of each kind, hidden at a drawn place in data of another engine: the first name.

As in `test_hidden.py`, a test has the bag and the robot file; the truth is read after the verdict.
"""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip('mujoco')

from support.against_mujoco import point_mass

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.recording.read import read_record
from validation.mujoco.truth import ROBOTS, generate

DURATION = 8.0  # s
SIGMA = 4.0  # of a dozen numbers, one is beyond it by chance in one of 1300 sets of seeds


def answer(case):
    """Verdict from data and robot file alone."""
    robot = load_robot_file(case.robot).robot
    return diagnose(read_record(case.data, robot), robot)


def hide(folder, robot, *effects, seed, duration=DURATION):
    return generate(robot, effects, folder=folder, seed=seed, duration=duration, bag=True)


def joint(robot, seed):
    return str(np.random.default_rng(seed).choice(ROBOTS[robot].joints))


def drawn(seed, low, high):
    """A number of random size and sign."""
    rng = np.random.default_rng(seed)
    return float(rng.uniform(low, high) * rng.choice([-1.0, 1.0]))


CASES = {
    'dry friction': ('servicer', 21, 'joint_coulomb_friction', 'torque', 0.3, 1.0),
    'sensor bias': ('sixdof', 22, 'torque_sensor_bias', 'bias', 0.3, 1.0),
    'encoder': ('sixdof', 23, 'encoder_offset', 'offset', 3e-3, 1e-2),
    'rate': ('servicer', 24, 'joint_rate_scale', 'gain', 5e-3, 2e-2),
}


@pytest.mark.parametrize('name', CASES)
def test_what_a_joint_hides_is_named_at_that_joint(tmp_path, name):
    robot, seed, effect, parameter, low, high = CASES[name]
    value = drawn(seed, low, high)
    value = abs(value) if 'friction' in effect else value
    value += CATALOGUE[effect].nominal()[parameter]
    case = hide(tmp_path, robot, (effect, joint(robot, seed), {parameter: value}), seed=seed)
    said = answer(case)
    assert said.verdict == 'explained', said.sentence
    (cause,) = said.causes
    ((hidden, where, truth),) = case.hidden
    assert (cause.applied.id, cause.applied.where) == (hidden, where)
    estimated = cause.parameters[parameter]
    assert abs(estimated.value - truth[parameter]) <= SIGMA * estimated.std


SYSTEM = {
    'imu_delay': ('servicer', 25, {'delay': 0.013}),
    'external_torque_inertial': ('servicer', 26, {'x': 0.4, 'y': -0.3, 'z': 0.5}),
    'gyro_misalignment': ('sixdof', 27, {'x': -2e-3, 'y': 3e-3, 'z': -4e-3}),
}


@pytest.mark.parametrize('effect', SYSTEM)
def test_what_the_whole_hides_is_named(tmp_path, effect):
    robot, seed, values = SYSTEM[effect]
    case = hide(tmp_path, robot, (effect, None, values), seed=seed)
    said = answer(case)
    assert said.verdict == 'explained', said.sentence
    (cause,) = said.causes
    ((hidden, _, truth),) = case.hidden
    assert cause.applied.id == hidden
    for name, value in truth.items():
        estimated = cause.parameters[name]
        assert abs(estimated.value - value) <= SIGMA * estimated.std


def test_a_payload_is_weighed(tmp_path):
    payload = ('inertial_parameters', 'link_6', point_mass(3.0, (0.05, 0.02, 0.1)))
    case = hide(tmp_path, 'sixdof', payload, seed=28)
    said = answer(case)
    assert said.verdict == 'explained', said.sentence
    (cause,) = said.causes
    ((hidden, where, truth),) = case.hidden
    assert (cause.applied.id, cause.applied.where) == (hidden, where)
    # the figure asked for
    np.testing.assert_allclose(cause.parameters['mass'].value, truth['mass'], rtol=0.1, atol=0.0)


def test_an_arm_on_the_ground_as_it_is_gives_none(tmp_path):
    said = answer(hide(tmp_path, 'pendulum', seed=29))
    assert (said.verdict, said.causes) == ('consistent', ()), said.sentence


BOOMS = {
    'on a mast at the side': (3.71, (0.0, 1.0, 0.0), 4.0, (0.0, 3.0, 0.0), (1.0, 0.3, 0.0), 10.0),
    'of three metres': (2.26, (0.0, 0.0, 1.0), 2.1, (0.3, 0.3, 0.2), (0.0, 1.5, 0.0), 20.0),
}


@pytest.mark.parametrize('name', BOOMS)
def test_a_boom_hinged_off_its_mass_is_named(tmp_path, name):
    """Its mode takes part in translations, and in squares of the rate: 6.5 kg m^2 at the hinge."""
    frequency, axis, mass, at, lever, needed = BOOMS[name]
    boom = {'inertia': 6.5, 'frequency': frequency, 'damping': 0.01, 'mass': mass}
    for name, vector in (('', axis), ('at_', at), ('lever_', lever)):
        boom |= {name + a: x for a, x in zip('xyz', vector, strict=True)}
    case = hide(tmp_path, 'servicer', ('flexible_appendage', None, boom), seed=42, duration=needed)
    said = answer(case)
    assert said.verdict == 'explained', said.sentence
    (cause,) = said.causes
    assert (cause.applied.id, cause.applied.where) == ('flexible_appendage', 'base_link')
    assert cause.parameters['frequency'].value == pytest.approx(frequency, rel=0.01)
    sway = mass * np.cross(axis, lever)
    axial = 6.5 - np.cross(axis, lever) @ sway
    turn = axial * np.array(axis) + np.cross(np.add(at, lever), sway)
    # small for the panel's angle, some per cent, and the scatter of so many numbers
    assert cause.parameters['inertia'].value == pytest.approx(turn @ turn / 6.5, rel=0.15)
