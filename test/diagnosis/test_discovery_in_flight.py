"""What the leftover of a free flyer depends on: a law of a joint, or nothing."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.diagnosis import friction_cause, hand_made

from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.diagnosis.answer.extended_model import effects_section
from spacerobot_ros.diagnosis.discovery.discover_in_flight import _places, discover_in_flight
from spacerobot_ros.diagnosis.discovery.flight_channels import FlightRows
from spacerobot_ros.diagnosis.discovery.in_place import _is_part, instead_of
from spacerobot_ros.diagnosis.search.conclusion import worded_with_laws
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effects
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.refit import refine
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from validation.hidden.diagnosis_scenario import motion_of, robot_file, simulated

ROBOT, SECONDS, TASK = 'minisat', 8.0, 4.0
DRAG = 0.02  # N m s^2/rad^2


def flown(effects=(), excitation='fast', seed=5, seconds=SECONDS):
    """The model as it stands beside a flight, no cause chosen before."""
    file = robot_file(ROBOT)
    record = observed(simulated(ROBOT, excitation, seed, effects, seconds), file.robot)
    noise, _ = noise_levels(file.robot.sensors, record)
    return Fit(Run(record, file.robot, file.effects, noise, 'held_before'), ())


def asked(fit):
    return discover_in_flight(hand_made('unexplained'), fit, lambda what, share: None)


def leftover(**hidden):
    """What is said of a flight with a hidden effect."""
    effects = bind_effects({'hidden': hidden} if hidden else {}, robot_file(ROBOT).robot)
    return asked(flown(effects))


def laws(answer):
    return {e.channel: e for e in answer.leftover if e.form is not None}


@pytest.fixture(scope='module')
def joint():
    return robot_file(ROBOT).robot.arm[1]


@pytest.fixture(scope='module')
def hidden(joint):
    """Drag as the machine has it: a table, which is no form of the grammar."""
    rates = np.linspace(-8.0, 8.0, 321)
    return {
        'effect': 'learned_torque',
        'where': joint,
        'form': 'table',
        'inputs': [f'rate/{joint}'],
        'knots': {'x': rates.tolist()},
        'values': (-DRAG * rates * np.abs(rates)).tolist(),
        'range': {f'rate/{joint}': [-8.0, 8.0]},
        'limit': 10.0,
        'kind': 'dissipative',
    }


@pytest.fixture(scope='module')
def dragged(hidden):
    return leftover(**hidden)


def test_drag_of_a_joint_is_found_there_alone(joint, dragged):
    ((channel, entry),) = laws(dragged).items()
    assert dragged.verdict == 'partly_explained'
    assert channel == f'joint_torque/{joint}'
    assert entry.depends_on == (f'rate/{joint}',)
    assert entry.form == 'x |x|'
    assert entry.coefficients[0].value == pytest.approx(-DRAG, rel=0.1)
    assert entry.applied.kind == 'dissipative'


def test_a_cause_that_stood_for_a_law_goes(hidden, joint):
    """Viscous friction is the best that the catalogue has for drag, and nothing beside it."""
    plain = flown(bind_effects({'hidden': hidden}, robot_file(ROBOT).robot))
    viscous = CATALOGUE['joint_viscous_friction']
    fit = refine(plain.run, [viscous(name='it', where=joint, values={'coefficient': 0.01})])
    assert fit.causes[0].values['coefficient'] > 0.005
    named = replace(friction_cause(), applied=fit.causes[0])
    answer = replace(hand_made('partly_explained'), causes=(named,))
    answer = discover_in_flight(answer, fit, lambda what, share: None)
    assert [entry.form for entry in laws(answer).values()] == ['x |x|']
    assert answer.causes == ()


@pytest.mark.parametrize('relevant', [True, False])
def test_a_cause_that_fits_gives_way_to_the_law_that_it_stands_for(hidden, joint, relevant):
    """Whatever the test of all that is left says; what is too small to matter stays so."""
    plain = flown(bind_effects({'hidden': hidden}, robot_file(ROBOT).robot))
    viscous = CATALOGUE['joint_viscous_friction']
    fit = refine(plain.run, [viscous(name='it', where=joint, values={'coefficient': 0.01})])
    named = replace(friction_cause(), applied=fit.causes[0], relevant=relevant)
    verdict = 'explained' if relevant else 'consistent'
    some = {'causes' if relevant else 'minor': (named,)}
    answer = replace(hand_made(verdict), **({'causes': (), 'minor': ()} | some))
    answer = discover_in_flight(answer, fit, lambda what, share: None)
    (entry,) = answer.leftover
    assert (entry.form, entry.applied.kind) == ('x |x|', 'dissipative')
    assert (answer.causes, answer.minor) == ((), ())
    assert answer.verdict == ('partly_explained' if relevant else 'consistent')
    sentence = worded_with_laws(answer, plain).sentence
    assert ('too small to matter' in sentence.lower()) != relevant


def test_a_right_cause_that_fits_stays(joint):
    """Friction of the catalogue, as small beside the noise as what laws would leave of it."""
    section = {'effect': 'joint_viscous_friction', 'where': joint, 'coefficient': 0.004}
    plain = flown(bind_effects({'it': section}, robot_file(ROBOT).robot))
    viscous = CATALOGUE['joint_viscous_friction']
    fit = refine(plain.run, [viscous(name='it', where=joint, values={'coefficient': 0.01})])
    named = replace(friction_cause(), applied=fit.causes[0])
    answer = replace(hand_made('explained'), causes=(named,))
    assert discover_in_flight(answer, fit, lambda what, share: None) is answer


def test_a_law_takes_friction_that_is_too_small_to_matter(hidden, joint):
    """Friction of one way is half of it in both, and a law that alone would push."""
    knots = np.array(hidden['knots']['x'])
    one_way = {**hidden, 'values': (-DRAG * np.maximum(knots, 0.0)).tolist()}
    plain = flown(bind_effects({'hidden': one_way}, robot_file(ROBOT).robot))
    viscous = CATALOGUE['joint_viscous_friction']
    fit = refine(plain.run, [viscous(name='it', where=joint, values={'coefficient': 0.01})])
    small = replace(friction_cause(), applied=fit.causes[0], relevant=False)
    answer = replace(hand_made('unexplained'), causes=(), minor=(small,))
    answer = discover_in_flight(answer, fit, lambda what, share: None)
    (entry,) = laws(answer).values()
    assert entry.depends_on == (f'rate/{joint}',)
    assert entry.applied.kind == 'dissipative'
    assert answer.minor == ()


def tracking_errors(hidden, added):
    """(n,) rms of reference less true angle, of a machine with drag, on a motion of its own."""
    file = robot_file(ROBOT)
    settings = replace(file.settings, reference=motion_of(file, 'fast', 6, SECONDS))
    true = bind_effects({'hidden': hidden}, file.robot)
    loop = ClosedLoop(file.robot, replace(settings, effects=effects_section(true)))
    believed = replace(settings, effects=effects_section(added))
    loop.controller = ControlLoop(file.robot, believed)
    n = file.robot.n_joints
    errors = [
        step.command.setpoint.q - step.state.q[:n]
        for step in loop.run(round(TASK / settings.simulator.period))
        if step.command is not None
    ]
    return np.sqrt(np.mean(np.square(errors), axis=0))


def test_the_controller_removes_what_the_law_does(joint, hidden, dragged):
    """At least 80 % of the error that drag causes, the sensors' noise counted with it."""
    applied = laws(dragged)[f'joint_torque/{joint}'].applied
    j = robot_file(ROBOT).robot.arm.index(joint)
    without, with_it = (tracking_errors(hidden, added)[j] for added in ((), (applied,)))
    assert with_it < 0.2 * without


