"""Vector algebra of compiled code: three numbers are a tuple, so nothing is allocated.

A motion is [linear; angular], a force [force; torque]; `get` and `put` take and write three
numbers of a longer row. What Python calls is `compiled` (or `summed`), the rest `inner`.
"""

from __future__ import annotations

import numba

from ..types import Array

compiled = numba.njit(cache=True, nogil=True, error_model='numpy')  # singular gives NaN, no error
inner = numba.njit(nogil=True, error_model='numpy', no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""For what compiled functions alone call: a quarter less to compile."""
summed = numba.njit(cache=True, nogil=True, fastmath={'reassoc', 'contract'})
"""For long sums, whose order is free, so that they run on vector units."""
Triple = tuple[float, float, float]


@inner  # type: ignore[untyped-decorator]
def get(x: Array, i: int) -> Triple:
    """Three entries of a row from i on."""
    return x[i], x[i + 1], x[i + 2]


@inner  # type: ignore[untyped-decorator]
def put(x: Array, i: int, a: Triple) -> None:
    """Write three entries of a row from i on."""
    x[i], x[i + 1], x[i + 2] = a


@inner  # type: ignore[untyped-decorator]
def add(x: Array, i: int, a: Triple) -> None:
    """Add to three entries of a row from i on."""
    x[i] += a[0]
    x[i + 1] += a[1]
    x[i + 2] += a[2]


@inner  # type: ignore[untyped-decorator]
def plus(a: Triple, b: Triple) -> Triple:
    """A + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inner  # type: ignore[untyped-decorator]
def times(s: float, a: Triple) -> Triple:
    """S a."""
    return s * a[0], s * a[1], s * a[2]


@inner  # type: ignore[untyped-decorator]
def dot(a: Triple, b: Triple) -> float:
    """A . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner  # type: ignore[untyped-decorator]
def cross(a: Triple, b: Triple) -> Triple:
    """A x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner  # type: ignore[untyped-decorator]
def rotate(R: Array, a: Triple) -> Triple:
    """R a."""
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )


@inner  # type: ignore[untyped-decorator]
def rotate_back(R: Array, a: Triple) -> Triple:
    """R^T a."""
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@inner  # type: ignore[untyped-decorator]
def power(x: Array, y: Array) -> float:
    """Product of a motion and a force, six numbers each."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + x[3] * y[3] + x[4] * y[4] + x[5] * y[5]


@inner  # type: ignore[untyped-decorator]
def add_motion_cross(V: Array, m: Array, scale: float, out: Array) -> None:
    """Add scale times V x m of two motions, six numbers each."""
    v, w, linear, angular = get(V, 0), get(V, 3), get(m, 0), get(m, 3)
    add(out, 0, times(scale, plus(cross(w, linear), cross(v, angular))))
    add(out, 3, times(scale, cross(w, angular)))


@inner  # type: ignore[untyped-decorator]
def force_cross(V: Array, force: Triple, torque: Triple) -> tuple[Triple, Triple]:
    """V x* f of a motion and a force."""
    v, w = get(V, 0), get(V, 3)
    return cross(w, force), plus(cross(w, torque), cross(v, force))


@inner  # type: ignore[untyped-decorator]
def unit(a: int) -> Triple:
    """Unit vector of axis a."""
    return 1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0
