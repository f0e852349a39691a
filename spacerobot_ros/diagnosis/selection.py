"""Which causes recordings of an arm want: forward selection on Gram matrices.

Columns hold for effects of any size, so every hypothesis is algebra on sums over the rows. What
every machine has (`tolerance`) stands beside all of them. A cause is worth its name where the
evidence of its plausible size over its tolerance exceeds what the number of hypotheses makes
likely by chance, where every part of the data is better predicted with it from the others, and
where it lowers what is left as it is, too, not only its fast content.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..estimation.arm_fit import Posterior
from ..estimation.arm_rows import ArmRows
from ..estimation.columns import Candidate
from ..estimation.evidence import Gram, Score, score, sum_of
from ..types import Array, IntArray

_FRICTION = ('joint_coulomb_friction', 'joint_viscous_friction')
_AFTER_FRICTION = ('joint_stribeck_friction', 'joint_friction_curvature', 'joint_load_friction')
_EXTRA = {'joint_torque_ripple': 3.0, 'joint_stiffness': 2.0, 'inertial_parameters': 1.0}
_FAMILYWISE = 3.0  # nats: -ln of 5 % of all hypotheses together
_SIMPLER = 0.9
_MOST_PRUNED = 2


class Selection:
    """Choice of causes.

    Args:
        rows: The recordings.
        parts: Their Gram matrices, fold by fold.
    """

    def __init__(self, rows: ArmRows, parts: Sequence[Gram]) -> None:
        self.rows, self.parts = rows, list(parts)
        self.whole = sum_of(parts)
        self.chosen: list[int] = []
        self._pruned: dict[int, int] = {}
        live = [i for i, at in enumerate(rows.places) if self.whole.matrix[at, at].any()]
        self.live = live
        self._count = math.log(max(len(live), 1))

    def precision(self, chosen: Sequence[int]) -> Array:
        """(K,) with the sizes of what is chosen and the tolerances of the rest."""
        return self.rows.deviations(chosen) ** -2.0

    def need(self, i: int) -> float:
        c = self.rows.candidates[i]
        size = len(c.sizes)
        extra = _EXTRA.get(c.kind.id, 0.0)
        return self._count + _FAMILYWISE + 0.5 * (min(size, 4) - 1) + extra

    def gain(self, gram: Gram, i: int, chosen: Sequence[int]) -> float:
        """Log evidence for a cause beside others."""
        others = [k for k in chosen if k != i]
        return self._gain(Posterior.of(gram, self.precision(others)), i)

    def _gain(self, posterior: Posterior, i: int) -> float:
        own = self.rows.places[i]
        c = self.rows.candidates[i]
        gram = posterior.group(own)
        bounds = (c.lower, c.upper)
        free = (np.full(len(own), -np.inf), np.full(len(own), np.inf))
        size = score(gram, c.sizes, bounds, None).evidence
        return size - score(gram, self.rows.tolerances[own], free, None).evidence

    def run(self) -> list[int]:
        while True:
            best = self._next()
            if best is None:
                return self.chosen
            self.chosen.append(best)
            self._prune()

    def _next(self) -> int | None:
        posterior = Posterior.of(self.whole, self.precision(self.chosen))
        margins = {
            i: self._gain(posterior, i) - self.need(i)
            for i in self.live
            if i not in self.chosen and self._is_open(i)
        }
        wanted = {i: m for i, m in margins.items() if m > 0.0}
        if not wanted:
            return None
        top = max(wanted, key=wanted.__getitem__)
        where = self.rows.candidates[top].where
        near = [
            i
            for i, m in wanted.items()
            if self.rows.candidates[i].where == where and m > _SIMPLER * wanted[top]
        ]
        return min(near, key=lambda i: (len(self.rows.candidates[i].sizes), -wanted[i]))

    def _is_open(self, i: int) -> bool:
        c = self.rows.candidates[i]
        if self._pruned.get(i, 0) >= _MOST_PRUNED:
            return False
        taken = [self.rows.candidates[k] for k in self.chosen]
        if c.contradicts(taken):
            return False
        if c.kind.id in _AFTER_FRICTION:
            return any(t.where == c.where and t.kind.id in _FRICTION for t in taken)
        return True

    def _prune(self) -> None:
        while len(self.chosen) > 1:
            gains = {i: self.gain(self.whole, i, self.chosen) - self.need(i) for i in self.chosen}
            worst = min(gains, key=gains.__getitem__)
            if gains[worst] > 0.0:
                return
            self._drop(worst)

    def _drop(self, i: int) -> None:
        self.chosen.remove(i)
        self._pruned[i] = self._pruned.get(i, 0) + 1

    def held_out(self, i: int) -> Array:
        """(F,) predictive gain of every fold."""
        whole = self.gain(self.whole, i, self.chosen)
        rests = [sum_of([*self.parts[:f], *self.parts[f + 1 :]]) for f in range(len(self.parts))]
        return np.array([whole - self.gain(rest, i, self.chosen) for rest in rests])

    def gate(self) -> None:
        """Drop what does not hold on folds, weakest first."""
        if len(self.parts) < 2:
            return
        while self.chosen:
            gains = {i: self.held_out(i) for i in self.chosen}
            failing = {i: float(np.sum(g)) for i, g in gains.items() if not holds(g)}
            if not failing:
                return
            self._drop(min(failing, key=failing.__getitem__))


def holds(gains: Array) -> bool:
    """Whether a cause predicts parts of the data that it was not fitted to."""
    total, worst = float(np.sum(gains)), min(float(np.min(gains)), 0.0)
    if total <= 3.0 or -worst > 0.5 * (total - worst):
        return False
    return len(gains) < 3 or total - float(np.max(gains)) > 0.0
