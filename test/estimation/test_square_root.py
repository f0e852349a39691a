"""Least squares in square-root form against normal equations and inverses of whole matrices."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.estimation.inference.square_root import (
    SquareRootInformation,
    marginal,
    ordered,
)


def test_information_equals_least_squares(rng):
    A, b = rng.standard_normal((80, 5)), rng.standard_normal(80)
    information = SquareRootInformation(5)
    for start, stop in (
        (0, 2),
        (2, 3),
        (3, 60),
        (60, 60),
        (60, 80),
    ):  # fewer rows than unknowns too
        information.add(A[start:stop], b[start:stop])
    want, squares, _, _ = np.linalg.lstsq(A, b, rcond=None)
    estimate, covariance = information.solve()
    np.testing.assert_allclose(estimate, want, rtol=0, atol=1e-13)
    np.testing.assert_allclose(covariance, np.linalg.inv(A.T @ A), rtol=0, atol=1e-14)
    assert information.residual == pytest.approx(squares[0], rel=1e-12)
    assert information.rows == 80


def test_information_of_columns_of_very_different_size(rng):
    scale = np.array([1e-6, 1.0, 1e6])
    A, x = rng.standard_normal((40, 3)), np.array([1.0, 2.0, 3.0])
    information = SquareRootInformation(3)
    information.add(A * scale, A @ x)
    estimate, covariance = information.solve()
    np.testing.assert_allclose(estimate * scale, x, rtol=0, atol=1e-13)
    unit = covariance * np.outer(scale, scale)
    np.testing.assert_allclose(unit, np.linalg.inv(A.T @ A), rtol=0, atol=1e-14)


def test_directions_without_information_stay_at_zero(rng):
    information = SquareRootInformation(3)
    information.add(np.array([[1.0, 1.0, 0.0]]), np.array([2.0]))
    estimate, _ = information.solve()
    np.testing.assert_allclose(estimate, [1.0, 1.0, 0.0], rtol=0, atol=1e-14)
    empty, none = SquareRootInformation(2).solve()
    np.testing.assert_array_equal(empty, 0.0)
    np.testing.assert_array_equal(none, 0.0)


def test_reset_of_the_residual(rng):
    A, x = rng.standard_normal((10, 3)), np.array([1.0, -2.0, 3.0])
    information = SquareRootInformation(3)
    information.add(A, A @ x + 0.1)
    information.reset_residual()
    assert (information.residual, information.rows) == (0.0, 0)


def some_information(rng, size):
    """Square-root information of a regular problem, and its solution and covariance."""
    A, b = rng.standard_normal((size + 10, size)), rng.standard_normal(size + 10)
    information = SquareRootInformation(size)
    information.add(A, b)
    covariance = np.linalg.inv(A.T @ A)
    return information.factor, covariance @ A.T @ b, covariance


@pytest.mark.parametrize('wanted', [[0], [4], [1, 3], [3, 1], [0, 1, 2, 3, 4]], ids=str)
def test_what_is_left_of_some_is_their_part_of_the_whole(wanted, rng):
    factor, estimate, covariance = some_information(rng, 5)
    left = marginal(factor, np.array(wanted))
    root, values = left[:, :-1], left[:, -1]
    # in the whole, to have forgotten the others is to look at a part of the covariance
    np.testing.assert_allclose(np.linalg.solve(root, values), estimate[wanted], rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.inv(root.T @ root), covariance[np.ix_(wanted, wanted)], rtol=0, atol=1e-12
    )


def test_what_is_eliminated_follows_from_the_others(rng):
    factor, estimate, _ = some_information(rng, 6)
    first, last = np.array([4, 0]), np.array([1, 2, 3, 5])
    A, B, a, C, c = ordered(factor, first, last)
    for triangle in (A, C):
        np.testing.assert_array_equal(triangle, np.triu(triangle))
    kept = np.linalg.solve(C, c)
    np.testing.assert_allclose(kept, estimate[last], rtol=0, atol=1e-12)
    found = np.linalg.solve(A, a - B @ kept)
    np.testing.assert_allclose(found, estimate[first], rtol=0, atol=1e-12)
    # with the others at any values: the minimum of the whole over the first
    other, whole = rng.standard_normal(4), factor[:, :-1]
    want = np.linalg.lstsq(whole[:, first], factor[:, -1] - whole[:, last] @ other, rcond=None)[0]
    np.testing.assert_allclose(np.linalg.solve(A, a - B @ other), want, rtol=0, atol=1e-12)


@pytest.mark.parametrize('size', [3, 7])
def test_elimination_where_nothing_is_known_leaves_nothing(size):
    left = marginal(np.zeros((size, size + 1)), np.arange(2))
    np.testing.assert_array_equal(left, np.zeros((2, 3)))


def test_unknown_unknowns_take_what_they_may_explain(rng):
    # one row of two unknowns tells nothing of one of them
    information = SquareRootInformation(2)
    information.add(np.array([[1.0, 2.0]]), np.array([3.0]))
    np.testing.assert_allclose(marginal(information.factor, np.array([1])), 0.0, atol=1e-15)


def misfit(information):
    """Sum of squares where all unknowns are zero."""
    return information.residual + float(np.sum(information.factor[:, -1] ** 2))


def test_misfit_at_zero_counts_all(rng):
    A, b = rng.standard_normal((9, 3)), rng.standard_normal(9)
    information = SquareRootInformation(3)
    information.add(A, b)
    assert misfit(information) == pytest.approx(b @ b, rel=1e-12)


def test_long_columns_are_added_in_parts_alike(rng):
    A, b = rng.standard_normal((1301, 4)), rng.standard_normal(1301)
    one, many = SquareRootInformation(4), SquareRootInformation(4)
    one.add(A, b)
    for k in range(1301):
        many.add(A[k : k + 1], b[k : k + 1])
    # signs of rows are free
    for got, want in zip(many.solve(), one.solve(), strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-13)
    assert many.residual == pytest.approx(one.residual, rel=1e-11)
