"""How sure the values of an arm's causes are: scatter between the parts of the data, and more."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from ...effects.effect import Effect
from ...effects.parameter import Parameter
from ...estimation.balance.arm_priors import (
    DRY,
    NOTHING,
    RUN_TO_RUN,
    Machine,
    is_kind_of,
    torque_tolerance,
)
from ...estimation.inference.evidence import score
from ...estimation.scaling import value_std
from ...types import Array, BoolArray
from ..limits import ALIKE
from .arm_found import ArmFound, is_clear


def values_std(found: ArmFound, i: int, birge: float) -> list[float]:
    """Standard deviations of a candidate's parameters from the covariance of its coefficients.

        std^2 = diag(J V J'), J = d parameters / d coefficients

    NaN of those that it is not linear in, which are chosen, and of those that it holds.

    Args:
        found: The causes.
        i: One of them.
        birge: Times by which it is less certain than its fit says.
    """
    candidate, applied = found.fit.rows.candidates[i], found.named[found.clear.index(i)]
    own = found.fit.rows.places[i]
    mean, steps = found.fit.values[own], 1e-3 * found.fit.spread(i)
    held = _held(found.fit.rows.sizes[own], applied)
    here = candidate.values(mean)
    moved = [candidate.values(mean + step) for step in np.diag(steps)]
    names = [p.name for p in applied.parameters]
    slopes = np.array([[(m[n] - here[n]) for m in moved] for n in names]) / steps
    variances = np.sum((slopes @ found.fit.covariance(i, birge)) * slopes, axis=1)
    stds = np.where(np.any(slopes[:, held], axis=1), math.nan, np.sqrt(variances))
    return [
        _std(p, applied, std) for p, std in zip(applied.parameters, stds.tolist(), strict=True)
    ]


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
        return math.hypot(std, RUN_TO_RUN * whole if len(found.records) == 1 else 0.0)
    if applied.id == 'inertial_parameters':
        return math.hypot(std, float(np.max(torque_tolerance(found.robot))) * value)
    return std


def scatter_of(found: ArmFound, i: int) -> tuple[float, float]:
    """Chi-square of a cause's coefficients between the parts of the data, and its freedom."""
    posterior, own = found.fit.posterior, found.fit.rows.places[i]
    total, dof = 0.0, 0.0
    free = (np.full(len(own), -np.inf), np.full(len(own), np.inf))
    deviations = posterior.precision**-0.5
    for fold in found.selection.parts.folds(i):
        part = fold.part
        if not part.rows:
            continue
        left = part.vector - part.matrix @ posterior.mean
        beside = found.selection.posterior(found.fit.chosen, part)
        alone = replace(beside, mean=beside.covariance @ left).group(own)
        judged = score(alone, deviations[own], free, None)
        total, dof = total + judged.gain, dof + judged.dof
    return total, max(dof - len(own), 1.0)


def clear_causes(found: ArmFound) -> tuple[int, ...]:
    """Chosen causes that are clear, their deviations as printed."""
    usual = usual_scatter(found)
    return tuple(i for i in found.fit.chosen if is_clear(found.fit, i, birge_of(found, i, usual)))


def birge_of(found: ArmFound, i: int, usual: float) -> float:
    """Times by which a cause is less certain than its fit says (Birge's ratio).

    By its own scatter between the parts of the data and the usual one of all causes, which counts
    like `ALIKE` numbers more: of two parts alone a scatter has next to no size.
    """
    total, dof = scatter_of(found, i)
    return math.sqrt(max(1.0, (total + ALIKE * usual) / (dof + ALIKE)))


def usual_scatter(found: ArmFound) -> float:
    """Scatter by its freedom of the middle one of all causes; half of them have less by chance.

    Two more are as constant as the fit says: of few causes the middle one is any.
    """
    scatters = [scatter_of(found, i) for i in found.fit.chosen]
    return float(np.median([1.0, 1.0, *(total / chdtri(dof, 0.5) for total, dof in scatters)]))
