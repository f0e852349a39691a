r"""Steps of the momentum filter's deviations [dphi; dq, dq', dq'', dq'''], compiled.

Joints follow a quartic, driven by white snap; only the three rows of the attitude are no
polynomial of the step's length.
"""

from __future__ import annotations

import numpy as np

from ...dynamics.compiling import compiled, inner
from ...types import Array, BoolArray

_CHAIN = (1.0, 1.0, 0.5, 1.0 / 6.0)  # of a quartic: dt^k / k!


@compiled
def transitions_of(durations: Array, matrices: Array) -> Array:
    """(N-1, d, d) as those of `linear_steps.Steps`, of which only three rows are no polynomial.

    With z = [[a, b], [0, c]] and c of joints from position to jerk, exp(z) - 1 = [[x, y], [0, w]]
    has w = exp(c) - 1, exactly, and D_a x = a, D_a y = b - D_b w by the rows of D.

    Args:
        durations: (N-1,) [s].
        matrices: (N, 3, d) rates of the attitude by all states.
    """
    size, n = matrices.shape[2], (matrices.shape[2] - 3) // 4
    out = np.zeros((len(durations), size, size))
    rows, by_rows = np.empty((3, size)), np.empty((3, size))
    for k in range(len(durations)):
        _exponent(durations[k], matrices[k], matrices[k + 1], n, rows)
        _denominator(durations[k], rows, n, by_rows)
        for c in range(3, size):
            for m in range(1, (c - 3) // n + 1):
                chain = _CHAIN[m] * durations[k] ** m
                out[k, c - m * n, c] = chain
                for i in range(3):
                    rows[i, c] -= by_rows[i, c - m * n] * chain
        _solve(by_rows, rows)
        for c in range(size):
            for i in range(3):
                out[k, i, c] = rows[i, c]
            out[k, c, c] += 1.0
    return out


@inner
def _solve(matrix: Array, right: Array) -> None:
    """Solve (1 + M) x = b (3, d) in place of both; turns within a step are far below pi."""
    for i in range(3):
        matrix[i, i] += 1.0
    for p in range(3):
        for i in range(3):
            if i != p:
                share = matrix[i, p] / matrix[p, p]
                for c in range(p + 1, 3):
                    matrix[i, c] -= share * matrix[p, c]
                for c in range(right.shape[1]):
                    right[i, c] -= share * right[p, c]
    for i in range(3):
        for c in range(right.shape[1]):
            right[i, c] /= matrix[i, i]


@inner
def _exponent(dt: float, early: Array, late: Array, n: int, out: Array) -> None:
    """Write the rows [a, b] (3, d) of z: Magnus' series to fourth order."""
    for i in range(3):
        for c in range(out.shape[1]):
            turned = late[i, c - n] - early[i, c - n] if c >= 3 + n else 0.0
            for j in range(3):
                turned += late[i, j] * early[j, c] - early[i, j] * late[j, c]
            out[i, c] = 0.5 * dt * (early[i, c] + late[i, c]) + dt * dt * turned / 12.0


@inner
def _denominator(dt: float, rows: Array, n: int, out: Array) -> None:
    """Write the rows (3, d) of D - 1 = z^2 / 12 - z / 2."""
    for i in range(3):
        for c in range(out.shape[1]):
            squared = dt * rows[i, c - n] if c >= 3 + n else 0.0
            for j in range(3):
                squared += rows[i, j] * rows[j, c]
            out[i, c] = squared / 12.0 - 0.5 * rows[i, c]


@compiled
def driven_by_joints(
    durations: Array, snap: Array, slopes: Array, joints: Array
) -> tuple[Array, Array]:
    """What white snap, and what a quartic misses of the reference, do within each step.

    What joints do within a step moves the attitude by the trapezoid of the rate error's end.

    Args:
        durations: (N-1,) [s].
        snap: (n,) power spectral density.
        slopes: (N, 3, 2 n) rate of the attitude by the joints' positions and rates.
        joints: (N, 4 n) positions to jerks of the reference.

    Returns:
        (N-1, d, d) noise, and (N-1, d) changes, of d = 3 + 4 n states.
    """
    size = 3 + 4 * len(snap)
    noise = np.zeros((len(durations), size, size))
    missed = np.zeros((len(durations), size))
    for k in range(len(durations)):
        _move_joints(durations[k], snap, joints[k], joints[k + 1], noise[k], missed[k])
        _move_attitude(0.5 * durations[k], slopes[k + 1], noise[k], missed[k])
    return noise, missed


@inner
def _move_joints(
    dt: float, snap: Array, early: Array, late: Array, noise: Array, missed: Array
) -> None:
    """Write what concerns the joints alone."""
    n = len(snap)
    for i in range(4):
        for j in range(4):
            share = _CHAIN[3 - i] * _CHAIN[3 - j] * dt ** (7 - i - j) / (7 - i - j)
            for joint in range(n):
                row, column = i * n + joint, j * n + joint
                noise[3 + row, 3 + column] = share * snap[joint]
                if j >= i:
                    missed[3 + row] += _CHAIN[j - i] * dt ** (j - i) * early[column]
    for row in range(4 * n):
        missed[3 + row] -= late[row]


@inner
def _move_attitude(half: float, slopes: Array, noise: Array, missed: Array) -> None:
    """Add what the joints make of the attitude, by half a step."""
    size, n = len(missed), slopes.shape[1] // 2
    for a in range(3):
        for c in range(2 * n):
            slope = half * slopes[a, c]
            missed[a] += slope * missed[3 + c]
            for column in range(3 + c % n, size, n):
                noise[a, column] += slope * noise[3 + c, column]
        for column in range(3, size):
            noise[column, a] = noise[a, column]
    for a in range(3):
        for b in range(3):
            for c in range(2 * n):
                noise[a, b] += noise[a, 3 + c] * half * slopes[b, c]


def add_stops(
    noise: Array, durations: Array, slopes: Array, stopped: BoolArray, fastest: Array
) -> None:
    """Add to the noise of steps what a stop does to joints, all of which then move on in any way.

    Their rates change by as much as a white acceleration with that variance makes of them; the
    attitude follows, as momentum is kept.

    Args:
        noise: (N-1, d, d), changed in place.
        durations: (N-1,) [s].
        slopes: (N-1, 3, n) rate of the attitude by the joints' rates.
        stopped: (N-1,) where a joint is at a limit.
        fastest: (3, n) standard deviations of rate, acceleration and jerk.
    """
    n = fastest.shape[1]
    turns = 3 + 2 * n  # of attitude, positions and rates
    for k in np.flatnonzero(stopped):
        by_way = np.vstack([slopes[k], np.eye(n), np.zeros((n, n))]) * fastest[0]
        by_rate = np.vstack([np.zeros((3 + n, n)), np.diag(fastest[0])])
        way, cross = durations[k] ** 2 / 3.0 * by_way @ by_way.T, by_way @ by_rate.T
        noise[k, :turns, :turns] += way + by_rate @ by_rate.T
        noise[k, :turns, :turns] += 0.5 * durations[k] * (cross + cross.T)
        others = np.arange(turns, turns + 2 * n)
        noise[k, others, others] += fastest[1:].ravel() ** 2
