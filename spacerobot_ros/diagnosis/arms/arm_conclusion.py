"""From an arm's causes to an answer: how surely each is one, what is left, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from ...effects.believed_friction import totals
from ...effects.effect import Effect, Key
from ...estimation.balance.arm_candidates import GAIN
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance, rms
from ...estimation.rows import ChannelError
from ...estimation.scaling import PROPORTIONAL, coordinate_of, origin_of
from ...inference.inferred import InferredCause
from ...inference.validation import HeldOut
from ...types import Array
from ..answer.cause import Cause, Estimated, Evidence, Rival, with_values
from ..answer.event_answer import with_events
from ..answer.free_motion import free_motion
from ..answer.residuals import series
from ..answer.result import Diagnosis, Gain, Leftover, Order, RecordingMisfit, Residual
from ..answer.words import laws_in_words, verdict_of
from ..events.event import Events
from ..limits import RELEVANT
from ..orders.orders import find_orders
from .arm_found import WORSE, ArmFound, still_words, touched_notes
from .arm_spread import covariance_of, values_std, whole_std
from .arm_verdict import Left, doubts, laws_that_matter, overall, sentence
from .friction_law import friction_laws
from .ratios import ratios, scale_notes
from .spring_rest import with_rests
from .two_directions import direction_notes, with_directions


def conclude_arm(
    found: ArmFound, leftover: tuple[Leftover, ...] | None, notes: tuple[str, ...]
) -> Diagnosis:
    """What a search says.

    Args:
        found: Its result.
        leftover: What that depends on; None: not asked.
        notes: What else a user should know.
    """
    held_out = HeldOut(found.fit.hypotheses, found.fit.chosen)
    before, after = held_out.squares()
    excess = max(float(np.sum(after)) - found.fit.blocks.whole.rows, 1.0)
    order = sorted(range(len(found.clear)), key=lambda k: -found.causes[found.clear[k]].log_odds)
    alone = [_cause(found, k, excess) for k in order]
    every = totals([*(c.applied for c in alone), *found.calibration], found.believed)
    causes = with_rests(with_values(alone, every[: len(alone)]), found.robot)
    causes = with_directions(causes, found.robot, found.constants)
    constants = tuple(_constant(found, effect) for effect in found.constants)
    named = tuple(c for c in causes if c.relevant)
    minor = tuple(c for c in causes if not c.relevant)
    left = Left.of(found)
    verdict = verdict_of(not left.unusual, bool(named))
    laws = laws_that_matter(found, left, leftover or ())
    has_unclear = len(found.fit.chosen) > len(found.clear) + len(found.learned)
    words = sentence(verdict, named, left, has_unclear=has_unclear) + laws_in_words(laws)
    pairs = zip(found.clear, found.named, strict=True)
    doubtful = [*doubts((found.causes[i], (e.id, e.where)) for i, e in pairs)]
    if laws or (
        doubtful and verdict == 'explained'
    ):  # a law is no named cause, and it is no noise
        verdict = 'partly_explained'
    channels = series(*(_levelled(traces.channels, found.levels) for traces in found.traces))
    residuals = tuple(
        Residual(
            channel=s.channel,
            unit=s.unit,
            rms_before=float(b),
            rms_after=float(a),
            noise_floor=s.noise_floor,
        )
        for s, b, a in zip(channels, left.before, left.after, strict=True)
    )
    diagnosis = Diagnosis(
        verdict=verdict,
        sentence=words,
        causes=(*constants, *named),
        minor=minor,
        residuals=residuals,
        series=channels,
        gain=_gain(before, after, found.fit.blocks.whole.rows),
        notes=(
            *notes,
            *touched_notes(found.fit.rows.balances),
            *scale_notes(found),
            *direction_notes(named, found.robot),
            *doubtful,
        ),
        calibration=(*(c.applied for c in minor), *every[len(alone) :]),
        recordings=_recordings(found),
        friction=friction_laws(found),
        leftover=leftover,
        orders=None if leftover is None else _orders(found),
        ratios=ratios(found),
        free_motion=free_motion(found.fit.rows.balances, found.extended),
        covariance=covariance_of(found, named),
        method='balance',
    )
    return with_events(diagnosis, found.events.events)


def _orders(found: ArmFound) -> tuple[Order, ...]:
    robot = found.robot
    return find_orders(found.records, {j: robot.unit_of('N m', j) for j in robot.joints})


def still_answer(balances: Sequence[Balance], events: Events) -> Diagnosis:
    """The answer for recordings in which no joint moves: events are all that they tell."""
    channels = balances[0].channels()
    answer = Diagnosis(
        verdict='consistent' if events.named else 'unexplained',
        sentence=f'{still_words(balances)}, and nothing else is told.',
        series=series(channels, channels),
        method='balance',
    )
    return with_events(answer, events)


def _cause(found: ArmFound, k: int, excess: float) -> Cause:
    """A cause with what speaks for it beside all others.

    Args:
        found: The causes.
        k: Number of the cause among those that are named.
        excess: Squares that are left of held-out rows with all causes, beyond one a row.
    """
    fit, i = found.fit, found.clear[k]
    applied, inferred = found.named[k], found.causes[i]
    share = max(fit.share(i), 1e-9)
    thresholds = [
        replace(p, relevant=RELEVANT / share * abs(coordinate_of(p, value) - origin_of(p)))
        if p.role in PROPORTIONAL
        else p
        for p, value in ((p, applied.values[p.name]) for p in applied.parameters)
    ]
    elpd = float(np.sum(inferred.gains))
    return Cause(
        applied=applied,
        parameters={
            p.name: Estimated(
                value=applied.values[p.name],
                std=whole_std(found, k, p.name, std),
                unit=applied.unit_at(found.robot, applied.where, p),
            )
            for p, std in zip(applied.parameters, values_std(found, i), strict=True)
        },
        evidence=Evidence(
            held_out_gain=2.0 * elpd / (2.0 * elpd + excess),
            log_odds=inferred.log_odds,
            elpd_gain=elpd,
        ),
        rivals=rivals_of(found.fit.rows, inferred),
        thresholds={p.name: p for p in thresholds},
        relevant=share > RELEVANT,
        held_out_recordings=None if found.is_one else tuple(inferred.gains.tolist()),
    )


def rivals_of(rows: ArmRows, inferred: InferredCause) -> tuple[Rival, ...]:
    """What could stand in a cause's place as well, each once: of all or of one recording."""
    out: dict[Key, Rival] = {}
    for other in inferred.rivals:
        for number in other.causes:
            c = rows.candidates[cast(int, number)]
            rival = Rival(effect=c.kind.id, where=c.where, log_odds=other.log_odds)
            out.setdefault(rival.key, rival)
    return tuple(out.values())


