"""The diagnosis campaign: cases are seeded, kept one by one, and scored as they are defined."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import binomtest

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.equivalents import EQUIVALENTS, unasked
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.estimation.unknowns.response import InverseDynamics
from validation.__main__ import main
from validation.campaigns import CAMPAIGNS
from validation.hidden.diagnosis_campaign import HiddenCase, run, trials
from validation.hidden.diagnosis_draw import drawn, places
from validation.hidden.diagnosis_judge import (
    is_equivalent,
    outcome,
    physical_limits,
)
from validation.hidden.diagnosis_scenario import (
    EXCITATIONS,
    ROBOTS,
    robot_file,
    simulated,
)
from validation.hidden.diagnosis_score import score
from validation.results.draw import main as draw
from validation.shares import Share

DOCS = Path(__file__).resolve().parents[2] / 'docs'
GYRO, RIPPLE = ('gyro_bias', None), ('joint_torque_ripple', 'joint_1')
WHEELS = ('target_wheel_momentum', 'left_3')
LATE = [
    ('joint_sensor_delay', f'{side}_joint_{k}') for side in ('left', 'right') for k in (1, 2, 3)
]
TURNED = [
    ('gyro_misalignment', None),
    ('encoder_offset', 'right_joint_1'),
    ('inertial_parameters', 'base_link'),
]
BIAS = ('torque_sensor_bias', 'joint_2')
VALUES = {
    'gyro_bias': {'x': 3e-5, 'y': 0.0, 'z': 4e-5},
    'joint_torque_ripple': {'amplitude': 0.5, 'harmonic': 10.0, 'phase': 1.0},
    'joint_stiffness': {'stiffness': 1e-3, 'rest_angle': 20.0},
    'torque_sensor_bias': {'bias': 0.2},
    'joint_delay': {},
    'joint_sensor_delay': {},
    'encoder_offset': {},
    'inertial_parameters': {},
    'target_wheel_momentum': {},
}


def line(kind, hidden=(), causes=(), verdict='explained', multiple=3.0, **more):
    """A finished case; causes are (effect, place), all values true but for half a deviation."""
    return {
        'case': '',
        'kind': kind,
        'robot': 'servicer',
        'truth': '',
        'multiple': multiple,
        'strength': multiple,
        'hidden': [{'effect': e, 'where': w, 'values': VALUES.get(e, {})} for e, w in hidden],
        'causes': [
            {
                'effect': e,
                'where': w,
                'rivals': [],
                'values': {name: [v + 0.05, 0.1] for name, v in VALUES.get(e, {}).items()},
            }
            for e, w in causes
        ],
        'minor': [],
        'verdict': verdict,
        'evidence': 10.0 * len(causes),
        'after': 1.01,
        'wall_s': 2.0,
        **more,
    }


def test_scores_of_cases_by_hand():
    scores = score(
        [
            line('clean', verdict='consistent', multiple=0.0),
            line('clean', causes=[GYRO], multiple=0.0),
            line('single', [GYRO], [GYRO]),
            line('single', [RIPPLE], [GYRO]),
            line('pair', [GYRO, RIPPLE], [RIPPLE, GYRO], multiple=10.0),
            line('triple', [GYRO, RIPPLE, BIAS], [RIPPLE, GYRO], multiple=10.0),
            line('triple', [GYRO, RIPPLE, BIAS], [BIAS, RIPPLE, GYRO], multiple=10.0),
            line('left_out', [GYRO], [RIPPLE], multiple=10.0),
        ]
    )
    assert (scores['clean_named'], scores['clean_unexplained']) == (Share(1, 2), Share(0, 2))
    assert scores['top'] == {3.0: Share(1, 2)}
    assert scores['confusion'] == {
        'joint_torque_ripple': {'gyro_bias': 1},
        'gyro_bias': {'gyro_bias': 1},
    }
    assert (scores['pairs'], scores['left_out_wrong']) == ({10.0: Share(1, 1)}, Share(1, 1))
    assert scores['triples'] == {10.0: Share(1, 2)}
    assert scores['outcomes']['triple 10.0'] == {'some of them': 1, 'right': 1}
    assert scores['within'] == Share(16, 16)  # phase and harmonic are in no proportion
    assert scores['held_out'] == Share(3, 3)
    assert scores['wall'] == (2.0, 2.0)
    assert scores['found'] == {
        'gyro_bias': {3.0: Share(1, 1)},
        'joint_torque_ripple': {3.0: Share(0, 1)},
    }


def test_what_is_refused_counts_and_what_can_not_be_is_no_trial():
    error = {'error': 'effort of joint_1 is flipped'}
    weak = {'strength': 1.0}
    scores = score(
        [
            line('clean', verdict='refused', multiple=0.0, **error),
            line('single', [GYRO], [GYRO]),
            line('single', [GYRO], verdict='refused', **error),
            line('single', [GYRO], verdict='not simulated', **error),
            line('single', [GYRO], [GYRO], **weak),
            line('pair', [GYRO, RIPPLE], [GYRO, RIPPLE], **weak),
            line('left_out', [GYRO], [RIPPLE], **weak),
        ]
    )
    assert scores['outcomes'] == {
        'clean 0.0': {'refused': 1},
        'single 3.0': {'right': 1, 'refused': 1, 'not simulated': 1, 'too weak': 1},
        'pair 3.0': {'too weak': 1},
        'left_out 3.0': {'too weak': 1},
    }
    assert (scores['clean_refused'], scores['top']) == (Share(1, 1), {3.0: Share(1, 2)})
    assert (scores['pairs'], scores['left_out_wrong']) == ({}, Share(0, 0))
    assert scores['refused'] == [
        ('clean', '', error['error']),
        *[('single', 'gyro_bias', error['error'])] * 2,
    ]
    assert scores['roc']['found_3'][-1] == 1.0
    assert scores['roc']['found_3'][0] == 0.5  # what is refused has no evidence


@pytest.mark.parametrize(
    ('where', 'became', 'is_right'),
    [('joint_1', 'equivalent', True), ('joint_2', 'wrong name', False)],
)
def test_a_declared_equivalent_is_no_error_at_its_place(where, became, is_right):
    bias = ('torque_sensor_bias', where)
    single = line('single', [RIPPLE], [bias])
    pair = line('pair', [GYRO, RIPPLE], [bias, GYRO])
    assert outcome(single) == outcome(pair) == became
    scores = score([single, pair])
    assert list(scores['top'].values()) == list(scores['pairs'].values()) == [Share(is_right, 1)]
    assert scores['found'] == {RIPPLE[0]: scores['top']}


@pytest.mark.parametrize(
    ('causes', 'verdict', 'became'),
    [
        ([('joint_stiffness', 'joint_1')], 'explained', 'equivalent'),
        ([('joint_stiffness', 'joint_2')], 'explained', 'wrong name'),
        ([('joint_stiffness', 'joint_1'), GYRO], 'explained', 'wrong name'),
        ([GYRO], 'partly_explained', 'partly_explained'),
        ([], 'unexplained', 'unexplained'),
        ([], 'consistent', 'consistent'),
    ],
)
def test_an_effect_out_of_the_catalogue(causes, verdict, became):
    case = line('left_out', [('torque_sensor_bias', 'joint_1')], causes, verdict, 10.0)
    assert outcome(case) == became
    scores = score([case])
    assert scores['left_out_wrong'] == Share(became == 'wrong name', 1)
    assert scores['left_out_missed'] == Share(became == 'consistent', 1)


@pytest.mark.parametrize(
    ('truth', 'causes', 'became'),
    [
        ('joint_delay', LATE, 'equivalent'),
        ('joint_delay', LATE[1:], 'wrong name'),
        ('right_joint_3', [('inertial_parameters', 'right_3')], 'equivalent'),
        ('right_joint_3', [('inertial_parameters', 'right_2')], 'wrong name'),
        ('left_joint_3', [('inertial_parameters', 'left_3')], 'wrong name'),  # wheels turn along
        ('left_joint_3', [('inertial_parameters', 'left_3'), WHEELS], 'equivalent'),
        ('attitude_misalignment', TURNED, 'equivalent'),
        ('attitude_misalignment', TURNED[1:], 'wrong name'),
        ('attitude_misalignment', [*TURNED, WHEELS], 'wrong name'),
        ('gyro_misalignment', [('attitude_misalignment', None), *TURNED[1:]], 'equivalent'),
        ('gyro_misalignment', TURNED[1:], 'wrong name'),
    ],
)
def test_what_effects_at_other_places_are_together(truth, causes, became):
    name = (truth, None) if truth in CATALOGUE else ('encoder_offset', truth)
    case = line('left_out', [name], causes, multiple=10.0)
    assert outcome(case | {'robot': 'twin'}) == became


def test_what_an_effect_is_made_of_may_be_too_small_to_matter():
    case = line('left_out', [('grasp_compliance', 'left_3')], multiple=10.0) | {'robot': 'twin'}
    fuel, panel, other = (
        {'effect': effect, 'where': 'left_3', 'values': {}, 'rivals': []}
        for effect in ('fuel_slosh', 'flexible_appendage', 'inertial_parameters')
    )
    for named, minor, became in (
        ([panel], [fuel], 'equivalent'),
        ([panel], [fuel, other], 'equivalent'),  # what is not named is no wrong name
        ([fuel], [], 'equivalent'),  # nothing is left, so that its inertia does not show
        ([panel, other], [fuel], 'wrong name'),
        ([panel], [], 'wrong name'),
    ):
        assert outcome(case | {'causes': named, 'minor': minor}) == became


def test_a_name_that_can_not_be_told_from_an_equivalent_is_none_that_is_wrong():
    """As of single effects, the right one among the rivals counts."""
    case = line('left_out', [('free_wheel_rotors', 'base_link')], multiple=10.0)
    body = {'effect': 'inertial_parameters', 'where': 'link_1', 'values': {}}
    for rivals, became in (([], 'wrong name'), (['base_link'], 'equivalent')):
        cause = body | {'rivals': [['inertial_parameters', link] for link in rivals]}
        assert outcome(case | {'causes': [cause]}) == became


def test_an_encoder_at_the_end_of_an_arm_is_its_last_body_turned():
    robot, d = robot_file('twin').robot, 0.1
    k = 1 + robot.joints.index('left_joint_3')
    turn = Rotation.from_rotvec(d * robot.bodies[k].axis).as_matrix()
    own = pin.Inertia.FromDynamicParameters(robot.inertial_parameters[k])
    every = robot.inertial_parameters.copy()
    every[k] = own.se3Action(pin.SE3(turn, np.zeros(3))).toDynamicParameters()
    turned = robot.with_inertial_parameters(every)
    turned = turned.with_target_momentum(turn @ robot.target_momentum)
    q, qd, a, *base = np.random.default_rng(0).standard_normal((5, 1, robot.n_joints))
    base = {'omega': base[0][:, :3], 'velocity': base[1][:, :3]}
    a = np.concatenate([a, q], axis=1)
    true_q = q + d * (np.arange(robot.n_joints) == k - 1)
    says, is_true = (
        InverseDynamics(r)(Motion(r, np.zeros(1), at, qd, qd, **base, acceleration=a))
        for r, at in ((turned, q), (robot, true_q))
    )
    np.testing.assert_allclose(says, is_true, rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize(('narrower', 'wider', 'why'), EQUIVALENTS)
def test_declared_equivalents_are_of_the_catalogue(narrower, wider, why):
    places = [set(CATALOGUE[e].places(robot_file('servicer').robot)) for e in (narrower, wider)]
    assert places[0] & places[1], why
    assert is_equivalent((wider, None), (narrower, None))


def test_what_a_name_may_stand_for_is_said_where_it_was_not_compared():
    robot = robot_file('servicer').robot
    stuck, (bias, late) = ('joint_stribeck_friction', 'joint_2'), ('gyro_bias', 'joint_delay')
    assert not unasked(robot, [stuck], CATALOGUE)  # rivals say what fits as well
    (note,) = unasked(robot, [stuck, (bias, None)], {*CATALOGUE} - {'joint_coulomb_friction'})
    assert 'joint_stribeck_friction at joint_2 may be joint_coulomb_friction' in note
    # a grasp is at an arm's end
    for link, count in (('link_2', 0), ('link_3', 1)):
        body = ('inertial_parameters', link)
        assert len(unasked(robot, [body], {*CATALOGUE} - {'grasp_compliance'})) == count
    turned = [('inertial_parameters', 'link_3'), ('target_wheel_momentum', 'link_3')]
    assert not unasked(robot, turned[:1], CATALOGUE)  # its wheels would be turned, too
    (note,) = unasked(robot, turned, CATALOGUE)
    assert 'may be encoder_offset at joint_3' in note
    delays = [('joint_sensor_delay', joint) for joint in robot.joints]
    assert late in unasked(robot, delays, CATALOGUE)[0]
    assert not unasked(robot, delays[1:], CATALOGUE)
    swings = [('fuel_slosh', 'link_3'), ('flexible_appendage', 'link_3')]
    assert not unasked(robot, swings, CATALOGUE)  # the grasp was compared with
    (note,) = unasked(robot, swings, {*CATALOGUE} - {'grasp_compliance'})
    assert 'fuel_slosh at link_3 may be grasp_compliance at link_3;' in note


def test_values_without_a_deviation_and_detuned_frequencies_are_no_hits():
    good, bad = line('single', [RIPPLE], [RIPPLE]), line('single', [RIPPLE], [RIPPLE])
    unsure = line('single', [RIPPLE], [RIPPLE])  # to 1 %: not asked for
    bad['causes'][0]['values'] = {'amplitude': [0.5, None], 'harmonic': [10.11, 0.03]}
    good['causes'][0]['values']['harmonic'] = [10.09, 0.03]
    scores = score([good, bad, unsure])
    assert (scores['within'], scores['without_std']) == (Share(2, 3), 1)
    assert scores['frequencies'] == {3.0: Share(1, 2)}


def test_held_out_errors_off_the_floor_are_no_hits():
    cases = [line('single', [GYRO], [GYRO], after=a) for a in (0.94, 0.96, 1.04, 1.06)]
    assert score(cases)['held_out'] == Share(2, 4)


def test_intervals_of_shares():
    low, high = proportion(19, 20)
    np.testing.assert_allclose(Share(19, 20).interval, (low, high), rtol=0.0, atol=1e-6)
    assert Share(0, 0).interval == (0.0, 1.0)
    assert Share(0, 300).interval[1] < 0.013


def proportion(hits, total):
    """Wilson's interval by SciPy."""
    interval = binomtest(hits, total).proportion_ci(0.95, 'wilson')
    return interval.low, interval.high


