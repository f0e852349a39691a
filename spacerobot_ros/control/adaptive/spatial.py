"""Vectors of three numbers in compiled code: tuples stay in registers, nothing is allocated."""

from __future__ import annotations

import math

import numba

from ...types import Array

Triple = tuple[float, float, float]


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def cross(a: Triple, b: Triple) -> Triple:
    """A x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def plus(a: Triple, b: Triple) -> Triple:
    """A + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def times(s: float, a: Triple) -> Triple:
    """S a."""
    return (s * a[0], s * a[1], s * a[2])


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def dot(a: Triple, b: Triple) -> float:
    """A . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def row(x: Array, i: int) -> Triple:
    """Row i of an (m, 3) array."""
    return (x[i, 0], x[i, 1], x[i, 2])


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def put(x: Array, i: int, a: Triple) -> None:
    """Write row i of an (m, 3) array."""
    x[i, 0], x[i, 1], x[i, 2] = a


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def part(x: Array, i: int) -> Triple:
    """Three entries of a vector from i on."""
    return (x[i], x[i + 1], x[i + 2])


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def out_of(R: Array, k: int, a: Triple) -> Triple:
    """R[k] @ a: child to parent coordinates."""
    return (
        R[k, 0, 0] * a[0] + R[k, 0, 1] * a[1] + R[k, 0, 2] * a[2],
        R[k, 1, 0] * a[0] + R[k, 1, 1] * a[1] + R[k, 1, 2] * a[2],
        R[k, 2, 0] * a[0] + R[k, 2, 1] * a[1] + R[k, 2, 2] * a[2],
    )


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def into(R: Array, k: int, a: Triple) -> Triple:
    """R[k].T @ a: parent to child coordinates."""
    return (
        R[k, 0, 0] * a[0] + R[k, 1, 0] * a[1] + R[k, 2, 0] * a[2],
        R[k, 0, 1] * a[0] + R[k, 1, 1] * a[1] + R[k, 2, 1] * a[2],
        R[k, 0, 2] * a[0] + R[k, 1, 2] * a[1] + R[k, 2, 2] * a[2],
    )


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def turned(a: Triple, axis: Triple, angle: float) -> Triple:
    """A vector turned about a unit axis (Rodrigues)."""
    c, s = math.cos(angle), math.sin(angle)
    return plus(plus(times(c, a), times(s, cross(axis, a))), times((1.0 - c) * dot(axis, a), axis))


@numba.njit(inline='always')  # type: ignore[untyped-decorator]
def unit_vector(j: int) -> Triple:
    """Unit vector of axis j."""
    return (1.0 if j == 0 else 0.0, 1.0 if j == 1 else 0.0, 1.0 if j == 2 else 0.0)