def _constant(found: ArmFound, effect: Effect) -> Cause:
    """A motor constant that nobody stated; as uncertain as a gain of its torques."""
    rows = found.fit.rows
    keys = [candidate.key for candidate in rows.candidates]
    i = keys.index((GAIN, effect.where))
    (std,) = found.fit.spread(i)
    return Cause(
        applied=effect,
        parameters={
            p.name: Estimated(
                value=effect.values[p.name],
                std=float(std) * effect.values[p.name],
                unit=effect.unit_at(found.robot, effect.where, p),
            )
            for p in effect.parameters
        },
        evidence=Evidence(),
        thresholds={p.name: replace(p, relevant=0.0) for p in effect.parameters},
        relevant=True,
    )


def _levelled(channels: Sequence[ChannelError], levels: Array) -> list[ChannelError]:
    """Channels with the level of what is left as their floor."""
    return [
        replace(channel, noise_floor=float(np.sqrt(np.sum(variances))))
        for channel, variances in zip(channels, levels, strict=False)
    ]


def _gain(before: Array, after: Array, count: int) -> Gain:
    """Held-out errors by the level of what is left, each part with values from the others."""
    return Gain(
        before=math.sqrt(float(np.sum(before)) / count),
        after=math.sqrt(float(np.sum(after)) / count),
    )


def _recordings(found: ArmFound) -> tuple[RecordingMisfit, ...]:
    """What is left of every recording, before and after."""
    if found.is_one:
        before, after = (traces.rms for traces in found.traces)
        pairs, ratios = [(before, after)], [after / before]
    else:
        both = zip(found.fit.rows.balances, found.extended, strict=True)
        pairs, ratios = [(rms([b]), rms([a])) for b, a in both], [*found.ratios]
    return tuple(
        RecordingMisfit(
            source=record.source,
            rms_before=overall(before),
            rms_after=overall(after),
            worse={
                joint: float(ratio)
                for joint, ratio in zip(found.robot.joints, own, strict=True)
                if ratio > WORSE
            },
        )
        for record, (before, after), own in zip(found.records, pairs, ratios, strict=False)
    )
