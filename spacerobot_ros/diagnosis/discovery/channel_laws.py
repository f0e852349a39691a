"""Laws of one channel that hold, and what is said of them.

What a law explains of parts of a channel that it was not fitted to is judged, against placebos.
Parts are whole recordings where there are several, else fifths of one. A part is predicted by the
others with the law and without it, named causes, inertial errors and other laws free in both: a
law is not credited with what is theirs, nor is a slow one lost to errors that a part alone allows
and all others do not.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.laws.grammar import quantity, unit_of
from ...effects.laws.learned_torque import LearnedTorque
from ...estimation.inference.evidence import Fold, Gram, score, sum_of
from ...estimation.inference.placebo import DRAWS, SEED, shuffle
from ...estimation.inference.spectral_terms import rows_of
from ...model.robot import Robot
from ...types import Array
from ..answer.cause import Estimated
from ..answer.result import LawRival, Leftover
from .arm_channels import JointChannel
from .discovery_limits import (
    AGREEING,
    BEYOND_PLACEBO,
    CHANCE,
    DEAD_HEAT,
    HELD_OUT,
    NEEDS_OTHER,
    OWN_SHARE,
    UNSETTLED,
)
from .law_search import LawSearch, Winner, columns_of
from .possible_laws import NO_LAWS, Law, others_of

_NOTHING_MEASURED = 'nothing measured'
_FREE = 1e-6  # precision of coefficients without a prior, of columns of unit size
_WIDE = 1e3  # prior deviation of a law's coefficients, of columns of unit size


@dataclass(frozen=True, slots=True)
class LeftOut:
    """What a law does for parts that it was not fitted to.

    Args:
        inside: Share of the squares of all parts that it explains, fitted to them.
        share: The same of parts that it was not fitted to, as the others predict them.
        placebo: The same of the best columns without meaning.
        agreeing: Share of parts that it explains anything of.
        left: Squares that it leaves of parts that it was not fitted to.
    """

    inside: float
    share: float
    placebo: float
    agreeing: float
    left: float


@dataclass(frozen=True, slots=True, eq=False)
class HeldLaw:
    """A law that a channel wants, with what it does for parts that it was not fitted to."""

    place: str
    step: Winner
    left_out: LeftOut

    @property
    def law(self) -> Law:
        """The law itself."""
        return self.step.law


def laws_of(channel: JointChannel, chance: float = CHANCE) -> tuple[list[HeldLaw], list[Winner]]:
    """Laws that hold; and what else won: sines of the time, inertial errors, what does not."""
    search = LawSearch(channel, chance)
    steps = settled(search, search.run())
    held = _held(search, steps)
    kept = [it.step for it in held]
    return held, [step for step in steps if not any(step is k for k in kept)]


def leftover_without(place: str, step: Winner | None, joints: Sequence[str]) -> Leftover:
    """What to say of a channel without a law.

    Args:
        place: The joint.
        step: What won there all the same.
        joints: Of the robot.
    """
    nothing = Leftover(
        channel=f'joint_torque/{place}',
        depends_on=(_NOTHING_MEASURED,),
        resembles='no function of what is measured',
    )
    if step is None:
        return nothing
    law, p_value = step.law, step.p_value
    if step.is_law:
        but = 'other parts of the data do not repeat it'
        if step.doubt > UNSETTLED:
            but = 'a law of other variables may do as well'
        seems = f'seems to be {law.resembles}, but {but}'
        return replace(nothing, resembles=seems, p_value=p_value)
    if law.kind == 'inertial':
        return replace(nothing, resembles=law.resembles, p_value=p_value)
    unknown = f'a function of time, or of an input that nobody measured: {law.in_words}'
    rivals = _rivals([r for r in step.rivals if r[0].kind not in NO_LAWS], joints)
    return replace(
        nothing, depends_on=('time',), resembles=unknown, p_value=p_value, rivals=rivals
    )


def _rivals(rivals: Iterable[tuple[Law, float]], joints: Sequence[str]) -> tuple[LawRival, ...]:
    return tuple(
        LawRival(form=law.form.name, depends_on=_ordered(law.inputs, joints), gap=gap)
        for law, gap in rivals
    )


def _held(search: LawSearch, steps: list[Winner]) -> list[HeldLaw]:
    """Laws that predict what they were not fitted to; the weakest of others goes first."""
    while True:
        parts = _Parts(search.channel, steps)
        judged = [
            HeldLaw(
                search.channel.place,
                step,
                parts.judge(step.columns, [s for s in steps if s is not step]),
            )
            for step in steps
            if step.is_law
        ]
        failing = [it for it in judged if not _is_held(it, search, parts, steps)]
        if not failing:
            return judged
        weakest = min(failing, key=lambda it: it.left_out.share).step
        steps = [step for step in steps if step is not weakest]


def _is_held(it: HeldLaw, search: LawSearch, parts: _Parts, steps: Sequence[Winner]) -> bool:
    out = it.left_out
    if it.step.doubt > UNSETTLED or out.agreeing < AGREEING:
        return False
    if out.share < max(HELD_OUT, out.placebo + BEYOND_PLACEBO):
        return False
    if not others_of(it.law, it.place):
        return True
    others = [step for step in steps if step is not it.step]
    own = search.best_of(
        others, lambda law: law.kind not in NO_LAWS and not others_of(law, it.place)
    )
    if own is None:
        return True
    alone = parts.judge(own, others, has_placebo=False)
    if 0.5 * len(search.terms.data) * math.log(alone.left / out.left) > DEAD_HEAT:
        return True
    return out.left <= NEEDS_OTHER * alone.left or alone.share <= OWN_SHARE * out.share


def leftover_of(
    it: HeldLaw,
    values: Sequence[float] | Array,
    spread: Array,
    robot: Robot,
    *,
    applied: LearnedTorque | None,
    is_of_several: bool,
) -> Leftover:
    """A law with all that speaks for it.

    Args:
        it: The law as it was judged.
        values: (k,) of its coefficients.
        spread: (k,) their standard deviations.
        robot: The robot.
        applied: As it is simulated; None where it is not worth it.
        is_of_several: Whether whole recordings were left out.
    """
    form, inputs, joints = it.law.form, it.law.inputs, robot.joints
    unit = robot.unit_of('N m', it.place)
    bodies = zip(joints, robot.bodies[1:], strict=True)
    sliding = [joint for joint, body in bodies if body.is_prismatic]
    coefficients = tuple(
        Estimated(value=float(c), std=float(std), unit=unit_of(powers, inputs, unit, sliding))
        for c, std, powers in zip(values, spread, form.powers, strict=True)
    )
    return Leftover(
        channel=f'joint_torque/{it.place}',
        depends_on=_ordered(inputs, joints),
        form=form.name,
        coefficients=coefficients,
        resembles=it.law.resembles,
        kind=it.law.kind if applied is None else applied.guard.kind,
        p_value=it.step.p_value,
        share=it.left_out.inside,
        held_out_gain=it.left_out.share,
        placebo_gain=it.left_out.placebo,
        other_recording=it.left_out.share if is_of_several else None,
        rivals=_rivals(it.step.rivals, joints),
        applied=applied,
    )


def _ordered(inputs: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Inputs in the order of the joints."""
    places = {joint: k for k, joint in enumerate(joints)}
    return tuple(sorted(inputs, key=lambda name: places.get(quantity(name)[1], -1)))


