"""What minimal parameters group, on a robot small enough to know it by hand."""

import numpy as np
from support.identification import servicer
from support.models import random_tree, robot_of

from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.estimation.unknowns.standard_parameters import standard_parameters


def test_last_links_own_inertia_is_grouped_with_nothing_else():
    robot = servicer('zyx')
    minimal = minimal_set(robot, 'symmetric')
    groups = dict(
        zip(minimal.names, standard_parameters(robot, minimal, 'symmetric'), strict=True)
    )
    # the last joint turns about x, on which the link's centre lies
    assert groups['J3xx'] == 'link_3: Ixx'
    assert groups['J3yy'] == 'link_3: Iyy Izz'


def test_numbers_that_are_not_named_change_nothing():
    robot = servicer('xyy')
    minimal = minimal_set(robot, 'generic')
    groups = standard_parameters(robot, minimal, 'generic')
    assert len(groups) == len(minimal) == 45
    assert all(groups)
    # every mass enters the products of first moments, which the base's inertia stands for
    place = minimal.names.index('J0xx')
    assert all(f'{body.name}: m' in groups[place] for body in robot.bodies)
    assert not np.any(['Izz' in part for part in groups[place].split(';') if 'base' in part])


def test_a_slide_tells_the_reduced_mass(rng):
    robot = robot_of(random_tree(rng, [0], prismatic=(1,)))
    minimal = minimal_set(robot, 'generic')
    values = dict(zip(minimal.names, minimal.of_robot(robot), strict=True))
    groups = dict(zip(minimal.names, standard_parameters(robot, minimal, 'generic'), strict=True))
    base, slide = (body.mass for body in robot.bodies)
    np.testing.assert_allclose(values['S1ss'], base * slide / (base + slide), rtol=1e-14)
    assert groups['S1ss'] == 'base_link: m; link_1: m'
    assert groups['Q0_1xs'] == 'base_link: m cx; link_1: m cx cy cz'  # turned against the base
