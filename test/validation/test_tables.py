"""Tables and figures to reach from their description."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from spacerobot_ros.model.files import read_yaml
from validation import tables
from validation.campaigns import CAMPAIGNS
from validation.shares import Share
from validation.tables import Check, checks_of, tables_of

DESCRIBED = Path(tables.__file__).parent / 'tables'
RESULTS = {
    'groups': {
        'a_b': {
            'found': Share(1, 2),
            'off': 0.25,
            'names': {'x_y': 2},
            'by': {'1': 3.0},
            'm': 1,
        },
        'c': {'found': Share(0, 0), 'off': math.nan, 'names': {}, 'by': {'1': None}, 'm': 2},
    },
    'size': 3,
}
SAID = {
    'tables': [
        {
            'title': 'Of {size}',
            'rows': 'groups',
            'columns': 'name | {of.words}\nshare [%] | {off.percent:.0f}\n'
            'names | {names}\n* | {by}',
        },
        {'title': 'Of {of}', 'each': 'groups', 'columns': 'off | {off:.1f}'},
    ],
    'checks': [
        {
            'rows': 'groups',
            'figures': '{of}: found | found | 0.6 | 1\n{of}: off | off | 0 | m | m\n'
            '{of}: size | m | 0 | 1 |  | names',
        },
        {'figures': 'all | size | 3 | 3'},
    ],
}


@pytest.fixture(autouse=True)
def said(monkeypatch):
    monkeypatch.setattr(tables, 'read_yaml', lambda path, what: SAID)


def test_cells_read_as_described():
    whole, first, second = tables_of('x', RESULTS)
    assert (whole.title, first.title, second.title) == ('Of 3', 'Of a_b', 'Of c')
    assert whole.head == ['name', 'share [%]', 'names', '1']
    assert whole.rows == [['a b', '25', 'x y 2', '3.0'], ['c', '-', '-', '-']]
    assert (first.rows, second.rows) == ([['0.2']], [['-']])


def test_figures_that_can_not_be_computed_or_are_not_asked_are_left_out():
    assert list(checks_of('x', RESULTS)) == [
        Check('a_b: found', 0.5, 0.6, 1.0),
        Check('a_b: off', 0.25, 0.0, 1.0, 'm'),
        Check('a_b: size', 1, 0.0, 1.0),
        Check('all', 3, 3.0, 3.0),
    ]


@pytest.mark.parametrize('name', CAMPAIGNS)
def test_every_campaign_is_described(name):
    described = read_yaml(DESCRIBED / f'{CAMPAIGNS[name].described or name}.yaml', 'tables')
    for table in described['tables']:
        assert all(line.count(' | ') == 1 for line in table['columns'].splitlines())
    for group in described['checks']:
        assert all(3 <= line.count(' | ') <= 5 for line in group['figures'].splitlines())
