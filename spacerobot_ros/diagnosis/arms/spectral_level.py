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
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.inference.spectral_terms import Level, SpectralTerms, cosines, rows_of
from ...inference.gram import Gram
from ...inference.gram_blocks import GramBlocks
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.model_search import ChosenSet
from ...types import Array
from ..limits import LINE
from .arm_hypotheses import no_blocks
from .fitted_arm import FittedArm

_UNSEEN = 1e-2  # of the noise, all rows together: what no evidence shows


class _Stretch(NamedTuple):
    """Terms of rows, joint after joint.

    Args:
        data: (R,). columns: (R, K), most of them zero. ends: Of all joints but the last.
        joints: Numbers of the sets of rows, see `ArmRows.joints`.
    """

    data: Array
    columns: csr_array
    ends: tuple[int, ...]
    joints: tuple[int, ...]


class SpectralRows:
    """Rows as cosines, whose level is what a set of causes leaves in bins of frequency.

    Args:
        rows: The recordings, or some stretches of a long one.
        every: The hypotheses.
    """

    def __init__(self, rows: ArmRows, every: Sequence[Hypothesis]) -> None:
        self._rows = rows
        self._every = [  # lower odds are those of what a level that is presumed leaves
            replace(h, log_odds=max(h.log_odds, 0.0)) if h.log_odds > -math.inf else h
            for h in every
        ]
        self._stretches = list[_Stretch]()
        self._squares = np.zeros(len(rows.tolerances))

    def add(self, rows: ArmRows, levels: Sequence[Array]) -> None:
        """Add rows, whitened by (8,) variances, see `ArmRows.joints`."""
        data, columns, joints = list[Array](), list[Array](), list[int]()
        for k, (joint, variances) in enumerate(zip(rows.joints, levels, strict=True)):
            if len(joint.torque) and np.isfinite(variances).all():
                torque, whitened, _ = joint.whitened(variances)
                data.append(cosines(torque))
                columns.append(cosines(whitened))
                joints.append(k)
        if data:
            whole, ends = np.concatenate(columns), np.cumsum([len(x) for x in data])[:-1]
            self._squares += np.sum(whole**2, axis=0)
            terms = np.concatenate(data), csr_array(whole), tuple(ends.tolist()), tuple(joints)
            self._stretches.append(_Stretch(*terms))

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

    def blocks(self, rows: ArmRows, chosen: Collection[int]) -> GramBlocks:
        """Rows in clusters, whitened by the level that a set of causes leaves of them, too.

        Args:
            rows: All that were added.
            chosen: The causes.
        """
        (stretch,), clusters = self._stretches, rows.in_clusters
        scale = self._level(stretch, chosen, np.ones(len(stretch.data))).scale
        both = np.column_stack([stretch.data, stretch.columns.toarray()]) / scale[:, None]
        count = len(rows.tolerances)
        nothing = Gram(np.zeros((count, count)), np.zeros(count), 0.0, 0)
        every = [nothing] * len(clusters.recording)
        for k, terms in zip(stretch.joints, np.split(both, stretch.ends), strict=True):
            block = clusters.joints[k].block
            whitened = rows_of(terms, len(block))
            for b in np.unique(block).tolist():
                own = whitened[block == b]
                every[b] = every[b] + Gram.of(own[:, 1:], own[:, 0])
        out = no_blocks(rows)
        for gram, recording in zip(every, clusters.recording.tolist(), strict=True):
            out.add_sums(gram, recording)
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
        blocks, levels = no_blocks(self._rows), list[Level]()
        for stretch in self._stretches:
            level = self._level(stretch, chosen, np.ones(len(stretch.data)))
            columns = stretch.columns.toarray()
            blocks.add(columns / level.scale[:, None], stretch.data / level.scale)
            levels.append(level)
        hypotheses = Hypotheses(blocks, self._every)
        beside, out = ChosenSet.of(hypotheses, chosen), {}
        for i in known:
            gone = hypotheses.dependents(beside.chosen, [i])
            evidence = _evidence(hypotheses, beside, i)
            if evidence <= LINE * known[i]:
                both = zip(self._stretches, levels, strict=True)
                lost = (
                    own.likelihood - self._level(it, beside.chosen - gone, own.scale).likelihood
                    for it, own in both
                )
                evidence = min(evidence, sum(lost))
            out[i] = evidence + hypotheses.prior(gone)
        return out

    def _level(self, stretch: _Stretch, chosen: Collection[int], scale: Array) -> Level:
        deviations = self._rows.deviations(chosen)
        seen = np.sqrt(self._squares) * deviations > _UNSEEN
        prior = stretch.columns.toarray()[:, seen] * deviations[seen]
        terms = SpectralTerms(stretch.data, prior, stretch.ends)
        return terms.level(np.zeros((len(prior), 0)), scale)


def _evidence(hypotheses: Hypotheses, found: ChosenSet, i: int) -> float:
    """Log evidence of a set for a cause and what needs it."""
    gone = hypotheses.dependents(found.chosen, [i])
    rest = ChosenSet.of(hypotheses, found.chosen - gone)
    return found.objective - rest.objective - hypotheses.prior(gone)
