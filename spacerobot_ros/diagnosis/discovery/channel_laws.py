"""Laws of one channel that hold, and what is said of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.grammar import quantity, unit_of
from ...effects.learned_torque import LearnedTorque
from ...types import Array
from ..answer.result import Estimated, LawRival, Leftover
from .discovery_limits import AGREEING, BEYOND_PLACEBO, HELD_OUT, NEEDS_OTHER, ONE_SPEED
from .law_search import LawSearch, SearchedChannel, Winner
from .left_out import LeftOut, Parts
from .possible_laws import Law, is_of_another

TIME = 'time'
NOTHING_MEASURED = 'nothing measured'
_WHOLE = ('attitude', 'base_rate')  # vectors: said as one


@dataclass(frozen=True, slots=True, eq=False)
class HeldLaw:
    """A law that a channel wants, with what it does for parts that it was not fitted to."""

    place: str
    step: Winner
    law: Law
    left_out: LeftOut


def channel_name(place: str) -> str:
    """As in `Residual`: of a joint, or of an axis of the base."""
    base, _, axis = place.rpartition('/')
    return f'base_torque/{axis}' if base else f'joint_torque/{place}'


def laws_of(channel: SearchedChannel) -> tuple[list[HeldLaw], Leftover]:
    """Laws that hold, and what to say where there are none."""
    search = LawSearch(channel)
    steps = search.run()
    chosen = [step for step in steps if step.is_law]
    kept = _held(search, channel, chosen)
    nothing = Leftover(
        channel=channel_name(channel.place),
        depends_on=(NOTHING_MEASURED,),
        resembles='no function of what is measured',
        one_speed=_has_one_speed(channel),
    )
    if kept or not steps:
        return kept, nothing
    last = steps[-1]
    if last.is_law and last.law is not None:
        seems = f'seems to be {last.law.resembles}, but other parts of the data do not repeat it'
        return [], replace(nothing, resembles=seems, p_value=last.p_value)
    if last.law is not None and last.law.kind == 'inertial':
        return [], replace(nothing, resembles=last.law.resembles, p_value=last.p_value)
    what = last.name or (last.law.resembles if last.law else '')
    unknown = f'a function of time, or of an input that nobody measured: {what}'
    return [], replace(nothing, depends_on=(TIME,), resembles=unknown, p_value=last.p_value)


def _held(search: LawSearch, channel: SearchedChannel, chosen: list[Winner]) -> list[HeldLaw]:
    """Laws that predict what they were not fitted to; the weakest of others goes first."""
    while chosen:
        parts = Parts(channel, chosen)
        judged = [
            HeldLaw(
                channel.place,
                step,
                step.law,
                parts.judge(step.columns, [s for s in chosen if s is not step]),
            )
            for step in chosen
            if step.law is not None
        ]
        failing = [it for it in judged if not _is_held(it, search, channel, parts, chosen)]
        if not failing:
            return judged
        chosen = [
            s for s in chosen if s is not min(failing, key=lambda it: it.left_out.share).step
        ]
    return []


def _is_held(
    it: HeldLaw,
    search: LawSearch,
    channel: SearchedChannel,
    parts: Parts,
    chosen: Sequence[Winner],
) -> bool:
    out = it.left_out
    if out.share < HELD_OUT or out.share < out.placebo + BEYOND_PLACEBO or out.agreeing < AGREEING:
        return False
    if not is_of_another(it.law, channel.place):
        return True
    others = [step for step in chosen if step is not it.step]
    own = search.best_of(others, lambda law: not is_of_another(law, channel.place))
    if own is None:
        return True
    return out.left <= NEEDS_OTHER * parts.judge(own, others, has_placebo=False).left


def _has_one_speed(channel: SearchedChannel) -> bool:
    if not len(channel.speed):
        return False
    low, middle, high = np.quantile(channel.speed, [0.05, 0.5, 0.95])
    return bool(high - low < ONE_SPEED * middle)


def said_of(
    it: HeldLaw,
    law: LearnedTorque | None,
    spread: Array | None,
    joints: Sequence[str],
    *,
    is_of_several: bool,
) -> Leftover:
    """A law with all that speaks for it.

    Args:
        it: The law as it was judged.
        law: As it is simulated; None where it is not worth it.
        spread: (k,) standard deviations of its coefficients.
        joints: All, in their order.
        is_of_several: Whether whole recordings were left out.
    """
    form, inputs = it.law.form, it.law.inputs
    coefficients: tuple[Estimated, ...] = ()
    if law is not None and spread is not None:
        coefficients = tuple(
            Estimated(value=c, std=float(std), unit=unit_of(powers, inputs))
            for c, std, powers in zip(law.coefficients, spread, form.powers, strict=True)
        )
    return Leftover(
        channel=channel_name(it.place),
        depends_on=_ordered(inputs, joints),
        form=form.name,
        coefficients=coefficients,
        resembles=it.law.resembles,
        kind=it.law.kind,
        p_value=it.step.p_value,
        share=it.left_out.inside,
        held_out_gain=it.left_out.share,
        placebo_gain=it.left_out.placebo,
        other_recording=it.left_out.share if is_of_several else None,
        rivals=tuple(
            LawRival(form=r.form.name, depends_on=_ordered(r.inputs, joints), gap=gap)
            for r, gap in it.step.rivals
        ),
        applied=law,
    )


def _ordered(inputs: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Inputs in the order of the joints."""
    places = {joint: k for k, joint in enumerate(joints)}
    words = dict.fromkeys(q if (q := quantity(name)[0]) in _WHOLE else name for name in inputs)
    return tuple(sorted(words, key=lambda name: places.get(quantity(name)[1], -1)))
