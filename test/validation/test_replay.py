"""The replay (`validation/replay`): its rule, its words, its check of records, four answers."""

from __future__ import annotations

import json
import shutil
from collections import Counter

import numpy as np
import pytest

from validation.replay import records
from validation.replay.__main__ import COMMITTED, accept, asked, read
from validation.replay.asking import ROOT, ask
from validation.replay.changes import changes, summary
from validation.replay.records import ChangedRecordError, check, made, table
from validation.replay.scoring import scored

FRICTION = {'effect': 'joint_viscous_friction', 'where': 'j2', 'values': {'coefficient': 3.0}}
GAIN = {'effect': 'joint_torque_constant', 'where': 'j1', 'values': {'gain': 0.9}}
VISCOUS, DRY = 'joint_viscous_friction@j2', 'joint_coulomb_friction@j2'


def answer(verdict, *names, asked='diagnose', values=None, **further):
    """A line of answers."""
    out = {'key': 'made', 'asked': asked, 'verdict': verdict, 'names': list(names), 'cpu_s': 1.0}
    return {**out, 'values': values or {}, **further}


def named(*names, value=3.1, std=0.1, **further):
    """An answer with names, the first of which has a coefficient."""
    values = {names[0]: {'coefficient': [value, std]}}
    return answer('explained', *names, values=values, **further)


@pytest.mark.parametrize(
    ('hidden', 'said', 'score'),
    [
        ([], answer('consistent'), 'right'),
        ([], answer('unexplained'), 'silent'),
        ([], named(VISCOUS), 'wrong'),
        ([FRICTION], named(VISCOUS), 'right'),
        ([FRICTION], named(VISCOUS, value=3.41), 'wrong'),  # 4.1 deviations
        ([FRICTION], named(VISCOUS, value=3.39), 'right'),  # 3.9
        ([FRICTION], named(VISCOUS, DRY), 'wrong'),
        ([FRICTION], named(DRY), 'wrong'),
        ([FRICTION], named(DRY, rivals={DRY: [VISCOUS]}), 'right'),
        ([FRICTION], answer('consistent', minor=[VISCOUS]), 'right'),
        ([FRICTION], answer('unexplained'), 'silent'),
        ([FRICTION], answer('refused', reason='too short'), 'silent'),
        ([FRICTION, GAIN], named(VISCOUS), 'silent'),
    ],
)
def test_the_rule(hidden, said, score):
    assert scored({'asked': 'diagnose', 'hidden': hidden}, said) == score


def test_a_comparison_tells_what_was_added():
    line = {'asked': 'compare', 'hidden': [GAIN]}
    name = 'joint_torque_constant@j1'
    for value, score in ((-0.1, 'right'), (0.9, 'wrong')):
        values = {name: {'gain': [value, 0.01]}}
        assert scored(line, answer('changed', name, asked='compare', values=values)) == score


@pytest.mark.parametrize(
    ('verdict', 'x', 'score'),
    [('valid', 1.3, 'right'), ('valid', 1.5, 'wrong'), ('not valid', 1.5, 'silent')],
)
def test_the_rule_of_a_momentum(verdict, x, score):
    momentum = {'effect': 'target_wheel_momentum', 'where': 'b3', 'values': {'x': 1.0, 'y': 2.0}}
    values = {'wheel momentum': {'x': [x, 0.1], 'y': [2.0, 0.1]}}
    said = answer(verdict, asked='identify', values=values)
    assert scored({'asked': 'identify', 'hidden': [momentum]}, said) == score


def test_the_rule_of_a_measured_machine():
    """Ranges for values, further names where the truth is known in part, no score without one."""
    truth = [{'name': VISCOUS, 'values': {'coefficient': [2.5, 3.05]}}]
    line = {'asked': 'diagnose', 'data': ['a.csv'], 'truth': truth}
    assert scored(line, named(VISCOUS, value=3.0)) == 'right'
    assert scored(line, named(VISCOUS, value=3.1)) == 'wrong'
    assert scored(line, named(VISCOUS, DRY, value=3.0)) == 'wrong'
    assert scored(line | {'others': True}, named(VISCOUS, DRY, value=3.0)) == 'right'
    assert scored({'asked': 'diagnose', 'data': ['a.csv']}, named(DRY)) is None


def words(before, after):
    """The one change between two answers, as it is printed."""
    (found,) = changes({'made': before}, {'made': after})
    return str(found), found.is_worse


def test_what_changed_is_said_in_words():
    before = named(VISCOUS, score='right')
    after = named(DRY, score='wrong', value=2.0) | {'verdict': 'partly_explained'}
    assert words(before, after) == (
        'made: WORSE, right -> wrong; verdict explained -> partly_explained; '
        f'came: {DRY}; went: {VISCOUS}',
        True,
    )
    assert words(after, before)[1] is False


