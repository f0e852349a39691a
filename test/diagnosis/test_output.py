"""What is made of a diagnosis: JSON, the extended model, what to fly next, the closed loop."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.contracts import keeps
from support.diagnosis import friction_cause, hand_made

from spacerobot_ros.diagnosis.answer.cause import Evidence, Rival
from spacerobot_ros.diagnosis.answer.closed_loop_gain import closed_loop_gain
from spacerobot_ros.diagnosis.answer.extended_model import NEVER, named, write_extended_model
from spacerobot_ros.diagnosis.answer.next_motion import with_motions
from spacerobot_ros.diagnosis.answer.output import relevance, to_dict
from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.effects.parameter import Parameter
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.report.diagnosis_tables import evidence_table, rival_lines

CONFIG = Path(__file__).resolve().parents[2] / 'config'
SERVICER = CONFIG / 'servicer.yaml'
RIVAL = Rival(effect='joint_coulomb_friction', where='joint_2', bic_gap=1.5, motion='')


@pytest.fixture
def beside(tmp_path):
    """A robot file with a relative URDF and an effect of its own."""
    content = yaml.safe_load(SERVICER.read_text())
    values = content['/**']['ros__parameters']
    values['robot']['urdf'] = 'robot.urdf'
    values['effects'] = {
        'joint_viscous_friction_joint_2': {
            'effect': 'joint_viscous_friction',
            'where': 'joint_1',
            'coefficient': 1.0,
        }
    }
    folder = tmp_path / 'robot'
    folder.mkdir()
    shutil.copy(CONFIG / 'servicer.urdf', folder / 'robot.urdf')
    path = folder / 'robot.yaml'
    path.write_text(yaml.safe_dump(content))
    return path


# ---------------------------------------------------------------- JSON


def test_json_has_the_documented_keys_and_only_finite_numbers():
    diagnosis = hand_made(rivals=(RIVAL,))
    values = keeps('diagnose', json.dumps(to_dict(diagnosis), allow_nan=False))
    assert values['schema'] == 3
    assert values['verdict'] == 'explained'
    assert values['extended_model'] == 'extended_model.yaml'
    cause = values['causes'][0]
    assert (cause['effect'], cause['where']) == ('joint_viscous_friction', 'joint_2')
    assert set(cause['parameters']['coefficient']) == {'value', 'std', 'unit', 'threshold'}
    evidence = {'log_likelihood_gain', 'bic_gain', 'p_value', 'held_out_gain', 'placebo_gain'}
    evidence |= {'log_odds', 'probability', 'elpd_gain'}
    assert set(cause['evidence']) == evidence
    assert cause['indistinguishable_from'][0]['bic_gap'] == 1.5
    keys = {'channel', 'unit', 'rms_before', 'rms_after', 'noise_floor', 'whiteness_p'}
    assert all(keys <= set(residual) for residual in values['residuals'])
    gain = values['gain']
    assert gain['ratio'] == pytest.approx(1.01 / 7.0, rel=1e-12)  # one division
    assert {'held_out_rmse_before', 'held_out_rmse_after', 'held_out_rmse_placebo'} < set(gain)


def test_odds_stand_where_they_are_known_and_nothing_else_does():
    """Log odds of ln 3 are three to one."""
    cause = friction_cause((replace(RIVAL, bic_gap=math.nan, log_odds=1.25),))
    known = Evidence(log_odds=math.log(3.0), elpd_gain=4.5, held_out_gain=0.5)
    found = replace(hand_made(), causes=(replace(cause, evidence=known),))
    (said,) = keeps('diagnose', json.dumps(to_dict(found), allow_nan=False))['causes']
    assert said['evidence']['probability'] == pytest.approx(0.75)
    nothing = {name for name, value in said['evidence'].items() if value is None}
    assert nothing == {'log_likelihood_gain', 'bic_gain', 'p_value', 'placebo_gain'}
    (rival,) = said['indistinguishable_from']
    assert (rival['log_odds'], rival['bic_gap']) == (1.25, None)
    table = evidence_table(found.causes)
    assert table.head == ['cause', 'log odds', 'probability', 'held-out gain [nats]', 'held out']
    assert [*table.rows[0]][1:] == ['1.099', '0.75', '4.5', '50.0 %']
    (line,) = rival_lines(found.causes)
    assert '(log odds 1.2)' in line


def test_json_says_null_where_there_is_no_number():
    values = to_dict(hand_made())
    assert values['minor'][0]['parameters']['time_constant']['value'] is None
    assert values['minor'][0]['parameters']['time_constant']['std'] is None
    assert values['residuals'][0]['whiteness_p'] is None
    assert values['closed_loop'] is None


@pytest.mark.parametrize(
    ('role', 'threshold'),
    [('linear', 0.04), ('reciprocal', 25.0), ('square', 0.2), ('phase', None)],
)
def test_thresholds_are_in_the_units_of_the_parameter(role, threshold):
    parameter = Parameter(name='x', unit='', relevant=0.04, role=role)
    got = relevance(parameter)
    assert got is threshold if threshold is None else got == pytest.approx(threshold, rel=1e-12)


# ---------------------------------------------------------------- extended model


def test_extended_model_keeps_what_was_there_and_adds_under_free_names(beside, tmp_path):
    file = load_robot_file(beside)
    causes = [friction_cause().applied, friction_cause().applied]
    added = named(causes, file.effects)
    assert [a.name for a in added] == [
        'joint_viscous_friction_joint_2_2',
        'joint_viscous_friction_joint_2_3',
    ]
    out = write_extended_model(beside, added[:1], tmp_path / 'out' / 'extended_model.yaml')
    shutil.rmtree(beside.parent)  # the new file needs nothing of the old one
    extended = load_robot_file(out)
    assert [(e.where, e.values['coefficient']) for e in extended.effects] == [
        ('joint_1', 1.0),
        ('joint_2', 3.0),
    ]
    assert replace(extended.settings, effects={}, robot=file.settings.robot) == replace(
        file.settings, effects={}
    )


def test_extended_model_keeps_package_paths_and_may_add_nothing(tmp_path):
    out = write_extended_model(SERVICER, (), tmp_path / 'extended_model.yaml')
    assert list(tmp_path.iterdir()) == [out]
    assert load_robot_file(out).settings == load_robot_file(SERVICER).settings


def test_infinite_values_are_written_as_never(tmp_path):
    endless = hand_made().minor[0].applied
    out = write_extended_model(SERVICER, (endless,), tmp_path / 'model.yaml')
    assert load_robot_file(out).effects[0].values['time_constant'] == NEVER


def test_extended_model_that_can_not_be_written_is_one_line(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(ConfigurationError, match=r'model\.yaml: can not be written: '):
        write_extended_model(SERVICER, (), tmp_path / 'file' / 'model.yaml')


# ---------------------------------------------------------------- what to fly next


def test_rivals_name_the_command_that_separates_them():
    diagnosis = with_motions(hand_made(rivals=(RIVAL,)), 'my robot.yaml')
    command = (
        "spacerobot excite --robot 'my robot.yaml' --separate joint_viscous_friction@joint_2 "
        'joint_coulomb_friction@joint_2 -o separate.yaml'
    )
    assert diagnosis.causes[0].rivals[0].motion == command
    assert diagnosis.next_motion[0].endswith(command)


@pytest.mark.parametrize(
    ('verdict', 'word'), [('explained', 'extended_model.yaml'), ('unexplained', 'resting joints')]
)
def test_advice_follows_the_verdict(verdict, word):
    assert word in ' '.join(with_motions(hand_made(verdict), 'robot.yaml').next_motion)


def test_consistent_data_ask_for_nothing():
    clean = replace(hand_made('consistent'), causes=(), minor=())
    assert with_motions(clean, 'robot.yaml').next_motion == ()


# ---------------------------------------------------------------- closed loop


def test_closed_loop_gain_of_friction():
    file = load_robot_file(SERVICER)
    reference = file.settings.reference
    gentle = {
        name: tuple(0.1 * v for v in getattr(reference, name)) for name in ('sine', 'cosine')
    }
    short = replace(reference, duration=4.0, **gentle)
    file = replace(file, settings=replace(file.settings, reference=short))
    section = {'f': {'effect': 'joint_viscous_friction', 'where': 'joint_2', 'coefficient': 3.0}}
    gain, why = closed_loop_gain(file, bind_effects(section, file.robot))
    assert why == ''
    assert gain.duration == 4.0
    own = gain.joints['joint_2']
    # of a linear friction nothing is left but what sensor noise makes, some 1e-5 rad
    assert own.rms_after < 0.3 * own.rms_before
    assert gain.ratio < 0.5
    assert math.isclose(
        gain.rms_before**2,
        np.mean([own.rms_before**2 for own in gain.joints.values()]),
        rel_tol=1e-12,
    )


def test_a_plant_that_takes_minutes_has_no_closed_loop():
    file = load_robot_file(SERVICER)
    section = {'f': {'effect': 'joint_viscous_friction', 'where': 'joint_2', 'coefficient': 1e7}}
    gain, why = closed_loop_gain(file, bind_effects(section, file.robot))
    assert gain is None
    assert 'would take minutes' in why


def test_no_causes_no_closed_loop():
    gain, why = closed_loop_gain(load_robot_file(SERVICER), ())
    assert gain is None
    assert 'nothing was found' in why
