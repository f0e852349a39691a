"""What could stand in the place of a cause: the best set without it, and the angle to it."""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable
from dataclasses import dataclass

import numpy as np
from scipy.special import expit

from ..types import Array, IntArray
from .bounded import RANK
from .decisive import CONFOUNDED
from .hypotheses import Hypotheses
from .marginal import Marginal
from .model_search import ChosenSet, best_set

MOST_RIVALS = 5
"""Of one cause that are sought: each further one takes a search. More within odds of 400 to 1 say
that the motion tells nothing there, which five say as well."""

THOROUGH = 1000
"""Causes by hypotheses up to which moves of three at once are tried for rivals: bounds the run
time, which grows with the square of the causes for each rival of each."""


@dataclass(frozen=True, slots=True, eq=False)
class Alternative:
    """A set of causes without one.

    Args:
        causes: Keys of what it has and the set with that one has not.
        log_odds: Of the set with it against this one.
        angle: Between what the cause does to the rows and what these could do, all others given
            [rad]; pi / 2 where it has nothing in its place.
    """

    causes: tuple[Hashable, ...]
    log_odds: float
    angle: float

    @property
    def probability(self) -> float:
        """That of the cause, were there only these two sets."""
        return float(expit(self.log_odds))

    @property
    def is_confounded(self) -> bool:
        """Whether the rows do not tell the two apart."""
        return bool(self.causes) and self.log_odds < CONFOUNDED


def alternatives(
    hypotheses: Hypotheses,
    found: ChosenSet,
    i: int,
    barred: Collection[int],
    most: float = math.inf,
) -> tuple[list[Alternative], ChosenSet]:
    """The best set without a cause, then without what stood in its place, and so on while close.

    Args:
        hypotheses: All of them.
        found: The set with it.
        i: The cause.
        barred: What may not come.
        most: Causes that no other joins.

    Returns:
        The alternatives, best first, and the best set among them.
    """
    rest = found.chosen - hypotheses.dependents(found.chosen, [i])
    closed, out, sets = {*barred, *hypotheses.families[i]}, list[Alternative](), list[ChosenSet]()
    is_thorough = len(found.chosen) * len(hypotheses.open) <= THOROUGH
    while len(out) < MOST_RIVALS:
        other = best_set(hypotheses, rest, closed, is_thorough=is_thorough, most=most)
        instead = sorted(other.chosen - found.chosen)
        sets.append(other)
        out.append(
            Alternative(
                tuple(hypotheses.every[k].key for k in instead),
                found.objective - other.objective,
                _angle(hypotheses, found, i, instead),
            )
        )
        if not out[-1].is_confounded:
            break
        closed |= set(instead)
    # a last one that is not close says only that there are no more
    return out[: max(1, len(out) - 1)] if not out[-1].is_confounded else out, sets[0]


def _angle(hypotheses: Hypotheses, found: ChosenSet, i: int, instead: Collection[int]) -> float:
    """Between the rows that a cause's values make and those that others could make."""
    if not instead:
        return 0.5 * math.pi
    own, others = hypotheses.columns_of([i]), hypotheses.columns_of(instead)
    both = np.concatenate([own, others])
    without = found.marginal.changed(both, -hypotheses.variances(found.chosen)[both])
    mean = found.marginal.mean(own, np.ones(len(own)))
    return float(principal_angles(without, own, others, mean[:, None])[0])


def principal_angles(
    marginal: Marginal, one: IntArray, other: IntArray, directions: Array | None = None
) -> Array:
    """(k,) angles between what two groups of columns make of the rows, ascending [rad].

    Zero: the rows do not tell them apart. All else is given with its uncertainty: the metric is
    the inverse of the covariance of the data without the two.

    Args:
        marginal: Of the rows under priors that say nothing of either group.
        one: (m,) columns of the first group.
        other: (n,) those of the second.
        directions: (m, d) combinations of the first; None: all of them.
    """
    columns = np.concatenate([one, other])
    at = np.searchsorted(marginal.columns, columns)
    metric = marginal.matrix[np.ix_(at, at)]
    m = len(one)
    turned = np.eye(m) if directions is None else directions
    first = _root(turned.T @ metric[:m, :m] @ turned)
    second = _root(metric[m:, m:])
    cosines = np.linalg.svd(first.T @ turned.T @ metric[:m, m:] @ second, compute_uv=False)
    return np.asarray(np.arccos(np.clip(cosines, 0.0, 1.0)))


def _root(matrix: Array) -> Array:
    """(m, r) whose columns are an orthonormal basis in a metric (m, m) of rank r."""
    values, vectors = np.linalg.eigh(matrix)
    kept = values > RANK * max(float(values[-1]), 0.0)
    return np.asarray(vectors[:, kept] / np.sqrt(values[kept]))