class _Parts:
    """A channel's rows, white under the level that laws leave, part by part.

    Args:
        channel: The channel.
        chosen: All laws.
    """

    def __init__(self, channel: JointChannel, chosen: Sequence[Winner]) -> None:
        terms = channel.terms
        self._part, self._times = channel.part, channel.times
        self._scale = terms.level(columns_of(chosen, len(terms.data))).scale
        self._data, self._nuisance = self._rows(terms.data), self._rows(terms.nuisance)

    def judge(
        self, columns: Array, others: Sequence[Winner], *, has_placebo: bool = True
    ) -> LeftOut:
        """What (M, k) columns do beside other laws."""
        beside = _normed(self._rows(columns_of(others, len(columns))))
        nuisance = np.concatenate([self._nuisance, beside], axis=1)
        count = self._nuisance.shape[1]
        precision = np.concatenate([np.ones(count), np.full(beside.shape[1], _FREE)])
        own = _normed(self._rows(columns))
        out = self._judged(nuisance, precision, own)
        if not has_placebo:
            return out
        rng, best = np.random.default_rng(SEED), 0.0
        for _ in range(DRAWS):
            order, signs = shuffle(self._times, rng)
            best = max(best, self._judged(nuisance, precision, signs[:, None] * own[order]).share)
        return LeftOut(out.inside, out.share, best, out.agreeing, out.left)

    def _judged(self, nuisance: Array, precision: Array, own: Array) -> LeftOut:
        """What (R, k) columns do beside what is free, (R, K) with a prior precision (K,)."""
        rows = np.concatenate([nuisance, own], axis=1)
        kept = [self._part == k for k in np.unique(self._part)]
        parts = [Gram.of(rows[at], self._data[at]) for at in kept]
        whole, sizes = sum_of(parts), np.full(own.shape[1], _WIDE)
        every = whole.without(len(precision), precision)
        rests = [(whole - part).without(len(precision), precision) for part in parts]
        free = (np.full(len(sizes), -np.inf), np.full(len(sizes), np.inf))
        found = [Fold(rest, every - rest) for rest in rests]
        gains = np.array([score(f.rest, sizes, free, f.part).held_out for f in found])
        square = sum(f.part.square for f in found)
        return LeftOut(
            inside=score(every, sizes, free, None).gain / every.square,
            share=float(np.sum(gains)) / square,
            placebo=0.0,
            agreeing=float(np.mean(gains > 0.0)),
            left=square - float(np.sum(gains)),
        )

    def _rows(self, terms: Array) -> Array:
        return rows_of((terms.T / self._scale).T, len(self._times))


def _normed(columns: Array) -> Array:
    return columns / np.maximum(np.sqrt(np.mean(columns**2, axis=0)), 1e-300)


def settled(search: LawSearch, chosen: Sequence[Winner]) -> list[Winner]:
    """The same laws of the joints of which they explain most; what comes close is their rival.

    Where two other joints move alike, the first law may be of the wrong one, and the next ones of
    it mend what that leaves.

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
