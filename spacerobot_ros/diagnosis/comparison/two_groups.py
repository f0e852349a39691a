"""Two groups of recordings of one machine as rows: what they share, what changed, what is of one.

Every cause has its coefficients twice, those that both groups share, which say nothing of a change
however large they are, and those that were added before the second group. The level of friction
and the zeros of sensors are besides others in every recording.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...effects.effect import Effect
from ...errors import ConfigurationError
from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_priors import DRY, FRICTION, OF_LOAD
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.arm_rows_about import about_model, is_of_readings
from ...inference.gram import sum_of
from ...inference.gram_blocks import NEVER_HELD_OUT, GramBlocks
from ...inference.marginal import Marginal
from ...types import Array, IntArray

LAWS = (*FRICTION, OF_LOAD)


@dataclass(frozen=True, eq=False)
class TwoGroups:
    """Rows of two groups of recordings, those before first.

    Args:
        rows: Of both, K columns.
        count: Number of recordings before.
        levels: (8,) variances of what no cause explains, by group and set of `ArmRows.joints`.
        is_repeated: Whether all are of one motion, whose mean torques are taken off.
    """

    rows: ArmRows
    count: int
    levels: tuple[Sequence[Array], Sequence[Array]]
    is_repeated: bool = False

    @property
    def size(self) -> int:
        """Number K of columns of the rows."""
        return len(self.rows.tolerances)

    @cached_property
    def groups(self) -> tuple[ArmRows, ArmRows]:
        """Rows of each group."""
        return split(self.rows, self.count)

    @cached_property
    def own(self) -> IntArray:
        """(m,) columns of what is another one in every recording."""
        return self._columns_of((DRY, *ZEROS))

    def places(self, run: int) -> IntArray:
        """(P,) which of the K columns each of all is in a recording; -1: none."""
        every, none = np.arange(self.size), np.full(self.size, -1)
        changed = every if run >= self.count else none
        own = np.full((len(self.rows.balances), len(self.own)), -1)
        own[run] = self.own
        return np.concatenate([every, changed, own.ravel()])

    @cached_property
    def blocks(self) -> GramBlocks:
        """The rows in clusters, each whitened by the level of its group."""
        out = GramBlocks(2 * self.size + len(self.rows.balances) * len(self.own))
        for group, levels, first in zip(self.groups, self.levels, (0, self.count), strict=True):
            clusters = group.in_clusters
            for gram, number in zip(clusters.parts(levels), clusters.recording, strict=True):
                run = first + int(number)
                out.add_sums(gram, run, places=self.places(run))
        for first in (0, self.size):  # scales that nothing measured tells are the file's
            held = np.full(out.count, -1)
            held[first : first + self.size] = np.arange(self.size)
            out.add_sums(self.rows.held, NEVER_HELD_OUT, places=held)
        return out

    def torque(self, run: int, coefficients: Array) -> Array:
        """(M, n) torques of a recording by coefficients (P,) [N m]."""
        places = self.places(run)
        own = np.bincount(places[places >= 0], coefficients[places >= 0], self.size)
        return np.asarray(self.rows.columns[run] @ own)

    def about(self, changes: Sequence[Effect]) -> TwoGroups:
        """With what goes with the model's torques, as delays do, about the changes afterwards.

        Torques that are late before are late with a load, too, and that is no change. Columns of
        gains stay: what the scale of all torques is uncertain by is said of a change, not found.
        """
        changes = [e for e in changes if e.acts('force') or e.acts('change')]
        if self.is_repeated or not changes:
            return self
        every = enumerate(self.rows.candidates)
        which = [i for i, c in every if is_of_readings(c) or c.kind.follows_load]
        runs = range(self.count, len(self.rows.balances))
        try:
            whole = {run: self.rows.balances[run].beside(changes) for run in runs}
        except ConfigurationError:  # together they are no robot
            return self
        return replace(self, rows=about_model(self.rows, whole, which))

    def left_by(self, mean: Array) -> TwoGroups:
        """With the levels of what coefficients (P,) leave: more columns explain some of any."""
        first, second = (
            leftover_levels(group, group.tolerances, self.friction) for group in self.left(mean)
        )
        return replace(self, levels=(first, second))

    def left(self, mean: Array) -> tuple[ArmRows, ArmRows]:
        """Torques that coefficients (P,) leave, by group; no columns explain any of them."""
        torques = [t - self.torque(run, mean) for run, t in enumerate(self.rows.torques)]
        return bare_rows(self.rows, torques, self.count)

    @cached_property
    def friction(self) -> Array:
        """(n,) rms torque before of all laws of friction, and what is uncertain in it [N m].

        Laws of neighbours among them: each alone is hardly told from others, their sum is.
        """
        rows, first, at = self.rows, self.groups[0], self._columns_of(LAWS)
        gram = sum_of([*first.parts(self.levels[0]), rows.held])
        variances = np.maximum(rows.sizes, rows.tolerances) ** 2
        machine = Marginal.of(gram, np.arange(self.size), variances)
        mean = machine.mean(at, variances[at])
        covariance = machine.covariance(at, variances[at])
        out = rows.friction.copy()
        for j, own in enumerate(rows.joints[: len(out)]):
            if len(own.torque):
                columns = own.columns[:, at]
                power = (columns @ mean) ** 2 + np.sum((columns @ covariance) * columns, axis=1)
                out[j] = math.hypot(out[j], math.sqrt(max(float(np.mean(power)), 0.0)))
        return out

    def _columns_of(self, kinds: Iterable[str]) -> IntArray:
        pairs = zip(self.rows.candidates, self.rows.places, strict=True)
        own = [at for c, at in pairs if c.kind.id in kinds]
        return np.concatenate([np.zeros(0, dtype=int), *own])


def split(rows: ArmRows, count: int) -> tuple[ArmRows, ArmRows]:
    """Rows of the first recordings, and of the others."""

    def some(part: slice) -> ArmRows:
        out = replace(rows, balances=rows.balances[part])
        out.__dict__.update(columns=rows.columns[part], torques=rows.torques[part])
        return out

    return some(slice(count)), some(slice(count, None))


def bare_rows(rows: ArmRows, torques: Sequence[Array], count: int) -> tuple[ArmRows, ArmRows]:
    """Torques (M, n) of every recording without columns, by group [N m]."""
    nothing = [np.broadcast_to(0.0, columns.shape) for columns in rows.columns]
    return split(rows.about_others(nothing, torques), count)
