r"""Pseudo-inertia of ten inertial parameters, which are those of a body where it is positive.

    P = [[tr(I)/2 1 - I, h], [h^T, m]] > 0          # Wensing, Kim, Slotine 2018

P is linear in the parameters, so the physical ones are a convex cone.
"""

from __future__ import annotations

import numpy as np

from ..types import Array


def _basis() -> Array:
    """(10, 4, 4) derivatives of P by m, h (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""
    out = np.zeros((10, 4, 4))
    out[0, 3, 3] = 1.0
    for i in range(3):
        out[1 + i, i, 3] = out[1 + i, 3, i] = 1.0
    for index, i, j in ((4, 0, 0), (5, 0, 1), (6, 1, 1), (7, 0, 2), (8, 1, 2), (9, 2, 2)):
        if i == j:
            out[index, :3, :3] = 0.5 * np.eye(3)
            out[index, i, i] -= 1.0
        else:
            out[index, i, j] = out[index, j, i] = -1.0
    return out


BASIS = _basis()
"""(10, 4, 4): derivatives of P by the parameters, in the order of `toDynamicParameters`."""
INVERSE = np.ascontiguousarray(np.linalg.pinv(BASIS.reshape(10, 16).T))
"""(10, 16): parameters of a symmetric P."""


def pseudo_inertia(parameters: Array) -> Array:
    """(..., 4, 4) pseudo-inertia of parameters (..., 10)."""
    return np.einsum('...k,kij->...ij', parameters, BASIS)


def parameters_of(P: Array) -> Array:
    """(..., 10) parameters of pseudo-inertias (..., 4, 4)."""
    return np.einsum('kn,...n->...k', INVERSE, P.reshape(*P.shape[:-2], 16))
