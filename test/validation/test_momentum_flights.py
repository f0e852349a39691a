"""Drawn robots that MuJoCo flies: one of them, and what the kept records come to."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('mujoco')

from validation.campaigns import CAMPAIGNS, key
from validation.mujoco.momentum_flights import results, run, trials

KEPT = Path(__file__).resolve().parents[2] / 'validation' / 'records' / 'momentum_flights.jsonl'


@pytest.mark.parametrize(('seed', 'off'), [(25, 0.1)])
def test_a_drawn_arm_that_slides(seed, off):
    row = run(key(seed, off))
    assert (row['joints'], row['slides']) == (3, True)
    assert row['valid'], row['reason']
    assert np.max(np.abs(row['z'])) < 4.5
    assert row['error_percent'] < 2.0
    assert 0.9 < row['chi2'] < 1.1


def test_kept_records_are_those_of_the_documents():
    records = [json.loads(line) for line in KEPT.read_text(encoding='utf-8').splitlines()]
    assert [r['case'] for r in records] == trials(60, False)
    found = results(records)
    assert all(check.is_met for check in CAMPAIGNS['momentum-flights'].judge(found))
    (table,) = CAMPAIGNS['momentum-flights'].tables(found)
    docs = (KEPT.parents[2] / 'docs' / 'identification.md').read_text(encoding='utf-8')
    for row in table.rows:
        assert f'| {" | ".join(row)} |' in docs
