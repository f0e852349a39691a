r"""A matched filter: transients beside columns that last, at all times.

With whitened rows r, columns A of prior precision P, and k whitened templates h of one shape at
one time, all coefficients integrated out,

    num = h' r - u' y,  den = h' h - u' u,   L L' = A' A + P,  u = L^-1 A' h,  y = L^-1 A' r,

the size is den^-1 num with covariance den^-1, and z^2 = num' den^-1 num (Kay, Fundamentals of
Statistical Signal Processing II (1998), 4.6 and 7.7). Only what no column can make speaks for a
transient, and its size is not drawn by what the columns take of it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from ...types import Array
from .transient import Shapes, Transient

_SEEN = 0.05  # of a template's square that columns must leave for it to say anything
_RIDGE = 1e-10  # of a column's square: columns that can not be told apart


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """M templates: (M, k) sizes, (M, k, k) their covariances, (M,) z; what is unseen has z = 0."""

    value: Array
    covariance: Array
    z: Array

    @classmethod
    def joined(cls, parts: Sequence[Filtered]) -> Filtered:
        """Some after each other."""
        each = zip(*((p.value, p.covariance, p.z) for p in parts), strict=True)
        return cls(*map(np.concatenate, each))


class Projection:
    """Columns beside which templates are judged.

    Args:
        lower: (K, K) L of columns over their size. scale: (K,) one by that size.
        right: (K,) y.
    """

    def __init__(self, lower: Array, scale: Array, right: Array) -> None:
        self._lower, self._scale, self._right = lower, scale, right

    @classmethod
    def of(cls, matrix: Array, vector: Array) -> Projection:
        """By (K, K) A' A + P and (K,) A' r."""
        none = cls(np.zeros((0, 0)), np.zeros(0), np.zeros(0))
        return none.with_more(np.zeros((0, len(vector))), vector, matrix)

    def with_more(self, cross: Array, along: Array, square: Array) -> Projection:
        """Further columns by products with these (K, E), the rows (E,), and themselves (E, E)."""
        u = self.taken(cross)
        size = np.sqrt(np.diag(square))
        scale = 1.0 / np.where(size > 0.0, size, 1.0)
        left = scale[:, None] * (square - u.T @ u) * scale
        left += np.diag(np.where(size > 0.0, _RIDGE, 1.0))
        own = np.linalg.cholesky(left)
        right = scale * (along - u.T @ self._right)
        lower = np.block([[self._lower, np.zeros_like(u)], [(u * scale).T, own]])
        more = scipy.linalg.solve_triangular(own, right, lower=True)
        return Projection(lower, np.append(self._scale, scale), np.append(self._right, more))

    @property
    def gain(self) -> float:
        """Chi-square that the columns take."""
        return float(self._right @ self._right)

    @property
    def coefficients(self) -> Array:
        """(K,) of all columns."""
        own = scipy.linalg.solve_triangular(self._lower, self._right, lower=True, trans=1)
        return np.asarray(self._scale * own)

    @property
    def covariance(self) -> Array:
        """(K, K) of their coefficients."""
        return self.solved(np.eye(len(self._scale)))

    def solved(self, right: Array) -> Array:
        """(K, C) coefficients by which the columns make up what they can of A' of others."""
        own = scipy.linalg.cho_solve((self._lower, True), self._scale[:, None] * right)
        return np.asarray(self._scale[:, None] * own)

    def taken(self, cross: Array) -> Array:
        """(K, ...) u of products (K, ...) with other columns."""
        flat = self._scale[:, None] * cross.reshape(len(cross), math.prod(cross.shape[1:]))
        u = scipy.linalg.solve_triangular(self._lower, flat, lower=True) if len(flat) else flat
        return np.asarray(u.reshape(cross.shape))

    def left(self, cross: Array, along: Array) -> Array:
        """(...) of products (...) of other columns with the rows, what these columns leave."""
        return np.asarray(along - np.tensordot(self._right, self.taken(cross), 1))

    def filtered(self, cross: Array, along: Array, square: Array) -> Filtered:
        """Templates by products with columns (K, M, k), rows (M, k), themselves (M, k, k)."""
        u = self.taken(cross)
        num = along - np.tensordot(self._right, u, 1)
        den = square - np.einsum('lma,lmb->mab', u, u)
        whole, left = (np.linalg.eigvalsh(x)[:, 0] for x in (square, den))
        seen = (left > _SEEN * whole) & (whole > 0.0)
        den[~seen] = np.eye(den.shape[-1])
        covariance = np.linalg.inv(den)
        value = np.einsum('mab,mb->ma', covariance, num)
        z = np.sqrt(np.maximum(np.sum(value * num, axis=1), 0.0))
        return Filtered(value, covariance, np.where(seen, z, 0.0))


