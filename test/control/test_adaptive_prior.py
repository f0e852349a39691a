"""How uncertain bodies are, as the adaptive laws' prior and as the natural gradient's gain."""

from __future__ import annotations

import numpy as np
import pytest
from support.models import random_tree, robot_of

from spacerobot_ros.control.adaptive.law_signals import AdaptiveSettings
from spacerobot_ros.control.adaptive.learner import Learner
from spacerobot_ros.control.adaptive.parameter_prior import prior_covariance
from spacerobot_ros.control.adaptive.regressors import parameter_values

KINDS = ('mass', 'com', 'inertia')
TINY = 1e-9  # of the two kinds that are not looked at
COM, INERTIA = slice(1, 4), slice(4, 10)


def robot_with(**stated):
    return robot_of(random_tree(np.random.default_rng(3), [0, 1]), uncertainty=stated)


def stds(shape, **stated):
    """(3, 10) standard deviations by their parameters' values, and the values."""
    robot = robot_with(**stated)
    values = parameter_values(robot).reshape(3, 10)
    return np.sqrt(np.diag(prior_covariance(robot, shape, 0.0))).reshape(3, 10), values


def test_a_density_alone():
    """P33 grows by twice the entry of E, the first moments by it, second moments not at all."""
    found, values = stds('bodies', mass=0.2, com=TINY, inertia=TINY)
    # what the other kinds add is a billionth
    np.testing.assert_allclose(found[:, 0], 0.2 * values[:, 0], rtol=1e-7, atol=0)
    np.testing.assert_allclose(found[:, COM], 0.1 * np.abs(values[:, COM]), rtol=1e-6, atol=1e-8)
    assert np.max(found[:, INERTIA]) < 1e-6


def test_a_stretch_alone_leaves_the_mass():
    found, values = stds('bodies', mass=TINY, com=TINY, inertia=0.2)
    assert np.max(found[:, 0] / values[:, 0]) < 1e-8
    assert np.min(found[:, INERTIA]) > 0.01 * np.min(np.abs(values[:, [4, 6, 9]]))


def test_a_shift_alone_moves_first_moments():
    found, values = stds('bodies', mass=TINY, com=0.2, inertia=TINY)
    spread = np.sqrt(0.5 * values[:, [4, 6, 9]].sum(axis=1) / values[:, 0])
    # by half the width of its radius of gyration; the entry across it adds at most as much
    least = 0.1 * values[:, 0] * spread
    assert np.all(found[:, COM] > least[:, None] * (1.0 - 1e-6))
    assert np.all(found[:, COM] < 2.0 * least[:, None])


def test_each_element_by_its_kind():
    found, values = stds('elements', mass=0.1, com=0.2, inertia=0.4)
    widths = np.array([0.1, *3 * [0.2], *6 * [0.4]])
    # of no value here is the floor of a thousandth of the body's size larger
    np.testing.assert_allclose(found, widths * np.abs(values), rtol=1e-12, atol=0)


@pytest.mark.parametrize('shape', ['bodies', 'elements'])
def test_a_link_has_its_own(shape):
    usual, _ = stds(shape)
    double = {'mass': 0.2, 'com': 0.2, 'inertia': 0.3}
    found, _ = stds(shape, links={'link_1': double})
    np.testing.assert_allclose(found, usual * np.array([[1.0], [2.0], [1.0]]), rtol=1e-12, atol=0)


def test_the_natural_gradient_moves_a_body_by_the_square_of_its_widths():
    def moved(widths):
        robot = robot_with(links={'link_1': dict(zip(KINDS, widths, strict=True))})
        settings = AdaptiveSettings(law='adaptive_lyapunov_paper', physical_consistency='natural')
        learner = Learner(robot, settings)
        learner.weigh(1.0, np.eye(8))
        learner.slope[:] = 1e-4 * np.random.default_rng(7).standard_normal(30)
        learner.has_slope, before = True, learner.pi.copy()
        learner.descend(1.0, np.zeros((8, 30)))
        return (learner.pi - before).reshape(3, 10)

    narrow, wide = moved((0.1, 0.1, 0.1)), moved((0.2, 0.2, 0.2))
    # steps of 1e-4: what is of second order in them is as small
    np.testing.assert_allclose(wide[1], 4.0 * narrow[1], rtol=1e-2, atol=1e-3 * np.abs(wide).max())
    np.testing.assert_array_equal(wide[[0, 2]], narrow[[0, 2]])
    # nine entries of E are the stretch's, six the shift's, one the density's
    mixed = moved((0.1, 0.2, 0.3))
    expected = (0.01 + 6 * 0.04 + 9 * 0.09) / 16 / 0.01 * narrow[1]
    np.testing.assert_allclose(mixed[1], expected, rtol=1e-2, atol=1e-3 * np.abs(mixed).max())
