"""A named physical cause, with what speaks for it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

from scipy.special import expit

from ...effects.effect import Effect, Key
from ...effects.parameter import Parameter


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimated:
    """A parameter's value and standard deviation."""

    value: float
    std: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """How surely a cause is one; nan is what was not computed.

    Args:
        log_likelihood_gain: On the whole record, beside the other causes.
        bic_gain: The same against the price of its parameters.
        p_value: Of such a gain by chance, for one candidate.
        held_out_gain: Share of the held-out excess misfit that it removes, from 0 to 1.
        placebo_gain: Largest held-out share among placebo extensions of the same size.
        log_odds: Against the best set of causes without it.
        elpd_gain: Log predictive density that it adds to held-out parts.
    """

    log_likelihood_gain: float = math.nan
    bic_gain: float = math.nan
    p_value: float = math.nan
    held_out_gain: float = math.nan
    placebo_gain: float = math.nan
    log_odds: float = math.nan
    elpd_gain: float = math.nan

    json_too: ClassVar[tuple[str, ...]] = ('probability',)

    @property
    def probability(self) -> float:
        """That it is a cause, were there only the best set with it and the best one without."""
        return float(expit(self.log_odds))


@dataclass(frozen=True, slots=True, kw_only=True)
class Rival:
    """A cause that this motion can't tell from the named one.

    Args:
        effect: Its id. where: Its place. bic_gap: By how much it fits worse.
        motion: The motion that would separate the two.
        log_odds: Of the named cause against the best set with this one in its place.
    """

    effect: str
    where: str | None
    bic_gap: float = math.nan
    motion: str = ''
    log_odds: float = math.nan

    @property
    def key(self) -> Key:
        """Its id and place."""
        return self.effect, self.where


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """A named physical cause.

    Args:
        applied: The effect with its estimated values.
        parameters: Its parameters.
        evidence: How surely.
        thresholds: The effect's parameters by name, with thresholds of relevance for this robot.
        relevant: Whether any parameter is beyond its threshold of relevance; if not it is fitted
            and printed, but not named.
        rivals: What it can't be told from.
        constant_p: Probability that its parameters are the same all along the record; nan: not
            tested.
        held_out_recordings: Log evidence that it adds to the prediction of every recording from
            the others; None where there is one recording, or where that was not computed.
    """

    applied: Effect
    parameters: Mapping[str, Estimated]
    evidence: Evidence
    thresholds: Mapping[str, Parameter]
    relevant: bool
    rivals: tuple[Rival, ...] = ()
    constant_p: float = math.nan
    held_out_recordings: tuple[float, ...] | None = None


def with_values(causes: Sequence[Cause], applied: Sequence[Effect]) -> tuple[Cause, ...]:
    """Causes as effects of the same kinds with other values, as uncertain as they are."""
    return tuple(
        replace(
            cause,
            applied=effect,
            parameters={
                name: replace(p, value=effect.values[name]) for name, p in cause.parameters.items()
            },
        )
        for cause, effect in zip(causes, applied, strict=True)
    )
