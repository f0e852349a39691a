"""Bodies of a machine among changes: ten numbers follow much of what one would say."""

from __future__ import annotations

from ..limits import HELD_OUT
from ..old.held_out_checks import check_held_out, predicted_better
from ..old.selection import Selection


def drop_needless_bodies(selection: Selection) -> None:
    """Drop bodies without which parts are predicted as well, weakest first.

    A spring of -5 N m/rad at the second joint of a KUKA was the body beyond it, both with the same
    evidence, of which the spring predicts parts of the motion better by 7 nats; encoders of a
    double pendulum that are set to zero where it hangs, rubbing, were 0.17 kg at its end (by 2).
    What has to be beaten need not be worth a name. Loads that were put on in 150 simulated arms
    beat it by 57 and more.
    """
    rows = selection.rows
    bodies = {
        i
        for i, candidate in enumerate(rows.candidates)
        if candidate.kind.id == 'inertial_parameters'
    }
    for i in sorted(bodies & set(selection.chosen), key=selection.gain):
        if i not in selection.chosen:
            continue
        other = selection.instead_of(i, bodies)
        if predicted_better(selection, selection.chosen, other.chosen) <= HELD_OUT:
            check_held_out(other)
            selection.take(other)
