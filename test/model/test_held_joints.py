"""Joints that are held: the same robot as Pinocchio's reduced model, and what is refused."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from spacerobot_ros.dynamics.equations import joint_torques
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.loader import build_robot
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.model.writer import urdf_text

_INERTIA = '<inertia ixx="{0}" ixy="0.001" ixz="0" iyy="{0}" iyz="0.002" izz="0.03"/>'


def _link(name: str, mass: float) -> str:
    origin = f'<origin xyz="0.02 {0.1 / mass} 0.05" rpy="0.2 0 0.4"/>'
    return (
        f'<link name="{name}"><inertial>{origin}<mass value="{mass}"/>'
        f'{_INERTIA.format(0.02 * mass)}</inertial></link>'
    )


def _joint(name: str, kind: str, parent: str, child: str, axis: str, more: str = '') -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0.2 0.3" rpy="0.3 -0.5 0.7"/><axis xyz="{axis}"/>'
        f'<limit lower="-2" upper="2" effort="9" velocity="1"/>{more}</joint>'
    )


MIMIC = '<mimic joint="finger" multiplier="-0.5" offset="0.01"/>'
URDF = ''.join(
    [
        '<robot name="r">',
        *(_link(f'l{i}', 1.0 + i) for i in range(6)),
        _joint('a', 'revolute', 'l0', 'l1', '0 0 1'),
        _joint('locked', 'revolute', 'l1', 'l2', '0 0.6 0.8'),
        _joint('b', 'revolute', 'l2', 'l3', '1 0 0'),
        _joint('finger', 'prismatic', 'l3', 'l4', '0.6 0 0.8'),
        _joint('thumb', 'prismatic', 'l3', 'l5', '0 1 0', MIMIC),
        '</robot>',
    ]
)
HELD = {'locked': 0.7, 'finger': 0.04}


def _robot(
    urdf: str = URDF,
    held: dict[str, object] | None = None,
    joints: str = 'a b',
    base: str = 'fixed',
) -> Robot:
    section = {'joints': joints.split(), 'base': base, 'gravity': [0.0, 0.0, -9.81]}
    return build_robot(parse_settings({'robot': {**section, 'held': held or {}}}), urdf)


def _pinocchio(motion: np.ndarray) -> np.ndarray:
    """(n,) torques of Pinocchio's reduced model at (3, n) positions, rates, accelerations."""
    whole = pin.buildModelFromXML(URDF.replace(MIMIC, ''))
    at = pin.neutral(whole)
    for name, q in {**HELD, 'thumb': -0.5 * HELD['finger'] + 0.01}.items():
        at[whole.joints[whole.getJointId(name)].idx_q] = q
    held = [whole.getJointId(name) for name in (*HELD, 'thumb')]
    reduced = pin.buildReducedModel(whole, held, at)
    return np.asarray(pin.rnea(reduced, reduced.createData(), *motion))


@pytest.mark.parametrize('is_rewritten', [False, True])
def test_a_robot_with_held_joints_is_pinocchios_reduced_one(
    rng: np.random.Generator, is_rewritten: bool
) -> None:
    robot = _robot(held=HELD)
    assert robot.held == {**HELD, 'thumb': pytest.approx(-0.01)}
    if is_rewritten:  # as `spacerobot export` and `identify` write it: the joints are fixed
        robot = _robot(urdf_text(robot))
        assert not robot.held
    assert robot.joints == ('a', 'b')
    for motion in rng.uniform(-1.5, 1.5, (5, 3, 2)):
        ours = joint_torques(robot, *motion[:, None], np.zeros((1, 3)))[0]
        # of 100 N m; rounding
        np.testing.assert_allclose(ours, _pinocchio(motion), rtol=0.0, atol=1e-11)