def test_three_times_as_fast_the_law_is_bounded_and_takes_energy(joint, dragged):
    applied = laws(dragged)[f'joint_torque/{joint}'].applied
    robot = robot_file(ROBOT).robot
    low, high = applied.range[f'rate/{joint}']
    rates = np.linspace(3.0 * low, 3.0 * high, 301)
    j = robot.joints.index(joint)
    still = np.zeros((len(rates), robot.n_joints))
    motion = Motion(robot, np.zeros(len(rates)), still, still.copy(), still)
    motion.qd[:, j] = rates
    torque = applied.force(motion, np.zeros((len(rates), 0)))[:, 6 + j]
    trained = DRAG * max(low**2, high**2)
    assert np.max(np.abs(torque)) <= 1.5 * 1.1 * trained  # the coefficient is within a tenth
    assert np.all(torque * rates <= 0.0)
    assert np.max(np.abs(torque)) > 1.1 * trained  # bounded, not nothing


def test_a_moment_in_a_field_is_found_and_holds_on_another_flight():
    """tau = m x R_WB^T b: a slow torque on the base, which errors of its inertia look like."""
    robot = robot_file(ROBOT).robot
    moment, field = np.array([1.0, -0.5, 0.8]), 0.01 * np.array([0.3, 0.9, -0.4])
    entries = [f'attitude/{i}{k}' for i in 'xyz' for k in 'xyz']
    section = {}
    for i, axis in enumerate('xyz'):
        own = np.zeros((3, 3))  # by entry l k of R_WB
        for k in range(3):
            own[:, k] = np.cross(moment, np.eye(3)[k])[i] * field
        section[axis] = {
            'effect': 'learned_torque',
            'where': f'{robot.base_link}/{axis}',
            'form': 'sum of 9',
            'inputs': entries,
            'coefficients': own.ravel().tolist(),
            'range': {name: [-1.0, 1.0] for name in entries},
            'limit': 1.0,
            'kind': 'external',
        }
    hidden = bind_effects(section, robot)
    found = laws(asked(flown(hidden, 'fast', 5, 12.0)))
    assert set(found) == {f'base_torque/{axis}' for axis in 'xyz'}
    assert all(entry.depends_on == ('attitude',) for entry in found.values())
    motion = flown(hidden, 'fast', 9, 6.0).rows.motion
    true = np.array([np.cross(moment, R.T @ field) for R in motion.rotation])
    none = np.zeros((len(motion), 0))
    learned = sum(entry.applied.force(motion, none)[:, 3:6] for entry in found.values())
    assert np.mean((learned - true) ** 2) < 0.1**2 * np.mean(true**2)