def test_limits_in_physical_units():
    bias = line('single', [GYRO])  # of 5e-5 rad/s, three times the limit
    stronger = line('left_out', [GYRO], multiple=10.0)
    drag = {'effect': 'target_wheel_drag', 'where': 'link_3', 'values': {'time_constant': 500.0}}
    limits = physical_limits([bias, stronger, line('single', multiple=5.0) | {'hidden': [drag]}])
    gyro = limits['gyro_bias']
    np.testing.assert_allclose([gyro['least'], gyro['most']], [5e-6, 5e-5 / 3.0], rtol=1e-12)
    assert (gyro['unit'], gyro['records'], gyro['relevant']) == ('rad/s', 2, 1e-5)
    np.testing.assert_allclose(limits['target_wheel_drag']['median'], 2500.0, rtol=1e-12)


def test_page_and_files_of_scores(tmp_path):
    clean, gyro = (
        next(k for k in trials(2, True) if name in k) for name in ('clean', 'gyro_bias')
    )
    records = {
        clean: line('clean', verdict='consistent', multiple=0.0),
        gyro: line('single', [GYRO], [GYRO]),
    }
    text = ''.join(json.dumps({**record, 'case': key}) + '\n' for key, record in records.items())
    (tmp_path / CAMPAIGNS['diagnosis'].file).write_text(text, encoding='utf-8')
    command = ['diagnosis', '--quick', '--runs', '2', '--minutes', '1e-9']
    assert main([*command, '--jobs', '1', '--out', str(tmp_path)]) == 0
    text = (tmp_path / CAMPAIGNS['diagnosis'].markdown).read_text(encoding='utf-8')
    assert '| gyro_bias | 1.000 (0.207 to 1.000) of 1 |' in text
    page = (tmp_path / 'report.html').read_text(encoding='utf-8')
    assert page.count('<div class="live"') == page.count('<table class="matrix"') == 1
    draw(tmp_path / 'results.json', tmp_path)
    for name in ('diagnosis_roc.svg', 'diagnosis_confusion.svg'):
        svg = ElementTree.fromstring((tmp_path / name).read_text(encoding='utf-8'))
        assert svg.tag == '{http://www.w3.org/2000/svg}svg'
    kept = json.loads((tmp_path / 'results.json').read_text(encoding='utf-8'))['diagnosis']
    assert kept['top']['3.0']['total'] == 1
    assert kept['outcomes']['single 3.0'] == {'right': 1}
    command = [*command, '--jobs', '1', '--out', str(tmp_path), '--only']
    assert main([*command, 'gyro_bias']) == 0
    kept = json.loads((tmp_path / 'results.json').read_text(encoding='utf-8'))['diagnosis']
    assert kept['outcomes'] == {'single 3.0': {'right': 1}}
    assert main([*command, 'no_such']) == 2


