"""Counts and units in words."""

from __future__ import annotations

import pytest

from spacerobot_ros.formats import counted, either, quantity


@pytest.mark.parametrize(
    ('said', 'text'),
    [
        (counted(1, 'table'), '1 table'),
        (counted(0, 'table'), '0 tables'),
        (counted(2, 'table'), '2 tables'),
        (counted(1, 'entry', 'entries'), '1 entry'),
        (counted(3, 'entry', 'entries'), '3 entries'),
        (either(['N m', 'N', 'N m']), 'N m or N'),
        (quantity(0.12345, 'N m'), '0.123 N m'),
        (quantity(float('inf'), 'N m'), 'never'),
    ],
)
def test_words(said, text):
    assert said == text
