"""What an arm's leftover depends on: laws searched, judged, fitted beside the causes, said."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from ...effects.grammar import quantity
from ...effects.learned_torque import LearnedTorque
from ...effects.motion import Motion
from ..answer.result import Leftover
from ..arms import ArmFound, rms
from .arm_channels import ArmMotions, JointChannel
from .channel_laws import HeldLaw, has_one_speed, laws_of, said_of, said_without
from .discovery_limits import FED_IN
from .fitted_laws import LawCandidate, applied_law, candidate_of, with_laws

_AGREE = 3.0  # standard deviations


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
        laws, rest = laws_of(channel)
        accepted += laws
        if not laws:
            step = rest[-1] if rest else None
            said.append(said_without(channel.place, step, one_speed=has_one_speed(channel)))
    if not accepted:
        return found, tuple(said)
    extended, held = _applied(found, accepted, motions)
    return extended, tuple(sorted([*held, *said], key=lambda entry: entry.channel))


def _applied(
    found: ArmFound, accepted: Sequence[HeldLaw], motions: ArmMotions
) -> tuple[ArmFound, list[Leftover]]:
    """All of them fitted with the causes; what feeds energy in or makes a joint worse is left."""
    joints = motions.rows.robot.joints
    alone = [candidate_of(it.law, joints.index(it.place), motions) for it in accepted]
    candidates = _coupled(found, accepted, alone, motions)
    pairs = [(it, c) for it, c in zip(accepted, candidates, strict=True) if c is not None]
    before = rms(found.extended)
    along = [balance.motion for balance in motions.rows.balances]
    several = len(motions.rows.balances) > 1
    while True:
        fitted, numbers = with_laws(found, [c for _, c in pairs])
        frees = fitted.fit.effects(numbers)
        laws = [
            applied_law(it.law, free, motions)
            for (it, _), free in zip(pairs, frees, strict=True)
            if isinstance(free, LearnedTorque)
        ]
        fitted = replace(fitted, learned=tuple(laws))
        refused = [k for k, law in enumerate(laws) if pushes(law, along)]
        if not refused and pairs:
            worse = np.flatnonzero(rms(fitted.extended) > before).tolist()
            refused = [k for k, (it, _) in enumerate(pairs) if joints.index(it.place) in worse]
        if not refused:
            break
        pairs = [pair for k, pair in enumerate(pairs) if k not in refused]
    said = [
        said_of(it, law, fitted.fit.spread(i), joints, is_of_several=several)
        for (it, _), law, i in zip(pairs, laws, numbers, strict=True)
    ]
    kept = {id(it) for it, _ in pairs}
    said += [
        said_of(it, None, None, joints, is_of_several=several)
        for it in accepted
        if id(it) not in kept
    ]
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
            out[n] = candidate_of(it.law, joints.index(it.place), motions, react=other)
            for m, far in enumerate(accepted):
                if (
                    far.place == other
                    and far.law.form.ratio == ratio
                    and set(far.law.inputs) == set(it.law.inputs)
                ):
                    out[m] = None
    return out


def pushes(law: LearnedTorque, motions: Iterable[Motion]) -> bool:
    """Whether friction, as it was fitted, feeds in more power than fits may."""
    if law.form.has_history:
        return law.coefficients[0] >= 0.0
    if law.kind != 'dissipative':
        return False
    free = replace(law, kind='external')
    given, taken = 0.0, 0.0
    for motion in motions:
        power = np.sum(free.force(motion, np.zeros((len(motion), 0))) * motion.rates, axis=1)
        given += float(np.sum(np.maximum(power, 0.0)))
        taken += float(np.sum(np.maximum(-power, 0.0)))
    return given > FED_IN * (given + taken)
