"""A moment in a field as five numbers: found where nine would lose to what is simpler."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.discovery.moment_field import ways_about_best
from spacerobot_ros.estimation.inference.spectral_terms import SpectralTerms

COUNT = 400
MOMENT, FIELD = np.array([0.2, -0.5, 0.3]), np.array([0.3, 0.9, -0.4])


@pytest.fixture
def terms_and_columns(rng):
    """Noise of unit size, columns of m_j b_l that are as unlike as those of a turning base."""
    columns = rng.standard_normal((COUNT, 9))
    data = columns @ np.outer(MOMENT, FIELD).ravel() + rng.standard_normal(COUNT)
    nothing = np.zeros((COUNT, 0))
    return SpectralTerms(data, nothing, np.zeros(0, dtype=bool)), columns


def test_directions_hold_the_true_moment_and_field(terms_and_columns):
    terms, columns = terms_and_columns
    ways = ways_about_best(terms, columns, np.zeros((COUNT, 0)))
    assert np.linalg.matrix_rank(ways, tol=1e-9) == 5  # m and b by a common factor are one
    level = terms.level(columns @ ways)
    found = ways @ level.coefficients
    spread = np.sqrt(np.diag(ways @ level.covariance @ ways.T))
    true = np.outer(MOMENT, FIELD).ravel()
    assert np.all(np.abs(found - true) < 4.0 * spread)
    _, sizes, _ = np.linalg.svd(found.reshape(3, 3))
    assert sizes[1] < 0.05 * sizes[0]  # it is a moment in a field


def test_five_numbers_pay_for_five(terms_and_columns):
    """Four numbers less, each half the logarithm of the terms at least."""
    terms, columns = terms_and_columns
    ways = ways_about_best(terms, columns, np.zeros((COUNT, 0)))
    five, nine = (terms.level(own).likelihood for own in (columns @ ways, columns))
    assert five > nine + 0.5 * 4.0 * np.log(COUNT) / 2.0


def test_what_another_law_says_is_not_taken(terms_and_columns, rng):
    """Beside it the moment is that of the rest."""
    terms, columns = terms_and_columns
    other = rng.standard_normal((COUNT, 1))
    beside = SpectralTerms(terms.data + 30.0 * other[:, 0], terms.nuisance, terms.is_free)
    ways = ways_about_best(beside, columns, other)
    level = beside.level(np.concatenate([other, columns @ ways], axis=1))
    found = ways @ level.coefficients[1:]
    np.testing.assert_allclose(found, np.outer(MOMENT, FIELD).ravel(), atol=0.3)
