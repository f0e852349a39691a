"""`robot.uncertainty`: what it says of each body, what is refused, and the keys it replaces."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.models import Part, robot_of, settings_of, table_one, wheel_joints, with_wheels

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.model.uncertainty import USUAL, BodyUncertainty
from spacerobot_ros.model.writer import parameters_of, write_robot_file

SERVICER = Path(__file__).parents[2] / 'config' / 'servicer.yaml'
NUMBERS = [
    (0, '0 must be above 0'),
    (-0.1, '-0.1 must be above 0'),
    (1.5, '1.5 must be at most 1'),
    (float('nan'), 'nan is not a finite number of a magnitude up to 1e+50'),
    (float('inf'), 'inf is not a finite number of a magnitude up to 1e+50'),
    ('wide', "expected a number, got 'wide'"),
    (True, 'expected a number, got True'),
    ([0.1], 'expected a number, got '),
]
OTHERS = [
    (0.1, 'robot.uncertainty: expected a map of parameters, got 0.1'),
    ({'mas': 0.1}, "robot.uncertainty.mas: unknown parameter (did you mean 'mass'?)"),
    ({'links': 0.5}, 'robot.uncertainty.links: expected a map of named entries, got 0.5'),
    ({'links': {'link_1': 0.5}}, 'robot.uncertainty.links.link_1: expected a map, got 0.5'),
    (
        {'links': {'link_1': {'volume': 0.5}}},
        'robot.uncertainty.links.link_1.volume: is none of mass, com, inertia',
    ),
    (
        {'links': {'lnk_1': {'mass': 0.5}}},
        "robot.uncertainty.links.lnk_1: the URDF has no link 'lnk_1' (did you mean 'link_1'?)",
    ),
    (
        {'links': {'hand': {'mass': 0.5}}},
        "robot.uncertainty.links.hand: the URDF has no link 'hand' "
        '(it has base_link, link_1, link_2, link_3)',
    ),
]


def uncertainties(parts=None, **stated):
    return robot_of(parts or table_one(), uncertainty=stated).uncertainties


def test_every_body_is_as_uncertain_where_nothing_else_is_said():
    assert robot_of(table_one()).uncertainties == (BodyUncertainty(0.1, 0.1, 0.15),) * 4
    stated = uncertainties(mass=0.2, inertia=1.0)
    assert stated == (BodyUncertainty(0.2, 0.1, 1.0),) * 4


def test_a_link_may_differ_in_some_of_the_three():
    usual = BodyUncertainty(0.2, 0.1, 0.15)
    stated = uncertainties(mass=0.2, links={'link_2': {'mass': 0.5}, 'base_link': {'com': 0.01}})
    expected = (BodyUncertainty(0.2, 0.01, 0.15), usual, BodyUncertainty(0.5, 0.1, 0.15), usual)
    assert stated == expected


def test_links_of_one_body_have_the_largest_of_theirs():
    tool = Part('tool', 3, 'fixed', 5.0, np.zeros(3), np.eye(3))
    links = {'link_3': {'mass': 0.02, 'com': 0.4}, 'tool': {'mass': 0.5, 'inertia': 0.05}}
    stated = uncertainties([*table_one(), tool], links=links)
    # com of the tool and inertia of link_3 are the usual ones
    assert stated == (USUAL, USUAL, USUAL, BodyUncertainty(0.5, 0.4, 0.15))
    alone = uncertainties([*table_one(), tool], links={'tool': {'mass': 0.02}})
    assert alone[3] == BodyUncertainty(0.02, 0.1, 0.15)


def test_bodies_that_nothing_is_said_of_have_the_usual_uncertainty():
    parts = with_wheels(table_one())
    wheels = {'joints': wheel_joints(0), 'rates': [1.0, 2.0, 3.0]}
    held = {'target_wheels': {'joints': wheel_joints(3), 'rates': [1.0, 2.0, 3.0]}}
    robot = robot_of(parts, servicer_wheels=wheels, **held, uncertainty={'mass': 0.4})
    plant = robot.with_free_rotors(np.arange(6.0))
    assert [plant.uncertainty_of(k).mass for k in range(10)] == [0.4] * 4 + [0.1] * 6
    assert replace(robot, uncertainties=()).uncertainty_of(0) == USUAL


@pytest.mark.parametrize('name', ['mass', 'com', 'inertia'])
@pytest.mark.parametrize('link', ['', 'link_1'], ids=['all', 'link'])
@pytest.mark.parametrize(('value', 'why'), NUMBERS, ids=[str(case[0]) for case in NUMBERS])
def test_numbers_that_are_refused(link, name, value, why):
    stated = {'links': {link: {name: value}}} if link else {name: value}
    place = f'links.{link}.{name}' if link else name
    with pytest.raises(ConfigurationError) as caught:
        uncertainties(**stated)
    assert str(caught.value).startswith(f'robot.uncertainty.{place}: {why}')
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize(('stated', 'words'), OTHERS, ids=[case[1][:44] for case in OTHERS])
def test_whatever_else_is_refused(stated, words):
    with pytest.raises(ConfigurationError) as caught:
        robot_of(table_one(), uncertainty=stated)
    assert str(caught.value) == words


def test_what_is_written_says_the_same(tmp_path):
    """In a file, and as the parameters of a node."""
    given = tmp_path / 'given.yaml'
    stated = 'uncertainty: {mass: 0.2, links: {link_3: {inertia: 0.6}}}'
    text = SERVICER.read_text(encoding='utf-8')
    given.write_text(text.replace('robot:\n', f'robot:\n      {stated}\n', 1))
    file = load_robot_file(given)
    assert file.robot.uncertainties[3] == BodyUncertainty(0.2, 0.1, 0.6)
    path, _ = write_robot_file(file.robot, given, tmp_path / 'written.yaml')
    assert load_robot_file(path).robot.uncertainties == file.robot.uncertainties
    settings = settings_of(table_one(), uncertainty={'links': {'link_3': {'inertia': 0.6}}})
    assert parse_settings(parameters_of(settings)) == settings


ALL = 'is read as robot.uncertainty {} of all bodies (docs/identification.md)'
INSTEAD = 'is ignored; robot.uncertainty is in its place (docs/identification.md)'
OLD = [
    ({'identifier': {'prior_std': 0.4}}, {}, 0.4, ['identifier.prior_std: ' + ALL.format(0.4)]),
    ({'adaptive': {'prior_std': 0.3}}, {}, 0.3, ['adaptive.prior_std: ' + ALL.format(0.3)]),
    ({'identifier': {'prior_std': 7}}, {}, 1.0, ['identifier.prior_std: ' + ALL.format(1)]),
    (
        {'identifier': {'prior_std': 1.0}, 'adaptive': {'prior_std': 0.3}},
        {},
        1.0,
        ['identifier.prior_std: ' + ALL.format(1), 'adaptive.prior_std: ' + INSTEAD],
    ),
    (
        {'adaptive': {'prior_std': 0.3}},
        {'uncertainty': {'mass': 0.2}},
        0.2,
        ['adaptive.prior_std: ' + INSTEAD],
    ),
    *(
        ({'identifier': {'prior_std': bad}}, {}, 0.1, ['identifier.prior_std: ' + INSTEAD])
        for bad in (0.0, -1.0, float('nan'), 'wide', True, None, [1.0], {})
    ),
    (
        {'identifier': {'manifold': 'linear'}},
        {},
        0.1,
        [
            'identifier.manifold: is ignored; estimates are of physical bodies '
            '(docs/identification.md)'
        ],
    ),
    ({'identifier': {'structure': 'symmetric'}}, {}, 0.1, []),
]


@pytest.mark.parametrize(('sections', 'robot', 'mass', 'lines'), OLD, ids=str)
def test_old_keys_are_read_with_one_line_each(caplog, sections, robot, mass, lines):
    given = {'robot': {'joints': ['j'], **robot}, **sections}
    with caplog.at_level(logging.WARNING):
        settings = parse_settings(given)
    assert [record.getMessage() for record in caplog.records] == lines
    assert settings.robot.uncertainty.mass == mass
    # what was given stays as it was, for who writes it again
    assert given == {'robot': {'joints': ['j'], **robot}, **sections}


def test_an_old_key_says_nothing_of_a_robot_that_is_none():
    for robot, words in ({'robot': 3}, 'expected a map'), ({}, 'required parameter is missing'):
        with pytest.raises(ConfigurationError, match=f'^robot: {words}'):
            parse_settings({**robot, 'adaptive': {'prior_std': 0.3}})
