"""Masses and inertias by Pinocchio's, which shares no code with ours."""

from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from spacerobot_ros.model.rigid_body import Solid

ATOL = 1e-13  # of numbers up to 10: rounding of a few sums


@pytest.fixture
def pairs(rng):
    """Bodies of ours, and the same of Pinocchio's."""
    pin.seed(int(rng.integers(1 << 30)))
    theirs = [pin.Inertia.Random() for _ in range(20)]
    return [(Solid(one.mass, one.lever, one.inertia), one) for one in theirs]


def assert_same(ours, theirs):
    np.testing.assert_allclose(ours.row, theirs.toDynamicParameters(), rtol=0, atol=ATOL)


def test_ten_numbers_and_back(pairs):
    for ours, theirs in pairs:
        assert_same(ours, theirs)
        assert_same(Solid.of_row(ours.row), theirs)


def test_in_another_frame(pairs):
    for ours, theirs in pairs:
        place = pin.SE3.Random()
        assert_same(ours.placed(place.rotation, place.translation), place.act(theirs))


def test_together_and_apart(pairs):
    for (one, a), (other, b) in pairwise(pairs):
        both = one.joined(other)
        assert_same(both, a + b)
        assert_same(both.without(other), a)


def test_what_has_no_mass_is_nothing():
    nothing = Solid.of_row(np.zeros(10))
    assert not any(np.any(part) for part in nothing)
    assert not nothing.joined(nothing).row.any()
