"""The torque of a moment in a field: nine columns m_j b_l, whose coefficients are five numbers.

All three axes share one moment m and one field b. As nine free numbers the law pays for four that
it has not: where a torque that is constant in inertial space takes most of the little that errors
of the masses leave, it lost to that by 2 nats as nine and is 9 ahead as five. m and b are found
by turns, each by least squares with the other held (alternating least squares), from directions
all round; about them the law is linear in what it may still be.
"""

from __future__ import annotations

import itertools

import numpy as np

from ...estimation.inference.spectral_terms import SpectralTerms, Whitening
from ...types import Array, Vector3

FREEDOM = 5 / 9
"""Numbers of a moment and a field, whose product alone counts, by those of nine columns."""
_TURNS = 60
_STARTS = [
    np.array(b) / np.linalg.norm(b)
    for b in itertools.product((0, 1, -1), repeat=3)
    if b > (0, 0, 0)
]


def ways_about_best(terms: SpectralTerms, columns: Array, beside: Array) -> Array:
    """(9, 6) directions of the coefficients m_j b_l about the best moment and field.

    Args:
        terms: Of what is left.
        columns: (M, 9) of m_j b_l, in the order of j, then l.
        beside: (M, k) of other laws, free.
    """
    scale = terms.level(np.concatenate([beside, columns], axis=1)).scale
    white = Whitening(terms.nuisance, scale)
    q, _ = np.linalg.qr(white(beside))
    own, data = (values - q @ (q.T @ values) for values in (white(columns), white(terms.data)))
    gram, along = (own.T @ own).reshape(3, 3, 3, 3), (own.T @ data).reshape(3, 3)
    # the prior of every law: a torque as large as the data
    ridge = np.eye(3) * float(np.sum(columns**2)) / 9.0 / terms.size**2
    ends = [_by_turns(gram, along, ridge, b) for b in _STARTS]
    _, moment, field = max(ends, key=lambda end: end[0])
    moment = moment / max(float(np.linalg.norm(moment)), 1e-300)
    of_moment = np.einsum('ij,l->jli', np.eye(3), field)
    of_field = np.einsum('il,j->jli', np.eye(3), moment)
    return np.concatenate([of_moment, of_field], axis=2).reshape(9, 6)


def _by_turns(
    gram: Array, along: Array, ridge: Array, field: Vector3
) -> tuple[float, Vector3, Vector3]:
    """What a moment in a field explains, the moment, and the field of unit length."""
    moment = np.zeros(3)
    for _ in range(_TURNS):
        moment = np.linalg.solve(
            np.einsum('jlkm,l,m->jk', gram, field, field) + ridge, along @ field
        )
        size = max(float(np.linalg.norm(moment)), 1e-300)
        unit = moment / size
        field = np.linalg.solve(np.einsum('jlkm,j,k->lm', gram, unit, unit) + ridge, unit @ along)
        field = field / max(float(np.linalg.norm(field)), 1e-300)
    lhs = np.einsum('jlkm,l,m->jk', gram, field, field) + ridge
    moment = np.linalg.solve(lhs, along @ field)
    return float(moment @ along @ field), moment, field
