"""Covariances of bodies: moments of random solids against samples of them."""

from __future__ import annotations

import numpy as np

from spacerobot_ros.dynamics.pseudo_inertia import parameters_of
from spacerobot_ros.dynamics.random_body import random_solid

MASS, CENTRE, EXTENT = 2.0, np.array([0.3, -0.1, 0.2]), 0.25
ROOT = np.array([[0.4, 0.0, 0.0], [0.1, 0.3, 0.0], [0.0, -0.2, 0.5]])


def test_a_random_solid_has_the_moments_of_samples(rng):
    """Of 200,000 draws: fourth moments of normal numbers are then known to 1 %, three times."""
    count = 200_000
    mass = MASS * rng.standard_normal(count)
    place = np.column_stack([CENTRE + rng.standard_normal((count, 3)) @ ROOT.T, np.ones(count)])
    rods = rng.standard_normal((count, 3, 3))
    P = np.einsum('ni,nj->nij', place, place)
    P[:, :3, :3] += EXTENT**2 / 3.0 * np.einsum('nki,nkj->nij', rods, rods)
    every = parameters_of(mass[:, None, None] * P)
    exact = random_solid(MASS, CENTRE, ROOT @ ROOT.T, EXTENT)
    scale = np.sqrt(np.diag(exact))
    unit = np.outer(scale, scale)
    np.testing.assert_allclose(every.T @ every / count / unit, exact / unit, atol=0.03)


def test_a_solid_that_is_put_at_one_place_is_a_mass_there_with_some_inertia():
    """Its first moment is its mass times the place, as far as the spread lets it be told."""
    covariance = random_solid(MASS, CENTRE, 1e-8 * np.eye(3), EXTENT)
    slope = covariance[1:4, 0] / covariance[0, 0]
    np.testing.assert_allclose(slope, CENTRE, rtol=1e-9)
    left = np.sqrt(np.diag(covariance)[1:4] - covariance[0, 0] * slope**2)
    np.testing.assert_allclose(left, MASS * 1e-4, rtol=1e-5)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0
