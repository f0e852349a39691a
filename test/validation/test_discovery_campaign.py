"""The campaign of unknown laws: keys, hidden torques, scores."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from support.campaigns import missed
from support.laws import law_entry

from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.effects.motion import Motion
from validation.campaigns import CAMPAIGNS
from validation.hidden.discovery_campaign import HeldArm, beyond, results, trials
from validation.hidden.hidden_laws import COLOURS, LAWS, NOISE, LawArm
from validation.hidden.real_arm import COULOMB

MOVING = ('joint_1', 'joint_2')


def said(form='x*abs(x)', *depends_on, channel='joint_1', rivals=()):
    shares = {'p': 1e-9, 'held_out': 0.5, 'rivals': [list(r) for r in rivals]}
    return {'channel': channel, 'depends_on': list(depends_on), 'form': form, **shares}


def record(*claims, law='drag', ratio=3.0, named=(), r2=0.99, colour='white', **work):
    return {
        'kind': 'law' if law else 'clean',
        'law': law,
        'ratio': ratio,
        'colour': colour,
        'where': 'joint_1',
        'variables': ['rate/joint_1'],
        'claims': list(claims),
        'named': [list(name) for name in named],
        'r2': r2,
        'wall_s': 1.0,
        'beyond': None,
        **work,
    }


def test_trials_are_distinct_and_cover_all_laws_and_colours():
    keys = [json.loads(key) for key in trials(4, is_quick=False)]
    assert len({json.dumps(key) for key in keys}) == len(keys)
    assert {key[2] for key in keys if key[0] == 'law'} == {*LAWS}
    assert {key[4] for key in keys if key[0] == 'clean'} == {*COLOURS}


@pytest.mark.parametrize('law', ['drag', 'sum of rates', 'Dahl', "another's spring"])
def test_a_law_has_the_size_that_was_asked_for(law):
    arm = LawArm(5, law=law, place=(0, 1)).sized(3.0, MOVING, 6.0)
    with_it, without = (
        a.record(0, MOVING, 6.0).joints.effort for a in (arm, replace(arm, law=''))
    )
    hidden = (with_it - without)[:, 0]
    # about its mean; filtered before it is logged
    assert np.std(hidden) == pytest.approx(3.0 * NOISE * COULOMB[0], rel=0.05)
    np.testing.assert_allclose(with_it[:, 1:], without[:, 1:], rtol=0, atol=1e-12)


def test_what_a_law_does_beyond_its_data():
    """Without limits drag is nine times as large, and takes energy."""
    arm = HeldArm(2, '', 0.0, 'white')
    guard = {'range': {'rate/joint_1': [-100.0, 100.0]}, 'limit': 1e6, 'kind': 'dissipative'}
    entry = law_entry('x*abs(x)', ['rate/joint_1'], [-2.0], 'joint_1', **guard)
    (law,) = bind_effects({'drag': entry}, arm.file.robot)
    moving = np.sin(np.linspace(0.0, 10.0, 500))[:, None] * np.ones(arm.file.robot.n_joints)
    motion = Motion(arm.file.robot, np.linspace(0.0, 10.0, 500), moving, moving, 0.0 * moving)
    size, fed = beyond([law], motion)
    assert size == pytest.approx(9.0)
    assert fed == 0.0
    pushing = replace(law, values={'c1': 2.0}, guard=replace(law.guard, kind='external'))
    assert beyond([pushing], motion) == (pytest.approx(9.0), 0.0)  # no friction, which is asked
    assert beyond([], motion) is None


def test_scores_are_of_variables():
    right = record(said('x*abs(x)', 'rate/joint_1'))
    wrong = record(said('x', 'rate/joint_2'))
    taken = record(named=[('joint_viscous_friction', 'joint_1')])
    clean = [record(law=''), record(said(None, 'time'), law=''), record(said('x', 'a'), law='')]
    scores = results([right, right, wrong, taken, *clean])['discovery']
    (group,) = scores['groups']
    shares = [group['right'].value, group['wrong'].value]
    assert shares == [0.75, 0.25]
    assert [group[name] for name in ('own', 'named', 'false')] == [2, 1, 1]
    assert group['transfer'] == 0.99
    assert scores['false'].value == pytest.approx(1 / 3)
    assert scores['timed'].value == pytest.approx(1 / 3)
    unreached = missed('discovery', {'discovery': scores})
    assert len(unreached) == 3  # right, wrong, false
    assert len(CAMPAIGNS['discovery'].tables({'discovery': scores})) == 4


def test_a_cause_counts_by_its_variables_and_where_it_holds():
    """So does a wrong one; the line of a noise that is one is no variable of the law."""
    viscous, load = 'joint_viscous_friction', 'joint_load_friction'
    records = {
        'named': record(named=[(viscous, 'joint_1')]),
        'misnamed': record(named=[(viscous, 'joint_1'), (load, 'joint_1')]),
        'missed': record(named=[(viscous, 'joint_2')]),
        'line': record(said(None, 'time'), colour='line'),
        'false': record(said(None, 'time', rivals=[['rate/joint_2']]), colour='pink'),
        'own': record(said('x', 'rate/joint_1'), named=[('gravity_error', None)]),
    }
    tilted = record(named=[('gravity_error', None)])
    astray = record(named=[(viscous, 'joint_1')], r2=0.3)
    undecided = record(said(None, 'time', rivals=[['rate/joint_2'], ['rate/joint_1']]))
    others = [('misnamed', tilted), ('misnamed', astray), ('missed', undecided)]
    for outcome, one in [*records.items(), *others]:
        (group,) = results([one])['discovery']['groups']
        assert group[outcome] == 1
        assert group['right'].value == (outcome in ('own', 'named'))
        assert group['wrong'].value == (outcome in ('false', 'misnamed'))


def test_learned_laws_count_beyond_their_data():
    right = said('x*abs(x)', 'rate/joint_1')
    learned = [record(right, beyond=[1.4, 0.0]), record(right, beyond=[1.6, 0.01]), record(right)]
    scores = results(learned)['discovery']
    (beyond_data,) = scores['applied']
    assert beyond_data['learned'] == 2
    assert (beyond_data['beyond'], beyond_data['fed_in']) == (1.6, 0.01)
    unreached = missed('discovery', {'discovery': scores})
    assert sum('three times' in what or 'feeds in' in what for what in unreached) == 2
