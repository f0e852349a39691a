"""Variances of a leftover by restricted likelihood (Patterson and Thompson, Biometrika 58 (1971)).

The coefficients of all columns are integrated out under their priors. With V the covariance of
rows, V_i its part of a unit variance, X the columns of unit prior, and

    P = V^-1 - V^-1 X (1 + X' V^-1 X)^-1 X' V^-1,

minus twice the log likelihood is log|V| + log|1 + X' V^-1 X| + y' P y, its slopes are
tr(P V_i) - y' P V_i P y, and y' P V_i P V_j P y is the mean of its observed and its expected
curvature: average information (Gilmour, Thompson and Cullis, Biometrics 51 (1995)).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from ...types import Array, IntArray
from .leftover import JointRows, KalmanGains

_LEAST = 1e-3  # of a torque's rms: no torque sensor is as good
_MOST = 10.0  # times a torque's rms
_START, _START_DRIFT = 0.03, 0.01  # of a torque's rms
_RANK = 1e-6  # of the largest singular value of the columns that a joint sees
_STEPS = 200
_LEAST_DAMPING, _MOST_DAMPING, _MORE, _LESS = 1e-2, 1e6, 10.0, 10.0  # of the information
_LEVEL = 1e-8  # slopes of what is settled; their rounding is 1e-12
_FLAT = 1e-6  # of a variance: the least that a step leaves; the least curvature
_ROUNDING = 1e-12  # of a cost
_CLOSE = 0.5  # in logarithms: how far a curvature is told by a change of slopes
_SECANT = 1e-8  # of a step and what it shows: beyond, they are at right angles


def level_of(
    rows: JointRows, priors: Array, scale: float, drift: Array, held: Array | None = None
) -> Array:
    """(8,) variances of what the columns leave, by REML; (6,) without late and unsure friction.

    Args:
        rows: Of one joint.
        priors: (K,) standard deviation of every column's coefficient.
        scale: Rms of the joint's torque, in which everything is reckoned [N m].
        drift: (4,) largest standard deviations of drifting friction, a drifting gain, late and
            unsure friction [N m]; (2,) without the last two.
        held: (K, A) orthonormal directions, coefficients by their priors, that stay zero.
    """
    columns = rows.columns * (priors / scale)
    if held is not None:
        columns = columns - (columns @ held) @ held.T
    observed = np.ascontiguousarray(rows.observed[:, : len(drift)])
    data = _LevelRows(_compressed(columns), rows.torque / scale, observed, rows.gap)
    most = drift / scale  # what would be less than the least white part is not there
    most[np.sqrt(np.mean(observed**2, axis=0)) * most < _LEAST] = 0.0
    low = 2.0 * np.log(np.array([_LEAST, *[0.1 * _LEAST] * (3 + len(drift))]))
    high = 2.0 * np.log(np.maximum(np.array([*[_MOST] * 4, *most]), 1e-300))
    high = np.maximum(high, low + 1e-3)
    start = 2.0 * np.log(np.array([*[_START] * 4, *[_START_DRIFT] * len(drift)]))
    return scale**2 * np.exp(_settled(_Point(data, np.clip(start, low, high)), low, high).x)


def _compressed(columns: Array) -> Array:
    """(M, r) with the same Gram matrix over rows: what coefficients of unit prior can make."""
    columns = columns[:, np.any(columns != 0.0, axis=0)]
    if not columns.size:
        return columns
    values, vectors = np.linalg.eigh(columns.T @ columns)
    return np.asarray(columns @ vectors[:, values > _RANK**2 * values[-1]])


@dataclass(frozen=True, slots=True, eq=False)
class _LevelRows:
    """Columns (M, r) of unit prior, torques (M,), and how processes are seen; see `JointRows`."""

    columns: Array
    torque: Array
    observed: Array
    gap: Array


class _Point:
    """Minus twice the log likelihood, but for a constant, its slopes and its curvature.

    Args:
        rows: The data.
        x: (8,) logarithms of the variances.

    Attributes:
        cost: The likelihood's.
    """

    def __init__(self, rows: _LevelRows, x: Array) -> None:
        self.rows, self.x = rows, x
        self._variances = np.exp(x)
        both = np.column_stack([rows.columns, rows.torque])
        self._gains = KalmanGains.of(rows.observed, rows.gap, self._variances)
        white = self._gains.whitened(both)
        columns, torque = white[:, :-1], white[:, -1]
        factor = np.linalg.cholesky(np.eye(columns.shape[1]) + columns.T @ columns)
        self._own = solve_triangular(factor, columns.T, lower=True, check_finite=False)  # (r, M)
        self._left = torque - self._own.T @ (self._own @ torque)
        self.cost = float(torque @ self._left) + float(np.sum(np.log(self._gains.every)))
        self.cost += 2.0 * float(np.sum(np.log(np.diag(factor))))

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        """(8,) by variances, and P y (M,)."""
        return self._gains.slopes(np.vstack([self._own, self._left]).T)

    @property
    def slope(self) -> Array:
        """(8,) by logarithms of variances."""
        return self._variances * self._slopes[0]

    @cached_property
    def information(self) -> Array:
        """(8, 8) average information, by variances, each by itself."""
        white = self._gains.whitened(self._variances * self._gains.products(self._slopes[1]))
        own = self._own @ white
        return np.asarray(white.T @ white - own.T @ own)


def _settled(point: _Point, low: Array, high: Array) -> _Point:
    """The lowest point near one, within bounds: damped Newton steps, of variances.

    Slopes tell it to rounding, costs to the root of that alone. By variances, the slope towards
    one that is not there is straight, so that a step goes to its bound. What the information
    lacks of the curvature is made up for by symmetric rank-one corrections from the slopes of
    steps that are close: 19 costs a level of an arm, a quasi-Newton search and difference
    quotients of its slopes 62.
    """
    missing = np.zeros_like(point.information)
    damping = 0.0
    for _ in range(_STEPS):
        x, slope = point.x, point.slope
        free = np.flatnonzero(~((x <= low) & (slope > 0.0) | (x >= high) & (slope < 0.0)))
        if not np.any(np.abs(slope[free]) > _LEVEL):
            break
        ahead = _Point(point.rows, np.clip(x + _step(point, missing, free, damping), low, high))
        is_lower = ahead.cost < point.cost + _ROUNDING * abs(point.cost)
        if is_lower and np.any(ahead.x != x):  # a step of less than x's rounding tells nothing
            missing = _corrected(missing, point, ahead)
            point, damping = ahead, damping / _LESS if damping > _LEAST_DAMPING else 0.0
        elif np.any(missing):
            missing = np.zeros_like(missing)
        elif damping > _MOST_DAMPING:
            break
        else:
            damping = max(_MORE * damping, _LEAST_DAMPING)
    return point


def _step(point: _Point, missing: Array, free: IntArray, damping: float) -> Array:
    """Of logarithms (8,), as slopes and curvature say (Levenberg, Marquardt)."""
    matrix = (point.information + missing)[np.ix_(free, free)]
    matrix = matrix + damping * np.diag(np.diag(point.information)[free])
    values, ways = np.linalg.eigh(matrix)
    step = np.zeros(len(point.x))
    step[free] = -ways @ (ways.T @ point.slope[free] / np.maximum(np.abs(values), _FLAT))
    return np.asarray(np.log(np.clip(1.0 + step, _FLAT, 1.0 / _FLAT)))


def _corrected(missing: Array, before: _Point, after: _Point) -> Array:
    """What the information lacks, by the change of slopes of one step more."""
    step = after.x - before.x
    if np.max(np.abs(step)) > _CLOSE:
        return np.zeros_like(missing)
    # by logarithms the curvature has the slopes beside it
    change = after.slope - before.slope - 0.5 * (before.slope + after.slope) * step
    left = change - (after.information + missing) @ step
    along = float(left @ step)
    if abs(along) < _SECANT * float(np.linalg.norm(left) * np.linalg.norm(step)):
        return missing
    return missing + np.outer(left, left) / along
