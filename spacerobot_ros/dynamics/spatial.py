"""Vector algebra of compiled code: three numbers are a tuple, so nothing is allocated.

A motion is [linear; angular], a force [force; torque]; `get` and `put` take and write three
numbers of a longer row, `get6`, `put6` and `add6` both halves of six.
"""

from __future__ import annotations

from ..types import Array
from .compiling import Triple, inner


@inner
def get(x: Array, i: int) -> Triple:
    """Three entries of a row from i on."""
    return x[i], x[i + 1], x[i + 2]


@inner
def put(x: Array, i: int, a: Triple) -> None:
    """Write three entries of a row from i on."""
    x[i], x[i + 1], x[i + 2] = a


@inner
def add(x: Array, i: int, a: Triple) -> None:
    """Add to three entries of a row from i on."""
    x[i] += a[0]
    x[i + 1] += a[1]
    x[i + 2] += a[2]


@inner
def column(X: Array, j: int) -> Triple:
    """Column j of three rows."""
    return X[0, j], X[1, j], X[2, j]


@inner
def put_column(X: Array, j: int, a: Triple) -> None:
    """Write column j of three rows."""
    X[0, j], X[1, j], X[2, j] = a


@inner
def get6(x: Array) -> tuple[Triple, Triple]:
    """Both halves of six numbers."""
    return get(x, 0), get(x, 3)


@inner
def put6(x: Array, a: Triple, b: Triple) -> None:
    """Write both halves of six numbers."""
    put(x, 0, a)
    put(x, 3, b)


@inner
def add6(x: Array, a: Triple, b: Triple) -> None:
    """Add to both halves of six numbers."""
    add(x, 0, a)
    add(x, 3, b)


@inner
def plus(a: Triple, b: Triple) -> Triple:
    """A + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inner
def times(s: float, a: Triple) -> Triple:
    """S a."""
    return s * a[0], s * a[1], s * a[2]


@inner
def dot(a: Triple, b: Triple) -> float:
    """A . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inner
def cross(a: Triple, b: Triple) -> Triple:
    """A x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inner
def rotate(R: Array, a: Triple) -> Triple:
    """R a."""
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )


@inner
def rotate_back(R: Array, a: Triple) -> Triple:
    """R^T a."""
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@inner
def in_body(R: Array, motion: Array) -> tuple[Triple, Triple]:
    """A motion (6,) in base coordinates, in those of a body."""
    return rotate_back(R, get(motion, 0)), rotate_back(R, get(motion, 3))


@inner
def power(x: Array, y: Array) -> float:
    """Product of a motion and a force, six numbers each."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2] + x[3] * y[3] + x[4] * y[4] + x[5] * y[5]


@inner
def along(motion: Array, force: Triple, torque: Triple) -> float:
    """Power of a wrench along a motion."""
    v, w = get6(motion)
    return dot(v, force) + dot(w, torque)


@inner
def motion_cross(V: Array, linear: Triple, angular: Triple) -> tuple[Triple, Triple]:
    """V x m of two motions."""
    v, w = get6(V)
    return plus(cross(w, linear), cross(v, angular)), cross(w, angular)


@inner
def force_cross(V: Array, force: Triple, torque: Triple) -> tuple[Triple, Triple]:
    """V x* f of a motion and a force."""
    v, w = get6(V)
    return cross(w, force), plus(cross(w, torque), cross(v, force))


@inner
def unit(a: int) -> Triple:
    """Unit vector of axis a; zero where there is no such axis."""
    return 1.0 if a == 0 else 0.0, 1.0 if a == 1 else 0.0, 1.0 if a == 2 else 0.0


@inner
def turn(e: Triple, eta: float, k: float, v: Triple) -> Triple:
    """R v = v + k e x (e x v + eta v) for a quaternion, with k = 2 / (e . e + eta^2)."""
    return plus(v, times(k, cross(e, plus(cross(e, v), times(eta, v)))))
