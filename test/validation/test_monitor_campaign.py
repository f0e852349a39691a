"""The monitor campaign: seeded flights, going on where it stopped, scored as defined."""

import json
import math

import pytest
from support.campaigns import missed

from validation.__main__ import main
from validation.campaigns import CAMPAIGNS
from validation.hidden import monitor_campaign as campaign
from validation.hidden.monitor_campaign import faulty, nominal, results, trials
from validation.hidden.monitor_flights import FAULTS, Flight, in_flight


def quiet(**more):
    """A flight without a fault."""
    line = {'robot': 'servicer', 'length': 900.0, 'alarms': 0, 'first': ''}
    return {**line, 'largest_evidence': 0.5, 'share_of_a_core': 0.05, **more}


def loud(**more):
    """A flight with a fault that is raised after 2 s."""
    line = {'robot': 'servicer', 'fault': 'gyro_bias', 'size': 1e-3, 'early': 0}
    return {**line, 'raised': 2.0, 'first': 'gyro x', 'cleared': 9.0, **more}


def test_scores_of_flights_by_hand():
    scores = results([quiet(), quiet(alarms=2, first='gyro x'), loud(), loud(raised=4.0)])
    own, (fault,) = scores['monitor']['nominal']['servicer'], scores['monitor']['faults']
    assert (own['hours'], own['alarms'], own['first']) == (0.5, 2, ['gyro x'])
    assert (fault['robot'], fault['fault'], fault['size']) == ('servicer', 'gyro_bias', 1e-3)
    assert fault['delay'] == 3.0


@pytest.mark.parametrize(
    ('line', 'what'),
    [
        (quiet(alarms=1, first='gyro x'), 'nominal'),
        (loud(early=1), 'before a fault'),
        (loud(raised=None, first='', cleared=None), 'gyro_bias'),
        (loud(raised=6.0), 'gyro_bias'),
    ],
)
def test_what_goes_wrong_is_told(line, what):
    assert missed('monitor', results([quiet(), loud()])) == []
    assert [what in text for text in missed('monitor', results([line]))] == [True]


def test_a_flight_that_is_never_raised_has_no_delay():
    scores = results([loud(raised=None, first='', cleared=None, size=1e-5)])
    assert math.isinf(scores['monitor']['faults'][0]['delay'])


def test_every_flight_once():
    keys = trials(4, False)
    assert len(set(keys)) == len(keys)
    assert not any('wheel_drag' in key and 'minisat' in key for key in keys)  # no such wheels


@pytest.mark.parametrize('name', FAULTS)
def test_every_fault_can_be_flown_on_its_robots(name):
    for robot in FAULTS[name].robots:
        for size in FAULTS[name].sizes:
            flight = in_flight(name, size, Flight(robot=robot, onset=0.05, end=0.1))
            assert len(list(flight.samples(0.12))) == 13


def test_a_quick_campaign_goes_on_where_it_stopped(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(campaign, 'nominal', lambda *_: quiet())
    monkeypatch.setattr(
        campaign, 'faulty', lambda robot, seed, name, size: loud(fault=name, size=size)
    )
    command = ['monitor', '--quick', '--jobs', '1', '--json', '--out', str(tmp_path)]
    assert main(command) == 0
    first = (tmp_path / CAMPAIGNS['monitor'].file).read_text(encoding='utf-8')
    assert main(command) == 0
    assert (tmp_path / CAMPAIGNS['monitor'].file).read_text(encoding='utf-8') == first
    data = json.loads(capsys.readouterr().out.split('\n}\n')[0] + '\n}')
    assert data['monitor']['nominal']['servicer']['alarms'] == 0
    assert '| servicer | gyro bias | 0.001 rad/s | 1 of 1 | 2 | 9 | gyro x |' in (
        tmp_path / CAMPAIGNS['monitor'].markdown
    ).read_text(encoding='utf-8')


def test_flights_of_a_seeded_subset(monkeypatch):
    monkeypatch.setattr(campaign, '_TIMED', 2.0)
    silent = nominal('minisat', 3, 20.0)
    assert (silent['alarms'], silent['first']) == (0, '')
    assert 0.0 < silent['largest_evidence'] < 1.0
    for name, value in {'ONSET': 12.0, 'END': 14.0, 'DURATION': 15.0}.items():
        monkeypatch.setattr(campaign, name, value)
    raised = faulty('servicer', 3, 'gyro_bias', 1e-3)
    assert (raised['early'], raised['first']) == (0, 'gyro x')
    assert 0.0 <= raised['raised'] <= 2.0
