"""`python -m validation wheel-momentum`: one small run, its JSON, its report, its tables."""

import io
import json
from contextlib import redirect_stdout

import pytest

from spacerobot_ros.batch.runner import Finished
from validation.__main__ import main
from validation.campaigns import key
from validation.papers import wheel_experiments
from validation.papers.estimators import METHODS, noisy_run
from validation.papers.paper import scenario

TRACKED = [key('track', 'zyx', *law, 1.0) for law in wheel_experiments.PLANTS_AND_LAWS]
SMALL = [
    *(key('noisy', 'zyx', scale, seed) for scale, seed in ((1.0, 0), (1.0, 1), (0.1, 0))),
    key('noise_free', 'zyx', 'moving', ['symmetric']),
    *TRACKED,
    *(key('bound', 'zyx', scale) for scale in (1.0, 0.1)),
    key('soft', 'xyy', 'paper', 8.0),
]
COMMAND = ['wheel-momentum', '--jobs', '1', '--out']


@pytest.fixture(scope='module')
def outcome(tmp_path_factory):
    """Exit status, standard output, folder and records of a small run."""
    folder, kept, results = tmp_path_factory.mktemp('reproduce'), [], wheel_experiments.results
    with pytest.MonkeyPatch.context() as patch, redirect_stdout(io.StringIO()) as out:
        patch.setattr(wheel_experiments, 'trials', lambda *_: SMALL)
        patch.setattr(
            wheel_experiments, 'results', lambda records: kept.extend(records) or results(records)
        )
        status = main([*COMMAND, str(folder), '--json'])
    return status, out.getvalue(), folder, kept


def test_every_figure_is_reached(outcome):
    status, text, *_ = outcome
    data = json.loads(text)
    assert [check for check in data['checks'] if not check['is_met']] == []
    assert status == 0


def test_json_has_every_experiment(outcome):
    data = json.loads(outcome[1])
    assert {s['method'] for s in data['estimators']} == set(METHODS)
    assert len(data['table_iii']['zyx']) == 22
    assert data['noise_free'][0]['reference']['raw'] == 801
    assert len(data['tracking']) == 5
    laws = {(r['plant'], r['law']): r['max_joint_error_deg'] for r in data['tracking']}
    assert laws['correct', 'corrected'] < 1e-6 < 2.0 < laws['correct', 'no_aam']


def test_the_estimators_rank_as_derived(outcome):
    scores = {(s['method'], s['noise_scale']): s for s in json.loads(outcome[1])['estimators']}
    for scale in (1.0, 0.1):
        for method in ('recursive', 'ml'):
            found = scores[method, scale]
            assert found['aam_over_bound'] < 0.2 * scores['ls', scale]['aam_over_bound']
            assert 0.9 < found['chi2_per_dof'] < 1.1
    assert scores['paper', 1.0]['bias_over_rmse'] > 0.9


def test_tracking_with_least_squares_is_worse_than_without_any_estimate(outcome):
    data = json.loads(outcome[1])
    found = {r['method']: r['max_joint_error_deg'] for r in data['tracking_identified']}
    assert found['ls'] > 2.1
    assert max(found['recursive'], found['ml']) < 0.1


def test_files_are_written(outcome):
    _, text, folder, _ = outcome
    page = (folder / 'report.html').read_text()
    assert page.count('<div class="live"') == 4
    assert 'Fig. 7' in page
    assert json.loads((folder / 'results.json').read_text()) == json.loads(text)


def test_tables_for_people(outcome, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('validation.__main__.finish', lambda *_: Finished(outcome[3], {}))
    assert main([*COMMAND, str(tmp_path)]) == 0
    text = capsys.readouterr().out
    assert 'joint [deg]' in text
    assert 'no AAM (37)' in text
    assert 'figures are reached' in text
    assert (tmp_path / 'report.html').exists()


def test_a_folder_that_can_not_be_written(tmp_path, capsys, monkeypatch):
    (tmp_path / 'file').write_text('')
    monkeypatch.setattr(wheel_experiments, 'trials', lambda *_: [])
    assert main([*COMMAND, str(tmp_path / 'file' / 'out')]) == 2
    assert 'is a file, not a folder' in capsys.readouterr().err


def test_an_interrupted_run_keeps_the_results_before(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    folder = tmp_path / 'new' / 'out'
    monkeypatch.setattr(wheel_experiments, 'trials', lambda *_: [])
    main([*COMMAND, str(folder)])
    assert (folder / 'results.json').is_file()
    (tmp_path / 'results.json').write_text('old')
    monkeypatch.setattr(wheel_experiments, 'trials', interrupted)
    assert main([*COMMAND, str(tmp_path)]) == 130
    assert (tmp_path / 'results.json').read_text() == 'old'


def test_every_trial_once_and_less_when_quick():
    every, quick = wheel_experiments.trials(3, False), wheel_experiments.trials(3, True)
    assert len(set(every)) == len(every)
    assert set(quick) < set(every)


@pytest.mark.parametrize(
    ('words', 'why'),
    [
        (['nothing'], "'nothing' is not one of"),
        (['coverage', '--runs', '1'], "'--runs': 1 is not in the range x>=2"),
        (['coverage', '--minutes', '0'], "'--minutes': 0 must be finite and above zero"),
        (['coverage', '--jobs', 'two'], "'--jobs': 'two' is not a valid whole number"),
        (['coverage', '--only', 'nowhere', '--out', 'out'], "has 'nowhere' in it"),
    ],
)
def test_words_that_can_not_be_used_are_one_line(words, why, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'validation {words[0]}: ')
    assert said.count('\n') == 1
    assert why in said


def test_the_same_seed_gives_the_same_estimates(outcome):
    case = scenario('zyx')
    first = next(r['solutions'] for r in outcome[3] if r['case'] == key('noisy', 'zyx', 1.0, 1))
    second = noisy_run('zyx', 1.0, 1)['solutions']
    assert all(first[m] == second[m].tolist() for m in METHODS)
    assert len(first['ml']) == 3 + len(case.minimal)