def test_the_docs_show_every_signature_and_every_equivalent():
    text = (DOCS / 'diagnosis.md').read_text(encoding='utf-8')
    pictures = sorted((DOCS / 'images' / 'effects').glob('*.svg'))
    assert [p.name for p in pictures if f'(images/effects/{p.name})' not in text] == []
    rows = [f'| `{a}` | `{b}` | {why} |' for a, b, why in EQUIVALENTS]
    assert [row for row in rows if row not in text] == []


@pytest.fixture(scope='module')
def clean():
    """Return the servicer's model on a clean record."""
    robot = robot_file('servicer').robot
    record = observed(simulated('servicer', 'default', 1, (), 4.0), robot)
    return Fit(Run(record, robot, (), noise_levels(robot.sensors, record)[0]), ())


def test_a_gear_too_stiff_to_be_simulated_is_drawn_softer(clean):
    applied, strength = drawn(
        clean, 'joint_flexibility', 'joint_2', 1e-3, np.random.default_rng(0)
    )
    assert strength > 1.0
    assert applied.fastest(clean.run.robot) <= 1e3


def test_what_is_drawn_is_possible_and_seen(clean):
    rng = np.random.default_rng(0)
    for _ in range(5):
        applied, strength = drawn(clean, 'joint_stribeck_friction', 'joint_2', 3.0, rng)
        assert applied.values['static'] >= applied.values['coulomb']
        assert strength > 0.0
    _, strength = drawn(clean, 'gravity_error', None, 3.0, rng)
    assert strength == 0.0  # a free base falls with its arm


