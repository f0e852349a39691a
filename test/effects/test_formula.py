"""Effects of a user's own: formulas in a robot file, and Python modules."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from support.effects import motion_of
from support.models import AXIS, Part, robot_of

from spacerobot_ros.control.computed_torque import FeedForward
from spacerobot_ros.control.joint_reference import Setpoint
from spacerobot_ros.diagnosis.answer.extended_model import effects_section
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects import catalogue
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effects
from spacerobot_ros.effects.laws.expression import Expression
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.recording.record import JointSeries, Record
from spacerobot_ros.recording.robot_inputs import with_inputs
from spacerobot_ros.recording.series import InputSeries
from spacerobot_ros.sensing.sensor_faults import SensorFaults
from spacerobot_ros.simulation.plant import Plant

CONFIG = Path(__file__).resolve().parents[2] / 'config'
VISCOUS = {
    'effect': 'formula',
    'where': 'j_first',
    'torque': '-c * rate',
    'parameters': {'c': {'unit': 'N m s/rad', 'size': 10.0, 'relevant': 0.05, 'minimum': 0.0}},
}
BUILT_IN = {'effect': 'joint_viscous_friction', 'where': 'j_first'}
STEP = 0.01
STATED = {'joint_position_std': 1e-4, 'joint_velocity_std': 1e-3, 'joint_effort_std': 0.02}


def robot(**settings):
    zero, along = np.zeros(3), np.array([0.3, 0.0, 0.0])
    parts = [
        Part('base_link', -1, 'base', 10.0, zero, np.eye(3)),
        Part('first', 0, 'revolute', 4.0, along, 0.3 * np.eye(3), AXIS['z']),
        Part('second', 1, 'prismatic', 1.0, zero, 0.2 * np.eye(3), AXIS['x'], along),
    ]
    return robot_of(parts, base='fixed', **settings)


def bound(**entry):
    return bind_effects({'own': {**VISCOUS, **entry}}, robot())[0]


def test_a_formula_is_what_it_says(rng):
    body = robot()
    entry = {
        **VISCOUS,
        'torque': '-k * sin(n * position + 0.5) - c * rate * abs(rate) + 0.1 * effort',
        'parameters': {
            'k': {'unit': 'N m'},
            'n': {'unit': '', 'guesses': [2.0, 4.0]},
            'c': {'unit': 'N m s^2/rad^2'},
        },
        **{'k': 2.0, 'n': 3.0, 'c': 0.5},
    }
    # a term that no parameter scales would be there at all times
    with pytest.raises(ConfigurationError, match='is not in proportion to k, c together'):
        bind_effects({'own': entry}, body)
    entry['torque'] = '-k * sin(n * position + 0.5) - c * rate * abs(rate)'
    (own,) = bind_effects({'own': entry}, body)
    motion = motion_of(body, rng, 5)
    q, qd = motion.q[:, 0], motion.qd[:, 0]
    force = own.force(motion, np.zeros((5, 0)))
    want = -2.0 * np.sin(3.0 * q + 0.5) - 0.5 * qd * np.abs(qd)
    np.testing.assert_allclose(force[:, 6], want, rtol=1e-12)
    assert not force[:, :6].any()
    assert not force[:, 7].any()


def run(entry, steps=300):
    """Positions of the plant under held torques and an effect."""
    body = robot()
    effects = bind_effects({'own': entry}, body)
    zero = np.zeros(2)
    still = State(
        np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), zero, np.zeros(3), np.zeros(3), zero
    )
    plant, rows = Plant(body, still, STEP, 1, effects), []
    for k in range(steps):
        rows.append((plant.state.q, plant.state.qd, plant.effort))
        plant.step(np.array([2.0, 1.0]) * np.sin(0.03 * k + np.arange(2)))
    return tuple(np.array(column) for column in zip(*rows, strict=True))


def test_simulated_as_its_built_in_twin():
    for own, theirs in zip(
        run({**VISCOUS, 'c': 0.7}), run({**BUILT_IN, 'coefficient': 0.7}), strict=True
    ):
        np.testing.assert_allclose(own, theirs, rtol=0, atol=1e-13)


@pytest.fixture(scope='module')
def measured():
    """12 s with friction of 0.7 N m s/rad that no model knows of, and noise that is stated."""
    return recorded({**BUILT_IN, 'coefficient': 0.7})


def recorded(entry):
    rng = np.random.default_rng(5)
    q, qd, effort = run(entry, 1200)
    stamps = np.arange(len(q)) * round(STEP * 1e9)
    noisy = (
        x + s * rng.standard_normal(x.shape) for x, s in ((q, 1e-4), (qd, 1e-3), (effort, 0.02))
    )
    return Record(JointSeries(('j_first', 'j_second'), stamps, *noisy))


def found(record, own, catalogue):
    """The one cause that a diagnosis names."""
    body = replace(robot(), sensors=SensorSettings(**STATED))
    (cause,) = diagnose(record, body, own, catalogue).causes
    return cause


def test_diagnosed_as_its_built_in_twin(measured):
    twin = CATALOGUE['joint_viscous_friction']
    others = [CATALOGUE['joint_coulomb_friction'], CATALOGUE['torque_sensor_bias']]
    own_kind = type(bound())
    theirs = found(measured, (), [twin, *others]).parameters['coefficient']
    cause = found(measured, (), [own_kind, *others])
    ours = cause.parameters['c']
    assert (cause.applied.id, cause.applied.where) == ('formula_own', 'j_first')
    assert ours.value == pytest.approx(theirs.value, rel=1e-3)
    assert ours.std == pytest.approx(theirs.std, rel=0.01)
    assert abs(ours.value - 0.7) < 4.0 * ours.std
    # what is written is read again as the same effect
    section = effects_section([cause.applied])
    (again,) = bind_effects(section, robot())
    assert type(again) is type(cause.applied)
    assert again.values == cause.applied.values


def test_a_formula_of_the_file_is_looked_for_without_being_asked():
    body = robot()
    believed = bind_effects({'own': VISCOUS}, body)  # without a value: it does nothing
    assert believed[0].values == {'c': 0.0}
    assert type(believed[0]) in catalogue.kinds_beside(believed)
    assert type(believed[0]) not in catalogue.kinds_beside(())
    assert type(bound()) is type(believed[0])


def test_fed_forward_as_every_other():
    body, at = robot(), Setpoint(np.zeros(2), np.array([0.5, 0.2]), np.zeros(2))
    tau = FeedForward(body, [bound(c=0.7)])(at, np.zeros(3), np.zeros(2))
    np.testing.assert_allclose(tau, [0.35, 0.0], atol=1e-12)
    period = {'unit': 's', 'guesses': [3.0]}
    parameters = {'c': {'unit': 'N m'}, 'T': period}
    timed = bound(torque='-c * sin(time / T)', parameters=parameters, c=1.0)
    assert FeedForward(body, [timed])(at, np.zeros(3), np.zeros(2)) == pytest.approx([0.0, 0.0])


def test_a_sensor_reads_what_the_formula_adds(rng):
    body = robot()
    entry = {
        **{'effect': 'formula', 'where': 'j_first', 'channel': 'joint_position'},
        **{'change': 'a * sin(2 * reading)', 'parameters': {'a': {'unit': 'rad'}}, 'a': 0.01},
    }
    faults = SensorFaults(body, bind_effects({'gear': entry}, body))
    motion = motion_of(body, rng, 4)
    said = faults.sensed('joint_position', motion.q, motion)
    want = motion.q + 0.01 * np.sin(2.0 * motion.q) * [1.0, 0.0]
    np.testing.assert_allclose(said, want, rtol=1e-12)
    np.testing.assert_array_equal(faults.sensed('joint_velocity', motion.qd, motion), motion.qd)
    undone, _, _ = faults.undo_joints(said, motion.qd, motion.effort)
    np.testing.assert_allclose(undone, motion.q, atol=2e-7)  # 0.02^4 rad left by three passes


def free(**settings):
    """A free base with two joints that turn."""
    parts = [
        Part('base_link', -1, 'base', 10.0, np.zeros(3), np.eye(3)),
        Part('first', 0, 'revolute', 4.0, np.full(3, 0.1), 0.3 * np.eye(3), AXIS['z']),
        Part('second', 1, 'revolute', 1.0, np.full(3, 0.1), 0.2 * np.eye(3), AXIS['x']),
    ]
    return robot_of(parts, base='free', **settings)


def of(text, units, where='j_first', body=None, **entry):
    """A formula as an effect; every parameter has the value 2."""
    parameters = {name: {'unit': unit} for name, unit in units.items()}
    values = dict.fromkeys(units, 2.0)
    key = {} if 'force' in entry or 'change' in entry else {'torque': text}
    given = {'effect': 'formula', 'where': where, **key, 'parameters': parameters, **values}
    return bind_effects({'own': {**given, **entry}}, body or free())[0]


def forced(effect, motion):
    return effect.force(motion, np.zeros((len(motion), 0)))


def test_other_joints_and_the_base(rng):
    body = free()
    motion = motion_of(body, rng, 5)
    rates, w, R = motion.qd, motion.omega, motion.rotation
    own = of('-c * (rate - rate[j_second])', {'c': 'N m s'})
    want = -2.0 * (rates[:, 0] - rates[:, 1])
    np.testing.assert_allclose(forced(own, motion)[:, 6], want, rtol=1e-12)
    quoted = of("-c * position['j_second'] * effort[j_second] ** 0", {'c': 'N m'})
    np.testing.assert_allclose(forced(quoted, motion)[:, 6], -2.0 * motion.q[:, 1], rtol=1e-12)
    drag = of('-c * base_rate[y] * attitude[xz]', {'c': 'N m s'}, 'base_link/y')
    want = np.zeros((5, 8))
    want[:, 4] = -2.0 * w[:, 1] * R[:, 0, 2]
    np.testing.assert_allclose(forced(drag, motion), want, rtol=1e-12)
    push = of('', {'f': 'N'}, 'base_link/x', force='f * attitude[zz]')
    assert drag.is_external
    assert push.is_external
    assert own.is_known_ahead
    assert not drag.is_known_ahead


def test_a_force_on_the_base_moves_it_as_newton_says():
    body = robot_of([Part('base_link', -1, 'base', 10.0, np.zeros(3), np.eye(3))], base='free')
    fixed = {'f': {'unit': 'N'}, 'T': {'unit': 's', 'fixed': 4.0}}
    push = of('', {'f': 'N'}, 'base_link/x', body, force='f * time / T', parameters=fixed)
    zero, none = np.zeros(3), np.zeros(0)
    still = State(zero, np.array([0.0, 0.0, 0.0, 1.0]), none, zero, zero, none)
    plant = Plant(body, still, STEP, 1, [push])
    for _ in range(100):
        plant.step(np.zeros(0))
    # x = f / (6 m T) t^3
    assert plant.state.p_WB[0] == pytest.approx(2.0 / (6.0 * 10.0 * 4.0), rel=1e-9)


def test_sensors_of_the_base(rng):
    body = free()
    gyro = {'change': 'a * base_rate[x] + a * reading / 10', 'channel': 'gyro'}
    tracker = {'change': 'b * sin(time / T) / 100', 'channel': 'attitude'}
    fixed = {'b': {'unit': 'rad'}, 'T': {'unit': 's', 'fixed': 3.0}}
    scale = of('', {'a': ''}, 'base_link/z', **gyro)
    turn = of('', {'b': 'rad'}, 'base_link/x', **tracker, parameters=fixed)
    faults = SensorFaults(body, [scale, turn])
    motion = motion_of(body, rng, 4)
    said = faults.sensed('gyro', motion.omega, motion)
    want = motion.omega.copy()
    want[:, 2] += 2.0 * motion.omega[:, 0] + 0.2 * motion.omega[:, 2]
    np.testing.assert_allclose(said, want, rtol=1e-12)
    errors = faults.sensed('attitude', np.zeros((4, 3)), motion)
    np.testing.assert_allclose(errors[:, 0], 0.02 * np.sin(motion.time / 3.0), rtol=1e-12)


WARM = {
    'effect': 'formula',
    'where': 'j_first',
    'torque': '-c * rate * (1 + a * (extra[oil] - cold))',
    'parameters': {
        'c': {'unit': 'N m s/rad', 'size': 10.0, 'relevant': 0.05},
        'a': {'unit': '1/degC', 'guesses': [0.0]},
        'cold': {'unit': 'degC', 'fixed': 20.0},
    },
    'extra': {'oil': {'unit': 'degC', 'typical': 25.0}},
}


def test_temperatures_of_the_mapping_are_taken_along(measured):
    (own,) = bind_effects({'own': {**WARM, 'c': 0.5, 'a': 0.1}}, robot())
    motion = motion_of(robot(), np.random.default_rng(0), 3)
    # nobody measures it here: its typical value
    want = -0.5 * motion.qd[:, 0] * 1.5
    np.testing.assert_allclose(forced(own, motion)[:, 6], want, rtol=1e-12)
    stamps = measured.joints.stamp_ns[::100]
    warming = 20.0 + 1e-9 * stamps
    oil = InputSeries(('oil',), stamps, warming[:, None], ('degC',))
    driven = with_inputs(robot(), replace(measured, inputs={'extra/oil': oil}))
    want = -0.5 * motion.qd[:, 0] * (1.0 + 0.1 * motion.time)
    along = replace(motion, robot=driven)
    np.testing.assert_allclose(forced(own, along)[:, 6], want, rtol=1e-9)
    in_kelvin = replace(measured, inputs={'extra/oil': replace(oil, units=('K',))})
    other = replace(motion, robot=with_inputs(robot(), in_kelvin))
    with pytest.raises(ConfigurationError, match=r"extra\.oil\.unit: is in 'degC' here"):
        forced(own, other)


def test_friction_that_follows_a_measured_temperature_is_found():
    growing = {'c': {'unit': 'N m s/rad'}, 'T': {'unit': 's', 'fixed': 10.0}}
    hidden = {**VISCOUS, 'torque': '-c * rate * time / T', 'parameters': growing, 'c': 0.7}
    record = recorded(hidden)
    stamps = record.joints.stamp_ns[::109]
    oil = InputSeries(('oil',), stamps, 20.0 + 1e-9 * stamps[:, None], ('degC',))
    per_kelvin = {'unit': 'N m s/rad/K', 'size': 1.0, 'relevant': 0.005}
    cold = {'unit': 'degC', 'fixed': 20.0}
    asked = {
        **{**WARM, 'torque': '-c * rate * (extra[oil] - cold)'},
        'parameters': {'c': per_kelvin, 'cold': cold},
    }
    believed = bind_effects({'own': asked}, robot())
    record = replace(record, inputs={'extra/oil': oil})
    others = [CATALOGUE['joint_viscous_friction'], CATALOGUE['joint_coulomb_friction']]
    cause = found(record, believed, [type(believed[0]), *others])
    assert (cause.applied.id, cause.applied.where) == ('formula_own', 'j_first')
    c = cause.parameters['c']
    assert abs(c.value - 0.07) < 4.0 * c.std


@pytest.mark.parametrize(
    ('where', 'entry', 'why'),
    [
        (
            'j_first',
            {'torque': 'c * rate[elbow]'},
            r'rate\[elbow\]: no such joint \(there are',
        ),
        ('j_first', {'torque': 'c * base_rate[w]'}, r"nothing is called 'base_rate\[w\]' here"),
        ('j_first', {'torque': 'c * extra[oil]'}, r"'extra\[oil\]' here"),
        ('base_link/x', {'torque': 'c * rate'}, r"'rate' here \(there are position\[JOINT\]"),
        ('base_link/x', {'change': 'c', 'channel': 'joint_effort'}, 'is of a joint'),
        ('j_first', {'change': 'c', 'channel': 'gyro'}, 'acts on the base'),
        ('j_first', {'force': 'c'}, 'acts on the base'),
        ('base_link/x', {'change': 'c * reading', 'channel': 'attitude'}, "'reading' here"),
    ],
)
def test_quantities_that_are_not_there_are_refused(where, entry, why):
    given = {'effect': 'formula', 'where': where, 'parameters': {'c': {'unit': 'N m s'}}}
    with pytest.raises(ConfigurationError, match=why):
        bind_effects({'own': {**given, **entry}}, free())
    if where == 'j_first' and 'rate[elbow]' in str(entry):
        with pytest.raises(ConfigurationError, match=r'base_rate\[x\]: the base is fixed'):
            of('-c * base_rate[x]', {'c': 'N m s'}, body=robot())


@pytest.mark.parametrize(
    ('change', 'why'),
    [
        ({'torque': '-c * rate * 1e999'}, r'own\.torque: has a number that is too large'),
        ({'torque': f'-c * rate * 1{400 * "0"}'}, r'own\.torque: has a number that is too large'),
        ({'torque': '-c * rate ** 9**9**9'}, 'only a number is an exponent'),
        ({'torque': '-c * rate * 9.0 ** 9 ** 9'}, 'is not finite at'),
        ({'torque': f'c{900 * ".a"}'}, 'is not part of a formula'),
        ({'torque': '-c * rate[0]'}, r"'rate\[0\]' is not part of a formula"),
        ({'torque': '-c * rate[sin(1)]'}, 'is not part of a formula'),
        ({'parameters': {'c': {'unit': 'N m s', 'guesses': 3}}}, 'expected a list'),
        ({'parameters': {'c': {'unit': 'N m s', 'size': 0.0}}}, 'must be above 0'),
        ({'parameters': {'c': {'unit': 'N m s', 'minimum': 2.0, 'maximum': 1.0}}}, r'c\.minimum'),
        ({'torque': '-c * speed'}, r"effects\.own\.torque: nothing is called 'speed' here"),
        ({'torque': '-c * rate +'}, r'is no formula: invalid syntax'),
        ({'torque': '-c * velocity(rate)'}, r"there is no function 'velocity'"),
        ({'torque': '-c * rate.real'}, r"'rate.real' is not part of a formula"),
        ({'torque': '(lambda: c * rate)()'}, 'is not part of a formula'),
        ({'torque': '-c * rate if rate else 0'}, 'is not part of a formula'),
        ({'torque': '-c * position'}, r'is in kg m\^2/s, expected N m'),
        ({'torque': '-c * (rate + position)'}, '1/s and pure numbers do not add up'),
        ({'torque': '-c * sin(rate)'}, 'sin takes a pure number, got 1/s'),
        ({'torque': '-c * rate / position'}, r'is not finite at position 0, rate 0'),
        ({'torque': '-c * rate ** 2 / rate'}, 'is not finite at rate 0'),
        ({'torque': '-exp(c * rate)'}, 'is not in proportion to c'),
        ({'c': -1.0}, r'effects\.own\.c: -1'),
        ({'d': 1.0}, r'effects\.own\.d: no such parameter \(it has c\)'),
        ({'parameters': {'c': {'unit': 'lbf'}}}, r"'lbf' is no SI unit"),
        ({'parameters': {'c': {}}}, r'parameters\.c\.unit: required parameter is missing'),
        (
            {'parameters': {'c': {'unit': '1', 'scale': 1.0}}},
            r'c\.scale: unknown parameter',
        ),
        ({'where': 'j_second'}, 'expected N'),
        ({'where': 'elbow'}, "no place 'elbow'"),
        ({'change': 'c'}, 'needs one formula'),
        ({'torque': '(' * 1200 + 'c' + ')' * 1200}, 'longer than 2000 characters'),
        ({'torque': '-' * 100 + 'c * rate'}, 'nested deeper than'),
    ],
)
def test_what_is_no_formula_is_refused_with_its_place(change, why):
    with pytest.raises(ConfigurationError, match=why):
        bound(**change)


HOSTILE = (
    '__import__("os").system("touch taken")',
    'c.__class__.__mro__[1].__subclasses__()',
    '(lambda: open("taken", "w"))()',
    '[x for x in (1, 2)]',
    'eval("1")',
    'f"{c}"',
    'c := 3',
    '"a" * 10**9',
    'sin(*[c])',
    'min(c, c, key=c)',
)


@pytest.mark.parametrize('text', HOSTILE)
def test_no_formula_runs_code(text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ConfigurationError):
        Expression.parse(text, 'here')
    assert not list(tmp_path.iterdir())


@given(st.text(alphabet='cr()+-*/. 012sin_[]{}:="\'\n', max_size=40))
def test_any_text_is_a_formula_or_refused(text):
    try:
        found = Expression.parse(text, 'here')
    except ConfigurationError:
        return
    values = dict.fromkeys(found.names, 0.5)
    assert np.shape(found(values)) == ()


MODULE = '''
from spacerobot_ros.effects.joint import JointTorque
from spacerobot_ros.effects.parameter import amount


class Grease(JointTorque):
    """tau = -c q' abs(q').

    Args:
        coefficient: Torque against the joint rate, per squared rate.
    """

    id = '{id}'
    title = 'grease'
    parameters = (amount('coefficient', 'N m s^2/rad^2', 1.0),)

    def torque(self, q, qd, effort):
        return -self['coefficient'] * qd * abs(qd)
'''


IDLE = MODULE.replace('{id}', 'idle').replace('def torque', 'def other')
IDLE = IDLE.replace('JointTorque', 'JointEffect')


@pytest.fixture
def with_module(tmp_path):
    """A robot file with a module beside it; the catalogue is as it was afterwards."""
    before = dict(CATALOGUE)

    def load(text, name='own_effects.py', effects=()):
        (tmp_path / name).write_text(text)
        content = yaml.safe_load((CONFIG / 'servicer.yaml').read_text())
        values = content['/**']['ros__parameters']
        values['robot']['effect_modules'] = [name]
        values['effects'] = dict(effects)
        (tmp_path / 'robot.yaml').write_text(yaml.safe_dump(content))
        return load_robot_file(tmp_path / 'robot.yaml')

    yield load
    for added in set(CATALOGUE) - set(before):
        del catalogue._KNOWN[added]


def test_effects_of_a_module_are_as_those_of_the_catalogue(with_module, rng):
    entry = {'effect': 'grease', 'where': 'joint_1', 'coefficient': 0.5}
    file = with_module(MODULE.replace('{id}', 'grease'), effects={'own': entry})
    motion = motion_of(file.robot, rng, 3)
    force = file.effects[0].force(motion, np.zeros((3, 0)))[:, 6]
    np.testing.assert_allclose(force, -0.5 * motion.qd[:, 0] * np.abs(motion.qd[:, 0]))
    assert CATALOGUE['grease'].is_own
    again = with_module(MODULE.replace('{id}', 'grease'), effects={'own': entry})
    assert type(again.effects[0]) is type(file.effects[0])
    load_robot_file(CONFIG / 'servicer.yaml')
    assert 'grease' not in CATALOGUE  # another robot's


@pytest.mark.parametrize(
    ('text', 'why'),
    [
        ('import nothing_of_that_name', r'raises ModuleNotFoundError.*\(raising_0\.py:1\)'),
        ('\n\n1 / 0', r'raises ZeroDivisionError: division by zero \(raising_1\.py:3\)'),
        ('x = 1', 'has no effect'),
        (MODULE.replace('{id}', 'joint_coulomb_friction'), "'joint_coulomb_friction' is taken"),
        (IDLE, 'does nothing'),
        ('raise SystemExit(0)', r'raises SystemExit: 0 \(raising_5\.py:1\)'),
        ('x = 1\ndef f(:', r'raises SyntaxError: invalid syntax \(raising_6\.py:2\)'),
    ],
    ids=range(7),
)
def test_modules_that_can_not_be_used_are_refused_in_one_line(with_module, text, why, request):
    name = f'raising_{request.node.callspec.id}.py'
    with pytest.raises(ConfigurationError, match=why) as refused:
        with_module(text, name)
    assert str(refused.value).startswith('robot.effect_modules[0] (')
    assert '\n' not in str(refused.value)


def test_effects_of_a_module_that_raise_later_are_one_line_with_their_place(with_module, rng):
    for i, body in enumerate(
        ['raise ValueError("no")', 'return np.zeros(7)', 'return q[9:10, 0]']
    ):
        text = MODULE.replace('{id}', f'late_{i}').split('def torque')[0]
        text += f'def torque(self, q, qd, effort):\n        import numpy as np\n        {body}\n'
        entry = {'effect': f'late_{i}', 'where': 'joint_1', 'coefficient': 0.5}
        file = with_module(text, f'late_{i}.py', effects={'own': entry})
        with pytest.raises(ConfigurationError, match=rf'{i}.py\): \w+.force: raises .*\.py:'):
            file.effects[0].force(motion_of(file.robot, rng, 3), np.zeros((3, 0)))


_ASKS = f"""
from pathlib import Path
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effects, kinds_beside
from spacerobot_ros.effects.robot_file import load_robot_file
file = load_robot_file(Path({str(CONFIG / 'servicer.yaml')!r}))
print('grease' in CATALOGUE)
entry = {{'effect': 'grease', 'where': 'joint_1', 'coefficient': 0.5}}
print(bind_effects({{'own': entry}}, file.robot)[0].id)
print('grease' in {{kind.id for kind in kinds_beside(())}})
"""


def test_effects_of_an_installed_package_are_there_once_they_are_asked_for(tmp_path):
    (tmp_path / 'greasy.py').write_text(MODULE.replace('{id}', 'grease'))
    described = tmp_path / 'greasy-1.0.dist-info'
    described.mkdir()
    (described / 'METADATA').write_text('Metadata-Version: 2.1\nName: greasy\nVersion: 1.0\n')
    (described / 'entry_points.txt').write_text('[spacerobot.effects]\ngreasy = greasy\n')
    path = os.pathsep.join([str(tmp_path), *sys.path])
    done = subprocess.run(
        [sys.executable, '-c', _ASKS],
        env={**os.environ, 'PYTHONPATH': path},
        capture_output=True,
        check=True,
        text=True,
    )
    assert done.stdout.split() == ['False', 'grease', 'True']
