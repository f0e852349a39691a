"""Rotations, the conventions of docs/conventions.md.

Quaternions are Hamilton, xyzw, and take base coordinates to inertial ones (`q_WB_xyzw`).
Single rotations in a tight loop use these few lines; stacks of rotations use
`scipy.spatial.transform.Rotation`.
"""

from __future__ import annotations

import numpy as np

from ..types import Array, Matrix3, Quaternion, Vector3

_AHEAD, _BEHIND = np.array([1, 2, 0]), np.array([2, 0, 1])  # of the axes
_FEW = 300  # numbers, of 100 rows: where both ways of `cross_rows` take as long


def skew(v: Array) -> Array:
    """(..., 3, 3) cross-product matrices of v (..., 3): `skew(v) @ u == cross(v, u)`."""
    out = np.zeros((*np.shape(v), 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return out - np.swapaxes(out, -1, -2)


def cross(a: Vector3, b: Vector3) -> Vector3:
    """Cross product of two (3,) vectors; ten times faster than `np.cross` on single vectors."""
    a0, a1, a2 = a
    b0, b1, b2 = b
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])


def cross_rows(a: Array, b: Array) -> Array:
    """(N, 3) cross products row by row of (N, 3) or (3,).

    Few rows cost what calls cost, 5 us by this way of taking them and 15 us by columns; of 2000
    columns take 24 us, this way 230 us and `np.cross` 100 us.
    """
    if max(a.size, b.size) < _FEW:
        return a.take(_AHEAD, -1) * b.take(_BEHIND, -1) - a.take(_BEHIND, -1) * b.take(_AHEAD, -1)
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k, i, j in zip(range(3), _AHEAD, _BEHIND, strict=True):
        out[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return out


def rotation_matrix(q_xyzw: Quaternion) -> Matrix3:
    """Rotation matrix of a quaternion, which is normalized first.

    Args:
        q_xyzw: (4,) quaternion, not zero.

    Returns:
        (3, 3) `R_WB` with `v_W = R_WB @ v_B`.
    """
    x, y, z, w = np.asarray(q_xyzw).tolist()  # numbers of Python's are faster, one by one
    s = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array(
        [
            [1.0 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
            [s * (x * y + z * w), 1.0 - s * (x * x + z * z), s * (y * z - x * w)],
            [s * (x * z - y * w), s * (y * z + x * w), 1.0 - s * (x * x + y * y)],
        ]
    )


def turned(q_WB_xyzw: Quaternion, rotation_vector_B: Vector3) -> Quaternion:
    """Attitude turned about its own axes: q_WB * exp(rotation_vector_B), normalized.

    Args:
        q_WB_xyzw: (4,) attitude.
        rotation_vector_B: (3,) rotation vector in base coordinates [rad].
    """
    half = 0.5 * float(np.linalg.norm(rotation_vector_B))
    turn, cosine = 0.5 * np.sinc(half / np.pi) * rotation_vector_B, np.cos(half)
    vector, scalar = q_WB_xyzw[:3], q_WB_xyzw[3]
    q = np.empty(4)
    q[:3] = scalar * turn + cosine * vector + cross(vector, turn)
    q[3] = scalar * cosine - vector @ turn
    return np.asarray(q / np.linalg.norm(q))


def rotation_between(q_a_xyzw: Quaternion, q_b_xyzw: Quaternion) -> Vector3:
    """(3,) shortest rotation vector that takes attitude a to b, in coordinates of a [rad]."""
    a, b = np.asarray(q_a_xyzw), np.asarray(q_b_xyzw)
    vector = a[3] * b[:3] - b[3] * a[:3] - cross(a[:3], b[:3])
    scalar = float(a @ b)
    if scalar < 0.0:
        vector, scalar = -vector, -scalar
    sine = float(np.linalg.norm(vector))
    factor = 2.0 / scalar if sine < 1e-9 else 2.0 * np.arctan2(sine, scalar) / sine
    return np.asarray(factor * vector)
