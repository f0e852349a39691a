"""Whether causes hold where nothing is presumed of the spectrum of what is left.

`leftover.py` has a family of spectra. A line in the band of the motion, or torques that lack at a
few frequencies, are none of it: a body that went with them was worth 400 nats, and is worth 50 at
the level that is left beside it in bins of frequency, 9 where what is left without it has a level
of its own. A cause has to be worth its prior odds so, too.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Sequence
from typing import cast

import numpy as np

from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.inference.spectral_terms import Level, SpectralTerms, cosines
from ...inference.gram_blocks import NEVER_HELD_OUT, GramBlocks
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.inferred import InferredCause
from ...inference.model_search import ChosenSet
from ...types import Array
from ..limits import LINE

_UNSEEN = 1e-2  # of the noise, all rows together: what no evidence shows


class SpectralEvidence:
    """Evidence of a set of causes by every joint's level in bins of frequency.

    Args:
        rows: The recordings.
        levels: (8,) variances by which rows are whitened first, see `ArmRows.joints`.
        every: The hypotheses.
        chosen: Numbers of the causes.
    """

    def __init__(
        self,
        rows: ArmRows,
        levels: Sequence[Array],
        every: Sequence[Hypothesis],
        chosen: Collection[int],
    ) -> None:
        self._rows, self._chosen = rows, frozenset(chosen)
        data, columns = [], []
        for joint, variances in zip(rows.joints, levels, strict=True):
            if len(joint.torque):
                torque, whitened, _ = joint.whitened(variances)
                data.append(cosines(torque))
                columns.append(cosines(whitened))
        self._data, self._columns = np.concatenate(data), np.concatenate(columns)
        self._ends = tuple(np.cumsum([len(x) for x in data])[:-1].tolist())
        self._sizes = np.linalg.norm(self._columns, axis=0)
        self._all = self._level(self._chosen, np.ones(len(self._data)))
        scale, blocks = self._all.scale, GramBlocks(self._columns.shape[1])
        blocks.add(self._columns / scale[:, None], self._data / scale)
        blocks.add_sums(rows.held, NEVER_HELD_OUT)
        self._hypotheses = Hypotheses(blocks, every)
        self._beside = ChosenSet.of(self._hypotheses, self._chosen)

    def margin(self, i: int, known: float) -> float:
        """By which a cause is worth more than its prior odds, beside all others [nats].

        At the level that is left beside it; where that is another one than the rows are whitened
        by, what is left without it has its own, too.

        Args:
            i: Its number.
            known: The same at the level that the rows are whitened by.
        """
        rest = self._chosen - self._hypotheses.dependents(self._chosen, [i])
        odds = self._hypotheses.prior(self._chosen) - self._hypotheses.prior(rest)
        margin = self._beside.objective - ChosenSet.of(self._hypotheses, rest).objective
        if margin - odds > LINE * (known - odds):
            return margin
        without = self._level(rest, self._all.scale)
        return min(margin, self._all.likelihood - without.likelihood + odds)

    def _level(self, chosen: Collection[int], scale: Array) -> Level:
        deviations = self._rows.deviations(chosen)
        seen = self._sizes * deviations > _UNSEEN
        prior = self._columns[:, seen] * deviations[seen]
        terms = SpectralTerms(self._data, prior, np.zeros(prior.shape[1], dtype=bool), self._ends)
        return terms.level(np.zeros((len(prior), 0)), scale)


def weakest_in_spectrum(
    rows: ArmRows,
    levels: Sequence[Array],
    every: Sequence[Hypothesis],
    causes: Sequence[InferredCause],
) -> Hashable | None:
    """The cause that is least worth its name by the level in bins of frequency; None: all are.

    An offset is one term: the bin around it says nothing of it, and it is not asked.
    """
    known = {cast(int, c.key): c.log_odds for c in causes}
    asked = [i for i in known if rows.candidates[i].kind.id not in ZEROS]
    if not asked:
        return None
    evidence = SpectralEvidence(rows, levels, every, known)
    margins = {i: evidence.margin(i, known[i]) for i in asked}
    weakest = min(margins, key=margins.__getitem__)
    return weakest if margins[weakest] <= 0.0 else None
