"""The campaign of unknown laws: keys, hidden torques, scores."""

from __future__ import annotations

import json
from dataclasses import fields, replace

import numpy as np
import pytest
from support.campaigns import missed

from spacerobot_ros.effects.laws.learned_torque import law_at
from validation.campaigns import CAMPAIGNS
from validation.hidden import law_flights
from validation.hidden.discovery_campaign import LOOPS, results, trials
from validation.hidden.hidden_laws import COLOURS, LAWS, NOISE, LawArm
from validation.hidden.law_flights import FIELD, FIXED, FLOWN, FREE, LawFlight
from validation.hidden.law_flights import beyond as beyond_data
from validation.hidden.real_arm import COULOMB

MOVING = ('joint_1', 'joint_2')


def said(form='x |x|', *depends_on, channel='joint_1', rivals=()):
    shares = {'p': 1e-9, 'held_out': 0.5, 'placebo': 0.0, 'rivals': [list(r) for r in rivals]}
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
        'removed': None,
        'beyond': None,
        **work,
    }


def test_trials_are_distinct_and_cover_all_laws_and_colours():
    keys = [json.loads(key) for key in trials(4, is_quick=False)]
    assert len({json.dumps(key) for key in keys}) == len(keys)
    assert {key[2] for key in keys if key[0] == 'law'} == {*LAWS, FIELD}
    assert {key[4] for key in keys if key[0] == 'clean'} == {*COLOURS, *LOOPS}
    assert {FREE, FIXED} == set(LOOPS)
    assert {key[2] for key in keys if key[4] == FREE} == {*FLOWN, ''}
    assert {key[2] for key in keys if key[4] == FIXED} == {*FLOWN, ''} - {FIELD}


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


def test_a_flown_law_has_its_size_and_transfers_to_itself(monkeypatch):
    monkeypatch.setattr(law_flights, '_DURATION', 3.0)
    flight = LawFlight(2, 'drag', 3.0)
    robot = flight.file.robot
    motion, hidden = flight.motion, flight._hidden
    j = robot.joints.index(flight.where)
    torque = hidden.force(motion, hidden.driven(motion))[:, 6 + j]
    # a table of straight lines, and the rate as a spline has it
    drag = -motion.qd[:, j] * np.abs(motion.qd[:, j])
    assert np.corrcoef(torque, drag)[0, 1] > 0.9999
    # what 8 numbers a second have, each three times its noise; efforts alone would leave no more
    force = hidden.force(motion, hidden.driven(motion))[:, :, None]
    force -= np.mean(force, axis=0)
    squares = np.sum(flight._quiet.whitened(force, {}) ** 2)
    assert squares == pytest.approx(3.0**2 * 8.0 * 3.0, rel=1e-9)
    noise = robot.sensors.std('joint_effort') * np.sqrt(8.0 / 100.0)
    assert np.std(torque) > 0.9 * 3.0 * noise
    assert flight.variables == [f'rate/{flight.where}']
    assert flight.transferred(()) == pytest.approx(0.0, abs=1e-12)
    assert flight.transferred([hidden]) == pytest.approx(1.0, abs=1e-12)


def test_what_the_true_law_does_at_work_and_beyond_its_data(monkeypatch):
    """Fed forward itself it removes its error; without limits drag is nine times as large."""
    monkeypatch.setattr(law_flights, '_DURATION', 3.0)
    flight = LawFlight(2, 'drag', 3.0, FIXED)
    assert flight.removed([flight._hidden]) is None  # from outside: nothing is fed forward
    law = law_at(**{f.name: getattr(flight._hidden, f.name) for f in fields(flight._hidden)})
    law = replace(law, name='drag', kind='dissipative')
    assert flight.removed([law]) > 0.9
    size, fed = beyond_data([law], flight.motion)
    assert size > 1.5  # its table is twice as wide as the motion
    assert fed == 0.0
    assert beyond_data([replace(law, kind='external')], flight.motion) == (size, 0.0)
    assert beyond_data([], flight.motion) is None


def test_scores_are_of_variables():
    right = record(said('x |x|', 'rate/joint_1'))
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


def test_learned_laws_count_at_work_and_beyond_their_data():
    right = said('x |x|', 'rate/joint_1')
    loop = [
        record(right, colour=FREE, removed=0.9, beyond=[1.4, 0.0]),
        record(right, colour=FREE, removed=0.6, beyond=[1.6, 0.01]),
        record(said('x', 'rate/joint_2'), colour=FREE, removed=-3.0),  # a wrong law is no answer
    ]
    scores = results(loop)['discovery']
    (work,) = scores['applied']
    assert (work['fed_forward'], work['learned']) == (2, 2)
    assert work['removed'] == pytest.approx(0.75)
    assert (work['beyond'], work['fed_in']) == (1.6, 0.01)
    unreached = missed('discovery', {'discovery': scores})
    assert sum('removed' in what for what in unreached) == 1
    assert sum('three times' in what or 'feeds in' in what for what in unreached) == 2
