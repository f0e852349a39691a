r"""Cosine terms of channels, whitened by the level that a hypothesis itself leaves.

    y = X c + Z z + S n,    z ~ N(0, 1),  n ~ N(0, 1)

with y the discrete cosine transform of the rows, X the columns of chosen laws, Z those of named
causes, inertial errors and tolerances times their prior deviations, and S the level: constant in
bins of frequency, interpolated. S is estimated along with c and z (expectation maximisation), so
that a law is no part of the noise that judges it, and the spectrum needs no model. c has a prior,
too, of a torque as large as the data: what tolerances or another column say already costs no more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.fft import dct, idct

from ...types import Array, IntArray
from .evidence import inverse_of_positive

_FIRST, _WIDER = 7, 1.25
"""Terms of the first bin of frequency, and the next one's by it: a line of noise half a tenth of a
hertz wide has four terms of 40 s. In bins of 12 it makes the noise beside it larger than it is; in
bins of 5 a sine of the time passes for a line of noise."""
_PASSES = 5
_LEAST = 1e-6  # of the data's rms: no level is below
_KEPT = 0.8  # of the terms: rows are 2.5 a period of the band
_COLLINEAR = 1e-3  # of the square of normed columns: below, two are one


def cosines(rows: Array) -> Array:
    """(M, ...) cosine terms of rows (R, ...), those in the band."""
    return np.asarray(dct(rows, axis=0, norm='ortho'))[: int(_KEPT * len(rows))]


def rows_of(terms: Array, count: int) -> Array:
    """(R, ...) so many rows of cosine terms."""
    padded = np.zeros((count, *terms.shape[1:]))
    padded[: len(terms)] = terms
    return np.asarray(idct(padded, axis=0, norm='ortho'))


@dataclass(frozen=True, eq=False)
class Level:
    """Level of what a hypothesis leaves, and how well it explains.

    Args:
        scale: (M,) S. likelihood: Log likelihood, c and z integrated out, S at its best.
    """

    scale: Array
    likelihood: float


@dataclass(frozen=True, eq=False)
class SpectralTerms:
    """M terms of a channel, or of several one after another.

    Args:
        data: (M,). nuisance: (M, r) Z.
        ends: Of all channels but the last, each of which has a level of its own.
    """

    data: Array
    nuisance: Array
    ends: tuple[int, ...] = ()

    @cached_property
    def size(self) -> float:
        """Prior deviation of every direction of laws: a torque as large as the data."""
        return float(np.linalg.norm(self.data))

    def level(self, columns: Array, scale: Array | None = None) -> Level:
        """What (M, k) columns of chosen laws leave.

        Args:
            columns: Theirs.
            scale: (M,) to begin with; None: of the data.
        """
        both = np.concatenate([self.nuisance, self.size * ways_of_each([columns])[0]], axis=1)
        if scale is None:
            scale = self._smooth(self.data**2)
        for _ in range(_PASSES):
            mean, covariance = _posterior(both, self.data, scale)
            left = self.data - both @ mean
            known = np.sum((both @ covariance) * both, axis=1)
            scale = self._smooth(left**2 + known)
        white = Whitening(both, scale)
        rest = white(self.data)
        likelihood = -float(np.sum(np.log(scale))) - 0.5 * white.log_det - 0.5 * float(rest @ rest)
        return Level(scale, likelihood)

    def _smooth(self, squares: Array) -> Array:
        """(M,) root of the mean square of each bin, channel by channel."""
        parts = (np.split(x, self.ends) for x in (squares, self.data))
        return np.concatenate(
            [_smoothed(own, (_LEAST * data) ** 2) for own, data in zip(*parts, strict=True)]
        )


def _smoothed(squares: Array, least: Array) -> Array:
    """(M,) root of the mean square of each bin of a channel, between them in proportion."""
    if not len(squares):  # of a single row
        return squares
    ends, width = [0], float(_FIRST)
    while ends[-1] < len(squares):
        ends.append(min(round(ends[-1] + width), len(squares)))
        width *= _WIDER
    if len(ends) > 2 and ends[-1] - ends[-2] < 0.5 * (ends[-2] - ends[-3]):
        del ends[-2]
    means = np.add.reduceat(squares, ends[:-1]) / np.diff(ends)
    middles = np.log(0.5 * (np.array(ends[1:]) + np.array(ends[:-1])))
    logs = np.log(np.maximum(means, float(np.mean(least)) + 1e-300))
    at = np.log(np.arange(len(squares)) + 0.5)
    return np.asarray(np.exp(0.5 * np.interp(at, middles, logs)))


def ways_of_each(groups: Sequence[Array]) -> list[Array]:
    """(M, r) orthonormal directions of each of many groups of (M, k) columns."""
    out = list(groups)
    for count in {columns.shape[1] for columns in groups} - {0}:
        at = [i for i, columns in enumerate(groups) if columns.shape[1] == count]
        some = np.array([groups[i] for i in at])
        size = np.maximum(np.linalg.norm(some, axis=1, keepdims=True), 1e-300)
        ways, values, _ = np.linalg.svd(some / size, full_matrices=False)
        for i, way, kept in zip(at, ways, values**2 > _COLLINEAR, strict=True):
            out[i] = way[:, kept]
    return out


class Whitening:
    """C^-1/2 of C = S (1 + Z_S Z_S^T) S with Z_S = S^-1 Z.

    Args:
        nuisance: (M, r) Z. scale: (M,) S.
    """

    def __init__(self, nuisance: Array, scale: Array) -> None:
        self.scale = scale
        # the left singular vectors by way of the small matrix
        scaled = nuisance / scale[:, None]
        values, vectors = np.linalg.eigh(scaled.T @ scaled)
        seen = values > 1e-12 * max(float(values[-1]), 1e-300) if len(values) else values > 0.0
        values = np.maximum(values[seen], 0.0)
        self._left = scaled @ vectors[:, seen] / np.sqrt(values)
        self._loss = 1.0 - 1.0 / np.sqrt(1.0 + values)
        self.log_det = float(np.sum(np.log1p(values)))

    def __call__(self, values: Array) -> Array:
        """(M, ...) whitened."""
        scaled = (values.T / self.scale).T
        inside = self._left.T @ scaled
        return np.asarray(scaled - self._left @ (self._loss * inside.T).T)


def _posterior(columns: Array, data: Array, scale: Array) -> tuple[Array, Array]:
    """Mean and covariance of all coefficients."""
    scaled = columns / scale[:, None]
    covariance = inverse_of_positive(scaled.T @ scaled + np.eye(columns.shape[1]))
    return covariance @ (scaled.T @ (data / scale)), covariance


class GroupBasis:
    """Directions of every group of columns, and what they cost.

    Args:
        columns: (M, C) whitened, of unit prior deviation; what is not asked is zero.
        groups: Columns of each group.
    """

    def __init__(self, columns: Array, groups: Sequence[IntArray]) -> None:
        scaled = columns.T
        counts = np.array([len(own) for own in groups])
        order = np.argsort(counts, kind='stable')
        self._back, parts, prices = np.argsort(order), [], []
        for count in np.unique(counts):
            at = np.array([groups[g] for g in order if counts[g] == count])
            own = scaled[at]  # (G, k, M)
            values, vectors = np.linalg.eigh(own @ own.transpose(0, 2, 1))
            values = np.maximum(values, 0.0)
            ways = vectors.transpose(0, 2, 1) @ own
            parts.append((ways / np.sqrt(1.0 + values)[:, :, None]).reshape(-1, own.shape[2]))
            freedom = 0.5 * np.sum(np.log1p(values), axis=1)
            prices.append(np.where(np.any(values > 0.0, axis=1), freedom, np.inf))
        self._rows = np.concatenate(parts)
        self._starts = np.concatenate([[0], np.cumsum(counts[order])[:-1]])
        self.prices = np.concatenate(prices)[self._back]
        """(G,) of the freedom of each [nats]: what a prior as wide as the data costs."""

    def gains(self, residuals: Array) -> Array:
        """(G, F) squares that each group explains of (M, F) residuals."""
        squares = (self._rows @ residuals) ** 2
        return np.asarray(np.add.reduceat(squares, self._starts, axis=0)[self._back])
