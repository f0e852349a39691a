"""The campaign of events: keys, machines with pulses, scores."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from support.campaigns import missed
from support.diagnosis import hand_made

from spacerobot_ros.diagnosis.events.base_templates import BaseTemplates
from spacerobot_ros.diagnosis.events.event import Event, EventLimit, Events
from spacerobot_ros.diagnosis.events.impulses import steps_beside_usual
from spacerobot_ros.diagnosis.events.transient_search import TransientSearch
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.campaigns import CAMPAIGNS
from validation.hidden import event_machines
from validation.hidden.event_campaign import (
    _match,
    results,
    run,
    trials,
)
from validation.hidden.event_machines import MACHINES, HiddenPulse
from validation.hidden.real_arm import COULOMB, JOINTS

SAID = hand_made('explained')


def record(*pulses, kind='moving', false=(), beside=()):
    return {
        'kind': kind,
        'machine': 'white',
        'seconds': 36.0,
        'false': [{'start': 1.0, 'end': 2.0, 'joints': [], 'z': z} for z in false],
        'beside': [{'start': 1.0, 'end': 2.0, 'joints': [], 'z': z} for z in beside],
        'pulses': list(pulses),
    }


def pulse(ratio, *, is_named=True, off=0.01, error=0.02, std=None):
    said = (
        {'off': off, 'off_std': std, 'error': error, 'reason': None}
        if is_named
        else {'reason': 'weak'}
    )
    return {'ratio': ratio, 'allowed': 1.0 / ratio, 'is_named': is_named, **said}


def test_trials_are_distinct_and_of_every_kind():
    keys = [json.loads(key) for key in trials(3, is_quick=False)]
    assert len({seed for _, seed in keys}) == len(keys)
    assert {kind for kind, _ in keys} == set(MACHINES)


@pytest.mark.parametrize('seed', [1, 11])
def test_pushes_of_joints_that_stand_are_named_from_the_limit_on(seed):
    """Their friction takes as much of each as it can; two others move, or none."""
    found = run(f'["still", {seed}]')
    assert not found['false']
    assert not found['beside']
    assert all(p['is_named'] for p in found['pulses'])
    assert sorted(p['ratio'] for p in found['pulses']) == [1.0, 1.5, 3.0]
    for p in found['pulses']:
        assert abs(p['off']) < 0.1


def test_friction_takes_its_share_of_a_push():
    machine = MACHINES['still'](11)
    j, size = 2, 60.0
    (event,) = machine.found([HiddenPulse(JOINTS[j], 5.0, 1.0, np.array(size), 1.0)]).named
    assert event.joints == (JOINTS[j],)
    assert size - 2.0 * COULOMB[j] - 1.0 < event.peak[JOINTS[j]] < size + 2.0


def steps_alone(record, robot):
    """Without a search for causes beside them."""
    seen = observed(record, robot)
    noise, _ = noise_levels(robot.sensors, seen)
    events = steps_beside_usual(Run(seen, robot, (), noise, 'sampled'))[0]
    return replace(hand_made('explained'), events=events)


def test_what_was_found_between_two_gives_way_to_both(monkeypatch):
    """It took a part of each before their times were fitted, and none of the three stood alone."""
    monkeypatch.setattr(event_machines, 'diagnose', steps_alone)
    hidden = [
        HiddenPulse(None, 6.89, 0.94, 1e-6 * np.array([17.8, -24.9, -28.8]), 40.0),
        HiddenPulse(None, 16.51, 1.80, 1e-6 * np.array([14.2, 5.1, -14.0]), 20.0),
        HiddenPulse(None, 19.42, 1.89, 1e-6 * np.array([-12.6, 1.5, 1.2]), 12.0),
    ]
    events = MACHINES['lone'](134).found(hidden)
    every = sorted((*events.named, *events.possible), key=lambda e: e.start)
    for p, e in zip(hidden, every, strict=True):
        assert e.start < p.start + 0.5 * p.duration < e.end or abs(e.start - p.start) < p.duration
    for p, e in zip(hidden, events.named, strict=False):
        off = 0.5 * (e.start + e.end) - p.start - 0.5 * p.duration
        assert abs(off) < 3.0 * e.middle_std < 1.0


def fit_alone(record, robot):
    seen = observed(record, robot)
    return Fit(Run(seen, robot, (), noise_levels(robot.sensors, seen)[0], 'held_before'), ())


def test_one_of_six_seconds_gives_way_to_the_two_that_it_covers(monkeypatch):
    """Its halves explain little more than it does: two at other times about it do."""
    monkeypatch.setattr(event_machines, 'diagnose', lambda *run: replace(SAID, events=run))
    hidden = [
        HiddenPulse(None, 6.31, 1.86, 1e-5 * np.array([0.707, 5.494, -3.143]), 12.0),
        HiddenPulse(None, 12.20, 0.39, 1e-5 * np.array([-0.183, -2.456, -10.287]), 20.0),
        HiddenPulse(None, 19.62, 0.81, 1e-5 * np.array([-12.377, -15.522, -6.495]), 40.0),
    ]
    fit = fit_alone(*MACHINES['lone'](70023).found(hidden))
    found = sorted(TransientSearch(BaseTemplates(fit)).found, key=lambda p: p.start)
    assert [p.middle for p in found] == pytest.approx([7.24, 12.40, 20.02], abs=1.0)


def test_sizes_are_by_what_noise_leaves_beside_the_other_pulses():
    """Of one alone it is half: what follows a step until the next tells its size."""
    machine = MACHINES['lone'](3)
    spans = [(6.0, 1.0), (14.0, 1.0), (22.0, 1.0)]
    limit = EventLimit(duration=1.0, durations=(1.0,), peaks=(1.0,), unit='N m s', snr=20.0)
    quiet = Events(limits=dict.fromkeys('xyz', limit))
    three, one = (machine.units(np.random.default_rng(1), quiet, s) for s in (spans, spans[1:2]))
    assert 1.5 < three[1][2] / one[0][2] < 4.0
    assert all(np.linalg.norm(size) < 3.0 * std for _, size, std in three)


def test_a_step_whose_time_is_uncertain_is_matched_by_it():
    hidden = HiddenPulse(None, 12.26, 0.32, np.ones(3), 20.0)
    said = {'effect': 'angular_impulse', 'where': None, 'joints': (), 'ongoing': False}
    sizes = {'peak': {}, 'peak_std': {}, 'units': {}, 'z': 13.0}
    for std, is_found in ((0.32, True), (0.01, False), (None, False)):
        event = Event(**said, **sizes, start=11.82, end=12.19, middle_std=std)
        assert (_match(hidden, Events(named=(event,))) is event) == is_found


def test_scores_by_size_and_false_events_by_the_hour():
    good = [pulse(12.0, is_named=False), pulse(20.0), pulse(40.0, off=-0.05)]
    every = results([record(*good), record(*good, false=(11.0,)), record(kind='still')])
    low, middle, high = every['events']['groups']
    assert [g['named'].value for g in (low, middle, high)] == [0.0, 1.0, 1.0]
    assert low['reasons'] == 'weak 2'
    assert high['off_95'] == pytest.approx(0.05)
    moving, still = every['events']['quiet']
    assert moving['per_hour'] == pytest.approx(50.0)  # one in two records of a hundredth
    assert (still['unjudged'], moving['unjudged']) == (1, 0)
    wrong = missed('events', every)
    assert wrong == ['arms that move: false events an hour']
    assert len(CAMPAIGNS['events'].tables(every)) == 2


def test_late_or_wrong_sizes_are_missed():
    bad = results([record(pulse(20.0, off=0.2, error=0.3), pulse(20.0, is_named=False))])
    wrong = {what.rpartition(': ')[2] for what in missed('events', bad)}
    assert wrong == {'named', 'middle, 95 % within', 'size, median error'}


def test_times_of_steps_count_by_their_deviation():
    steps = [pulse(20.0, off=0.2, std=0.1), pulse(40.0, off=0.2, std=0.05)]
    wrong = missed('events', results([record(*steps, kind='base')]))
    assert wrong == ['free bases, wheels unknown, snr 40: middle by its deviation, 95 % within']
