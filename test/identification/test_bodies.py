"""Bodies as unknowns: physical whatever their coordinates, and the robot found, against truth."""

from dataclasses import replace

import numpy as np
import pytest
from support.identification import changed, measure, servicer, simulate
from support.models import H_TARGET, random_tree, robot_of

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.estimation.unknowns.body_coordinates import BodyCoordinates
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.model.rigid_body import check_inertia
from spacerobot_ros.model.settings import IdentifierSettings
from spacerobot_ros.model.writer import urdf_text, write_robot_file

GENERIC = IdentifierSettings(structure='generic', nuisances=())
WRONG = np.array([1.25, 1.5, 0.5, 1.5])[:, None]


@pytest.fixture(scope='module')
def run():
    return simulate('zyx', 20.0)


@pytest.fixture(scope='module')
def believed():
    robot = servicer('zyx')
    return robot.with_inertial_parameters(robot.inertial_parameters * WRONG)


@pytest.fixture(scope='module')
def found(run, believed):
    return identify(measure(run, 3), believed, GENERIC)


def test_bodies_are_physical(found):
    for body in found.robot.bodies:
        check_inertia(body.mass, body.inertia, body.name)


def test_dynamics_of_the_bodies_are_those_of_the_truth(run, found, rng):
    truth = Dynamics(servicer('zyx').with_target_momentum(H_TARGET))
    rebuilt = Dynamics(found.robot)
    for _ in range(20):
        q, qd, omega = rng.uniform(-1, 1, 3), 0.3 * rng.normal(size=3), 0.1 * rng.normal(size=3)
        state = State(np.zeros(3), np.array([0.0, 0, 0, 1]), q, np.zeros(3), omega, qd)
        one, other = truth.reduced(state), rebuilt.reduced(state)
        scale = np.max(np.abs(one.H))
        np.testing.assert_allclose(other.H, one.H, rtol=0, atol=5e-3 * scale)  # noisy data


def test_wrong_structure_is_reported_not_averaged_away():
    # Encoders of joints 2 and 3 swapped: no robot of the file's tree moves like that.
    symmetric = replace(GENERIC, structure='symmetric')
    data = measure(simulate('zyx', 20.0), 3)
    rolled = changed(data, q=data.q[:, [0, 2, 1]], qd=data.qd[:, [0, 2, 1]])
    estimate = identify(rolled, servicer('zyx'), symmetric).estimate
    assert not estimate.valid


STRUCTURES = pytest.mark.parametrize('structure', ['generic', 'symmetric'])


@STRUCTURES
def test_coordinates_start_at_the_robot_file(structure):
    robot = servicer('zyx')
    bodies = BodyCoordinates(robot, structure)
    rebuilt = bodies.robot(np.zeros(bodies.size))
    np.testing.assert_allclose(
        rebuilt.inertial_parameters, robot.inertial_parameters, rtol=1e-12, atol=1e-9
    )


@STRUCTURES
@pytest.mark.parametrize('size', [0.1, 1.0, 3.0])
def test_bodies_are_physical_at_any_coordinates(structure, size, rng):
    robot = servicer('zyx')
    bodies = BodyCoordinates(robot, structure)
    for _ in range(20):
        y = size * rng.standard_normal(bodies.size)
        found = bodies.robot(y)
        for body, known in zip(found.bodies, robot.bodies, strict=True):
            check_inertia(body.mass, body.inertia, body.name)
            if structure == 'symmetric':  # what is zero in the URDF stays there
                assert not np.any(body.inertia[known.inertia == 0.0])
        if size < 1.0:  # flatter ones are kept a little inside the boundary
            np.testing.assert_allclose(bodies.coordinates(found), y, rtol=0, atol=1e-6)


@STRUCTURES
def test_slopes_are_those_of_the_inertial_parameters(structure, rng):
    robot = robot_of(random_tree(rng, [0, 1, 1], prismatic=(2,)))
    bodies = BodyCoordinates(robot, structure)
    y, step = 0.2 * rng.standard_normal(bodies.size), 1e-6
    slopes = bodies.slopes(y)
    rows, columns = np.nonzero(bodies.free)
    for i, (body, column) in enumerate(zip(rows, columns, strict=True)):
        change = step * (np.arange(bodies.size) == i)
        ahead, behind = (bodies.robot(y + s * change).inertial_parameters for s in (1.0, -1.0))
        want = (ahead - behind) / (2.0 * step)
        assert not np.any(np.delete(want, body, axis=0))
        # differences of either side, of numbers of ten
        np.testing.assert_allclose(slopes[body, :, column], want[body], rtol=1e-6, atol=1e-6)


def test_written_robot_loads_as_it_was(tmp_path, found, believed):
    template = tmp_path / 'template.yaml'
    (tmp_path / 'robot.urdf').write_text(believed.urdf)
    joints = ', '.join(believed.joints)
    link = believed.target_wheels[0].link
    template.write_text(
        f'/**:\n  ros__parameters:\n    robot:\n      urdf: robot.urdf\n'
        f'      base_link: {believed.base_link}\n      joints: [{joints}]\n'
        f'      target_wheels: {{links: [{link}], momentum: [0.0, 0.0, 0.0]}}\n'
        f'    sensors: {{gyro_std: 2e-5}}\n'
    )
    path, urdf = write_robot_file(found.robot, template, tmp_path / 'out' / 'found.yaml')
    loaded = load_robot_file(path)
    np.testing.assert_allclose(
        loaded.robot.inertial_parameters, found.robot.inertial_parameters, rtol=1e-12, atol=1e-9
    )
    np.testing.assert_allclose(loaded.robot.target_momentum, found.estimate.aam, rtol=1e-12)
    assert loaded.settings.sensors.gyro_std == 2e-5
    assert urdf.read_text() == urdf_text(found.robot)
