"""Projection onto physical bodies, and the robot written back, against simulated truth."""

from dataclasses import replace

import numpy as np
import pytest
from support.identification import changed, errors_of, measure, servicer, simulate, truth_of
from support.models import H_TARGET

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.batch import identify, identify_robot
from spacerobot_ros.identification.physical import BodyParameters, project
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
    return identify_robot(measure(run, 3), believed, GENERIC)


def test_bodies_sharpen_the_estimate_and_stay_honest(run, believed, found):
    linear = identify(measure(run, 3), believed, replace(GENERIC, manifold='linear'))
    truth = truth_of(run, 'generic')
    error, std = errors_of(found.estimate, truth)
    # 45 numbers of a generic arm come from bodies of 30 dimensions: the worst AAM gains twice.
    assert np.max(found.estimate.std[:3]) < 0.6 * np.max(linear.std[:3])
    assert np.max(np.abs(error[3:6] / std[3:6])) <= 4.0


def test_a_body_that_can_not_be_is_named():
    """Inertia of the last link against the triangle inequality, as exact constants say it."""
    robot = servicer('zyx')
    model = MomentumModel(robot, minimal_set(robot, 'symmetric'))
    pi = model.tree.parameters()
    place = model.tree.names.index('J3xx')
    impossible = np.array([5.0, 100.0, 300.0])  # of link 3: 300 > 5 + 100
    pi[[place, place + 3, place + 5]] += impossible - np.diag(robot.bodies[3].inertia)
    constants = np.concatenate([np.ones(3), H_TARGET, model.minimal.regrouping @ pi])
    factor = np.diag(1.0 / np.maximum(1e-3 * np.abs(constants), 1e-2))
    found = project(model, IdentifierSettings(), constants, factor)
    assert 'link_3' in found.contradiction
    assert 'base_link' not in found.contradiction
    fits = model.minimal.regrouping @ model.tree.parameters()
    constants[model.x] = fits
    assert not project(model, IdentifierSettings(), constants, factor).contradiction


def test_bodies_are_physical(found):
    for body in found.robot.bodies:
        check_inertia(body.mass, body.inertia, body.name)


def test_dynamics_of_the_bodies_are_those_of_the_truth(run, found, rng):
    truth = Dynamics(servicer('zyx').with_target_momentum(np.array([42.0, 49.0, 41.0])))
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
    estimate = identify(rolled, servicer('zyx'), symmetric)
    assert not estimate.valid


@pytest.mark.parametrize('structure', ['generic', 'symmetric'])
def test_coordinates_start_at_the_robot_file(structure):
    robot = servicer('zyx')
    bodies = BodyParameters(robot, structure)
    rebuilt = bodies.robot(np.zeros(bodies.size))
    np.testing.assert_allclose(
        rebuilt.inertial_parameters, robot.inertial_parameters, rtol=1e-12, atol=1e-9
    )


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
