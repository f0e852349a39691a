"""What an arm's leftover depends on: laws searched, judged, fitted beside the causes, said."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...effects.laws.grammar import quantity
from ...effects.laws.learned_torque import LearnedTorque
from ...effects.motion import Motion
from ...estimation.balance.balance import rms
from ..answer.result import Leftover
from ..arms.arm_found import WORSE, ArmFound, without_harm
from ..limits import CHANCE as NO_CHANCE
from .arm_channels import REPLACEABLE, ArmMotions, JointChannel
from .channel_laws import (
    HeldLaw,
    laws_of,
    leftover_of,
    leftover_without,
)
from .discovery_limits import CHANCE, FED_IN, MARGIN
from .fitted_laws import SAME, LawCandidate, applied_law, candidate_of, with_laws
from .law_search import Winner, worth
from .possible_laws import Law

_AGREE = 3.0  # standard deviations


def discover(
    found: ArmFound, report: Callable[[str, float], None]
) -> tuple[ArmFound, tuple[Leftover, ...]]:
    """The causes with laws beside them, and what is to be said of every motor that moves.

    Of a joint without one what is left is of its motion, of which no torque is a function.
    """
    motions = ArmMotions(found.fit.rows, found.extended)
    accepted: list[HeldLaw] = []
    entries: list[Leftover] = []
    replaced: dict[str, tuple[int, ...]] = {}
    rows = found.fit.rows
    driven = ~np.isin(rows.robot.joints, rows.robot.passive_joints)
    moving = [j for j in np.flatnonzero(driven).tolist() if len(rows.joints[j].torque)]
    for count, j in enumerate(moving):
        report('asking what the leftover depends on', 0.85 + 0.05 * count / len(moving))
        channel, laws, rest, instead = _laws_of_joint(found, motions, j, CHANCE / len(moving))
        accepted += laws
        replaced[channel.place] = instead
        if not laws:
            step = rest[-1] if rest else None
            entries.append(leftover_without(channel.place, step, rows.robot.joints))
    extended = found
    if accepted:
        extended, held = _applied(found, accepted, motions, replaced)
        entries += held
    done = {entry.channel for entry in entries}
    entries += [
        leftover_without(place, None, ())
        for place in replaced
        if f'joint_torque/{place}' not in done
    ]
    slow = {f'joint_torque/{rows.robot.joints[j]}' for j in moving if motions.has_one_speed(j)}
    entries = [replace(entry, one_speed=entry.channel in slow) for entry in entries]
    return extended, tuple(sorted(entries, key=lambda entry: entry.channel))


def _laws_of_joint(
    found: ArmFound, motions: ArmMotions, j: int, chance: float
) -> tuple[JointChannel, list[HeldLaw], list[Winner], tuple[int, ...]]:
    """Laws of a joint, what else won there, and the causes in whose place these laws stand.

    Causes can stand in for a law: a spring and a ripple, or a ripple of which the motion shows a
    part, for a spring that stiffens; friction of two joints' motor that the other joint does not
    confirm for a law of this one alone. Where laws in their place raise the evidence at all joints
    where these causes act by more than the prior odds, they are none. Both have the prior of a
    law's coefficients there: that of a cause's size would count for the law.
    """
    chosen, fit = found.fit.chosen, found.fit
    channel, held, rest = _in_likeliest_noise(JointChannel(motions, j, chosen), chance)
    kinds = [c.kind.id for c in motions.rows.candidates]
    instead = tuple(i for i in _acting(motions, chosen, j) if kinds[i] in REPLACEABLE)
    if not instead:
        return channel, held, rest, ()
    kept = tuple(i for i in chosen if i not in instead)
    other, laws, left = _in_likeliest_noise(JointChannel(motions, j, kept), chance)
    before, after = [it.law for it in held], [it.law for it in laws]
    others = [k for k in range(motions.rows.robot.n_joints) if k != j]
    elsewhere = [k for k in others if _acting(motions, instead, k)]
    if not laws or (not elsewhere and _are_of(other, after, instead)):
        return channel, held, rest, ()
    beyond = worth(other, after) - worth(replace(other, loud=channel.loud), before, instead)
    beyond += sum(_without(motions, k, kept, instead) for k in elsewhere)
    usual, every = fit.hypotheses.usual, fit.hypotheses.every
    beyond += usual * (len(after) - len(before))
    beyond -= sum(usual + every[i].log_odds for i in instead)
    return (other, laws, left, instead) if beyond > MARGIN else (channel, held, rest, ())


def _are_of(channel: JointChannel, laws: Sequence[Law], causes: Sequence[int]) -> bool:
    """Whether laws are what causes are, by other names."""
    columns = channel.of_causes(causes), np.concatenate(channel.columns(laws), axis=1)
    theirs, own = (channel.terms.beside_offset(some) for some in columns)
    left = own - theirs @ np.linalg.lstsq(theirs, own)[0]
    return bool(np.all(np.sum(left**2, axis=0) <= SAME * np.sum(own**2, axis=0)))


def _acting(motions: ArmMotions, causes: Iterable[int], j: int) -> list[int]:
    """Those of some causes that the rows of a joint show."""
    rows = motions.rows
    return [i for i in causes if np.any(rows.joints[j].columns[:, rows.places[i]])]


def _without(motions: ArmMotions, j: int, kept: tuple[int, ...], causes: tuple[int, ...]) -> float:
    """Log likelihood that a joint gains without some causes [nats]."""
    bare = JointChannel(motions, j, kept)
    noise = JointChannel(motions, j, (*kept, *causes)).likeliest(()).loud
    return worth(bare.likeliest(()), ()) - worth(replace(bare, loud=noise), (), causes)


def _in_likeliest_noise(
    channel: JointChannel, chance: float
) -> tuple[JointChannel, list[HeldLaw], list[Winner]]:
    """A channel under the noise that is likeliest beside its laws, these, and what else won.

    A law leaves more where it is larger, as noise that grows with the rate does: what it leaves
    is asked again beside it.
    """
    first = channel.likeliest(())
    held, rest = laws_of(first, chance)
    again = channel.likeliest([it.law for it in held])
    if again is first:
        return first, held, rest
    return (again, *laws_of(again, chance))


def _applied(
    found: ArmFound,
    accepted: Sequence[HeldLaw],
    motions: ArmMotions,
    replaced: Mapping[str, tuple[int, ...]],
) -> tuple[ArmFound, list[Leftover]]:
    """All of them fitted with the causes; what feeds energy in or makes a joint worse is left."""
    joints = motions.rows.robot.joints
    alone = [candidate_of(it.law, joints.index(it.place), motions) for it in accepted]
    gone = {i for it in accepted for i in replaced[it.place]}
    candidates = _coupled(found, accepted, alone, motions, gone)
    pairs = [(it, c) for it, c in zip(accepted, candidates, strict=True) if c is not None]
    before = rms(found.extended)
    along = [balance.motion for balance in motions.balances]
    several = len(motions.rows.balances) > 1
    refused: list[Leftover] = []
    while True:
        dropped = {i for it, _ in pairs for i in replaced[it.place]}
        fitted, numbers = with_laws(found, [c for _, c in pairs], dropped)
        frees = [e for e in fitted.fit.effects(numbers) if isinstance(e, LearnedTorque)]
        friction = _frictions(fitted)
        laws = [
            _sane(applied_law(it.law, free, motions), friction, along)
            for (it, _), free in zip(pairs, frees, strict=True)
        ]
        known = tuple(law for law in laws if law is not None)
        fitted = without_harm(replace(fitted, learned=known))
        worse = rms(fitted.extended) > WORSE * before
        is_refused = (fitted.ratios > WORSE).any()
        is_out = [
            law is None
            or worse[joints.index(it.place)]
            or is_refused
            or fitted.fit.chance(i) >= NO_CHANCE
            for (it, _), law, i in zip(pairs, laws, numbers, strict=True)
        ]
        entries = [
            leftover_of(
                it,
                tuple(free.values.values()),
                fitted.fit.spread(i),
                motions.rows.robot,
                applied=None if out else law,
                is_of_several=several,
            )
            for (it, _), free, law, i, out in zip(pairs, frees, laws, numbers, is_out, strict=True)
        ]
        if not any(is_out):
            return fitted, [*entries, *refused]
        # of a law that is not applied causes are not said to have given way
        judged = zip(entries, pairs, is_out, strict=True)
        refused += [entry for entry, (it, _), out in judged if out and not replaced[it.place]]
        pairs = [pair for pair, out in zip(pairs, is_out, strict=True) if not out]


def _frictions(found: ArmFound) -> dict[str, list[Effect]]:
    """Friction that the model has at every joint, named or not."""
    out: dict[str, list[Effect]] = {}
    for effect in (*found.believed, *found.named, *found.calibration):
        if effect.id.endswith('_friction'):
            out.setdefault(str(effect.where), []).append(effect)
    return out


def _coupled(
    found: ArmFound,
    accepted: Sequence[HeldLaw],
    candidates: Sequence[LawCandidate],
    motions: ArmMotions,
    gone: Collection[int],
) -> list[LawCandidate | None]:
    """Friction of a sum of rates acts on both joints where both show it, and agree."""
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
        fitted, numbers = with_laws(found, both, gone)
        # of x - y both sine and coefficients turn round with the joints
        here, there = (fitted.fit.values[fitted.fit.rows.places[i]] for i in numbers)
        near, away = (fitted.fit.spread(i) for i in numbers)
        is_same = np.all(np.abs(here - there) <= _AGREE * np.hypot(near, away))
        if is_same and np.any(np.abs(there) > _AGREE * away):  # it is seen there, too
            out[n] = candidate_of(it.law, joints.index(it.place), motions, react=other)
            for m, far in enumerate(accepted):
                if (
                    far.place == other
                    and far.law.form.ratio == ratio
                    and set(far.law.inputs) == set(it.law.inputs)
                ):
                    out[m] = None
    return out


def _sane(
    law: LearnedTorque, friction: Mapping[str, Sequence[Effect]], along: Sequence[Motion]
) -> LearnedTorque | None:
    """A law that takes energy; one that corrects friction of the model is no friction alone.

    None where with all friction of its joint it feeds energy in.
    """
    if not feeds_energy(law, along):
        return law
    beside = friction.get(str(law.where), ())
    if feeds_energy(law, along, beside):
        return None
    return _of_kind(law, 'external')


def _of_kind(law: LearnedTorque, kind: str) -> LearnedTorque:
    return replace(law, guard=replace(law.guard, kind=kind))


def feeds_energy(
    law: LearnedTorque, motions: Iterable[Motion], beside: Sequence[Effect] = ()
) -> bool:
    """Whether friction, as it was fitted, feeds in more power than fits may.

    Args:
        law: The law.
        motions: Of the recordings.
        beside: Other friction of the same joint.
    """
    if law.guard.kind != 'dissipative':
        return False
    every = [_of_kind(law, 'external'), *beside]
    given, taken = 0.0, 0.0
    for motion in motions:
        force = np.sum([e.force(motion, e.driven(motion)) for e in every], axis=0)
        power = np.sum(force * motion.rates, axis=1)
        given += float(np.sum(np.maximum(power, 0.0)))
        taken += float(np.sum(np.maximum(-power, 0.0)))
    return given > FED_IN * (given + taken)
