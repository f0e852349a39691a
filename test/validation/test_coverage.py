"""The coverage campaign: a few seeded runs, going on where it stopped, its figures."""

import json

import numpy as np
import pytest

from spacerobot_ros.errors import RecordingError
from validation.__main__ import main
from validation.campaigns import CAMPAIGNS, finish
from validation.papers import coverage
from validation.papers.estimators import true_values


def made_up(axes, seed):
    """Errors of known spread: the truth plus unit noise times a tenth, as stated."""
    truth = true_values(axes)
    value = truth + 0.1 * np.random.default_rng(seed).standard_normal(len(truth))
    one = {'value': value.tolist(), 'std': [0.1] * len(truth), 'chi2_per_dof': 1.0, 'valid': True}
    return {'seed': seed, 'axes': axes, 'methods': dict.fromkeys(coverage.METHODS, one)}


def test_a_few_runs_are_covered(tmp_path, capsys):
    command = ['coverage', '--out', str(tmp_path)]
    status = main([*command, '--runs', '4', '--jobs', '1', '--json'])
    data = json.loads(capsys.readouterr().out)
    assert [check for check in data['checks'] if not check['is_met']] == []
    assert status == 0
    assert len(data['coverage']) == len(coverage.AXES) * len(coverage.METHODS)
    assert 'Coverage campaign' in (tmp_path / 'report.html').read_text(encoding='utf-8')


def test_goes_on_where_it_stopped(tmp_path, monkeypatch):
    calls = []

    def run(key):
        _, axes, seed = json.loads(key)
        calls.append(seed)
        return made_up(axes, seed)

    monkeypatch.setattr(coverage, 'run', run)
    finish(CAMPAIGNS['coverage'], coverage.trials(3, False), tmp_path)
    runs = finish(CAMPAIGNS['coverage'], coverage.trials(50, False), tmp_path).records
    assert calls == list(range(50))
    assert [r['seed'] for r in runs] == list(range(50))
    assert len(finish(CAMPAIGNS['coverage'], coverage.trials(10, False), tmp_path).records) == 10
    assert len(calls) == 50


def test_figures_of_errors_that_are_as_stated():
    runs = [made_up(coverage.AXES[seed % 2], seed) for seed in range(400)]
    scores = coverage.results(runs)['coverage']
    assert len(scores) == 2 * len(coverage.METHODS)
    for score in scores:
        # 200 runs of 22 independent numbers: 0.003
        np.testing.assert_allclose(np.mean(score['covered']), 0.95, rtol=0, atol=0.015)
        assert np.sqrt(np.mean(score['bias'] ** 2)) < 0.1
        assert score['valid'] == 1.0


def test_foreign_file_is_refused(tmp_path):
    (tmp_path / CAMPAIGNS['coverage'].file).write_text('{"seed": 1}\n', encoding='utf-8')
    with pytest.raises(RecordingError, match='is no case of a campaign'):
        finish(CAMPAIGNS['coverage'], coverage.trials(2, False), tmp_path)
