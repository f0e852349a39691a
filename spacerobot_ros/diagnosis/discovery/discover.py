"""What an arm's leftover depends on: laws found, fitted beside the causes, said."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...effects.laws.grammar import quantity, unit_of
from ...effects.laws.learned_torque import LearnedTorque
from ...estimation.balance.balance import Balance, rms
from ...inference.decisive import NAMED
from ...types import Array
from ..answer.cause import Estimated
from ..answer.result import LawRival, Leftover
from ..arms.arm_found import WORSE, ArmFound, without_harm
from ..arms.arms import levels_of
from ..arms.fitted_arm import FittedArm
from ..limits import CHANCE
from .law_candidate import LawCandidate, applied_law, guarded
from .law_search import FoundLaw, LawSearch
from .possible_laws import NO_LAWS

_NOTHING_MEASURED = 'nothing measured'


def discover(
    found: ArmFound, report: Callable[[str, float], None]
) -> tuple[ArmFound, tuple[Leftover, ...]]:
    """The causes with laws beside them, and what is to be said of every motor that moves.

    Of a joint without one what is left is of its motion, of which no torque is a function.
    """
    report('asking what the leftover depends on', 0.85)
    search = LawSearch(found)
    every = search.run()
    laws = [law for law in every if law.candidate.of.kind not in NO_LAWS]
    said = [law for law in laws if doubt(law, search) <= math.exp(-NAMED)]
    extended, entries = _applied(found, said, search) if said else (found, [])
    joints = found.robot.joints
    rest = {joint: [law for law in every if law.candidate.where == joint] for joint in joints}
    told = {entry.channel for entry in entries}
    entries += [
        _without_law(joint, rest[joint], search)
        for joint in (joints[j] for j in search.moving)
        if _channel(joint) not in told
    ]
    slow = {_channel(joints[j]) for j in search.moving if search.motions.has_one_speed(j)}
    entries = [replace(entry, one_speed=entry.channel in slow) for entry in entries]
    return extended, tuple(sorted(entries, key=lambda entry: entry.channel))


def _channel(joint: str) -> str:
    return f'joint_torque/{joint}'


def doubt(found: FoundLaw, search: LawSearch) -> float:
    """Odds of a cause in its place, or of laws with neither some of its variables nor more."""
    own, out = set(found.candidate.of.inputs), 0.0
    for other in found.inferred.rivals:
        laws = search.laws_of(other.causes)
        theirs = set().union(*(law.inputs for law in laws))
        if len(laws) < len(other.causes) or not (theirs <= own or own <= theirs):
            out += math.exp(-other.log_odds)
    return out


def _without_law(joint: str, chosen: Sequence[FoundLaw], search: LawSearch) -> Leftover:
    """What to say of a channel without a law, of which something may have been chosen."""
    nothing = Leftover(
        channel=_channel(joint),
        depends_on=(_NOTHING_MEASURED,),
        resembles='no function of what is measured',
    )
    if not chosen:
        seems, but = search.unrepeated.get(joint), 'other parts of the data do not repeat it'
        return replace(nothing, resembles=f'seems to be {seems}, but {but}') if seems else nothing
    best = max(chosen, key=lambda law: law.inferred.log_odds)
    law = best.candidate.of
    if law.kind not in NO_LAWS:
        seems = f'seems to be {law.resembles}, but a law of other variables may do as well'
        return replace(nothing, resembles=seems, p_value=best.chance)
    if law.kind == 'inertial':
        return replace(nothing, resembles=law.resembles, p_value=best.chance)
    return replace(
        nothing,
        depends_on=('time',),
        resembles=f'a function of time, or of an input that nobody measured: {law.in_words}',
        p_value=best.chance,
        rivals=_law_rivals(best, search),
    )


def _law_rivals(found: FoundLaw, search: LawSearch) -> tuple[LawRival, ...]:
    is_law = found.candidate.of.kind not in NO_LAWS
    return tuple(
        LawRival(
            form=law.form.name,
            depends_on=_ordered(law.inputs, search.robot.joints),
            gap=other.log_odds,
        )
        for other in found.inferred.rivals
        for law in search.laws_of(other.causes)
        if is_law or law.kind not in NO_LAWS
    )


def _ordered(inputs: Iterable[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Inputs in the order of the joints."""
    places = {joint: k for k, joint in enumerate(joints)}
    return tuple(sorted(inputs, key=lambda name: places.get(quantity(name)[1], -1)))


