"""Which other joint laws are of: all of them together, asked again with each joint in its place.

Laws are chosen one after another. Where two other joints move alike, the first law may be of the
wrong one, and the next ones of it mend what that leaves: together they explain less than the same
laws of the right joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...effects.laws.grammar import quantity
from .discovery_limits import DEAD_HEAT
from .law_search import LawSearch, Winner, columns_of
from .possible_laws import Law, others_of


def settled(search: LawSearch, chosen: Sequence[Winner]) -> list[Winner]:
    """The same laws of the joints of which they explain most; what comes close is their rival.

    Args:
        search: That chose them.
        chosen: What won, one after another.
    """
    steps, place = list(chosen), search.channel.place
    every = dict.fromkeys(joint for law in search.laws for joint in others_of(law, place))
    for joint in dict.fromkeys(k for step in chosen for k in others_of(step.law, place)):
        choices = [steps, *(_moved(search, steps, joint, other) for other in every)]
        ranked = sorted(
            ((_likelihood(search, choice), n) for n, choice in enumerate(choices) if choice),
            reverse=True,
        )
        best, first = ranked[0]
        steps = choices[first]
        for likelihood, n in ranked[1:]:
            if best - likelihood < DEAD_HEAT:
                steps = _with_rivals(steps, choices[n], best - likelihood)
    return steps


def _moved(search: LawSearch, steps: Sequence[Winner], joint: str, other: str) -> list[Winner]:
    """Laws of one joint as those of another; none where that is the same, or they are no laws."""
    laws = [replace(step.law, inputs=_renamed(step.law, joint, other)) for step in steps]
    known = {_key(law) for law in search.laws}
    if (
        other == joint
        or len({*map(_key, laws)}) < len(laws)
        or not known.issuperset(map(_key, laws))
    ):
        return []
    columns = search.channel.columns(laws)
    return [
        replace(step, law=law, columns=own, rivals=()) if law.inputs != step.law.inputs else step
        for step, law, own in zip(steps, laws, columns, strict=True)
    ]


def _renamed(law: Law, joint: str, other: str) -> tuple[str, ...]:
    parts = (quantity(name) for name in law.inputs)
    return tuple(
        f'{what}/{other if whose == joint else whose}'.rstrip('/') for what, whose in parts
    )


def _key(law: Law) -> tuple[str, tuple[str, ...]]:
    return law.form.name, law.inputs


def _likelihood(search: LawSearch, steps: Sequence[Winner]) -> float:
    return search.terms.level(columns_of(steps, len(search.terms.data))).likelihood


def _with_rivals(steps: Sequence[Winner], others: Sequence[Winner], gap: float) -> list[Winner]:
    """Laws with those of another joint beside each, once."""
    out = []
    for step, other in zip(steps, others, strict=True):
        rivals = step.rivals
        if step.law.inputs != other.law.inputs:
            left = tuple(r for r in rivals if _key(r[0]) != _key(other.law))
            rivals = (*left, (other.law, gap))
        out.append(replace(step, rivals=rivals))
    return out
