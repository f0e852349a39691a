"""What every entry of the catalogue owes to the diagnosis and to the documentation."""

from __future__ import annotations

import math
from inspect import cleandoc
from pathlib import Path

import numpy as np
import pytest
from support.models import robot_of, table_one

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
    said = ''.join(cleandoc(base.__doc__ or '') for base in effect.__mro__)
    for what in ('Typical: ', 'Signature: ', 'Source: '):
        assert f'\n{what}' in said
    for parameter in effect.parameters:
        inside = max(parameter.minimum, parameter.above) <= parameter.nominal <= parameter.maximum
        assert inside or math.isinf(parameter.nominal) or parameter.role == 'linear'
        if parameter.role in ('linear', 'reciprocal'):
            assert 0.0 < parameter.size < math.inf
            assert parameter.relevant < parameter.size


def test_something_of_every_effect_is_worth_naming():
    for effect in FITTED:
        assert any(parameter.relevant > 0.0 for parameter in effect.parameters), effect.id


@pytest.mark.parametrize(
    ('effect', 'name', 'share'),
    [
        ('joint_coulomb_friction', 'torque', 0.2),
        ('external_torque_body', 'x', 0.2),
        ('fuel_slosh', 'mass', 0.2),
        ('joint_flexibility', 'stiffness', 1.0),  # rad by N m: not a torque
        ('gyro_bias', 'x', 1.0),
    ],
)
def test_a_lighter_robot_has_lower_thresholds_of_torque_and_mass(effect, name, share):
    robot = robot_of(table_one())
    rows = robot.inertial_parameters
    heavy, light = (
        robot.with_inertial_parameters(rows * (mass / np.sum(rows[:, 0])))
        for mass in (150.0, 20.0)
    )

    def threshold(robot):
        at = CATALOGUE[effect].parameters_at(robot, CATALOGUE[effect].places(robot)[0])
        return next(p.relevant for p in at if p.name == name)

    assert threshold(light) == pytest.approx(share * threshold(heavy))
