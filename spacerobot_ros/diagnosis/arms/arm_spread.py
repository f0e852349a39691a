"""Standard deviations of the parameters of an arm's causes."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...effects.effect import Effect
from ...effects.parameter import Parameter
from ...effects.prior import NOTHING, RUN_TO_RUN
from ...estimation.balance.arm_priors import DRY, Machine, is_kind_of, torque_tolerance
from ...estimation.scaling import value_std
from ...types import Array, BoolArray
from ..answer.cause import Cause
from ..answer.result import Covariance
from .arm_found import ArmFound


def values_std(found: ArmFound, i: int) -> list[float]:
    """Standard deviations of a candidate's parameters from the covariance of its coefficients.

        std^2 = diag(J V J'), J = d parameters / d coefficients

    NaN of those that it is not linear in, which are chosen, and of those that it holds.

    Args:
        found: The causes.
        i: One of them.
    """
    applied, slopes = found.named[found.clear.index(i)], _slopes(found, i)
    own = found.fit.rows.places[i]
    held = _held(found.fit.rows.sizes[own], applied)
    variances = np.sum((slopes @ found.fit.covariance(own)) * slopes, axis=1)
    stds = np.where(np.any(slopes[:, held], axis=1), math.nan, np.sqrt(variances))
    return [
        _std(p, applied, std) for p, std in zip(applied.parameters, stds.tolist(), strict=True)
    ]


def _slopes(found: ArmFound, i: int) -> Array:
    """(P, k) derivatives of a candidate's parameters by its coefficients."""
    candidate, own = found.fit.rows.candidates[i], found.fit.rows.places[i]
    mean, steps = found.fit.values[own], 1e-3 * found.fit.spread(i)
    here = candidate.values(mean)
    moved = [candidate.values(mean + step) for step in np.diag(steps)]
    names = [p.name for p in found.named[found.clear.index(i)].parameters]
    return np.array([[(m[n] - here[n]) for m in moved] for n in names]) / steps


def covariance_of(found: ArmFound, causes: Sequence[Cause]) -> Covariance | None:
    """Of the values of named causes, whose variances are those that are said with them.

    Args:
        found: The causes as they were found.
        causes: As they are named; what was put together of several has no covariances.
    """
    numbers = {effect.key: i for effect, i in zip(found.named, found.clear, strict=True)}
    entries = [
        (cause.applied, name, estimated.std)
        for cause in causes
        for name, estimated in cause.parameters.items()
        if math.isfinite(estimated.std)
    ]
    rows = np.zeros((len(entries), len(found.fit.rows.sizes)))
    for row, (applied, name, _) in zip(rows, entries, strict=True):
        i = numbers.get(applied.key)
        names = [p.name for p in applied.parameters]
        if i is None or names != [p.name for p in found.named[found.clear.index(i)].parameters]:
            row[:] = math.nan
            continue
        row[found.fit.rows.places[i]] = _slopes(found, i)[names.index(name)]
    used = np.flatnonzero(np.any(rows != 0.0, axis=0))
    matrix = rows[:, used] @ found.fit.covariance(used) @ rows[:, used].T
    np.fill_diagonal(matrix, [std**2 for *_, std in entries])
    where = ('/'.join(filter(None, (a.id, a.where, name))) for a, name, _ in entries)
    return Covariance(names=tuple(where), matrix=matrix) if entries else None


def _std(p: Parameter, applied: Effect, std: float) -> float:
    """Of a parameter, from that of the coordinate in which its effect is linear."""
    if p.role == 'search':
        return math.nan
    is_inverse = p.role in ('reciprocal', 'square')
    return value_std(p, applied.values[p.name], std) if is_inverse else std


def _held(sizes: Array, effect: Effect) -> BoolArray:
    """(K,) coefficients whose prior leaves them where they are, beside others of their unit."""
    is_of_one_unit = len({p.unit for p in effect.parameters}) == 1
    return (sizes <= NOTHING * np.max(sizes)) & is_of_one_unit


def whole_std(found: ArmFound, k: int, name: str, std: float) -> float:
    """With what one recording can not show: friction from run to run, the scale of torques."""
    applied = found.named[k]
    value = abs(applied.values[name])
    if is_kind_of(applied, DRY) and math.isfinite(std):
        machine = Machine(found.robot, found.fit.rows.balances)
        whole = value + machine.friction(DRY, applied.where)
        return math.hypot(std, RUN_TO_RUN * whole if found.is_one else 0.0)
    if applied.id == 'inertial_parameters':
        return math.hypot(std, float(np.max(torque_tolerance(found.robot))) * value)
    return std
