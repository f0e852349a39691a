"""Whether causes hold where nothing is presumed of the spectrum of what is left.

`leftover.py` has a family of spectra. A line in the band of the motion, or torques that lack at a
few frequencies, are none of it: a body that went with them was worth 400 nats, and is worth 50 at
the level that is left beside it in bins of frequency, 9 where what is left without it has a level
of its own. A cause has to be worth its prior odds so, too, to have a name.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.inference.spectral_terms import Level, SpectralTerms, cosines, rows_of
from ...inference.gram import Gram
from ...inference.gram_blocks import NEVER_HELD_OUT, GramBlocks
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.model_search import ChosenSet
from ...types import Array
from ..limits import LINE
from .fitted_arm import FittedArm

_UNSEEN = 1e-2  # of the noise, all rows together: what no evidence shows


class SpectralRows:
    """Rows as cosines, whose level is what a set of causes leaves in bins of frequency.

    Args:
        rows: The recordings.
        levels: (8,) variances by which rows are whitened first, see `ArmRows.joints`.
        every: The hypotheses.
    """

    def __init__(
        self, rows: ArmRows, levels: Sequence[Array], every: Sequence[Hypothesis]
    ) -> None:
        self._rows = rows
        self._every = [  # lower odds are those of what a level that is presumed leaves
            replace(h, log_odds=max(h.log_odds, 0.0)) if h.log_odds > -math.inf else h
            for h in every
        ]
        data, columns, self._joints = [], [], list[int]()
        for k, (joint, variances) in enumerate(zip(rows.joints, levels, strict=True)):
            if len(joint.torque):
                torque, whitened, _ = joint.whitened(variances)
                data.append(cosines(torque))
                columns.append(cosines(whitened))
                self._joints.append(k)
        self._data, self._columns = np.concatenate(data), np.concatenate(columns)
        self._ends = tuple(np.cumsum([len(x) for x in data])[:-1].tolist())
        self._sizes = np.linalg.norm(self._columns, axis=0)

    def unsupported(self, fit: FittedArm) -> set[int]:
        """Causes that are not worth their prior odds, weakest first.

        An offset is one term: the bin around it says nothing of it, and it is not asked.

        Args:
            fit: The causes at the level that the rows are whitened by.
        """
        found = ChosenSet.of(fit.hypotheses, fit.chosen)
        known = {i: _evidence(fit.hypotheses, found, i) for i in found.chosen}
        chosen, gone = set(found.chosen), set[int]()
        while asked := {i: known[i] for i in chosen if self._is_asked(i)}:
            margins = self._margins(chosen, asked)
            weakest = min(margins, key=margins.__getitem__)
            if margins[weakest] > 0.0:
                break
            chosen.discard(weakest)
            gone.add(weakest)
        return gone

    def scale(self, chosen: Collection[int]) -> Array:
        """(M,) level of what a set of causes leaves."""
        return self._level(chosen, np.ones(len(self._data))).scale

    def blocks(self, scale: Array) -> GramBlocks:
        """The rows in clusters, whitened by a level (M,) too."""
        both = np.column_stack([self._data, self._columns]) / scale[:, None]
        clusters, columns = self._rows.in_clusters, self._columns.shape[1]
        every = [Gram(np.zeros((columns, columns)), np.zeros(columns), 0.0, 0)] * len(
            clusters.recording
        )
        for k, terms in zip(self._joints, np.split(both, self._ends), strict=True):
            block = clusters.joints[k].block
            whitened = rows_of(terms, len(block))
            for b in np.unique(block).tolist():
                own = whitened[block == b]
                every[b] = every[b] + Gram.of(own[:, 1:], own[:, 0])
        out = GramBlocks(columns)
        for gram, recording in zip(every, clusters.recording.tolist(), strict=True):
            out.add_sums(gram, recording)
        out.add_sums(self._rows.held, NEVER_HELD_OUT)
        return out

    def _is_asked(self, i: int) -> bool:
        return self._rows.candidates[i].kind.id not in ZEROS

    def _margins(self, chosen: Collection[int], known: Mapping[int, float]) -> dict[int, float]:
        """By which causes are worth more than their prior odds, beside all others [nats].

        At the level that is left beside all; where that is another one than the rows are whitened
        by, what is left without one has its own, too.

        Args:
            chosen: The causes.
            known: Log evidence at the level that the rows are whitened by, of those asked.
        """
        whole = self._level(chosen, np.ones(len(self._data)))
        blocks = GramBlocks(self._columns.shape[1])
        blocks.add(self._columns / whole.scale[:, None], self._data / whole.scale)
        blocks.add_sums(self._rows.held, NEVER_HELD_OUT)
        hypotheses = Hypotheses(blocks, self._every)
        beside, out = ChosenSet.of(hypotheses, chosen), {}
        for i in known:
            gone = hypotheses.dependents(beside.chosen, [i])
            evidence = _evidence(hypotheses, beside, i)
            if evidence <= LINE * known[i]:
                without = self._level(beside.chosen - gone, whole.scale)
                evidence = min(evidence, whole.likelihood - without.likelihood)
            out[i] = evidence + hypotheses.prior(gone)
        return out

    def _level(self, chosen: Collection[int], scale: Array) -> Level:
        deviations = self._rows.deviations(chosen)
        seen = self._sizes * deviations > _UNSEEN
        prior = self._columns[:, seen] * deviations[seen]
        terms = SpectralTerms(self._data, prior, self._ends)
        return terms.level(np.zeros((len(prior), 0)), scale)


def _evidence(hypotheses: Hypotheses, found: ChosenSet, i: int) -> float:
    """Log evidence of a set for a cause and what needs it."""
    gone = hypotheses.dependents(found.chosen, [i])
    rest = ChosenSet.of(hypotheses, found.chosen - gone)
    return found.objective - rest.objective - hypotheses.prior(gone)
