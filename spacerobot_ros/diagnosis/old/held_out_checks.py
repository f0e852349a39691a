"""Whether what was chosen holds on parts of the data that it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...types import Array
from ..limits import HELD_OUT, OTHERS
from .selection import Selection


def check_held_out(selection: Selection) -> None:
    """Drop what does not hold on parts that it was not fitted to, weakest first.

    A law that goes leaves its place to its special cases, and to those that it is one of, but not
    to what failed before it.
    """
    failed: set[int] = set()
    while selection.chosen:
        gains = {i: selection.held_out(i) for i in selection.chosen}
        failing = {
            i: float(np.sum(g))
            for i, g in gains.items()
            if not holds(g, is_predicted=selection.is_stretched(i, selection.chosen))
        }
        if not failing:
            return
        weakest = selection.leaning_on(min(failing, key=failing.__getitem__))
        failed.add(weakest)
        if selection.alike(weakest):
            selection.take(selection.instead_of(weakest, failed))
        else:
            selection.drop(weakest)


def predicted_better(rows: Selection, chosen: Sequence[int], others: Sequence[int]) -> float:
    """By how much one choice predicts parts of the data better than another [nats].

    A part of which more is missed than its noise counts by its own level: where something else
    happens decides nothing.
    """
    with_it, without = (rows.held_out_misfits(choice) for choice in (chosen, others))
    sizes = np.array([fold.part.rows for fold in rows.parts.folds()])
    seen = sizes > 0  # nothing moves in the others
    weight = np.minimum(sizes, with_it)[seen]
    return float(0.5 * np.sum(weight * np.log(without[seen] / with_it[seen])))


def holds(gains: Array, *, is_predicted: bool = False) -> bool:
    """Whether a cause predicts parts of the data that it was not fitted to.

    The worst part loses less than half of what the others gain, and no single one decides: each
    shows it by itself, or all others gain together and, of three or more, the next one shows the
    same. What a part gains by values of the others alone, all of them decided.

    Args:
        gains: (F,) see `Selection.held_out`.
        is_predicted: Whether they are by values of the others alone.
    """
    total, worst = float(np.sum(gains)), min(float(np.min(gains)), 0.0)
    if total <= HELD_OUT or -worst > 0.5 * (total - worst):
        return False
    if len(gains) < 2 or np.min(gains) > HELD_OUT or is_predicted:
        return True
    *_, second, best = np.sort(gains).tolist()
    return bool(total > best and (len(gains) < 3 or second > OTHERS * best))