def test_cases_are_the_same_every_time_and_all_different():
    first, second = (trials(300, False) for _ in range(2))
    assert first == second
    assert len(set(first)) == len(first)
    cases = [json.loads(key) for key in first]
    assert sum(case['kind'] == 'clean' for case in cases) >= 300
    for kind, size in (('pair', 2), ('triple', 3)):
        some = [case for case in cases if case['kind'] == kind]
        assert {case['multiple'] for case in some} == {3.0, 10.0}
        assert {len(set(case['effects'])) for case in some} == {size}
    trees = [robot_file(robot).robot.bodies[1:] for robot in {case['robot'] for case in cases}]
    assert {sum(body.parent == 0 for body in tree) for tree in trees} == {1, 2}  # arms


@pytest.mark.parametrize('robot', ROBOTS)
def test_motions_rest_at_their_ends_and_leave_the_controller_its_limits(robot):
    """The largest angle is as said; the controller follows and does not saturate."""
    file = robot_file(robot)
    for name, (largest, *_) in EXCITATIONS.items():
        record = simulated(robot, name, 3)
        assert np.max(np.abs(record.q - record.q[0])) < 1.02 * largest
        assert np.max(np.abs(record.qd[[0, -1]])) < 1e-2
        assert (np.max(np.abs(record.effort), axis=0) < file.robot.effort_limits).all()
        assert (np.max(np.abs(record.qd), axis=0) < file.robot.velocity_limits).all()


