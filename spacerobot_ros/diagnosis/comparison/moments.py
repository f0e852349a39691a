"""Whether a change is said by all of the motion, or by moments in which the model errs.

    V = sum_m (c_m - c) (c_m - c)^T

with c the coefficients of a change and c_m those of all rows but a moment's: the jackknife over
clusters (MacKinnon, Nielsen and Webb, J. Appl. Econometrics 38 (2023)), which asks nothing of what
a model misses but that moments err for themselves. Whitened rows trust what is fast: most of what
they say of a rotor may be the start of one motion, where what is missed is not the level that the
rest of it has. Where a moment says most, V is as large as what it says.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...estimation.balance.arm_fit import Posterior
from ...estimation.inference.evidence import Gram, fisher_limit, fisher_tail
from ...types import Array, IntArray
from ..limits import CHANCE
from ..old.selection import Selection


@dataclass(frozen=True, slots=True, eq=False)
class ByMoments:
    """One change by single moments, along one direction of its coefficients.

    Args:
        square: Of the direction by the rows' own covariance.
        well_determined: Number of coefficients that the data determine (MacKay's gamma).
        wider: Times by which the change is less certain than its rows say, 1 or more.
        freedom: Of that scatter (Satterthwaite, Biometrics Bulletin 2 (1946)): the moments that
            count, 1 where a single one decides.
    """

    square: float
    well_determined: float
    wider: float
    freedom: float

    @property
    def chance(self) -> float:
        """Probability that a change is so far from nothing where there is none."""
        return fisher_tail(self.square / self.wider**2, self.well_determined, self.freedom)

    @property
    def limit(self) -> float:
        """Multiple of the direction from which a change is no chance."""
        square = fisher_limit(CHANCE, self.well_determined, self.freedom)
        return self.wider * math.sqrt(square / self.square)


class Moments:
    """Sums over each moment of the recordings of a selection."""

    def __init__(self, selection: Selection, parts: Sequence[Gram]) -> None:
        self.selection, self.parts = selection, parts
        self._kept: dict[frozenset[int], list[dict[int, tuple[Array, Array]]]] = {}

    def drop_chances(self) -> None:
        """Drop changes that moments do not agree on, least clear first."""
        chosen = self.selection.chosen
        while chosen:
            chances = {i: self.judge(i).chance for i in chosen}
            worst = max(chances, key=chances.__getitem__)
            if chances[worst] < CHANCE:
                return
            self.selection.drop(worst)

    def judge(self, i: int, direction: Array | None = None) -> ByMoments:
        """A change beside the chosen ones.

        Args:
            i: Its number.
            direction: (k,) of its coefficients; None: the one that is found.
        """
        whole, *without = (found[i] for found in self._found())
        covariance, found = whole
        steps = np.array([estimate for _, estimate in without]) - found
        sizes = self.selection.rows.sizes[self.selection.rows.places[i]]
        return _judged(covariance, found if direction is None else direction, steps, sizes)

    def _found(self) -> list[dict[int, tuple[Array, Array]]]:
        """Covariance and mean of every change, of all rows, then of all but those of each moment.

        What was asked of the last choice is kept.
        """
        selection = self.selection
        key = frozenset(selection.chosen)
        if key not in self._kept:
            deviations = selection.rows.deviations(key)
            grams = (selection.whole, *(selection.whole - part for part in self.parts))
            self._kept = {key: [self._estimates(Posterior.of(g, deviations)) for g in grams]}
        return self._kept[key]

    def _estimates(self, posterior: Posterior) -> dict[int, tuple[Array, Array]]:
        rows = self.selection.rows
        own = {i: rows.places[i] for i in self.selection.live}
        return {i: _estimate(posterior, at, rows.sizes[at]) for i, at in own.items()}


def _estimate(posterior: Posterior, own: IntArray, sizes: Array) -> tuple[Array, Array]:
    """Covariance and mean of some coefficients under their plausible sizes."""
    gram = posterior.group(own)
    covariance = np.asarray(np.linalg.inv(gram.matrix + np.diag(sizes**-2.0)))
    return covariance, covariance @ gram.vector


def _judged(covariance: Array, direction: Array, steps: Array, sizes: Array) -> ByMoments:
    weighed = np.linalg.solve(covariance, direction)
    square = max(float(direction @ weighed), 1e-300)
    scatter = (steps @ weighed) ** 2
    total = float(np.sum(scatter))
    return ByMoments(
        square=square,
        well_determined=max(1.0, float(np.sum(1.0 - np.diag(covariance) / sizes**2))),
        wider=math.sqrt(max(1.0, total / square)),
        freedom=total**2 / max(float(np.sum(scatter**2)), 1e-300) if total else math.inf,
    )
