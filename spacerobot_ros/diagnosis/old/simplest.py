"""Which of the causes that an arm's recordings want is chosen: the likeliest beforehand."""

from __future__ import annotations

from collections.abc import Container, Sequence

from ...estimation.columns import Candidate
from ..limits import SIMPLER_MARGIN

_LAST = ('joint_torque_ripple',)
"""Chosen where nothing else is wanted: a few periods follow any smooth curve of the angle. What
stands in its place until then is pruned."""
_BODY = 'inertial_parameters'


def simplest(
    wanted: Sequence[tuple[int, float]], candidates: Sequence[Candidate], last: Container[str]
) -> int:
    """The likeliest beforehand of those that do nearly as well as the best.

    That is the cause of fewest numbers at the same place; of bodies, whose columns are much the
    same as their neighbours', what hangs on the last link. There one number is a case of all ten,
    whose freedom the evidence has paid: the better one is chosen.

    Args:
        wanted: Numbers of candidates with their margins, best first.
        candidates: All of them.
        last: Names of the last links.
    """
    wanted = [pair for pair in wanted if candidates[pair[0]].kind.id not in _LAST] or wanted
    close = [(i, m) for i, m in wanted if m > SIMPLER_MARGIN * wanted[0][1]]
    best = candidates[wanted[0][0]]
    if best.kind.id == _BODY:
        bodies = [i for i, _ in close if candidates[i].kind.id == _BODY]
        return next((i for i in bodies if candidates[i].where in last), bodies[0])
    near = [(i, margin) for i, margin in close if candidates[i].where == best.where]
    return min(near, key=lambda pair: (len(candidates[pair[0]].sizes), -pair[1]))[0]
