"""How surely a cause of an arm is one: held-out shares, and what columns without meaning reach."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ..estimation.arm_fit import Posterior
from ..estimation.placebo import held_out_gain
from ..types import Array
from .answer.result import Evidence
from .selection import Selection


def evidence_of(selection: Selection, levels: Sequence[Array], i: int) -> Evidence:
    """What speaks for a chosen cause beside all others.

    Held-out shares are of the misfit of the model with all other causes.

    Args:
        selection: The choice.
        levels: (6,) variances of every joint's leftover.
        i: Number of the cause.
    """
    others = [k for k in selection.chosen if k != i]
    judged = selection.score(i)
    without = held_out_misfit(selection, others)
    excess = max(without - selection.whole.rows, 1.0)
    return Evidence(
        log_likelihood_gain=0.5 * judged.gain,
        bic_gain=judged.bic_gain,
        p_value=judged.p_value,
        held_out_gain=(without - held_out_misfit(selection, selection.chosen)) / excess,
        placebo_gain=_placebo(selection, levels, i) / excess,
    )


def held_out_misfit(selection: Selection, chosen: Sequence[int]) -> float:
    """Squared whitened rows of every fold with the coefficients that the others give."""
    if len(selection.parts) < 2:
        return math.nan
    deviations = selection.rows.deviations(chosen)
    return sum(
        part.misfit(Posterior.of(selection.rest(f), deviations).mean)
        for f, part in enumerate(selection.parts)
    )


def _placebo(selection: Selection, levels: Sequence[Array], i: int) -> float:
    """Largest held-out gain of columns without meaning, of the same size and colour."""
    rows, own = selection.rows, selection.rows.places[i]
    if len(selection.parts) < 2:
        return math.nan
    others = [k for k in selection.chosen if k != i]
    mean = Posterior.of(selection.whole, rows.deviations(others)).mean
    times, data, columns, folds = [], [], [], []
    for j, (joint, variances) in enumerate(zip(rows.joints, levels, strict=True)):
        if len(joint.torque) and joint.columns[:, own].any():
            torque, whitened, _ = joint.whitened(variances)
            data.append(torque - whitened @ mean)
            columns.append(whitened[:, own])
            times.append(rows.joint_times(j))
            folds.append(rows.folds[joint.block])
    order = np.lexsort((np.concatenate(times), np.concatenate(folds)))
    ends = np.searchsorted(np.concatenate(folds)[order], np.arange(len(selection.parts) + 1))
    return held_out_gain(
        np.concatenate(columns)[order],
        np.concatenate(data)[order],
        rows.sizes[own],
        [slice(a, b) for a, b in pairwise(ends.tolist())],
        np.concatenate(times)[order],
    )
