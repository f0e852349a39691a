r"""Whether a cause predicts parts of the rows from all others.

    elpd_p(S) = ln Z(all rows | S) - ln Z(all rows but those of part p | S)

is the log predictive density of a part (Bernardo and Smith, Bayesian Theory (1994), 6.1.6). What a
cause gains there, beside the same set without it and what needs it, has to be more than nothing by
its sum, and by its scatter over the parts or without its best part.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np

from ..types import Array, IntArray
from .decisive import PREDICTED, STEADY
from .gram import Gram
from .gram_blocks import merged
from .hypotheses import Hypotheses
from .marginal import Marginal


class HeldOut:
    """Parts of the rows under a set of causes, each predicted from all others.

    Args:
        hypotheses: All of them.
        chosen: The set.
        is_absent: Whether a cause that goes leaves nothing, its tolerance neither: stretched by
            many of its deviations that predicts as well, and only its prior speaks against it.
    """

    def __init__(
        self, hypotheses: Hypotheses, chosen: Collection[int], *, is_absent: bool = False
    ) -> None:
        self._hypotheses, self._chosen = hypotheses, frozenset(chosen)
        self._is_absent = is_absent
        self._active = hypotheses.active(self._chosen)
        self._grams = hypotheses.grams(self._active)
        self._whole = hypotheses.whole.part(hypotheses.columns_of(self._active))
        self._marginals: dict[bytes, list[Marginal]] = {}
        self._full = self._marginal(self._whole)

    def gains(self, i: int) -> Array:
        """(P,) log predictive density that a cause adds to each part."""
        gone = self._hypotheses.dependents(self._chosen, [i])
        every = [self._full, *self._rests(self._labels([i]))]
        full, *rest = (self._evidence(m) - self._evidence(m, gone) for m in every)
        return full - np.array(rest)

    def density(self) -> Array:
        """(P,) log predictive density of each part under the whole set."""
        full, *rest = map(self._evidence, [self._full, *self._rests(self._labels(self._chosen))])
        return full - np.array(rest)

    def squares(self) -> tuple[Array, Array]:
        """(P,) squared rows of each part, and what is left of them by values of the others."""
        labels = self._labels(self._chosen)
        columns = self._hypotheses.columns_of(self._active)
        variances = self._hypotheses.variances(self._chosen)[columns]
        parts = [part for part in merged(self._grams, labels) if part.rows]
        means = (
            Marginal.of(self._whole - p, columns, variances).vector * variances for p in parts
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
        columns = self._hypotheses.columns_of(self._active)
        variances = self._hypotheses.variances(self._chosen)[columns]
        out = Marginal.of(gram, columns, variances)
        return out.part(self._hypotheses.columns_of(self._chosen))

    def _evidence(self, marginal: Marginal, gone: Collection[int] = frozenset()) -> float:
        """Log evidence of the set without some causes."""
        if gone:
            columns, change = self._hypotheses.exchange((), gone)
            marginal = marginal.changed(
                columns, -np.ones(len(columns)) if self._is_absent else change
            )
        return self._hypotheses.evidence(marginal, self._chosen - frozenset(gone))


def passes(gains: Array) -> bool:
    """Whether a cause that adds so much to each part (P,) holds on what it was not fitted to."""
    total = float(np.sum(gains))
    if len(gains) < 2 or total <= PREDICTED:
        return False
    error = math.sqrt(len(gains)) * float(np.std(gains, ddof=1))
    return total > STEADY * error or total > float(np.max(gains))


def weakest(gains: dict[int, Array]) -> int | None:
    """Of causes with what each adds to the parts, the least of those that do not pass."""
    failing = {i: float(np.sum(g)) for i, g in gains.items() if not passes(g)}
    return min(failing, key=failing.__getitem__, default=None)
