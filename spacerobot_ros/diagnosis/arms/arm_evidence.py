"""How surely a cause of an arm is one: held-out shares, and what columns without meaning reach."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...effects.effect import Key
from ...estimation.inference.placebo import held_out_gain
from ...types import Array
from ..answer.cause import Evidence, Rival
from ..limits import EQUIVALENT
from .selection import Selection


def evidence_of(selection: Selection, levels: Sequence[Array], i: int) -> Evidence:
    """What speaks for a chosen cause beside all others.

    Held-out shares are of the misfit of the model with all other causes, and nothing of this one,
    beyond one a row; what a cause removes is such an excess, also where no other is seen.

    Args:
        selection: The choice.
        levels: (8,) variances of every joint's leftover.
        i: Number of the cause.
    """
    others = [k for k in selection.chosen if k != i]
    judged = selection.score(i)
    without, with_it = (
        selection.held_out_misfit(chosen, i) for chosen in (others, selection.chosen)
    )
    removed = without - with_it
    rows = sum(fold.part.rows for fold in selection.parts.folds(i))
    excess = max(without - rows, removed, 1.0)
    return Evidence(
        log_likelihood_gain=0.5 * judged.gain,
        bic_gain=judged.bic_gain,
        p_value=judged.p_value,
        held_out_gain=removed / excess,
        placebo_gain=_placebo(selection, levels, i) / excess,
    )


def _placebo(selection: Selection, levels: Sequence[Array], i: int) -> float:
    """Largest held-out gain of columns without meaning, of the same size and colour."""
    rows, own = selection.rows, selection.rows.places[i]
    mean = selection.without(i, selection.chosen).mean
    labels = selection.parts.labels(i)
    times, data, columns, part = [], [], [], []
    for j, (joint, variances) in enumerate(zip(rows.joints, levels, strict=True)):
        if len(joint.torque) and joint.columns[:, own].any():
            torque, whitened, _ = joint.whitened(variances)
            judges = labels[joint.block] >= 0
            data.append((torque - whitened @ mean)[judges])
            columns.append(whitened[judges][:, own])
            times.append(rows.joint_times(j)[judges])
            part.append(labels[joint.block][judges])
    order = np.lexsort((np.concatenate(times), np.concatenate(part)))
    ends = np.searchsorted(np.concatenate(part)[order], np.arange(labels.max() + 2))
    return held_out_gain(
        np.concatenate(columns)[order],
        np.concatenate(data)[order],
        rows.sizes[own],
        [slice(a, b) for a, b in pairwise(ends.tolist())],
        np.concatenate(times)[order],
    )


def rivals_of(selection: Selection, i: int) -> tuple[Rival, ...]:
    """What could stand in a cause's place as well, each once: of all or of one recording."""
    own, which = selection.gain(i), selection.rows.candidates[i]
    out: dict[Key, Rival] = {}
    for k, margin in selection.ranking(without=i):
        gap = own - (margin + selection.need(k))
        c = selection.rows.candidates[k]
        is_other = c.key != which.key and not c.repeats([which])
        if is_other and margin > 0.0 and abs(gap) < EQUIVALENT:
            rival = Rival(effect=c.kind.id, where=c.where, bic_gap=2.0 * max(gap, 0.0))
            out.setdefault(rival.key, rival)
    return tuple(out.values())
