r"""Whether a cause predicts parts of the rows from all others.

    elpd_p(S) = ln Z(all rows | S) - ln Z(all rows but those of part p | S)

is the log predictive density of a part (Bernardo and Smith, Bayesian Theory (1994), 6.1.6). What a
cause gains there, beside the same set without it and what needs it, has to be more than nothing by
its sum, and by its scatter over the parts or without its best part.

Tolerances are data, too, of which no part is left out: without a cause some of them may fit every
part, far outside of what they are. The strain of a set is minus the log density of its tolerances,

    t(S) = 1/2 sum m_j^2 / spike_j^2    over all that is no cause, m their posterior mean

and what a cause takes from it counts in equal shares with the parts.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from ..types import Array, IntArray
from .decisive import NAMED, STEADY
from .gram import Gram
from .gram_blocks import merged
from .hypotheses import Hypotheses
from .marginal import Marginal


class HeldOut:
    """Parts of the rows under a set of causes, each predicted from all others.

    Args:
        hypotheses: All of them.
        chosen: The set.
    """

    def __init__(self, hypotheses: Hypotheses, chosen: Collection[int]) -> None:
        self._hypotheses, self._chosen = hypotheses, frozenset(chosen)
        self._active = hypotheses.active(self._chosen)
        self._grams = hypotheses.grams(self._active)
        self._columns = hypotheses.columns_of(self._active)
        self._variances = hypotheses.variances(self._chosen)[self._columns]
        self._whole = hypotheses.whole.part(self._columns)
        self._marginals: dict[bytes, list[Marginal]] = {}
        self._every = Marginal.of(self._whole, self._columns, self._variances)
        self._full = self._every.part(hypotheses.columns_of(self._chosen))

    def gains(self, i: int) -> Array:
        """(P,) log predictive density that a cause adds to each part, and to tolerances."""
        gone = self._hypotheses.dependents(self._chosen, [i])
        every = [self._full, *self._rests(self._labels([i]))]
        full, *rest = (self._evidence(m) - self._evidence(m, gone) for m in every)
        strain = self._strain(gone) - self._strain()
        return full - np.array(rest) + strain / len(rest)

    def _strain(self, gone: Collection[int] = frozenset()) -> float:
        """Of the tolerances of the set without some causes."""
        marginal = self._every
        if gone:
            marginal = marginal.changed(*self._hypotheses.exchange((), gone))
        causes = self._hypotheses.columns_of(self._chosen - frozenset(gone))
        tolerated = ~np.isin(self._columns, causes)
        spikes = self._hypotheses.spikes[self._columns[tolerated]]
        return 0.5 * float(spikes @ marginal.vector[tolerated] ** 2)

    def density(self) -> Array:
        """(P,) log predictive density of each part under the whole set."""
        full, *rest = map(self._evidence, [self._full, *self._rests(self._labels(self._chosen))])
        return full - np.array(rest)

    def squares(self) -> tuple[Array, Array]:
        """(P,) squared rows of each part, and what is left of them by values of the others."""
        labels = self._labels(self._chosen)
        variances = self._variances
        parts = [part for part in merged(self._grams, labels) if part.rows]
        means = (
            Marginal.of(self._whole - p, self._columns, variances).vector * variances
            for p in parts
        )
        after = [part.misfit(mean) for part, mean in zip(parts, means, strict=True)]
        return np.array([part.square for part in parts]), np.array(after)

    def _labels(self, which: Collection[int]) -> IntArray:
        every = which or range(len(self._hypotheses.every))
        columns = self._hypotheses.columns_of(every)
        deviations = np.zeros(self._hypotheses.blocks.count)
        for h in (self._hypotheses.every[i] for i in every):
            deviations[h.columns] = h.deviations
        return self._hypotheses.blocks.parts(columns, deviations[columns] ** 2)

    def _rests(self, labels: IntArray) -> list[Marginal]:
        """Rows without each part; what was made of the same parts is kept."""
        key = labels.tobytes()
        if key not in self._marginals:
            parts = merged(self._grams, labels)
            self._marginals[key] = [self._marginal(self._whole - part) for part in parts]
        return self._marginals[key]

    def _marginal(self, gram: Gram) -> Marginal:
        """Of some rows, for the columns of the set alone."""
        out = Marginal.of(gram, self._columns, self._variances)
        return out.part(self._hypotheses.columns_of(self._chosen))

    def _evidence(self, marginal: Marginal, gone: Collection[int] = frozenset()) -> float:
        """Log evidence of the set without some causes."""
        if gone:
            marginal = marginal.changed(*self._hypotheses.exchange((), gone))
        return self._hypotheses.evidence(marginal, self._chosen - frozenset(gone))


def passes(gains: Array) -> bool:
    """Whether a cause that adds so much to each part (P,) holds on what it was not fitted to."""
    total = float(np.sum(gains))
    if len(gains) < 2 or total <= NAMED:
        return False
    error = math.sqrt(len(gains)) * float(np.std(gains, ddof=1))
    return total > STEADY * error or total - float(np.max(gains)) > NAMED


def weakest(gains: dict[int, Array]) -> int | None:
    """Of causes with what each adds to the parts, the least of those that do not pass."""
    failing = {i: float(np.sum(g)) for i, g in gains.items() if not passes(g)}
    return min(failing, key=failing.__getitem__, default=None)