def _applied(
    found: ArmFound, laws: Sequence[FoundLaw], search: LawSearch
) -> tuple[ArmFound, list[Leftover]]:
    """All of them fitted with the causes; what feeds energy in or makes a joint worse is left."""
    before, joints = rms(found.extended), found.robot.joints
    along = [balance.motion for balance in search.motions.balances]
    refused: list[Leftover] = []
    kept = [*laws]
    while True:
        gone = search.given_way([it.candidate for it in kept])
        fitted, numbers = with_laws(
            found, [it.candidate for it in kept], search.motions.balances, gone
        )
        frees = [e for e in fitted.fit.effects(numbers) if isinstance(e, LearnedTorque)]
        friction = _frictions(fitted)
        as_applied = [
            guarded(applied_law(it.candidate, free, search.motions), friction, along)
            for it, free in zip(kept, frees, strict=True)
        ]
        known = tuple(law for law in as_applied if law is not None)
        fitted = without_harm(replace(fitted, learned=known))
        worse = rms(fitted.extended) > WORSE * before
        is_refused = (fitted.ratios > WORSE).any()
        is_out = [
            law is None
            or worse[joints.index(str(law.where))]
            or is_refused
            or fitted.fit.chance(i) >= CHANCE
            for law, i in zip(as_applied, numbers, strict=True)
        ]
        entries = [
            _entry(it, [*free.values.values()], fitted.fit.spread(i), search, None if out else law)
            for it, free, law, i, out in zip(kept, frees, as_applied, numbers, is_out, strict=True)
        ]
        if not any(is_out):
            return fitted, [*entries, *refused]
        for it, entry, out in zip(kept, entries, is_out, strict=True):
            # of a law that is not applied causes are not said to have given way
            if out and not search.given_way([it.candidate]):
                refused.append(entry)
        kept = [it for it, out in zip(kept, is_out, strict=True) if not out]


def _frictions(found: ArmFound) -> dict[str, list[Effect]]:
    """Friction that the model has at every joint, named or not."""
    out: dict[str, list[Effect]] = {}
    for effect in (*found.believed, *found.named, *found.calibration):
        if effect.id.endswith('_friction'):
            out.setdefault(str(effect.where), []).append(effect)
    return out


def with_laws(
    found: ArmFound,
    laws: Sequence[LawCandidate],
    balances: Sequence[Balance],
    dropped: Collection[int] = (),
) -> tuple[ArmFound, list[int]]:
    """Causes and laws fitted together, and the laws' numbers among the candidates.

    Args:
        found: The causes.
        laws: The laws.
        balances: The model with all that was found along each recording.
        dropped: Numbers of the causes in whose place they stand.
    """
    causes = [i for i in found.fit.chosen if i not in dropped]
    first = len(found.fit.rows.candidates)
    numbers = list(range(first, first + len(laws)))
    rows = found.fit.rows.with_more(laws, balances)
    both = [*causes, *numbers]
    levels = levels_of(rows, FittedArm.of(rows, [*found.levels], both))
    fit = FittedArm.of(rows, levels, both)
    out = replace(found, fit=fit, levels=np.array(levels))
    clear = tuple(i for i in causes if i in found.clear and fit.chance(i) < CHANCE)
    unclear = [i for i in causes if i not in clear]
    out = replace(
        out,
        clear=clear,
        named=tuple(fit.effects(clear)),
        calibration=tuple(fit.effects([*unclear, *fit.calibration])),
    )
    return out, numbers


def _entry(
    it: FoundLaw,
    values: Sequence[float],
    spread: Array,
    search: LawSearch,
    applied: LearnedTorque | None,
) -> Leftover:
    """A law with all that speaks for it, as it is simulated where that is worth it."""
    law, robot, where = it.candidate.of, search.robot, str(it.candidate.where)
    unit = robot.unit_of('N m', where)
    bodies = zip(robot.joints, robot.bodies[1:], strict=True)
    sliding = [joint for joint, body in bodies if body.is_prismatic]
    coefficients = tuple(
        Estimated(value=float(c), std=float(std), unit=unit_of(powers, law.inputs, unit, sliding))
        for c, std, powers in zip(values, spread, law.form.powers, strict=True)
    )
    is_of_several = len(search.motions.balances) > 1
    return Leftover(
        channel=_channel(where),
        depends_on=_ordered(law.inputs, robot.joints),
        form=law.form.name,
        coefficients=coefficients,
        resembles=law.resembles,
        kind=law.kind if applied is None else applied.guard.kind,
        p_value=it.chance,
        share=it.share,
        held_out_gain=it.held_out,
        other_recording=it.held_out if is_of_several else None,
        rivals=_law_rivals(it, search),
        applied=applied,
    )