def test_what_is_no_body_may_hang_on_a_joint_that_is_held() -> None:
    flat = URDF.replace(_link('l4', 5.0), '<link name="l4"><inertial><mass value="0.01"/>'
                        '<inertia ixx="1e-9" ixy="0" ixz="0" iyy="1e-9" iyz="0" izz="1e-5"/>'
                        '</inertial></link>')  # fmt: skip
    with pytest.raises(ConfigurationError, match='l4'):
        _robot(flat, joints='a b locked finger', held={'thumb': 0.0})
    assert _robot(flat, HELD).bodies[-1].mass == pytest.approx(4.0 + 0.01 + 6.0, rel=1e-12)


REFUSALS = [
    (
        'a name that the URDF lacks',
        {'fingre': 0.0},
        "robot.held.fingre: .*no moving joint 'fingre'",
    ),
    (
        'beyond the limits',
        {**HELD, 'locked': 40.0},
        'robot.held.locked: 40 rad is beyond its limi',
    ),
    ('beyond those of a slide', {**HELD, 'finger': 40.0}, '40 m is beyond its limits.*-2 to 2 m'),
    ('a unit', {**HELD, 'locked': '40 deg'}, "robot.held.locked: expected a number, got '40 deg'"),
    ('no number', {**HELD, 'locked': float('nan')}, 'robot.held.locked: nan is not a finite'),
    ('a list', [0.1], r'robot.held: expected a map of named entries, got \[0.1\]'),
    ('moves, too', {**HELD, 'a': 0.0}, "'a' is one of robot.held, too: a joint moves or is held"),
    ('against its leader', {**HELD, 'thumb': 0.0}, 'thumb: 0 m, but it mimics .* -0.01 m: leave'),
    ('not held', {'finger': 0.0}, "'locked' of the URDF.*robot.held: {locked: 0.0}"),
    ('a leader that moves', {'locked': 0.0}, "'thumb' .* mimics 'finger'.*held: {thumb: 0.0}"),
]


@pytest.mark.parametrize(
    ('held', 'match'), [r[1:] for r in REFUSALS], ids=[r[0] for r in REFUSALS]
)
def test_what_can_not_be_held_is_refused_by_name(held: dict[str, object], match: str) -> None:
    with pytest.raises(ConfigurationError, match=match) as error:
        _robot(held=held)
    assert '\n' not in str(error.value)


def test_angles_in_degrees_of_a_joint_without_limits_are_refused() -> None:
    free = URDF.replace('name="locked" type="revolute"', 'name="locked" type="continuous"')
    with pytest.raises(ConfigurationError, match='90 rad is more than a turn: angles are in rad'):
        _robot(free, {**HELD, 'locked': 90.0})


def test_a_mimic_joint_is_held_alone_while_its_leader_moves() -> None:
    robot = _robot(held={'locked': 0.7, 'thumb': 0.0}, joints='a b finger')
    assert robot.joints == ('a', 'b', 'finger')


@pytest.mark.parametrize(
    ('held', 'joints', 'expected'),
    [
        ('rest', 'a b', {'locked': 0.0, 'finger': 0.0, 'thumb': 0.01}),
        ({'locked': 0.7, 'rest': 0.0}, 'a b', {'locked': 0.7, 'finger': 0.0, 'thumb': 0.01}),
        ('rest', 'a finger', {'locked': 0.0, 'b': 0.5, 'thumb': 0.0}),
        ('rest', 'a b locked finger', {'thumb': 0.0}),
    ],
)
def test_the_rest_is_held_as_near_to_zero_as_it_goes(
    held: dict[str, object], joints: str, expected: dict[str, float]
) -> None:
    end = _joint('b', 'revolute', 'l2', 'l3', '1 0 0')
    urdf = URDF.replace(end, end.replace('lower="-2"', 'lower="0.5"'))
    assert _robot(urdf, held, joints).held == {k: pytest.approx(v) for k, v in expected.items()}


def test_mimics_in_a_ring_move() -> None:
    ring = URDF.replace('<limit', '<mimic joint="thumb"/><limit', 4).replace(
        '<mimic joint="thumb"/>', '', 3
    )
    assert ring.count('<mimic') == 2
    with pytest.raises(ConfigurationError, match=r"'finger' .* mimics 'thumb'"):
        _robot(ring, {'locked': 0.0})