class Templates(Protocol):
    """Rows of one way to make them, and pulses in these rows.

    Attributes:
        joints: Where pulses may act; `BASE` or joints.
        runs: Number of recordings.
        durations: Of the bells that are tried at all times [s].
        bounds: Shortest and longest duration [s].
        edges: Shares of edges that are tried.
        shows: Time for which a pulse shows in other rows than its own [s].
        data: (R,) whitened rows. lasting: (R, K) columns of what lasts. projection: Of these.
    """

    joints: Sequence[int]
    runs: int
    durations: tuple[float, ...]
    bounds: tuple[float, float]
    edges: tuple[float, ...]
    shows: float
    data: Array
    lasting: Array
    projection: Projection

    def bells(self, run: int, duration: float) -> Shapes:
        """All along a recording."""
        ...

    def white(self, duration: float) -> tuple[float, float]:
        """Mean and standard deviation, in white noise, of the logarithm of `QUIET` of z."""
        ...

    def about(self, found: Sequence[Transient]) -> Templates:
        """With the level of what is left beside some transients."""
        ...

    def column(self, p: Transient) -> Array:
        """(R, k) of a transient of unit size."""
        ...

    def test(self, beside: MatchedFilter, joint: int, run: int, shapes: Shapes) -> Filtered:
        """Pulses on a joint, or the base, of a recording."""
        ...


class MatchedFilter:
    """What lasts, and some transients, as columns beside which further ones are judged.

    Args:
        templates: What lasts.
        found: The transients.
    """

    def __init__(self, templates: Templates, found: Sequence[Transient]) -> None:
        self.templates, self.found = templates, list(found)
        none = np.zeros((len(templates.data), 0))
        self.columns = np.column_stack([none, *map(templates.column, found)])
        self.projection = templates.projection.with_more(*self.products(self.columns))

    def products(self, columns: Array) -> tuple[Array, Array, Array]:
        """Of columns (R, C) with what lasts (K, C), the rows (C,), and themselves (C, C)."""
        t = self.templates
        return t.lasting.T @ columns, columns.T @ t.data, columns.T @ columns

    def left(self, columns: Array) -> Array:
        """(R, C) of columns (R, C), less what all columns here make of them."""
        cross = np.concatenate([self.templates.lasting.T @ columns, self.columns.T @ columns])
        return np.asarray(columns - self.made(self.projection.solved(cross)))

    def made(self, coefficients: Array) -> Array:
        """(R, ...) by coefficients (K, ...) of all columns."""
        count = self.templates.lasting.shape[1]
        made = self.templates.lasting @ coefficients[:count]
        return np.asarray(made + self.columns @ coefficients[count:])

    @property
    def values(self) -> list[Array]:
        """(k,) size of every transient."""
        every = self.projection.coefficients[self.templates.lasting.shape[1] :]
        return np.split(every, max(len(self.found), 1))

    def test(self, joint: int, run: int, shapes: Shapes) -> Filtered:
        """See `Templates`."""
        return self.templates.test(self, joint, run, shapes)
