"""Own states of an effect along a given motion: x' = A(t) x + b(t), propagated step by step."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..dynamics.compiling import compiled, inner
from ..types import Array

_LARGEST = 0.5  # of a scaled matrix: where the approximant below is right to 1e-9


def driven_states(rate: Callable[[Array], Array], time: Array, size: int) -> Array:
    """States from rest at the first time.

    A and b are averaged over each step, and the averages are propagated exactly, with exponentials
    of [[A, b], [0, 0]]: the error is that of the trapezium rule, whatever the frequency.

    Args:
        rate: (N, size) rates of (N, size) states, affine in them.
        time: (N,) increasing [s].
        size: Number of states.
    """
    zero = np.zeros((len(time), size))
    drive, units = rate(zero), np.eye(size)
    matrix = np.stack([rate(zero + unit) - drive for unit in units], axis=2)
    half = 0.5 * np.diff(time)
    block = np.concatenate(
        [
            (matrix[1:] + matrix[:-1]) * half[:, None, None],
            ((drive[1:] + drive[:-1]) * half[:, None])[:, :, None],
        ],
        axis=2,
    )
    largest = float(np.max(np.sum(np.abs(block[:, :, :-1]), axis=2), initial=0.0))
    halvings = max(0, math.ceil(math.log2(max(largest, _LARGEST) / _LARGEST)))
    return np.asarray(_propagated(_affine_exponential(block / 2.0**halvings, halvings)))


@compiled
def _affine_exponential(block: Array, halvings: int) -> Array:
    """(N, size, size + 1): [P, p] of exp of [[A, b], [0, 0]] = [[P, p], [0, 1]].

    Args:
        block: (N, size, size + 1) [A, b], already halved; overwritten with the result.
        halvings: How often.
    """
    size = block.shape[1]
    square, cube = np.empty((size, size + 1)), np.empty((size, size + 1))
    lower = np.empty((size, size))
    for k in range(len(block)):
        x = block[k]
        _product(x, x, square)
        _product(x, square, cube)
        for i in range(size):
            for j in range(size + 1):
                even = 0.1 * square[i, j] + (1.0 if i == j else 0.0)
                odd = 0.5 * x[i, j] + cube[i, j] / 120.0
                x[i, j] = 2.0 * odd if j == size else even + odd
                if j < size:
                    lower[i, j] = even - odd
        _solve(lower, x)
        for _ in range(halvings):
            _product(x, x, square)
            for i in range(size):
                square[i, size] += x[i, size]
            for i in range(size):
                for j in range(size + 1):
                    x[i, j] = square[i, j]
    return block


@inner
def _product(x: Array, y: Array, out: Array) -> None:
    """[A, b] of the product of [[A, b], [0, 0]] with another such matrix."""
    size = len(x)
    for i in range(size):
        for j in range(size + 1):
            total = 0.0
            for c in range(size):
                total += x[i, c] * y[c, j]
            out[i, j] = total


@inner
def _solve(matrix: Array, x: Array) -> None:
    """Solve in place, without exchange of rows: the matrix is close to 1."""
    size = len(matrix)
    for i in range(size):
        for row in range(i + 1, size):
            share = matrix[row, i] / matrix[i, i]
            for j in range(i + 1, size):
                matrix[row, j] -= share * matrix[i, j]
            for j in range(x.shape[1]):
                x[row, j] -= share * x[i, j]
    for i in range(size - 1, -1, -1):
        for j in range(x.shape[1]):
            total = x[i, j]
            for c in range(i + 1, size):
                total -= matrix[i, c] * x[c, j]
            x[i, j] = total / matrix[i, i]


@compiled
def _propagated(steps: Array) -> Array:
    """(N, size) states from zero through N - 1 affine maps (N - 1, size, size + 1)."""
    count, size = steps.shape[0], steps.shape[1]
    states = np.zeros((count + 1, size))
    for k in range(count):
        for i in range(size):
            total = steps[k, i, size]
            for j in range(size):
                total += steps[k, i, j] * states[k, j]
            states[k + 1, i] = total
    return states
