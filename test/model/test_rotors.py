"""True rotors: locked in the gyrostat view, free in the plant view, never counted twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.models import (
    H_BASE,
    H_TARGET,
    WHEEL_SPIN,
    robot_of,
    settings_of,
    table_one,
    wheel_joints,
    with_wheels,
)

from spacerobot_ros.dynamics.state import initial_state
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.motion_settings import InitialSettings
from spacerobot_ros.model.settings import TruthSettings, parse_settings
from spacerobot_ros.simulation.truth import true_robot

PARTS = with_wheels(table_one())
WHEELS = {
    'servicer_wheels': {'joints': wheel_joints(0), 'rates': list(H_BASE / WHEEL_SPIN)},
    'target_wheels': {'joints': wheel_joints(3), 'rates': list(H_TARGET / WHEEL_SPIN)},
}


def test_gyrostat_view_is_the_locked_robot():
    robot, locked = robot_of(PARTS, **WHEELS), robot_of(table_one())
    assert robot.joints == locked.joints
    assert robot.rotor_count == 0
    # 2000 kg and 1500 kg m^2 less three wheels plus three wheels: a few ulp
    np.testing.assert_allclose(
        robot.inertial_parameters, locked.inertial_parameters, rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(robot.servicer_wheels.momentum, H_BASE, rtol=1e-14, atol=0)
    assert [g.link for g in robot.target_wheels] == ['link_3']
    np.testing.assert_allclose(robot.target_momentum, H_TARGET, rtol=1e-14, atol=0)


def test_plant_view_frees_the_rotors_and_empties_the_gyrostats():
    settings = settings_of(PARTS, **WHEELS)
    plant = true_robot(robot_of(PARTS, **WHEELS), settings)
    explicit = robot_of(PARTS, joints=[p.joint for p in PARTS[1:]])
    assert plant.joints == explicit.joints
    assert plant.rotor_count == 6
    assert plant.n_joints == 9
    assert not any(g.momentum.any() for g in plant.gyrostats)
    np.testing.assert_allclose(
        plant.inertial_parameters, explicit.inertial_parameters, rtol=0, atol=1e-11
    )
    np.testing.assert_allclose(
        plant.rotor_rates * WHEEL_SPIN, [*H_BASE, *H_TARGET], rtol=1e-14, atol=0
    )
    np.testing.assert_allclose(plant.target_momentum, H_TARGET, rtol=1e-14, atol=0)
    np.testing.assert_allclose(plant.servicer_momentum, H_BASE, rtol=1e-14, atol=0)
    assert plant.effort_limits.shape == (9,)
    assert plant.position_limits.shape == (9, 2)


def test_rotors_start_at_their_rates_behind_the_arm():
    settings = settings_of(PARTS, **WHEELS)
    plant = true_robot(robot_of(PARTS, **WHEELS), settings)
    state = initial_state(plant, InitialSettings(joint_velocity=(0.1, 0.2, 0.3)))
    np.testing.assert_array_equal(state.qd, [0.1, 0.2, 0.3, *plant.rotor_rates])
    np.testing.assert_array_equal(state.q, np.zeros(9))


def test_true_rates_differ_from_the_believed_ones():
    believed = {**WHEELS, 'target_wheels': {'joints': wheel_joints(3)}}
    settings = settings_of(PARTS, **believed)
    truth = TruthSettings(target_rates=tuple(H_TARGET / WHEEL_SPIN))
    robot = robot_of(PARTS, **believed)
    plant = true_robot(robot, replace(settings, truth=truth))
    np.testing.assert_array_equal(robot.target_momentum, np.zeros(3))
    np.testing.assert_allclose(plant.target_momentum, H_TARGET, rtol=1e-14, atol=0)
    np.testing.assert_allclose(plant.servicer_momentum, H_BASE, rtol=1e-14, atol=0)


def test_true_inertia_of_a_carrier_excludes_its_rotors():
    settings = settings_of(PARTS, **WHEELS)
    row = (480.0, 480.0, 0.0, 0.0, 400.0, 0.0, 900.0, 0.0, 0.0, 900.0)
    truth = TruthSettings(links=('link_3',), inertial_parameters=row)
    plant = true_robot(robot_of(PARTS, **WHEELS), replace(settings, truth=truth))
    np.testing.assert_allclose(plant.inertial_parameters[3], row, rtol=0, atol=1e-11)
    assert plant.rotor_count == 6


def test_rotors_on_several_links_give_a_gyrostat_a_link_in_order_of_appearance():
    parts = with_wheels(table_one(), carriers=(3, 0))
    joints = [wheel_joints(0)[0], *wheel_joints(3), *wheel_joints(0)[1:]]
    robot = robot_of(
        parts, target_wheels={'joints': joints, 'rates': [10.0, 20.0, 30.0, 40.0, 50.0, 60.0]}
    )
    assert [g.link for g in robot.target_wheels] == ['base_link', 'link_3']
    np.testing.assert_allclose(
        robot.target_momentum, [1.0, 5.0, 6.0, 2.0, 3.0, 4.0], rtol=1e-14, atol=0
    )


def test_momentum_of_a_rotated_rotor_on_a_fixed_link_is_in_the_carriers_frame():
    # The carrier is fixed to the base, turned by 90 deg about z; its rotor's frame is turned by 90
    # deg about x.
    body = (
        '<link name="{}"><inertial><mass value="10"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="{}"/></inertial></link>'
    )
    joint = (
        '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>'
        '<origin rpy="{}"/><axis xyz="0 0 1"/></joint>'
    )
    quarter = '1.5707963267948966'
    urdf = ''.join(
        [
            '<robot name="r"><link name="panel"/>',
            body.format('base_link', 1),
            body.format('arm', 1),
            body.format('rotor', 0.2),
            joint.format('j', 'continuous', 'base_link', 'arm', '0 0 0'),
            joint.format('mount', 'fixed', 'base_link', 'panel', f'0 0 {quarter}'),
            joint.format('spin', 'continuous', 'panel', 'rotor', f'{quarter} 0 0'),
            '</robot>',
        ]
    )

    def load(section: str):
        return build_robot(
            parse_settings(
                {'robot': {'joints': ['j'], section: {'joints': ['spin'], 'rates': [5.0]}}}
            ),
            urdf,
        )

    # rotor z = panel -y (turn about x); panel -y = base x (turn about z); h = .2 * 5
    np.testing.assert_allclose(
        load('servicer_wheels').servicer_wheels.momentum, [1.0, 0.0, 0.0], rtol=0, atol=1e-15
    )
    target = load('target_wheels').target_wheels
    assert [g.link for g in target] == ['panel']
    np.testing.assert_allclose(target[0].momentum, [0.0, -1.0, 0.0], rtol=0, atol=1e-15)
    np.testing.assert_allclose(target[0].body_momentum, [1.0, 0.0, 0.0], rtol=0, atol=1e-15)


def _changed(name: str, **changes):
    return [replace(p, **changes) if p.name == name else p for p in PARTS]


WHEEL = 'wheel_0_x'
REFUSALS = [
    (
        'slides',
        _changed(WHEEL, kind='prismatic'),
        WHEELS,
        r'servicer_wheels.joints\[0\]: joint .* is prismatic',
    ),
    (
        'no leaf',
        [*PARTS, replace(PARTS[-1], name='flag', parent=4, kind='fixed')],
        WHEELS,
        r"'wheel_0_x' must be a leaf",
    ),
    (
        'off centre',
        _changed(WHEEL, com=np.array([0.0, 0.01, 0.0])),
        WHEELS,
        'not balanced.* 0.01 m',
    ),
    ('tilted', _changed(WHEEL, axis=np.array([0.8, 0.6, 0.0])), WHEELS, 'not balanced'),
    (
        'massless',
        _changed(WHEEL, mass=0.0, inertia=np.zeros((3, 3))),
        WHEELS,
        'needs a mass and an inertia about its axis',
    ),
    (
        'wrong number of rates',
        PARTS,
        {**WHEELS, 'target_wheels': {'joints': wheel_joints(3), 'rates': [1.0]}},
        r'robot.target_wheels.rates: expected 3 \(one a joint\), got 1',
    ),
    (
        'gyrostat and rotors',
        PARTS,
        {**WHEELS, 'target_wheels': {'joints': wheel_joints(3), 'links': ['link_3']}},
        'robot.target_wheels: give either',
    ),
    (
        'named twice',
        PARTS,
        {**WHEELS, 'target_wheels': {'joints': [*wheel_joints(3), 'j_link_1']}},
        r"target_wheels.joints\[3\]: joint 'j_link_1' is named twice, first as robot.joints\[0\]",
    ),
    (
        'not named',
        PARTS,
        {'servicer_wheels': WHEELS['servicer_wheels']},
        "robot.joints: joint 'j_wheel_3_x' of the URDF moves",
    ),
    (
        'unknown',
        PARTS,
        {**WHEELS, 'target_wheels': {'joints': ['j_whel']}},
        r"robot.target_wheels.joints\[0\]: the URDF has no moving joint 'j_whel'",
    ),
    (
        'servicer wheel on the arm',
        PARTS,
        {
            'servicer_wheels': {'joints': wheel_joints(3)},
            'target_wheels': {'joints': wheel_joints(0)},
        },
        r"servicer_wheels.joints\[0\]: the servicer's wheels are on 'base_link', not on 'link_3'",
    ),
    (
        'carrier is all rotor',
        _changed('link_3', mass=0.0, inertia=np.zeros((3, 3))),
        WHEELS,
        "link 'link_3': carries rotors",
    ),
]


@pytest.mark.parametrize(
    ('parts', 'wheels', 'match'),
    [case[1:] for case in REFUSALS],
    ids=[case[0] for case in REFUSALS],
)
def test_refusals(parts, wheels, match):
    with pytest.raises(ConfigurationError, match=match):
        robot_of(parts, **wheels)


@pytest.mark.parametrize(
    ('truth', 'match'),
    [
        (
            TruthSettings(target_momentum=(1.0, 2.0, 3.0)),
            'truth.target_momentum: the wheels are rotors: give truth.target_rates',
        ),
        (
            TruthSettings(servicer_momentum=(1.0, 2.0, 3.0)),
            'truth.servicer_momentum: the wheels are rotors',
        ),
        (
            TruthSettings(target_rates=(1.0,)),
            r'truth.target_rates: expected 3 \(one a rotor\), got 1',
        ),
    ],
)
def test_truth_refusals(truth, match):
    settings = settings_of(PARTS, **WHEELS)
    with pytest.raises(ConfigurationError, match=match):
        true_robot(robot_of(PARTS, **WHEELS), replace(settings, truth=truth))
