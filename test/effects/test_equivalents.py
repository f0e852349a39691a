"""Effects that together are another one: the same rows, to first order of what is small."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation

from spacerobot_ros.effects.bodies.bodies import NAMES
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.equivalents import made_of
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.diagnosis_scenario import robot_file, simulated


@pytest.fixture(scope='module')
def clean():
    """Four seconds of the servicer as its model has it."""
    robot = robot_file('servicer').robot
    record = observed(simulated('servicer', 'default', 5, (), 4.0), robot)
    run = Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')
    return Fit(run, ())


def of(kind, where, **values):
    kind = CATALOGUE[kind]
    return kind(name=f'{kind.id}_{values}', where=where, values={**kind.nominal(), **values})


def differ(clean, one, others):
    """How far others are from being one effect, as a share of what it changes in the data."""
    changed = [Fit(clean.run, some).data - clean.data for some in ([one], others)]
    names = {(e.id, e.where) for e in others}
    needed, further = made_of(clean.run.robot, one.id, one.where)
    assert needed <= names <= needed | further
    return np.linalg.norm(changed[0] - changed[1]) / np.linalg.norm(changed[0])


def test_a_soft_grasp_is_fuel_and_panels_of_its_frequency(clean):
    own = pin.Inertia.FromDynamicParameters(clean.run.robot.inertial_parameters[-1])
    share, spring = 0.02, {'frequency': 4.0, 'damping': 0.05}
    at = dict(zip('xyz', own.lever.tolist(), strict=True))
    moments, axes = np.linalg.eigh(share * own.inertia)
    panels = [
        of(
            'flexible_appendage',
            'link_3',
            inertia=inertia,
            **spring,
            **dict(zip('xyz', axis, strict=True)),
        )
        for inertia, axis in zip(moments.tolist(), axes.T.tolist(), strict=True)
    ]
    fuel = of('fuel_slosh', 'link_3', mass=share * own.mass, **spring, **at)
    grasp = of('grasp_compliance', 'link_3', share=share, **spring)
    assert differ(clean, grasp, [fuel, *panels]) < 0.05


@pytest.mark.parametrize(
    ('one', 'other', 'angle'),
    [
        ('attitude_misalignment', 'gyro_misalignment', 1e-3),
        ('gyro_misalignment', 'attitude_misalignment', -1e-3),
    ],
)
def test_a_turned_sensor_is_a_turned_base_and_the_other_sensor_turned(clean, one, other, angle):
    """About the first joint's axis: the arm's mount is not tilted."""
    robot = clean.run.robot
    first, turned = robot.bodies[1], angle * robot.bodies[1].rotation @ robot.bodies[1].axis
    back = Rotation.from_rotvec(-turned).as_matrix()
    base = pin.Inertia.FromDynamicParameters(robot.inertial_parameters[0])
    moved = base.se3Action(pin.SE3(back, first.translation - back @ first.translation))
    added = moved.toDynamicParameters() - robot.inertial_parameters[0]
    wheels = back @ robot.servicer_momentum - robot.servicer_momentum
    by = dict(zip('xyz', np.sign(angle) * turned, strict=True))
    causes = [
        of(other, None, **by),
        of('encoder_offset', 'joint_1', offset=angle),
        of('inertial_parameters', robot.bodies[0].name, **dict(zip(NAMES, added, strict=True))),
        of('servicer_wheel_momentum_error', None, **dict(zip('xyz', wheels, strict=True))),
    ]
    assert differ(clean, of(one, None, **by), causes) < 0.01
