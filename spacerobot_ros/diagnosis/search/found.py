"""What a search has found: the model with all causes, and what speaks for each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import cast

import numpy as np

from ...effects.effect import Effect, Key
from ...estimation.fit import Fit
from ...inference.decisive import MISFIT
from ...inference.gram_blocks import GramBlocks
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.inferred import Inferred, InferredCause
from ...types import Array
from .linear_rows import Variant, variant_of


@dataclass(frozen=True, eq=False)
class Found:
    """Result of the search.

    Args:
        null: The model as it stands.
        fit: The model with all causes.
        blocks: Its rows, with everything else as columns.
        every: Hypotheses about them, the causes in the order of the fit first.
        inferred: What that says.
        rivals: By cause, what could stand in its place, with the log odds against that.
        fitted: A model with some causes.
    """

    null: Fit
    fit: Fit
    blocks: GramBlocks
    every: Sequence[Hypothesis]
    inferred: Inferred
    rivals: Mapping[Key, Mapping[Key, float]]
    fitted: Callable[[Sequence[Effect]], Fit]

    @property
    def is_good(self) -> bool:
        """Whether the model with all causes fits."""
        p_value, _ = self.fit.rows.whiteness()
        return p_value is not None and p_value >= MISFIT

    @property
    def gain(self) -> float:
        """Log evidence of the causes."""
        return self.fit.evidence - self.null.evidence

    @cached_property
    def hypotheses(self) -> Hypotheses:
        """The causes in the order of `fit`, and all else."""
        return Hypotheses(self.blocks, self.every)

    @property
    def deviations(self) -> Array:
        """(P,) standard deviations of all fitted coordinates, by the scatter over blocks."""
        spread = np.sqrt(np.maximum(np.diag(self.fit.covariance()), 0.0))
        robust = self.inferred.covariance
        return spread if robust is None else spread * robust.wider

    @property
    def causes(self) -> list[InferredCause]:
        """What speaks for each, in the order of `fit`."""
        by_key = {variant_of(cause).key: cause for cause in self.inferred.causes}
        return [by_key[cause.key] for cause in self.fit.causes]

    def only(self, kept: Sequence[int]) -> Fit:
        """The fit with only some of its causes."""
        if len(kept) == len(self.fit.causes):
            return self.fit
        return self.fitted([self.fit.causes[i] for i in kept])


def rivals_of(inferred: Inferred) -> dict[Key, dict[Key, float]]:
    """By cause, what the rows do not tell from it, with the log odds against that."""
    out: dict[Key, dict[Key, float]] = {}
    for cause in inferred.causes:
        own = out.setdefault(variant_of(cause).key, {})
        for other in cause.rivals:
            for key in other.causes:
                own.setdefault(cast(Variant, key).key, other.log_odds)
    return out
