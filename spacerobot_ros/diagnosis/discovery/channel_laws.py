"""Laws of one channel that hold, and what is said of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from ...effects.laws.formula_quantities import is_axis
from ...effects.laws.grammar import quantity, unit_of
from ...effects.laws.learned_torque import LearnedTorque
from ...estimation.filters.prediction_rows import LABELS
from ...model.robot import Robot
from ...types import Array
from ..answer.cause import Estimated
from ..answer.result import LawRival, Leftover
from .discovery_limits import (
    AGREEING,
    BEYOND_PLACEBO,
    CHANCE,
    DEAD_HEAT,
    HELD_OUT,
    NEEDS_OTHER,
    OF_TERMS,
    OWN_SHARE,
    UNSETTLED,
)
from .law_search import LawSearch, SearchedChannel, Winner
from .left_out import LeftOut, Parts
from .possible_laws import NAMED, NO_LAWS, Law, others_of
from .which_joint import settled

TIME = 'time'
NOTHING_MEASURED = 'nothing measured'
_WHOLE = ('attitude', 'base_rate')  # vectors: said as one
_UNITS = dict(LABELS.values())  # of sensors


@dataclass(frozen=True, slots=True, eq=False)
class HeldLaw:
    """A law that a channel wants, with what it does for parts that it was not fitted to."""

    place: str
    step: Winner
    law: Law
    left_out: LeftOut


def channel_name(place: str) -> str:
    """As in `Residual`: of a joint, of an axis of the base, or of a sensor."""
    if place.partition('/')[0] in _UNITS:
        return place
    return f'base_torque/{place[-1]}' if is_axis(place) else f'joint_torque/{place}'


def _unit(channel: str, robot: Robot) -> str:
    kind, _, place = channel.partition('/')
    unit = _UNITS.get(kind, 'N m')
    return robot.unit_of(unit, place) if place in robot.joints else unit


def laws_of(
    channel: SearchedChannel, chance: float = CHANCE
) -> tuple[list[HeldLaw], list[Winner]]:
    """Laws that hold; and what else won: sines of the time, inertial errors, what does not."""
    search = LawSearch(channel, chance)
    steps = search.run()
    if channel.place:  # in flight laws have places of their own
        steps = settled(search, steps)
    held = _held(search, channel, list(steps))
    kept = [it.step for it in held]
    return held, [step for step in steps if not any(step is k for k in kept)]


def leftover_without(place: str, step: Winner | None, joints: Sequence[str]) -> Leftover:
    """What to say of a channel without a law.

    Args:
        place: Joint, or axis of the base.
        step: What won there all the same.
        joints: Of the robot.
    """
    nothing = Leftover(
        channel=channel_name(place),
        depends_on=(NOTHING_MEASURED,),
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
    return replace(nothing, depends_on=(TIME,), resembles=unknown, p_value=p_value, rivals=rivals)


def may_be_named(it: HeldLaw) -> bool:
    """Whether a law is what a cause of the catalogue is, or two are, or may as well be."""
    every = (it.law, *(law for law, _ in it.step.rivals))
    return any(law.form.name in NAMED and not others_of(law, it.place) for law in every)


def _rivals(rivals: Iterable[tuple[Law, float]], joints: Sequence[str]) -> tuple[LawRival, ...]:
    return tuple(
        LawRival(form=law.form.name, depends_on=_ordered(law.inputs, joints), gap=gap)
        for law, gap in rivals
    )


def _held(search: LawSearch, channel: SearchedChannel, steps: list[Winner]) -> list[HeldLaw]:
    """Laws that predict what they were not fitted to; the weakest of others goes first."""
    while True:
        parts = Parts(channel, steps)
        judged = [
            HeldLaw(
                step.law.place or channel.place,
                step,
                step.law,
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


def _is_held(it: HeldLaw, search: LawSearch, parts: Parts, steps: Sequence[Winner]) -> bool:
    out = it.left_out
    if it.step.doubt > UNSETTLED:
        return False
    in_flight = not search.channel.place  # noise is known there, and squares over it are nats
    of = min(1.0, OF_TERMS / len(search.terms.data)) if in_flight else 1.0
    if out.share < of * HELD_OUT or out.share < out.placebo + of * BEYOND_PLACEBO:
        return False
    if out.agreeing < AGREEING:
        return False
    if not others_of(it.law, it.place):
        return True
    others = [step for step in steps if step is not it.step]

    def is_own(law: Law) -> bool:
        is_law = law.kind not in NO_LAWS
        return is_law and law.place == it.law.place and not others_of(law, it.place)

    own = search.best_of(others, is_own)
    if own is None:
        return True
    alone = parts.judge(own, others, has_placebo=False)
    if in_flight:
        return alone.left - out.left > 2.0 * DEAD_HEAT
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
    channel = channel_name(it.place)
    unit = _unit(channel, robot)
    bodies = zip(joints, robot.bodies[1:], strict=True)
    sliding = [joint for joint, body in bodies if body.is_prismatic]
    coefficients = tuple(
        Estimated(value=float(c), std=float(std), unit=unit_of(powers, inputs, unit, sliding))
        for c, std, powers in zip(values, spread, form.powers, strict=True)
    )
    return Leftover(
        channel=channel,
        depends_on=_ordered(inputs, joints),
        form=form.name,
        coefficients=coefficients,
        resembles=it.law.resembles,
        kind=it.law.kind if applied is None else applied.kind,
        p_value=it.step.p_value,
        share=it.left_out.inside,
        held_out_gain=it.left_out.share,
        placebo_gain=it.left_out.placebo,
        other_recording=it.left_out.share if is_of_several else None,
        rivals=_rivals(it.step.rivals, joints),
        applied=applied,
    )


def _ordered(inputs: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Inputs in the order of the joints; several components of a vector are said as one."""
    places = {joint: k for k, joint in enumerate(joints)}
    kinds = [quantity(name)[0] for name in inputs]
    words = dict.fromkeys(
        kind if kind in _WHOLE and kinds.count(kind) > 1 else name
        for kind, name in zip(kinds, inputs, strict=True)
    )
    return tuple(sorted(words, key=lambda name: places.get(quantity(name)[1], -1)))
