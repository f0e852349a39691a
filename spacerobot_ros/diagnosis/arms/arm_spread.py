"""How sure the values of an arm's causes are: scatter between the parts of the data, and more."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
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
from ..limits import CLEAR, CLEAR_AS_PRINTED
from .arm_found import ArmFound, is_clear


def values_std(found: ArmFound, i: int, spread: Array) -> list[float]:
    """Standard deviations of a candidate's parameters from those of its coefficients.

    NaN of those that it is not linear in, which are chosen, and of those that it holds.
    """
    candidate, applied = found.fit.rows.candidates[i], found.named[found.clear.index(i)]
    mean = found.fit.values[found.fit.rows.places[i]]
    held = _held(found.fit.rows.sizes[found.fit.rows.places[i]], applied)
    here = candidate.values(mean)
    total = dict.fromkeys(here, 0.0)
    for k, std in enumerate(spread):
        step = 1e-3 * float(std) * np.eye(len(mean))[k]
        moved = candidate.values(mean + step)
        for name in total:
            change = ((moved[name] - here[name]) / 1e-3) ** 2
            total[name] += math.nan if held[k] and change else change
    stds = {name: math.sqrt(square) for name, square in total.items()}
    for p in applied.parameters:
        if p.role in ('reciprocal', 'square'):
            stds[p.name] = value_std(p, applied.values[p.name], stds[p.name])
        elif p.role == 'search':
            stds[p.name] = math.nan
    return [stds[p.name] for p in applied.parameters]


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
    for fold in found.selection.folds(i):
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
    """Chosen causes that are clear by their fit, and of what is printed as their deviation.

    Of two parts only, scatter has no size that could take a name.
    """
    fit, usual = found.fit, usual_scatter(found)
    printed = {
        i: CLEAR_AS_PRINTED * birge_of(found, i, usual) if scatter_of(found, i)[1] > 1.0 else 0.0
        for i in fit.chosen
    }
    return tuple(i for i in fit.chosen if is_clear(fit, i, max(CLEAR, printed[i])))


def birge_of(found: ArmFound, i: int, usual: float) -> float:
    """Times by which a cause is less certain than its fit says (Birge's ratio).

    By its own scatter between the parts of the data, or by the usual one of all causes.
    """
    total, dof = scatter_of(found, i)
    return math.sqrt(max(1.0, total / dof, usual))


def usual_scatter(found: ArmFound) -> float:
    """Half of all causes are taken to be as constant as they should be (Birge's ratio)."""
    ratios = [total / dof for total, dof in (scatter_of(found, i) for i in found.fit.chosen)]
    return float(np.median(ratios)) if ratios else 1.0
