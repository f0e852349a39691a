"""docs/parameters.md is what the schema says."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

from parameter_docs import parameter_page

from spacerobot_ros.model.settings import Settings

PAGE = Path(__file__).parents[2] / 'docs' / 'parameters.md'
COMMAND = 'python scripts/parameter_docs.py > docs/parameters.md'


def test_page_is_fresh():
    assert PAGE.read_text() == parameter_page(), f'docs/parameters.md is stale: run {COMMAND}'


def test_page_names_every_section_and_has_a_command():
    page = parameter_page()
    for f in fields(Settings):
        assert f'## `{f.name}`' in page
    assert '## `robot.servicer_wheels`' in page
    assert '| `period` | number | `0.01` | at least 1e-06, at most 1 | s |' in page
    assert '| `joints` | list of names | required |' in page
    assert COMMAND in page
