"""Whether what was chosen holds on parts of the data that it was not fitted to.

A cause stays where every part is better predicted with it from the others, a body where it beats
simpler causes in its place, and any where it lowers what is left as it is, too, not only its fast
content.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.balance.arm_fit import ArmFit
from ...types import Array
from ..limits import HELD_OUT, OTHERS, RELEVANT
from .arm_found import is_clear
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


def check_bodies(selection: Selection, plain: Selection) -> None:
    """Drop bodies of the machine without which parts are predicted as well, weakest first.

    Ten numbers follow much of what several simpler causes leave. What they have to beat by
    `HELD_OUT` is the best that does without: what is chosen in their place, no other body among
    it. A slow load is little of the whitened rows, so that beating it as it is will do. What
    does without by values so implausible that these alone are evidence for the body does not.

    Args:
        selection: What is chosen.
        plain: The same choice on rows that are not whitened.
    """
    bodies = {
        i
        for i, candidate in enumerate(selection.rows.candidates)
        if candidate.kind.id == 'inertial_parameters'
        and candidate.along is None
        and not candidate.recordings
    }
    left = sorted(bodies & set(selection.chosen), key=selection.gain)
    while left:
        other = selection.instead_of(left[0], bodies)
        check_held_out(other)
        gains = [
            predicted_better(rows, selection.chosen, other.chosen) for rows in (selection, plain)
        ]
        dearer = other.implausibility(other.chosen) - selection.implausibility(selection.chosen)
        if max(gains) <= HELD_OUT and dearer <= selection.need(left[0]):
            selection.take(other)
            left = sorted(bodies & set(selection.chosen), key=selection.gain)
        else:
            left = left[1:]


def check_refinements(selection: Selection, plain: Selection) -> None:
    """Put the simpler law in the place of one whose further numbers are not clear, or do nothing.

    What whitened rows say of slow motion is said by starts and turns, where a rate is hardly
    measured; rows as they are hold the whole law against them.

    Args:
        selection: What is chosen.
        plain: The same choice on rows that are not whitened.
    """
    for i in list(selection.chosen):
        candidate = selection.rows.candidates[i]
        further = [k for k, parameter in enumerate(candidate.parameters) if parameter.beyond]
        if not further or i not in selection.chosen:
            continue
        fit = ArmFit(selection.rows, selection.whole, tuple(selection.chosen), plain.whole)
        if is_clear(fit, i, which=further) and fit.share(i, further) > RELEVANT:
            continue
        other = selection.instead_of(i, [i])
        check_held_out(other)
        selection.take(other)


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


def check_plain(selection: Selection, plain: Selection) -> None:
    """Drop what only helps after whitening, weakest first.

    Args:
        selection: What is chosen.
        plain: The same choice on rows that are not whitened: without a cause no more may be left
            of parts that it was not fitted to.
    """
    while selection.chosen:
        gains = {}
        for i in selection.chosen:
            others = [k for k in selection.chosen if k != i]
            with_it, without = (
                plain.held_out_misfit(chosen, i) for chosen in (selection.chosen, others)
            )
            gains[i] = without - with_it
        worst = min(gains, key=gains.__getitem__)
        if gains[worst] > 0.0:
            return
        selection.drop(worst)


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
