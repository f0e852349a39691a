"""Friction of a joint as one law: named and learned frictions together."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from support.laws import law_entry

from spacerobot_ros.diagnosis.arms.friction_law import friction_laws
from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.real_arm import RealArm, arm_file

JOINT, OTHER = 'joint_2', 'joint_3'
RATE, ANGLE = f'rate/{JOINT}', f'angle/{JOINT}'
BOTH = [RATE, f'rate/{OTHER}']
NAMED = {
    'dry': {'effect': 'joint_coulomb_friction', 'where': JOINT, 'torque': 5.0},
    'wet': {'effect': 'joint_viscous_friction', 'where': JOINT, 'coefficient': 2.0},
}


def law(form, inputs, coefficients, where=JOINT, **guard):
    ends = {name: [-10.0, 10.0] for name in inputs}
    return law_entry(form, inputs, coefficients, where, range=ends, limit=100.0, **guard)


@pytest.fixture(scope='module')
def balance():
    file = arm_file(has_friction=False)
    record = RealArm(4).record(0, (JOINT, OTHER), 10.0)
    return balance_of(observed(record, file.robot), file.robot, ())


def friction(balance, named, learned):
    """As of a diagnosis that found these."""
    robot = balance.robot
    named, learned = (bind_effects(section, robot) for section in (named, learned))
    found = SimpleNamespace(
        robot=robot, named=named, learned=learned, calibration=(), extended=(balance,)
    )
    return {it.joint: it for it in friction_laws(found)}


@pytest.mark.parametrize(
    ('learned', 'coulomb', 'viscous'),
    [
        ({}, 5.0, 2.0),
        ({'l': law('sign(x), x', [RATE], [-3.0, -0.5])}, 8.0, 2.5),
        ({'l': law('x', [ANGLE], [-3.0])}, 5.0, 2.0),  # a spring is none
        ({'l': law('x', [f'rate/{OTHER}'], [-3.0])}, 5.0, 2.0),  # nor is the other's
        ({'l': law('sign(x + y)', BOTH, [-3.0], kind='coupled', react={OTHER: 1.0})}, 5.0, 2.0),
    ],
)
def test_named_and_learned_frictions_count_together(learned, coulomb, viscous, balance):
    """At rates that the motion has; reversals are smoothed over some mrad/s, or a displacement."""
    (it,) = friction(balance, NAMED, learned).values()
    assert it.joint == JOINT
    for rate in (0.3, 0.8):
        expected = coulomb + viscous * rate
        assert it.coulomb + it.viscous * rate == pytest.approx(expected, rel=0.03)


def test_drag_counts_as_what_comes_closest_to_it(balance):
    """Least squares of v |v| on sign(v) and v, by the rates of the motion."""
    (it,) = friction(balance, {}, {'l': law('x*abs(x)', [RATE], [-3.0])}).values()
    column = balance.robot.joints.index(JOINT)
    v = balance.motion.qd[balance.arm.is_moving[:, column], column]
    design = np.column_stack([np.sign(v), v])
    coulomb, viscous = np.linalg.solve(design.T @ design, design.T @ (3.0 * v * np.abs(v)))
    assert coulomb < 0.0 < viscous
    np.testing.assert_allclose([it.coulomb, it.viscous], [coulomb, viscous], rtol=1e-9)


def test_an_offset_makes_friction_of_two_sizes(balance):
    bias = {'effect': 'torque_sensor_bias', 'where': JOINT, 'bias': 0.7}
    it = friction(balance, {**NAMED, 'bias': bias}, {})[JOINT]
    assert it.coulomb_forward - it.coulomb_backward == pytest.approx(1.4)


@pytest.mark.parametrize(('law', 'missing'), [('dry', 'viscous'), ('wet', 'coulomb')])
def test_what_is_not_named_is_nothing(law, missing, balance):
    """Rounding of the fit, 1e-15 of the other, is printed as a negative friction otherwise."""
    ((joint, it),) = friction(balance, {law: NAMED[law]}, {}).items()
    assert (joint, it.unit) == (JOINT, 'N m')
    assert abs(getattr(it, missing)) < (0.2 if law == 'dry' else 1e-300)  # dry friction creeps
