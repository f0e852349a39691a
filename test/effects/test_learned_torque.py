"""Learned torques: formulas, saturation, energy, robot files, feed-forward."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from support.effects import PERIOD, motion_of
from support.laws import law_entry
from support.models import random_tree, robot_of

from spacerobot_ros.control.computed_torque import FeedForward
from spacerobot_ros.control.joint_reference import Setpoint
from spacerobot_ros.dynamics.integrate import TABLEAUS
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.effects.joint import STICTION_RATE
from spacerobot_ros.effects.laws.grammar import FORMS, unit_of
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.machine import machine_of
from spacerobot_ros.simulation.plant import Plant

JOINT, CARRIER = 'j_link_2', 'j_link_1'
RATE, ANGLE, LOAD = f'rate/{JOINT}', f'angle/{JOINT}', f'load/{JOINT}'
RANGES = {RATE: [-2.0, 2.0], ANGLE: [-1.5, 1.5], LOAD: [-9.0, 9.0], f'rate/{CARRIER}': [-2.0, 2.0]}


def sign(v):
    return math.tanh(v / STICTION_RATE)


LAWS = {
    'x*abs(x)': ([RATE], [-0.7], {}, lambda v: -0.7 * v * abs(v)),
    'sign(x), x': ([RATE], [-0.5, -0.3], {}, lambda v: -0.5 * sign(v) - 0.3 * v),
    'sign(x)*exp(-(x/scale)**2)': (
        [RATE],
        [-0.8],
        {'scale': 0.4},
        lambda v: -0.8 * sign(v) * math.exp(-((v / 0.4) ** 2)),
    ),
    'min(x, lower) - lower, max(x, upper) - upper': (
        [ANGLE],
        [-4.0, -6.0],
        {'lower': -0.5, 'upper': 0.7},
        lambda q: -4.0 * min(q + 0.5, 0.0) - 6.0 * max(q - 0.7, 0.0),
    ),
    'sign(x), sin(m*y)*sign(x), cos(m*y)*sign(x)': (
        [RATE, ANGLE],
        [-1.0, -0.2, 0.3],
        {'m': 3.0},
        lambda v, q: sign(v) * (-1.0 - 0.2 * math.sin(3 * q) + 0.3 * math.cos(3 * q)),
    ),
    'y**2*sign(x)': ([RATE, LOAD], [-0.01], {}, lambda v, t: -0.01 * t * t * sign(v)),
    'x, x*exp(-y/scale)': (
        [RATE, 'time'],
        [-0.4, -0.2],
        {'scale': 8.0},
        lambda v, t: -v * (0.4 + 0.2 * math.exp(-t / 8.0)),
    ),
    'sin(x - y), cos(x - y)': (
        [ANGLE, f'angle/{CARRIER}'],
        [0.3, -0.2],
        {},
        lambda a, b: 0.3 * math.sin(a - b) - 0.2 * math.cos(a - b),
    ),
    'sin(m*y), cos(m*y), x*sin(m*y), x*cos(m*y)': (
        [ANGLE, f'angle/{CARRIER}'],
        [0.3, -0.2, 0.1, 0.4],
        {'m': 2.0},
        lambda a, b: (0.3 + 0.1 * a) * math.sin(2 * b) + (0.4 * a - 0.2) * math.cos(2 * b),
    ),
}


@pytest.fixture
def robot(rng):
    return robot_of(random_tree(rng, [0, 1, 2]))


def entry(form, inputs, coefficients, options=None, **guard):
    ends = {'range': {**RANGES, 'time': [0.0, 60.0]}}
    return law_entry(form, inputs, coefficients, JOINT, options, **{**ends, **guard})


def bound(robot, **given):
    return bind_effects({'it': given}, robot)[0]


def inputs_of(motion, name):
    what, _, joint = name.partition('/')
    if what == 'time':
        return motion.time
    values = {'rate': motion.qd, 'angle': motion.q, 'load': motion.effort}[what]
    return values[:, motion.robot.joints.index(joint)]


@pytest.mark.parametrize('form', LAWS)
def test_torque_is_the_formula(form, robot, rng):
    names, coefficients, options, law = LAWS[form]
    applied = bound(robot, **entry(form, names, coefficients, options))
    motion = motion_of(robot, rng, 50)
    motion.q[:], motion.qd[:] = np.clip(motion.q, -1.4, 1.4), np.clip(motion.qd, -1.9, 1.9)
    motion.effort[:] = np.clip(motion.effort, -8.9, 8.9)
    given = zip(*(inputs_of(motion, name) for name in names), strict=True)
    expected = np.zeros((50, 6 + robot.n_joints))
    expected[:, 6 + robot.joints.index(JOINT)] = [law(*row) for row in given]
    force = applied.force(motion, np.zeros((50, 0)))
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize('form', FORMS)
def test_columns_are_as_many_as_their_powers(form, rng):
    it = FORMS[form]
    options = dict.fromkeys(it.parameters, 0.5)
    columns = it([rng.normal(size=20) for _ in range(it.inputs)], options)
    assert columns.shape == (20, len(it.powers))
    assert np.all(np.isfinite(columns))


def test_a_spring_rests_anywhere():
    x = np.array([-2.0, -1.5, -1.0])
    columns = FORMS['1, x - centre, (x - centre)**2, (x - centre)**3']([x], {'centre': -1.5})
    np.testing.assert_array_equal(
        columns, [[1, -0.5, 0.25, -0.125], [1, 0, 0, 0], [1, 0.5, 0.25, 0.125]]
    )


def test_outside_its_data_it_saturates(robot, rng):
    """Inputs stop a tenth of the range beyond its ends, the torque at its limit."""
    given = entry('x*abs(x)', [RATE], [-1.0], kind='dissipative', limit=100.0)
    motion = motion_of(robot, rng, 3)
    j = robot.joints.index(JOINT)
    motion.qd[:, j] = [-6.0, 2.3, 1.0]
    torque = bound(robot, **given).force(motion, np.zeros((3, 0)))[:, 6 + j]
    np.testing.assert_allclose(torque, [2.4**2, -(2.3**2), -1.0], rtol=0, atol=1e-12)
    given['guard']['limit'] = 3.0
    limited = bound(robot, **given).force(motion, np.zeros((3, 0)))[:, 6 + j]
    np.testing.assert_allclose(limited, [3.0, -3.0, -1.0], rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    'form', ['x, x**2', 'sign(x), x, abs(x)', 'sign(x), y*sign(x), y**2*sign(x)', 'abs(y)*sign(x)']
)
def test_friction_never_pushes_whatever_its_numbers(form, robot, rng):
    names = [RATE, ANGLE][: FORMS[form].inputs]
    motion = motion_of(robot, rng, 400)
    motion.qd *= 3.0
    is_pushed = False
    for _ in range(5):
        coefficients = rng.normal(size=len(FORMS[form].powers))
        forces = [
            bound(robot, **entry(form, names, coefficients, kind=kind)).force(
                motion, np.zeros((400, 0))
            )
            for kind in ('dissipative', 'external')
        ]
        force, free = forces
        assert np.all(np.sum(force * motion.rates, axis=1) <= 0.0)
        is_pushed |= bool(np.any(np.sum(free * motion.rates, axis=1) > 0.0))
    assert is_pushed  # else the guard was not asked


@pytest.mark.parametrize(('form', 'ratio'), [('sign(x + y), x + y', 1.0), ('sign(x - y)', -1.0)])
def test_friction_of_two_rates_acts_on_both_joints(form, ratio, robot, rng):
    coefficients = [-0.8, -0.3][: len(FORMS[form].powers)]
    names = [RATE, f'rate/{CARRIER}']
    applied = bound(
        robot, **entry(form, names, coefficients, kind='coupled', react={CARRIER: ratio})
    )
    motion = motion_of(robot, rng, 60)
    j, k = (robot.joints.index(name) for name in (JOINT, CARRIER))
    force = applied.force(motion, np.zeros((60, 0)))
    np.testing.assert_allclose(force[:, 6 + k], ratio * force[:, 6 + j], rtol=0, atol=1e-14)
    assert np.all(np.sum(force * motion.rates, axis=1) <= 0.0)
    assert np.abs(force).max() > 0.5


def slow(robot, effects, seconds):
    """A plant that starts with rates of its own, without torques."""
    n = robot.n_joints
    at_rest = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3), np.zeros(3)
    p, quaternion, v, omega = at_rest
    state = State(p, quaternion, np.full(n, 0.2), v, omega, np.full(n, 0.8))
    plant = Plant(robot, state, PERIOD, 1, effects, TABLEAUS['dop853'])
    works = []
    for _ in range(round(seconds / PERIOD)):
        plant.step(np.zeros(n))
        works.append(plant.ledger().effect_work)
    return plant, np.array(works)


@pytest.mark.parametrize(
    ('form', 'names', 'coefficients', 'kind'),
    [
        ('sign(x), x', [RATE], [-0.5, -0.4], 'dissipative'),
        ('x, x*exp(-y/scale)', [RATE, 'time'], [-1.0, -1.0], 'dissipative'),
        ('sign(x + y), x + y', [RATE, f'rate/{CARRIER}'], [-0.4, -0.2], 'coupled'),
    ],
)
def test_plant_only_loses_energy_to_friction(form, names, coefficients, kind, robot):
    options = {'scale': 0.5} if 'scale' in form else {}
    react = {'react': {CARRIER: 1.0}} if kind == 'coupled' else {}
    given = entry(form, names, coefficients, options, kind=kind, **react)
    plant, works = slow(robot, bind_effects({'it': given}, robot), 0.5)
    assert np.all(np.diff(works) <= 1e-9)  # the integrator's error
    assert works[-1] < -1e-2
    assert abs(plant.ledger().energy_drift) < 1e-6  # DOP853 over the stiff sign


def test_angle_laws_are_conservative(robot, rng):
    """-dU/dq of a potential written by hand, by differences."""
    given = entry('sin(m*x), cos(m*x)', [ANGLE], [0.4, -0.3], {'m': 2.0}, kind='potential')
    applied = bound(robot, **given)

    def potential(q):
        return 0.4 / 2.0 * np.cos(2.0 * q) + 0.3 / 2.0 * np.sin(2.0 * q)

    motion = motion_of(robot, rng, 30)
    j = robot.joints.index(JOINT)
    motion.q[:, j] = np.linspace(-1.4, 1.4, 30)
    step = 1e-5
    slope = (potential(motion.q[:, j] + step) - potential(motion.q[:, j] - step)) / (2.0 * step)
    torque = applied.force(motion, np.zeros((30, 0)))[:, 6 + j]
    np.testing.assert_allclose(torque, -slope, rtol=0, atol=1e-9)  # step^2


def test_controller_makes_up_for_what_it_can_know(robot):
    drag = entry('x*abs(x)', [RATE], [-0.6], kind='dissipative')
    clock = entry('x, x*exp(-y/scale)', [RATE, 'time'], [-1.0, -1.0], {'scale': 5.0})
    n, j = robot.n_joints, robot.joints.index(JOINT)
    setpoint = Setpoint(np.zeros(n), np.full(n, 0.5), np.zeros(n))
    for given, expected in ((drag, 0.6 * 0.25), (clock, 0.0)):
        feed = FeedForward(robot, bind_effects({'it': given}, robot))
        extra = feed(setpoint, np.zeros(3), np.zeros(n))
        assert extra[j] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize('form', LAWS)
def test_entry_is_what_was_read(form, robot):
    names, coefficients, options, _ = LAWS[form]
    given = entry(form, names, coefficients, options)
    written = {'effect': 'learned_torque', 'where': JOINT, **bound(robot, **given).entry()}
    assert written == given


RANGE = {'rate': [-2.0, 2.0]}


@pytest.mark.parametrize(
    ('change', 'guard', 'message'),
    [
        ({'torque': 'c1 *'}, {}, r"effects.it.torque: 'c1 \*' is no formula"),
        ({'torque': 'c1*rate[wrist_9]*rate'}, {}, r'rate\[wrist_9\]: no such joint'),
        ({'torque': 'c1*speed'}, {}, "nothing is called 'speed' here"),
        ({'torque': 'c1*rate'}, {}, 'is in .* expected N m'),
        ({'torque': 'c1*rate**2 + 1'}, {}, 'is not in proportion to c1'),
        ({'c2': 1.0}, {}, r'c2: no such parameter \(it has c1\)'),
        ({'c1': 'much'}, {}, r"c1: expected a number, got 'much'"),
        ({'force': '1'}, {}, 'needs one formula'),
        ({'where': 'j_link_9'}, {}, "no place 'j_link_9'"),
        ({}, {'range': {}}, 'guard.range.rate: expected .smallest, largest.'),
        ({}, {'range': {'rate': [1.0]}}, 'expected two numbers'),
        ({}, {'range': {'rate': None}}, 'expected two numbers'),
        ({}, {'range': {'rate': [2.0, -2.0]}}, 'expected .smallest, largest.'),
        ({}, {'range': {**RANGE, 'position': [-1.0, 1.0]}}, 'position: the formula has no such'),
        ({}, {'limit': 0.0}, 'guard.limit: 0 is not above 0|guard.limit: .* above 0'),
        ({}, {'limit': float('nan')}, 'limit: nan is not a finite number'),
        ({}, {'kind': 'magic'}, "kind: 'magic' is not one of dissipative"),
        ({}, {'gain': 3.0}, 'guard.gain: unknown parameter'),
        # what a kind says of energy must hold of the formula
        ({}, {'kind': 'potential'}, 'a potential depends on its own position alone'),
        ({}, {'react': {CARRIER: 1.0}}, r'is no friction of rate \+ 1 rate.j_link_1.'),
        ({}, {'react': {JOINT: 1.0}}, 'is no friction of rate'),
        ({}, {'react': [CARRIER]}, 'expected {joint: ratio} of one joint'),
    ],
)
def test_nonsense_is_refused(change, guard, message, robot):
    given = entry('x*abs(x)', [RATE], [1.0])
    given['guard'] |= guard
    with pytest.raises(ConfigurationError, match=message):
        bound(robot, **{**given, **change})


@pytest.mark.parametrize(('ratio', 'is_right'), [(1.0, False), (-1.0, True), (2.0, False)])
def test_a_joint_reacts_by_the_ratio_of_the_formula(ratio, is_right, robot):
    given = entry(
        'sign(x - y), x - y', [RATE, f'rate/{CARRIER}'], [-1.0, -0.5], react={CARRIER: ratio}
    )
    if is_right:
        bound(robot, **given)
        return
    with pytest.raises(ConfigurationError, match=r'guard\.react: the formula is no friction of'):
        bound(robot, **given)


@pytest.mark.parametrize('name', ['attitude/qq', 'attitude/x', 'base_rate/xy'])
def test_a_component_that_the_base_has_not_is_refused(name, robot):
    given = entry('x', [name], [1.0])
    with pytest.raises(ConfigurationError, match=r'nothing is called|the base is fixed'):
        bound(robot, **given)


def test_a_law_of_another_machine_is_refused_whose_joints_have_the_same_names(robot, rng):
    """A URDF of other masses, or written otherwise, is of the same machine."""
    given = entry('x*abs(x)', [RATE], [1.0])
    own = {**given, 'guard': {**given['guard'], 'machine': machine_of(robot.urdf)}}
    assert bound(robot, **own).entry() == {k: own[k] for k in own if k not in ('effect', 'where')}
    same = replace(robot, urdf=robot.urdf.replace('mass value="', 'mass   value="1'))
    assert same.urdf != robot.urdf
    bound(same, **own)
    other = robot_of(random_tree(rng, [0, 1]))
    assert other.joints == robot.joints[: other.n_joints]
    bound(other, **given)  # nobody says of which it is: as before
    with pytest.raises(
        ConfigurationError, match='learned on another robot does not hold'
    ) as caught:
        bound(other, **own)
    assert '\n' not in str(caught.value)


def test_coefficients_have_the_units_of_a_data_sheet():
    assert unit_of((0,), [RATE]) == 'N m'
    assert unit_of((1,), [RATE]) == 'N m s/rad'
    assert unit_of((2,), [RATE]) == 'N m s^2/rad^2'
    assert unit_of((1,), [ANGLE]) == 'N m/rad'
    assert unit_of((0, 1), [RATE, LOAD]) == '1'
    assert unit_of((1,), ['time'], 'kg m^2') == 'kg m^2/s'
    assert unit_of((1,), ['rate/rail'], 'N', {'rail'}) == 'N s/m'
    assert unit_of((2,), ['angle/rail'], 'N m', {'rail'}) == 'N/m'
