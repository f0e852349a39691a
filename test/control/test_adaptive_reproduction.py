"""`python -m validation adaptive-control`: the command itself, its tables and its checks."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from validation.__main__ import main
from validation.campaigns import CAMPAIGNS, finish
from validation.papers import adaptive_control
from validation.papers.adaptive_judge import median, select, worst

STEPS = 4  # control periods a run: what the command does, not how well the laws learn


def shortened(case):
    return replace(case, duration=STEPS * case.period)


@pytest.fixture(scope='module')
def short():
    """Every run cut short, and no timing: on a shared machine it says nothing."""
    whole = adaptive_control.run_case
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            adaptive_control, 'run_case', lambda case, drawn: whole(shortened(case), drawn)
        )
        patch.setattr(adaptive_control, 'cycle_time', lambda law, consistency: 10.0)
        yield


def test_the_command_writes_its_page_and_lists_what_is_missed(short, tmp_path, capsys):
    there = tmp_path / 'out'
    command = ['adaptive-control', '--quick', '--json', '--jobs', '1']
    status = main([*command, '--out', str(there)])
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
def one_diverged(short, tmp_path_factory):
    """Results of very short runs, one of which counts as diverged."""
    keys = adaptive_control.trials(1, True)
    records = finish(CAMPAIGNS['adaptive-control'], keys, tmp_path_factory.mktemp('one')).records
    gone = ['harmonic', 'iid', 0.4, 'adaptive_rls', 'none', 0]
    for record in records:
        record |= {'diverged': True} if record.get('key') == gone else {}
    return adaptive_control.results(records)


def test_a_diverged_run_is_said_and_misses_its_figures(one_diverged):
    found = {check.what: check for check in CAMPAIGNS['adaptive-control'].judge(one_diverged)}
    name = 'harmonic, adaptive_rls, none, iid priors 40 %, worst of 1'
    for what in ('attitude', 'joints'):
        assert not found[f'{name}: {what}'].is_met
    tables = {table.title: table for table in CAMPAIGNS['adaptive-control'].tables(one_diverged)}
    harmonic = tables['Harmonic tracking, element-wise priors']
    row = next(row for row in harmonic.rows if row[:2] == ['adaptive_rls', 'none'])
    assert row[-3:-1] == ['diverges', 'diverges']


def test_the_median_of_few_divergences_is_finite(one_diverged):
    gone = select(one_diverged, 'harmonic', 'iid', 0.4, 'adaptive_rls')[0]
    well = {**gone, 'diverged': False}
    assert worst([gone, well, well]) == (np.inf, np.inf)
    # np.median averages the same numbers
    expected = gone['attitude_rms_deg'], gone['joint_rms_deg']
    np.testing.assert_allclose(median([gone, well, well]), expected, rtol=1e-12, atol=0.0)
