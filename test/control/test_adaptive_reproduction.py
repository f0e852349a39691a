"""`spacerobot reproduce adaptive-control`: the command itself, its tables and its checks."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.campaign import adaptive_control
from spacerobot_ros.campaign.adaptive_checks import checks
from spacerobot_ros.campaign.adaptive_control import Adaptation, Options, median, worst
from spacerobot_ros.campaign.adaptive_identities import identities
from spacerobot_ros.cli.main import main
from spacerobot_ros.cli.reproduce_adaptive import tables

STEPS = 4  # control periods a run: what the command does, not how well the laws learn


def shortened(case):
    return replace(case, duration=STEPS * case.period)


@pytest.fixture
def short(monkeypatch):
    """Every run cut short, and no timing: on a shared machine it says nothing."""
    whole = adaptive_control.run_case
    monkeypatch.setattr(adaptive_control, 'run_case', lambda case: whole(shortened(case)))
    monkeypatch.setattr(adaptive_control, 'cycle_time', lambda law, consistency: 10.0)
    monkeypatch.setattr('spacerobot_ros.cli.reproduce._workers', lambda _: 1)


def test_the_command_writes_its_page_and_lists_what_is_missed(short, tmp_path, capsys):
    there = tmp_path / 'out'
    status = main(['reproduce', 'adaptive-control', '--quick', '--json', '--out', str(there)])
    data = json.loads(capsys.readouterr().out)
    assert (there / 'report.html').stat().st_size > 0
    met = {check['what']: check['is_met'] for check in data['checks']}
    # a few steps are too few to learn in: the figures are missed, and the status says so
    assert status == 1
    assert not met['harmonic, adaptive_rls, none, iid priors 40 %, worst of 2: attitude']
    # the identities do not depend on the runs
    assert met['Lyapunov identity, random estimates']
    for check in data['checks']:
        is_within = check['value'] is not None and check['low'] <= check['value'] <= check['high']
        assert check['is_met'] == is_within


@pytest.fixture(scope='module')
def one_diverged():
    """Results of very short runs, one of which counts as diverged."""
    options = Options.quick(runs=1)
    runs = {}
    for key, case in adaptive_control.cases(options).items():
        runs[key] = adaptive_control.run_case(shortened(case))
    key = ('harmonic', 'iid', 0.4, 'adaptive_rls', 'none', 0)
    runs[key] = replace(runs[key], diverged=True)
    times = dict.fromkeys(adaptive_control.TIMED, 10.0)
    return Adaptation(options, runs, times, identities())


def test_a_diverged_run_is_said_and_misses_its_figures(one_diverged):
    found = {check.what: check for check in checks(one_diverged)}
    name = 'harmonic, adaptive_rls, none, iid priors 40 %, worst of 1'
    for what in ('attitude', 'joints'):
        assert not found[f'{name}: {what}'].is_met
    harmonic = dict(tables(one_diverged))['Harmonic tracking, element-wise priors']
    row = next(row for row in harmonic.rows if row[:2] == ['adaptive_rls', 'none'])
    assert row[-3:-1] == ['diverges', 'diverges']


def test_the_median_of_few_divergences_is_finite(one_diverged):
    gone = one_diverged.of('harmonic', 'iid', 0.4, 'adaptive_rls')[0]
    well = replace(gone, diverged=False)
    assert worst([gone, well, well]) == (np.inf, np.inf)
    # np.median averages the same numbers
    np.testing.assert_allclose(median([gone, well, well]), well.rms_deg(), rtol=1e-12, atol=0.0)