def test_values_are_said_from_one_deviation_on():
    before = named(VISCOUS, score='right')
    assert changes({'made': before}, {'made': named(VISCOUS, score='right', value=3.19)}) == []
    text, is_worse = words(before, named(VISCOUS, score='right', value=3.25, std=0.2))
    assert not is_worse
    assert f'coefficient of {VISCOUS} 3.1 -> 3.25 (1.5 deviations)' in text
    assert f'deviation of coefficient of {VISCOUS} 0.1 -> 0.2' in text


def test_a_model_that_misses_more_of_another_run_is_said():
    before = named(VISCOUS, score='right', rms_of_another_run=0.3)
    assert changes({'made': before}, {'made': before | {'rms_of_another_run': 0.302}}) == []
    text, is_worse = words(before, before | {'rms_of_another_run': 0.33})
    assert text == 'made: the extended model misses 0.3 -> 0.33 of another run'
    assert not is_worse


def test_time_is_said_and_is_not_worse():
    before = answer('consistent', score='right') | {'cpu_s': 10.0}
    assert words(before, before | {'cpu_s': 30.0}) == ('made: CPU 10 -> 30 s', False)
    assert changes({'made': before}, {'made': before | {'cpu_s': 14.0}}) == []


def test_a_silent_answer_that_was_right_is_worse():
    right, silent = named(VISCOUS, score='right'), answer('consistent', score='silent')
    assert words(right, silent)[1] is True
    assert words(silent, right)[1] is False
    assert words(silent, named(DRY, score='wrong'))[1] is True


def test_answers_that_nobody_committed_are_counted():
    one, other = answer('consistent', score='right'), answer('consistent', score='silent')
    said = summary({'a': one}, {'a': one, 'b': other})
    assert said[0].startswith('1 answers compared: 1 right, 0 wrong, 0 silent')
    assert said[-1].startswith('1 without a committed answer: 0 right, 0 wrong, 1 silent')


def line_of(key):
    """A line of the table."""
    return next(line for line in table() if line['key'] == key)


@pytest.fixture
def record(tmp_path):
    """The key of a small record, and its folder."""
    return 'arm-00', made(line_of('arm-00'), tmp_path)


def test_a_changed_record_is_refused(record):
    key, folder = record
    with np.load(folder / 'data.npz') as data:
        channels = dict(data)
    channels['tau'][-1, -1] += 2e-9 * np.max(np.abs(channels['tau']))
    np.savez(folder / 'data.npz', **channels)
    with pytest.raises(ChangedRecordError, match='arm-00: tau of data is not what it was'):
        check(key, folder)


def test_a_changed_generator_is_refused(monkeypatch, tmp_path):
    monkeypatch.setattr(records, '_RIPPLE', 0.030001)
    with pytest.raises(ChangedRecordError, match='arm-00: tau of data is not what it was'):
        made(line_of('arm-00'), tmp_path)


def test_a_record_without_samples_is_refused(tmp_path):
    with pytest.raises(ChangedRecordError, match='new: no samples of it are stored'):
        made(line_of('arm-00') | {'key': 'new'}, tmp_path)


def test_the_table():
    lines = table()
    kinds = Counter(line['key'].split('-')[0] for line in lines if 'machine' in line)
    assert kinds['hidden'] == 60
    assert kinds['flyer'] + kinds['arm'] + kinds['change'] == 40
    assert kinds['identify'] == 12
    assert len({line['key'] for line in lines}) == len(lines)
    assert sum(line.get('quick', False) for line in lines) == 20
    assert sum(line.get('ci', False) for line in lines) == 4


@pytest.mark.slow
@pytest.mark.parametrize('key', [line['key'] for line in table() if line.get('ci')])
def test_no_answer_changed(key, tmp_path):
    """What CI asks: names and score are those that are committed."""
    said, before = ask(line_of(key), ROOT, tmp_path), read(COMMITTED)[key]
    assert (said['score'], said['verdict']) == (before['score'], before['verdict'])
    assert said['names'] == before['names']


def test_a_run_goes_on_where_it_stopped(tmp_path, monkeypatch):
    """A line that was cut off is asked about again, a finished one is not."""
    keys = ['check-arm', 'arm-00']
    monkeypatch.setattr('validation.replay.__main__.fingerprint', lambda _: 'made')
    kept = tmp_path / 'answers-made.jsonl'
    done = answer('unexplained', score='right') | {'key': 'arm-00'}
    kept.write_text(f'{json.dumps(done)}\n{{"key": "check-')
    answers = asked([line_of(key) for key in keys], ROOT, tmp_path, 1)
    assert answers['arm-00'] == done | {'truth': [], 'score': 'silent'}  # by the rule of today
    assert answers['check-arm']['verdict'] == 'good'
    assert read(kept).keys() == set(keys)
    shutil.copyfile(COMMITTED, tmp_path / 'answers.jsonl')
    monkeypatch.setattr('validation.replay.__main__.COMMITTED', tmp_path / 'answers.jsonl')
    accept({'check-arm': answers['check-arm'] | {'verdict': 'new'}})
    assert read(tmp_path / 'answers.jsonl')['check-arm']['verdict'] == 'new'
    assert len(read(tmp_path / 'answers.jsonl')) == len(read(COMMITTED))
