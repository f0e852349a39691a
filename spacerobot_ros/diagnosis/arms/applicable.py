"""The causes of an arm as they are applied: no joint may be worse with them than without."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ...errors import ConfigurationError
from ...estimation.balance.arm_fit import ArmFit
from ...estimation.balance.arm_priors import DRY, is_kind_of
from ...estimation.inference.evidence import Gram, sum_of
from ...types import Array
from ..limits import MOST
from .arm_found import WORSE, ArmFound
from .arm_spread import clear_causes
from .selection import Selection

_HEAVIEST = 8.0
"""Times that a joint may count for more: values that are then 64 times its own are its alone."""


def applicable(found: ArmFound) -> ArmFound:
    """The causes as they are applied: no joint of a recording may be worse with them than without.

    Where one is, its rows count more: values that suit all together may cost one of them a little.
    Where that does not help, the cause at that joint goes without which it is best off; what of
    the file is corrected within its tolerance goes before any.
    """
    selection, weights = found.selection, found.weights
    while True:
        plain = plain_of(selection, [*found.levels], weights).whole
        tried = list(_applied(replace(found, weights=weights), selection.chosen, plain))
        unrelated = [i for i in selection.chosen if is_unrelated(tried[0].fit, i)]
        if superfluous := unrelated or shared_frictions(tried[0].fit, tried[0].clear):
            selection.drop(min(superfluous, key=selection.gain))
            continue
        for out in tried:
            if not np.any(_ratios(out) > WORSE):
                return out
        if not selection.chosen:
            return replace(tried[0], calibration=())
        best = min(tried, key=lambda out: float(np.max(_ratios(out))))
        ratios = _ratios(best)
        if np.isfinite(ratios).all() and np.max(weights) < _HEAVIEST:
            weights = np.where(ratios > WORSE, 2.0 * weights, weights)
        else:
            selection.drop(culprit(best, plain))
            weights = np.ones_like(weights)


def shared_frictions(fit: ArmFit, clear: Sequence[int]) -> list[int]:
    """Laws of dry friction at one joint, none of which is clear: together they share one torque.

    Without the least of them the others may be.
    """
    rubbing = [i for i in fit.chosen if is_kind_of(fit.rows.candidates[i].kind, DRY)]
    for where in dict.fromkeys(fit.rows.candidates[i].where for i in rubbing):
        here = [i for i in rubbing if fit.rows.candidates[i].where == where]
        if len(here) > 1 and not set(here) & set(clear):
            return here
    return []


def is_unrelated(fit: ArmFit, i: int) -> bool:
    """Whether a candidate is a gain of measured torques that do not follow from the model.

    A large gain makes next to nothing of what the model needs, and so explains torques that have
    nothing to do with that. What is left beside the other causes where the model needs nothing
    must become less by most with a share of what it needs.
    """
    if not fit.is_gain(i):
        return False
    rows = fit.rows
    own = rows.joints[rows.robot.joints.index(str(rows.candidates[i].where))]
    needed = own.columns[:, rows.places[i]]
    others = [k for c in fit.chosen if c != i for k in rows.places[c].tolist()]
    causes = own.columns[:, others]
    measured = own.torque - needed[:, 0]  # its opposite
    squares = []
    for columns in (causes, np.column_stack([causes, needed])):
        left = measured - columns @ np.linalg.lstsq(columns, measured, rcond=1e-9)[0]
        squares.append(float(left @ left))
    return squares[1] > (1.0 - MOST) * squares[0]


def plain_of(selection: Selection, levels: Sequence[Array], weights: Array) -> Selection:
    """The same with rows that are not whitened, counted so often that they say as much.

    Args:
        selection: The choice.
        levels: (8,) variances of every set of `ArmRows.joints`.
        weights: (R, n), see `ArmRows.parts`.
    """
    parts = selection.rows.parts(levels, weights)
    chosen = [selection.rows.places[i] for i in selection.chosen or selection.live]
    own = np.concatenate(chosen) if chosen else np.zeros(0, dtype=int)
    white, plain = (np.diag(g.matrix)[own] for g in (selection.whole, sum_of(parts)))
    ratios = white[plain > 0.0] / plain[plain > 0.0]
    factor = float(np.median(ratios)) if len(ratios) else 1.0
    rows = selection.rows
    return Selection(rows, [part.times(factor) for part in parts], rows.recording, rows.held)


def _applied(found: ArmFound, chosen: Sequence[int], plain: Gram) -> Iterator[ArmFound]:
    """What is found with some causes, with all corrections of the file and with none."""
    selection = found.selection
    fit = ArmFit(selection.rows, selection.whole, tuple(chosen), plain)
    out = replace(found, fit=fit)
    clear = clear_causes(out)
    out = replace(out, clear=clear, named=tuple(fit.effects(clear)))
    unclear = [i for i in fit.chosen if i not in clear]
    for more in ([*unclear, *fit.calibration], unclear):
        yield replace(out, calibration=tuple(fit.effects(more)))


def _ratios(found: ArmFound) -> Array:
    """(R, n) `ArmFound.ratios`, 0 at rest; infinite where the causes make no robot."""
    try:
        return np.nan_to_num(found.ratios)
    except ConfigurationError:
        return np.full(found.weights.shape, math.inf)


def culprit(found: ArmFound, plain: Gram) -> int:
    """The cause at the joint that is worst off without which that is best off.

    Of all causes the one with the least evidence where they make no robot.

    Args:
        found: What is applied.
        plain: Sums over rows that are not whitened, see `plain_of`.
    """
    selection, rows = found.selection, found.selection.rows
    extent = np.max(_ratios(found), axis=0)
    if np.isinf(extent).any():
        return min(selection.chosen, key=selection.gain)
    j = int(np.argmax(extent))
    there = [i for i in selection.chosen if rows.candidates[i].where == rows.robot.joints[j]]

    def without(i: int) -> float:
        others = [k for k in selection.chosen if k != i]
        return min(float(np.max(_ratios(out)[:, j])) for out in _applied(found, others, plain))

    return min(there or selection.chosen, key=without)
