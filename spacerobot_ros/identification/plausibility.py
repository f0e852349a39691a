"""Joint columns that are swapped in positions and rates alike, found by what breaks: momentum."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from ..estimation.momentum_process import MomentumModel
from ..estimation.reference import Kinematics
from .validity_limits import EXCHANGED_MISFIT

_ROWS = 200  # times at which momentum is compared


def swapped_joints(
    model: MomentumModel, reference: Kinematics, joints: tuple[str, ...]
) -> tuple[str, ...]:
    """The pair of joints whose exchange makes momentum hold, in a line; empty where none does."""
    sparse = reference.part(slice(None, None, max(1, len(reference.time) // _ROWS)))
    as_given = _momentum_misfit(model, sparse)
    misfits = {}
    for a, b in combinations(range(model.n), 2):
        order = list(range(model.n))
        order[a], order[b] = b, a
        exchanged = replace(sparse, q=sparse.q[:, order], qd=sparse.qd[:, order])
        misfits[joints[a], joints[b]] = _momentum_misfit(model, exchanged)
    if not misfits:
        return ()
    pair = min(misfits, key=lambda names: misfits[names])
    if misfits[pair] < EXCHANGED_MISFIT * as_given:
        return (f'the columns of {pair[0]} and {pair[1]} seem to be swapped',)
    return ()


def _momentum_misfit(model: MomentumModel, reference: Kinematics) -> float:
    columns, h0 = model.regressor(reference)
    rows, right = columns.reshape(-1, model.size), h0.ravel()
    norms = np.linalg.norm(rows, axis=0)
    unit = rows / np.where(norms > 0.0, norms, 1.0)
    if not np.any(right):  # wheels at rest: the smallest singular value of the homogeneous system
        return float(np.linalg.svd(unit[:, norms > 0.0], compute_uv=False)[-1])
    solution = np.linalg.lstsq(unit, right, rcond=1e-12)[0]
    return float(np.linalg.norm(unit @ solution - right))