def field_about_x(robot):
    """b^T R_WB e_x about that axis alone: a constant torque in inertial space has all three."""
    inputs = [f'attitude/{i}x' for i in 'xyz']
    return {
        'effect': 'learned_torque',
        'where': f'{robot.base_link}/x',
        'form': 'sum of 3',
        'inputs': inputs,
        'coefficients': [0.003, -0.0015, 0.0024],
        'range': {name: [-1.0, 1.0] for name in inputs},
        'limit': 1.0,
        'kind': 'external',
    }


CONSTANT = {'effect': 'external_torque_inertial', 'x': 0.003, 'y': -0.0015, 'z': 0.0024}
WHEELS = {'effect': 'servicer_wheel_momentum_error', 'x': 0.02, 'y': -0.02, 'z': 0.01}


@pytest.mark.parametrize('is_law', [True, False])
def test_a_torque_and_a_momentum_together_give_way_to_the_law_that_they_stand_for(is_law):
    """Neither does alone, as the other is left its part; right ones stay."""
    robot = robot_file(ROBOT).robot
    hidden = {'it': field_about_x(robot)} if is_law else {'torque': CONSTANT, 'wheels': WHEELS}
    plain = flown(bind_effects(hidden, robot), seconds=12.0)
    kinds = [CATALOGUE[entry['effect']] for entry in (CONSTANT, WHEELS)]
    causes = [kind(name=kind.id, where=None, values=kind.nominal()) for kind in kinds]
    fit = refine(plain.run, causes)
    places = _places(FlightRows(fit))
    assert set(instead_of(fit, places, is_refused=is_law)) == ({0, 1} if is_law else set())


def test_a_ripple_of_which_a_part_was_seen_gives_way_to_a_stiffening_spring(joint):
    """Along other angles such a sine may be anything; a ripple of whole periods stays."""
    robot = robot_file(ROBOT).robot
    section = {
        'effect': 'learned_torque',
        'where': joint,
        'form': 'x^3',
        'inputs': [f'angle/{joint}'],
        'coefficients': [-0.02],
        'range': {f'angle/{joint}': [-9.0, 9.0]},
        'limit': 10.0,
        'kind': 'external',
    }
    plain = flown(bind_effects({'hidden': section}, robot))
    way = np.ptp(plain.rows.motion.q[:, robot.joints.index(joint)])
    ripple = CATALOGUE['joint_torque_ripple']
    values = {'amplitude': 0.01, 'harmonic': 3.0 / way, 'phase': 0.0}
    fit = refine(plain.run, [ripple(name='it', where=joint, values=values)])
    places = {place: it for place, it in _places(FlightRows(fit)).items() if place == joint}
    assert set(instead_of(fit, places, is_refused=True)) == {0}
    whole = replace(fit.causes[0], values={**values, 'harmonic': 7.0 / way})
    assert [_is_part(one, 0) for one in (fit, Fit(plain.run, (whole,)))] == [True, False]


def test_friction_with_a_history_does_not_give_way_to_its_own_form():
    """It lost its name, by 7.4 nats; where the model does not fit the form may still tell more."""
    robot, joint = robot_file(ROBOT).robot, 'joint_1'
    section = {
        'effect': 'joint_presliding_friction',
        'where': joint,
        'torque': 0.0028,
        'displacement': 0.03,
    }
    causes = bind_effects({'hidden': section}, robot)
    fit = refine(flown(causes, 'default', 11, 16.0).run, causes)
    places = {place: it for place, it in _places(FlightRows(fit)).items() if place == joint}
    assert set(instead_of(fit, places, is_refused=False)) == set()
    assert set(instead_of(fit, places, is_refused=True)) == {0}


def test_a_right_model_has_no_law():
    assert not laws(leftover())


def test_a_joint_of_one_speed_is_told_from_one_that_rests():
    """Rests between moves are none of its speeds, drifts of a held joint no motion."""
    t = np.arange(0.0, 20.0, 0.1)
    way = np.sign(np.sin(t)) * (np.abs(np.sin(t)) > 0.3)
    rates = np.column_stack([0.25 * way, np.full(len(t), 1e-5), np.sin(t)])
    motion = SimpleNamespace(robot=SimpleNamespace(joints=('a', 'b', 'c')), qd=rates)
    flight = FlightRows(SimpleNamespace(rows=SimpleNamespace(motion=motion)))
    assert [flight.has_one_speed(joint) for joint in 'abc'] == [True, False, False]
