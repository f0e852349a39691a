"""Sums over rows: all that linear least squares asks of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import scipy

from ..types import Array, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Gram:
    """Sums over some rows.

    Args:
        matrix: (K, K) W^T W. vector: (K,) W^T r. square: r^T r. rows: Number of rows.
    """

    matrix: Array
    vector: Array
    square: float
    rows: int

    @classmethod
    def of(cls, columns: Array, data: Array) -> Gram:
        """From (R, K) columns and (R,) data."""
        return cls(columns.T @ columns, columns.T @ data, float(data @ data), len(data))

    def __add__(self, other: Gram) -> Gram:
        """Sums over the rows of both."""
        return Gram(
            self.matrix + other.matrix,
            self.vector + other.vector,
            self.square + other.square,
            self.rows + other.rows,
        )

    def __sub__(self, other: Gram) -> Gram:
        """Sums over rows without some of them."""
        return Gram(
            self.matrix - other.matrix,
            self.vector - other.vector,
            self.square - other.square,
            self.rows - other.rows,
        )

    def times(self, factor: float) -> Gram:
        """Sums of rows that count so many times."""
        return Gram(factor * self.matrix, factor * self.vector, factor * self.square, self.rows)

    def misfit(self, coefficients: Array) -> float:
        """Squared rows that coefficients (K,) leave."""
        return float(
            self.square
            - 2.0 * self.vector @ coefficients
            + coefficients @ self.matrix @ coefficients
        )

    def left(self, coefficients: Array) -> Gram:
        """The same of the rows that coefficients (K,) leave."""
        vector = self.vector - self.matrix @ coefficients
        return Gram(self.matrix, vector, self.misfit(coefficients), self.rows)

    def part(self, chosen: IntArray) -> Gram:
        """The same with only the chosen columns."""
        matrix = self.matrix[chosen[:, None], chosen]
        return Gram(matrix, self.vector[chosen], self.square, self.rows)

    def placed(self, places: IntArray) -> Gram:
        """The same for other columns, each of which is one of these, or nothing.

        Args:
            places: (n,) which; -1: none.
        """
        is_one = places >= 0
        matrix = self.matrix[places[:, None], places] * np.outer(is_one, is_one)
        return Gram(matrix, self.vector[places] * is_one, self.square, self.rows)

    def without(self, nuisance: int, precision: Array) -> Gram:
        """The rest, the first `nuisance` columns of given prior precision marginalized."""
        if not nuisance:
            return self
        held = self.matrix[:nuisance, :nuisance] + np.diag(precision)
        across = self.matrix[:nuisance, nuisance:]
        solved = _solved(held, np.column_stack([across, self.vector[:nuisance]]))
        return Gram(
            self.matrix[nuisance:, nuisance:] - across.T @ solved[:, :-1],
            self.vector[nuisance:] - across.T @ solved[:, -1],
            self.square - float(self.vector[:nuisance] @ solved[:, -1]),
            self.rows,
        )


def sum_of(parts: Sequence[Gram]) -> Gram:
    """Sums over the rows of all parts."""
    return reduce(add, parts)


def _solved(matrix: Array, right: Array) -> Array:
    """matrix^-1 right of a symmetric matrix; the least solution where it is singular."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    try:
        factor = scipy.linalg.cho_factor(scale[:, None] * matrix * scale, check_finite=False)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0])
    return np.asarray(scale[:, None] * scipy.linalg.cho_solve(factor, scale[:, None] * right))
