"""Whether causes hold where nothing is presumed of the spectrum of what is left.

`leftover.py` has a family of spectra. A line in the band of the motion, or torques that lack at a
few frequencies, are none of it: a body that went with them was worth 400 nats, and is worth 50 at
the level that is left beside it in bins of frequency, 9 where what is left without it has a level
of its own. A cause has to be worth its name so, too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_fit import Posterior
from ...estimation.inference.evidence import Gram
from ...estimation.inference.spectral_terms import Level, SpectralTerms, cosines
from ...types import Array
from .selection import Selection

_UNSEEN = 1e-2  # of the noise, all rows together: what no evidence shows
_OTHER = 0.5
"""Share of a cause's evidence at the level beside it from which what is left is of the family
there. A swing of one frequency is a line itself, whose bin would hide any cause in its own level;
beside its causes nothing is left there (2 to 50 times the evidence). Of what went with lines of
noise at most 0.2 was left."""


class SpectralEvidence:
    """Log evidence of chosen causes by every joint's level in bins of frequency.

    Args:
        selection: The choice.
        levels: (8,) variances by which rows are whitened first, see `ArmRows.joints`.
    """

    def __init__(self, selection: Selection, levels: Sequence[Array]) -> None:
        self._selection = selection
        data, columns = [], []
        for joint, variances in zip(selection.rows.joints, levels, strict=True):
            if len(joint.torque):
                torque, whitened, _ = joint.whitened(variances)
                data.append(cosines(torque))
                columns.append(cosines(whitened))
        self._data, self._columns = np.concatenate(data), np.concatenate(columns)
        self._ends = tuple(np.cumsum([len(x) for x in data])[:-1].tolist())
        self._sizes = np.linalg.norm(self._columns, axis=0)

    def gain(self, i: int) -> float:
        """Of one of the chosen causes, beside all others [nats].

        At the level that is left beside it; where that is another one than the rows are whitened
        by, what is left without it has its own, too.
        """
        selection = self._selection
        known = selection.gain_beside(self._beside, i)
        if known > _OTHER * selection.gain(i):
            return known
        others = [k for k in selection.chosen if k != i]
        without = self._level(others, self._all.scale)
        return min(known, self._all.likelihood - without.likelihood)

    @cached_property
    def _all(self) -> Level:
        return self._level(self._selection.chosen, np.ones(len(self._data)))

    @cached_property
    def _beside(self) -> Posterior:
        rows, scale = self._selection.rows, self._all.scale
        gram = Gram.of(self._columns / scale[:, None], self._data / scale) + rows.held
        return Posterior.of(gram, rows.deviations(self._selection.chosen))

    def _level(self, chosen: Iterable[int], scale: Array) -> Level:
        deviations = self._selection.rows.deviations(chosen)
        seen = self._sizes * deviations > _UNSEEN
        prior = self._columns[:, seen] * deviations[seen]
        free = np.zeros(prior.shape[1], dtype=bool)
        terms = SpectralTerms(self._data, prior, free, self._ends)
        return terms.level(np.zeros((len(prior), 0)), scale)


def check_spectrum(selection: Selection, levels: Sequence[Array]) -> set[int]:
    """Drop what is not worth its name by the level in bins of frequency, weakest first.

    An offset is one term: the bin around it says nothing of it, and it is not asked.

    Args:
        selection: What is chosen.
        levels: (8,) variances of every joint's leftover.

    Returns:
        Numbers of the causes that are gone.
    """
    gone: set[int] = set()
    kinds = [candidate.kind.id for candidate in selection.rows.candidates]
    while asked := [i for i in selection.chosen if kinds[i] not in ZEROS]:
        evidence = SpectralEvidence(selection, levels)
        margins = {i: evidence.gain(i) - selection.need(i) for i in asked}
        weakest = min(margins, key=margins.__getitem__)
        if margins[weakest] > 0.0:
            break
        gone.add(selection.leaning_on(weakest))
        selection.chosen = [i for i in selection.chosen if i not in gone]
    selection.bar(gone)
    return gone