def test_every_effect_that_a_robot_can_have_is_hidden_at_all_strengths_and_left_out():
    cases = [json.loads(key) for key in trials(0, False)]
    for robot in ROBOTS:
        possible = {effect for effect, _ in places(robot_file(robot).robot)}
        for kind, multiple in [
            ('single', 1.0),
            ('single', 3.0),
            ('single', 10.0),
            ('left_out', 10.0),
        ]:
            hidden = {
                case['effects'][0]
                for case in cases
                if (case['kind'], case['multiple'], case['robot']) == (kind, multiple, robot)
            }
            assert hidden == possible, (robot, kind, multiple)


def test_a_campaign_that_is_cut_off_has_something_of_everything_urgent():
    kinds = [(c['kind'], c['multiple']) for c in map(json.loads, trials(600, False)[:200])]
    for kind in [('clean', 0.0), ('single', 3.0), ('single', 10.0), ('left_out', 10.0)]:
        assert kinds.count(kind) >= 15, kind
    for kind in [('pair', 3.0), ('pair', 10.0), ('triple', 3.0), ('triple', 10.0)]:
        assert kinds.count(kind) >= 2, kind


def test_a_hidden_effect_is_found():
    case = HiddenCase(
        kind='single',
        robot='servicer',
        excitation='default',
        seed=5,
        effects=('gyro_bias',),
        multiple=10.0,
        duration=10.0,
    )
    found = run(case.key)
    assert [(h['effect'], h['where']) for h in found['hidden']] == [('gyro_bias', None)]
    assert score([found])['top'] == {10.0: Share(1, 1)}


def test_records_may_come_from_an_independent_engine():
    pytest.importorskip('mujoco')
    engine = 'validation.mujoco.campaign'
    cases = [json.loads(key) for key in trials(3, False, engine)]
    assert {case['truth'] for case in cases} == {engine}
    case = HiddenCase(
        kind='single',
        robot='twin',
        excitation='default',
        seed=5,
        effects=('gyro_bias',),
        multiple=10.0,
        duration=5.0,
        truth=engine,
    )
    found = run(case.key)
    assert score([found])['top'] == {10.0: Share(1, 1)}
    with pytest.raises(ConfigurationError, match='no_such_engine'):
        trials(3, False, 'no_such_engine')


def test_what_leaves_no_trace_is_no_trial():
    """A torque that is held looks the same a little later; most delays are seen."""
    late = HiddenCase(
        kind='single',
        robot='servicer',
        excitation='fast',
        seed=5,
        effects=('effort_delay',),
        multiple=3.0,
        duration=4.0,
    )
    for effect, seen in (('effort_delay', False), ('joint_delay', True)):
        found = run(replace(late, effects=(effect,)).key)
        assert found['hidden'][0]['values']['delay'] < 0.01, effect  # s, of a hold
        assert (outcome(found) != 'too weak') == seen, effect
