"""The campaign of arms: seeded machines, scored as defined; a subset of it."""

import json

import numpy as np
import pytest
from support.campaigns import missed

from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.__main__ import main
from validation.campaigns import CAMPAIGNS, key
from validation.hidden import arm_campaign as campaign
from validation.hidden.arm_campaign import CAUSES, results, run, trials
from validation.hidden.real_arm import HIDDEN, JOINTS, RealArm, arm_file
from validation.shares import Share

BIAS = {'effect': 'torque_sensor_bias', 'where': 'joint_1', 'values': {'bias': 2.0}}


def said(effect, where, **values):
    """A named cause."""
    return {'effect': effect, 'where': where, 'rivals': [], 'values': values}


def line(kind='diagnose', clean=(), single=(), hidden=BIAS):
    """A finished trial."""
    cause = hidden['effect'] if hidden else 'body'
    line = {'case': key(kind, 0, cause), 'kind': kind, 'cause': cause, 'hidden': hidden}
    return {**line, 'clean': list(clean), 'single': list(single), 'wall_s': 1.0}


RIGHT = said('torque_sensor_bias', 'joint_1', bias=[2.2, 0.1])
WRONG = said('torque_sensor_bias', 'joint_2', bias=[2.2, 0.1])


def test_scores_by_hand():
    found = results(
        [
            line(single=[RIGHT]),
            line(single=[WRONG, RIGHT], clean=[WRONG]),
            line(single=[]),
            line(hidden=None),
            line('compare', single=[RIGHT]),
        ]
    )['arms']
    own = found['diagnose']
    assert (own['machines'], own['too_large']) == (4, 1)
    assert (own['false'], own['first'], own['alone']) == (Share(1, 4), Share(1, 3), Share(1, 3))
    assert own['false_names'] == {'torque_sensor_bias': 1}
    assert (own['within'], own['spread']) == (Share(2, 2), pytest.approx(2.0))
    (cause,) = own['causes']
    assert (cause['missed'], cause['taken_for']) == (1, {'torque_sensor_bias': 1})
    assert found['compare']['first'] == Share(1, 1)
    wrong = missed('arms', {'arms': found})
    assert wrong == [
        'machines without a cause with a name',
        'causes named first',
        'diagnose: rms error by standard deviation',
        'compare: rms error by standard deviation',
    ]
    assert len(CAMPAIGNS['arms'].tables({'arms': found})) == 3


def test_every_cause_is_hidden_in_turn():
    keys = [json.loads(text) for text in trials(len(CAUSES), False)]
    assert {(kind, cause) for kind, _, cause in keys} == {
        (kind, cause) for kind in ('diagnose', 'compare') for cause in CAUSES
    }
    assert len({tuple(parts) for parts in keys}) == len(keys)


def test_a_machine_whose_file_is_right_has_balanced_torques():
    """Pinocchio's torques against our equations: what is left is what filters and noise leave."""
    file = arm_file()
    record = observed(RealArm(0, leftover=0.0).record(0), file.robot)
    balance = balance_of(record, file.robot, file.effects)
    moving = balance.arm.is_moving[:: balance.arm.stride]
    left = np.sqrt(np.mean(balance.torque**2, axis=0, where=moving))
    # friction that jumps at reversals passes two filters of other widths
    assert np.all(left < 0.03 * balance.arm.effort.std(axis=0) + 0.2)


def test_records_are_seeded_and_every_effect_changes_them():
    plain = RealArm(3).record(1, duration=2.0).joints
    again = RealArm(3).record(1, duration=2.0).joints
    np.testing.assert_array_equal(plain.effort, again.effort)
    kinds = {c.kind.id: c for c in campaign_candidates()}
    for name in HIDDEN:
        c = kinds[name]
        hidden = c.applied(c.values(0.5 * c.sizes))
        changed = RealArm(3, [hidden]).record(1, duration=2.0).joints
        is_same = np.array_equal(plain.effort, changed.effort)
        assert not (is_same and np.array_equal(plain.position, changed.position)), name
    assert plain.names == JOINTS


def campaign_candidates():
    """Every candidate of a recording that is asked about."""
    return list(campaign._diagnosed(0, ())[1].values())


def test_a_seeded_subset():
    """A payload is named alone, and its machine without it has no name."""
    for kind in ('diagnose', 'compare'):
        found = run(key(kind, 12, 'payload'))
        assert found['clean'] == []
        assert found['hidden']['where'] == 'link_6'
        assert [c['effect'] for c in found['single']] == ['inertial_parameters']


def test_the_command_goes_on_where_it_stopped(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(campaign, 'run', lambda text: {**line(json.loads(text)[0]), 'case': text})
    command = ['arms', '--quick', '--jobs', '1', '--json', '--out']
    for _ in range(2):
        assert main([*command, str(tmp_path / 'new')]) == 1  # nothing is named first
    lines = (tmp_path / 'new' / CAMPAIGNS['arms'].file).read_text(encoding='utf-8').splitlines()
    assert len(lines) == 2 * CAMPAIGNS['arms'].quick_runs
    assert '"arms"' in capsys.readouterr().out
    assert (tmp_path / 'new' / CAMPAIGNS['arms'].markdown).exists()
