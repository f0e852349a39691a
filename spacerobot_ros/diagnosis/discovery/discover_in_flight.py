"""What the leftover of a robot whose sensors' noise is known depends on: joints and base."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...effects.learned_torque import LearnedTorque, law_at
from ...estimation.refit import Fit, refine
from ..answer.result import Diagnosis
from .channel_laws import HeldLaw, laws_of, said_of
from .discover import pushes
from .flight_channels import FlightTorques, TorqueChannel
from .left_out import Parts

_LIMIT = 1.5  # of a law's largest torque in the data


def discover_in_flight(
    answer: Diagnosis, fit: Fit, report: Callable[[str, float], None]
) -> Diagnosis:
    """The answer with laws of what its causes leave, the causes fitted beside them.

    Args:
        answer: Whose model does not fit.
        fit: Of its causes.
        report: Called with what is being done and the share done.
    """
    report('asking what the leftover depends on', 0.95)
    torques = FlightTorques(fit)
    said, applied = [], []
    for channel in _channels(torques):
        held, nothing = laws_of(channel)
        if not held:
            said.append(nothing)
            continue
        laws = _fitted(channel, held)
        for it, (law, spread) in zip(held, laws, strict=True):
            is_sane = not pushes(law, [torques.motion])
            said.append(
                said_of(
                    it,
                    law if is_sane else None,
                    spread,
                    torques.motion.robot.joints,
                    is_of_several=False,
                )
            )
            applied += [law] * is_sane
    answer = replace(answer, leftover=tuple(sorted(said, key=lambda entry: entry.channel)))
    if not any(entry.form for entry in said):
        return answer
    return _with_laws(answer, fit, applied)


def _with_laws(answer: Diagnosis, fit: Fit, laws: list[LearnedTorque]) -> Diagnosis:
    """The causes with the values that they have beside the laws, where these are worth it."""
    extended = refine(fit.run, [*fit.causes, *laws])
    if extended.misfit >= fit.misfit:
        leftover = tuple(replace(entry, applied=None) for entry in answer.leftover or ())
        return replace(answer, verdict='partly_explained', leftover=leftover)
    moved = {(e.id, e.where): e for e in extended.causes}
    causes = tuple(
        replace(
            cause,
            applied=now,
            parameters={
                name: replace(e, value=now.values[name]) for name, e in cause.parameters.items()
            },
        )
        for cause in answer.causes
        for now in [moved.get((cause.applied.id, cause.applied.where), cause.applied)]
    )
    return replace(answer, verdict='partly_explained', causes=causes)


def _channels(torques: FlightTorques) -> list[TorqueChannel]:
    """Every joint with a torque, and the axes of a free base."""
    robot, run = torques.motion.robot, torques.fit.run
    axes = [f'{robot.base_link}/{axis}' for axis in 'xyz'] if robot.is_free else []
    out = [TorqueChannel(torques, place, 3 + k) for k, place in enumerate(axes)]
    if run.record.effort is not None:
        lacking = run.record.joints.without_effort if run.record.joints else ()
        columns = [(j, 6 + robot.joints.index(j)) for j in robot.arm if j not in lacking]
        out += [TorqueChannel(torques, joint, column) for joint, column in columns]
    return out


def _fitted(channel: TorqueChannel, held: list[HeldLaw]) -> list[tuple[LearnedTorque, np.ndarray]]:
    """Laws with coefficients, and the standard deviations of these."""
    level = Parts(channel, [it.step for it in held]).level
    out, first = [], 0
    for it in held:
        last = first + len(it.law.form.powers)
        own = level.coefficients[first:last]
        torque = channel.law_columns(it.law) @ own
        law = law_at(
            name=f'learned_torque_{channel.place.replace("/", "_")}',
            where=channel.place,
            values={},
            form=it.law.form,
            inputs=it.law.inputs,
            coefficients=tuple(own.tolist()),
            range=channel.ranges(it.law),
            limit=max(_LIMIT * float(np.max(np.abs(torque))), math.ulp(1.0)),
            kind=it.law.kind,
            options=dict(it.law.options),
        )
        out.append((law, level.deviations[first:last]))
        first = last
    return out
