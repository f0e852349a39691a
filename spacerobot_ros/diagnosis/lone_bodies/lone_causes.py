"""Causes of lone bodies, from plain estimates of their parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping

from ...effects.catalogue import CATALOGUE
from ...estimation.inference.evidence import chi_square_tail
from ...estimation.scaling import is_relevant
from ...model.robot import Robot
from ..answer.cause import Cause, Estimated, Evidence


def cause_of(
    kind: str,
    where: str | None,
    estimates: Mapping[str, tuple[float, float]],
    evidence: Evidence,
    robot: Robot,
) -> Cause:
    """A cause.

    Args:
        kind: Its id.
        where: Its place.
        estimates: Value and standard deviation of every parameter that is observable; the others
            are nominal.
        evidence: What speaks for it.
        robot: The body.
    """
    parameters = {p.name: p for p in CATALOGUE[kind].parameters_at(robot, where)}
    values = CATALOGUE[kind].nominal() | {name: value for name, (value, _) in estimates.items()}
    return Cause(
        applied=CATALOGUE[kind](name=kind, where=where, values=values),
        parameters={
            name: Estimated(value=value, std=std, unit=parameters[name].unit)
            for name, (value, std) in estimates.items()
        },
        evidence=evidence,
        thresholds=parameters,
        relevant=any(is_relevant(parameters[name], values[name]) for name in estimates),
    )


def evidence_of(gain: float, count: int, rows: int, held_out: float = math.nan) -> Evidence:
    """Evidence of a gain in twice the log likelihood by so many numbers, of so many rows."""
    return Evidence(
        log_likelihood_gain=0.5 * gain,
        bic_gain=gain - count * math.log(rows),
        p_value=chi_square_tail(gain, max(count, 1)),
        held_out_gain=held_out,
    )
