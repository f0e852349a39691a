"""From rows to causes: search, validation, rivals, values, in this order."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..types import Array
from .alternatives import Alternative, alternatives
from .cluster_robust import RobustCovariance, robust_covariance
from .decisive import IMPLAUSIBLE
from .goodness import Goodness, goodness
from .gram_blocks import GramBlocks
from .hypotheses import Hypotheses
from .hypothesis import Hypothesis
from .model_search import RISE, ChosenSet, best_set
from .validation import HeldOut, weakest


@dataclass(frozen=True, slots=True, eq=False)
class InferredCause:
    """A cause, with what speaks for it.

    Args:
        hypothesis: What it is.
        values: (k,) its coefficients.
        gains: (P,) log predictive density that it adds to each part.
        alternatives: Sets without it, best first.
    """

    hypothesis: Hypothesis
    values: Array
    gains: Array
    alternatives: tuple[Alternative, ...]

    @property
    def key(self) -> Hashable:
        """Its name."""
        return self.hypothesis.key

    @property
    def log_odds(self) -> float:
        """Against the best set without it."""
        return self.alternatives[0].log_odds

    @property
    def probability(self) -> float:
        """The same as a probability."""
        return self.alternatives[0].probability

    @property
    def rivals(self) -> list[Alternative]:
        """What the rows do not tell from it."""
        return [a for a in self.alternatives if a.is_confounded]

    @property
    def slabs(self) -> float:
        """Its largest coefficient in standard deviations of what is plausible."""
        return float(np.max(np.abs(self.values) / self.hypothesis.deviations))


@dataclass(frozen=True, slots=True, eq=False)
class Inferred:
    """What rows say of hypotheses.

    Args:
        causes: By their log odds, most certain first.
        log_evidence: ln Z of the set.
        mean: (K,) coefficients of all columns within bounds, those of tolerances among them.
        covariance: Of the causes' coefficients; None without causes.
        density: (P,) log predictive density of each part.
        goodness: Of the fit.
        excluded: Keys of what did not hold on parts that it was not fitted to.
    """

    causes: tuple[InferredCause, ...]
    log_evidence: float
    mean: Array
    covariance: RobustCovariance | None
    density: Array
    goodness: Goodness
    excluded: frozenset[Hashable]

    @property
    def verdict(self) -> Literal['consistent', 'explained', 'partly_explained', 'unexplained']:
        """What is said of the rows in one word."""
        if not self.causes:
            return 'consistent' if self.goodness.is_good else 'unexplained'
        is_plausible = all(cause.slabs <= IMPLAUSIBLE for cause in self.causes)
        return 'explained' if self.goodness.is_good and is_plausible else 'partly_explained'


Refusal = Callable[[Hypotheses, ChosenSet], Collection[int]]
"""Numbers of causes of a set that something else than the rows' parts speaks against."""


def infer(
    blocks: GramBlocks,
    every: Sequence[Hypothesis],
    most: float = math.inf,
    refused: Refusal = lambda hypotheses, found: (),
) -> Inferred:
    """Find the causes that rows want and that predict their parts.

    What fails the validation is excluded, and the search goes on. It ends: each round excludes
    one hypothesis more, or raises the objective of the same search.

    Args:
        blocks: The rows, in `CLUSTERS` blocks or more.
        every: The hypotheses.
        most: Causes that no other joins.
        refused: Asked of each set that passes the validation; what it says is excluded, too.

    Raises:
        ValueError: rows and hypotheses do not fit each other, or there are too few blocks.
    """
    hypotheses = Hypotheses(blocks, every)
    barred = set[int]()
    found = best_set(hypotheses, most=most)
    while True:
        held_out = HeldOut(hypotheses, found.chosen)
        asked = sorted(found.chosen - hypotheses.always)
        gains = {i: held_out.gains(i) for i in asked}
        worst = weakest(gains)
        failing = refused(hypotheses, found) if worst is None else (worst,)
        if failing:
            barred |= set(failing)
            rest = found.chosen - hypotheses.dependents(found.chosen, failing)
            found = best_set(hypotheses, rest, barred, most=most)
            continue
        others, better = _alternatives(hypotheses, found, asked, barred, most)
        if better is None:
            return _inferred(hypotheses, found, held_out, gains, others, barred)
        found = better


def _alternatives(
    hypotheses: Hypotheses,
    found: ChosenSet,
    asked: Sequence[int],
    barred: set[int],
    most: float,
) -> tuple[dict[int, list[Alternative]], ChosenSet | None]:
    """Sets without each cause; and one that does better than the set, where there is one."""
    out = {}
    for i in asked:
        out[i], best = alternatives(hypotheses, found, i, barred, most)
        if best.objective > found.objective + RISE:
            return out, best_set(hypotheses, best.chosen, barred, most=most)
    return out, None


def _inferred(
    hypotheses: Hypotheses,
    found: ChosenSet,
    held_out: HeldOut,
    gains: dict[int, Array],
    others: dict[int, list[Alternative]],
    barred: set[int],
) -> Inferred:
    mean = hypotheses.mean(found.marginal, found.chosen)
    fitted = hypotheses.fitted(found.marginal, found.chosen)
    causes = [
        InferredCause(h, mean[h.columns], gains[i], tuple(others[i]))
        for i, h in ((i, hypotheses.every[i]) for i in gains)
    ]
    return Inferred(
        tuple(sorted(causes, key=lambda cause: -cause.log_odds)),
        hypotheses.evidence(found.marginal, found.chosen),
        mean,
        robust_covariance(hypotheses, fitted, found.chosen) if found.chosen else None,
        held_out.density(),
        goodness(fitted),
        frozenset(hypotheses.every[i].key for i in barred),
    )
