"""What could stand in the place of a chosen cause."""

from __future__ import annotations

from ...effects.effect import Key
from ..answer.cause import Rival
from ..limits import EQUIVALENT
from .selection import Selection


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
