"""What an arm's leftover depends on: laws searched, judged, fitted beside the causes, said."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.grammar import quantity, unit_of
from ...effects.learned_torque import LearnedTorque
from ...types import Array
from ..answer.result import Estimated, LawRival, Leftover
from ..arms import ArmFound, rms
from .arm_channels import ArmMotions, JointChannel
from .discovery_limits import AGREEING, BEYOND_PLACEBO, FED_IN, HELD_OUT, NEEDS_OTHER, ONE_SPEED
from .fitted_laws import LawCandidate, applied_law, candidate_of, with_laws
from .law_search import LawSearch, Winner
from .left_out import LeftOut, Parts
from .possible_laws import Law, is_of_another

TIME = 'time'
NOTHING_MEASURED = 'nothing measured'
_AGREE = 3.0  # standard deviations


@dataclass(frozen=True, slots=True, eq=False)
class HeldLaw:
    """A law that a channel wants, with what it does for parts that it was not fitted to."""

    j: int
    step: Winner
    law: Law
    left_out: LeftOut


def discover(
    found: ArmFound, report: Callable[[str, float], None]
) -> tuple[ArmFound, tuple[Leftover, ...]]:
    """The causes with laws beside them, and what is to be said of every joint that moves."""
    motions = ArmMotions(found.fit.rows)
    accepted: list[HeldLaw] = []
    said: list[Leftover] = []
    rows = found.fit.rows
    moving = [j for j in range(rows.robot.n_joints) if len(rows.joints[j].torque)]
    for count, j in enumerate(moving):
        report('asking what the leftover depends on', 0.85 + 0.05 * count / len(moving))
        channel = JointChannel(motions, j, found.levels[j], found.fit.deviations)
        laws, without = _of_channel(channel)
        accepted += laws
        said += [] if laws else [without]
    if not accepted:
        return found, tuple(said)
    extended, held = _applied(found, accepted, motions)
    return extended, tuple(sorted([*held, *said], key=lambda entry: entry.channel))


def _of_channel(channel: JointChannel) -> tuple[list[HeldLaw], Leftover]:
    """Laws that hold, and what to say where there are none."""
    search = LawSearch(channel)
    steps = search.run()
    chosen = [step for step in steps if step.is_law]
    kept = _held(search, channel, chosen)
    name = f'joint_torque/{channel.joint}'
    nothing = Leftover(
        channel=name,
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


def _held(search: LawSearch, channel: JointChannel, chosen: list[Winner]) -> list[HeldLaw]:
    """Laws that predict what they were not fitted to; the weakest of others goes first."""
    while chosen:
        parts = Parts(channel, chosen, channel.part, channel.times)
        judged = [
            HeldLaw(
                channel.j,
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
    it: HeldLaw, search: LawSearch, channel: JointChannel, parts: Parts, chosen: Sequence[Winner]
) -> bool:
    out = it.left_out
    if out.share < HELD_OUT or out.share < out.placebo + BEYOND_PLACEBO or out.agreeing < AGREEING:
        return False
    if not is_of_another(it.law, channel.joint):
        return True
    others = [step for step in chosen if step is not it.step]
    own = search.best_of(others, lambda law: not is_of_another(law, channel.joint))
    if own is None:
        return True
    return out.left <= NEEDS_OTHER * parts.judge(own, others, has_placebo=False).left


def _has_one_speed(channel: JointChannel) -> bool:
    low, middle, high = np.quantile(channel.speed, [0.05, 0.5, 0.95])
    return bool(high - low < ONE_SPEED * middle)


def _applied(
    found: ArmFound, accepted: Sequence[HeldLaw], motions: ArmMotions
) -> tuple[ArmFound, list[Leftover]]:
    """All of them fitted with the causes; what feeds energy in or makes a joint worse is left."""
    alone = [candidate_of(it.law, it.j, motions) for it in accepted]
    candidates = _coupled(found, accepted, alone, motions)
    pairs = [(it, c) for it, c in zip(accepted, candidates, strict=True) if c is not None]
    before = rms(found.extended)
    while True:
        fitted, numbers = with_laws(found, [c for _, c in pairs])
        frees = fitted.fit.effects(numbers)
        laws = [
            applied_law(it.law, free, motions)
            for (it, _), free in zip(pairs, frees, strict=True)
            if isinstance(free, LearnedTorque)
        ]
        fitted = replace(fitted, learned=tuple(laws))
        refused = [k for k, law in enumerate(laws) if _pushes(law, motions)]
        if not refused and pairs:
            worse = np.flatnonzero(rms(fitted.extended) > before).tolist()
            refused = [k for k, (it, _) in enumerate(pairs) if it.j in worse]
        if not refused:
            break
        pairs = [pair for k, pair in enumerate(pairs) if k not in refused]
    said = [
        _said(it, law, fitted.fit.spread(i), motions)
        for (it, _), law, i in zip(pairs, laws, numbers, strict=True)
    ]
    kept = {id(it) for it, _ in pairs}
    said += [_said(it, None, None, motions) for it in accepted if id(it) not in kept and it.j >= 0]
    return fitted, said


def _coupled(
    found: ArmFound,
    accepted: Sequence[HeldLaw],
    candidates: Sequence[LawCandidate],
    motions: ArmMotions,
) -> list[LawCandidate | None]:
    """Friction of a sum of rates acts on both joints where both channels agree on it."""
    out: list[LawCandidate | None] = list(candidates)
    joints = motions.rows.robot.joints
    for n, it in enumerate(accepted):
        ratio = it.law.form.ratio
        if not ratio or out[n] is None:
            continue
        other = quantity(it.law.inputs[1])[1]
        k = joints.index(other)
        turned = replace(it.law, inputs=it.law.inputs[::-1])
        both = [candidates[n], candidate_of(turned, k, motions)]
        fitted, numbers = with_laws(found, both)
        # of x - y both sine and coefficients turn round with the joints
        here, there = (fitted.fit.values[fitted.fit.rows.places[i]] for i in numbers)
        spread = np.hypot(*(fitted.fit.spread(i) for i in numbers))
        if np.all(np.abs(here - there) <= _AGREE * spread):
            out[n] = candidate_of(it.law, it.j, motions, react=other)
            for m, far in enumerate(accepted):
                if (
                    far.j == k
                    and far.law.form.ratio == ratio
                    and set(far.law.inputs) == set(it.law.inputs)
                ):
                    out[m] = None
    return out


def _pushes(law: LearnedTorque, motions: ArmMotions) -> bool:
    """Whether friction, as it was fitted, feeds in more power than fits may."""
    if law.kind != 'dissipative' or law.form.has_history:
        return bool(law.form.has_history and law.coefficients[0] >= 0.0)
    free = replace(law, kind='external')
    given, taken = 0.0, 0.0
    for balance in motions.rows.balances:
        motion = balance.motion
        power = np.sum(free.force(motion, np.zeros((len(motion), 0))) * motion.rates, axis=1)
        given += float(np.sum(np.maximum(power, 0.0)))
        taken += float(np.sum(np.maximum(-power, 0.0)))
    return given > FED_IN * (given + taken)


def _said(
    it: HeldLaw, law: LearnedTorque | None, spread: Array | None, motions: ArmMotions
) -> Leftover:
    """A law with all that speaks for it."""
    joints = motions.rows.robot.joints
    form, inputs = it.law.form, it.law.inputs
    coefficients: tuple[Estimated, ...] = ()
    if law is not None and spread is not None:
        coefficients = tuple(
            Estimated(value=c, std=float(std), unit=unit_of(powers, inputs))
            for c, std, powers in zip(law.coefficients, spread, form.powers, strict=True)
        )
    several = len(motions.rows.balances) > 1
    return Leftover(
        channel=f'joint_torque/{joints[it.j]}',
        depends_on=_ordered(inputs, joints),
        form=form.name,
        coefficients=coefficients,
        resembles=it.law.resembles,
        kind=it.law.kind,
        p_value=it.step.p_value,
        share=it.left_out.inside,
        held_out_gain=it.left_out.share,
        placebo_gain=it.left_out.placebo,
        other_recording=it.left_out.share if several else None,
        rivals=tuple(
            LawRival(form=r.form.name, depends_on=_ordered(r.inputs, joints), gap=gap)
            for r, gap in it.step.rivals
        ),
        applied=law,
    )


def _ordered(inputs: Sequence[str], joints: Sequence[str]) -> tuple[str, ...]:
    """Inputs in the order of the joints."""
    places = {joint: k for k, joint in enumerate(joints)}
    return tuple(sorted(inputs, key=lambda name: places.get(quantity(name)[1], -1)))
