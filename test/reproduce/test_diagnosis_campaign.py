"""The diagnosis campaign: cases are seeded, kept one by one, and scored as they are defined."""

from __future__ import annotations

import json

import pytest

from spacerobot_ros.errors import RecordingError
from spacerobot_ros.reproduce.diagnosis_campaign import (
    FILE,
    Case,
    Options,
    cases,
    read_campaign,
    run_campaign,
    run_case,
)
from spacerobot_ros.reproduce.diagnosis_score import score


def line(kind, hidden=(), causes=(), verdict='explained', multiple=3.0):
    """A finished case; causes are (effect, place)."""
    return {
        'case': '',
        'kind': kind,
        'multiple': multiple,
        'strength': multiple,
        'hidden': [{'effect': e, 'where': w, 'values': {'x': 1.0}} for e, w in hidden],
        'causes': [
            {'effect': e, 'where': w, 'rivals': [], 'values': {'x': [1.1, 0.1]}} for e, w in causes
        ],
        'minor': [],
        'verdict': verdict,
        'evidence': 10.0 * len(causes),
        'wall_s': 2.0,
    }


def test_scores_of_cases_by_hand():
    a, b = ('gyro_bias', None), ('encoder_offset', 'joint_1')
    scores = score(
        [
            line('clean', verdict='consistent', multiple=0.0),
            line('clean', causes=[a], multiple=0.0),
            line('single', [a], [a]),
            line('single', [b], [a]),
            line('pair', [a, b], [b, a], multiple=10.0),
            line('left_out', [a], [b], multiple=10.0),
            line('single', [a], verdict='refused'),
        ]
    )
    assert (scores.clean_named, scores.clean_unexplained) == (0.5, 0.0)
    assert scores.top == {3.0: 0.5}
    assert scores.confusion == {
        'encoder_offset': {'gyro_bias': 1},
        'gyro_bias': {'gyro_bias': 1},
    }
    assert (scores.pairs, scores.left_out_wrong, scores.within) == (1.0, 1.0, 1.0)
    assert scores.wall == (2.0, 2.0)


def test_cases_are_the_same_every_time_and_all_different():
    first, second = (cases(Options()) for _ in range(2))
    assert first == second
    assert len({case.key for case in first}) == len(first)
    assert sum(case.kind == 'clean' for case in first) >= 300


def test_a_campaign_goes_on_where_it_stopped(tmp_path):
    options = Options.quick(1)
    done = [{**line(c.kind), 'case': c.key} for c in cases(options)]
    text = ''.join(json.dumps(entry) + '\n' for entry in done)
    (tmp_path / FILE).write_text(text + '{"case": cut o', encoding='utf-8')
    seen = []
    assert len(run_campaign(tmp_path, options, lambda: seen.append(1))) == len(done) == len(seen)
    assert (tmp_path / FILE).read_text(encoding='utf-8') == text


def test_what_is_no_case_is_refused(tmp_path):
    (tmp_path / FILE).write_text('{"kind": "clean"}\n', encoding='utf-8')
    with pytest.raises(RecordingError, match=r'jsonl:1: is no case'):
        read_campaign(tmp_path / FILE)


def test_a_hidden_effect_is_found():
    case = Case(
        kind='single',
        robot='servicer',
        excitation='default',
        seed=5,
        effects=('gyro_bias',),
        multiple=10.0,
        duration=10.0,
    )
    found = run_case(case)
    assert [(h['effect'], h['where']) for h in found['hidden']] == [('gyro_bias', None)]
    assert score([found]).top == {10.0: 1.0}
