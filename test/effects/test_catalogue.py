"""What every entry of the catalogue owes to the diagnosis and to the documentation."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from spacerobot_ros.effects.catalogue import CATALOGUE

PAGE = Path(__file__).parents[2] / 'docs' / 'effects.md'
FITTED = [effect for effect in CATALOGUE.values() if effect.group in ('joint', 'bodies')]


@pytest.mark.parametrize('effect', FITTED, ids=lambda effect: effect.id)
def test_page_has_a_section_with_a_picture(effect):
    page = PAGE.read_text(encoding='utf-8')
    section = page.split(f'\n### {effect.id}\n')[1].split('\n### ')[0]
    assert (PAGE.parent / 'images' / 'effects' / f'{effect.id}.svg').is_file()
    assert f'(images/effects/{effect.id}.svg)' in section
    assert 'Confused with:' in section
    assert 'Test:' in section


@pytest.mark.parametrize('effect', FITTED, ids=lambda effect: effect.id)
def test_fit_knows_where_to_start_and_what_is_plausible(effect):
    assert effect.magnitude
    assert effect.signature
    assert effect.source
    for parameter in effect.parameters:
        inside = max(parameter.minimum, parameter.above) <= parameter.nominal <= parameter.maximum
        assert inside or math.isinf(parameter.nominal) or parameter.role == 'linear'
        if parameter.role in ('linear', 'reciprocal'):
            assert 0.0 < parameter.size < math.inf
            assert parameter.relevant < parameter.size


def test_something_of_every_effect_is_worth_naming():
    for effect in FITTED:
        assert any(parameter.relevant > 0.0 for parameter in effect.parameters), effect.id
