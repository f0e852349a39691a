r"""Matched filters for pulses of torque on one joint, beside every column of the balance.

With whitened rows r, columns A of prior standard deviations S, and a whitened template h on one
joint, all coefficients integrated out,

    num = h' r - u' y,  den = h' h - u' u,   L L' = A' A + S^-2,  u = L^-1 A' h,  y = L^-1 A' r,

the torque is num / den with standard deviation 1 / sqrt(den), and z = num / sqrt(den). Only what
no column can make speaks for an event, and its size is not drawn by what the columns take of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from ...effects.surroundings.external import pulse_shape
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.leftover import JointRows
from ...types import Array, BoolArray, IntArray

SPREAD = 0.15
"""Time by which the filter of the balance spreads the ends of a pulse [s]."""
_CHUNK = 400  # templates at once
_MEMORY = 20.0  # s around templates in which their whitening is looked at
_TAIL = 1.0  # s around a pulse, where its filtered shape ends
_COVERED = 0.5  # of a pulse's square that rows must see
_SEEN = 0.05  # of a template's square that columns must leave for it to say anything


@dataclass(frozen=True, slots=True, eq=False)
class Pulses:
    """Shapes of M pulses: (M,) centre and duration [s], and the share of their edges."""

    centre: Array
    duration: Array
    edge: Array

    def __getitem__(self, at: slice) -> Pulses:
        """Some of them."""
        return Pulses(self.centre[at], self.duration[at], self.edge[at])

    def __len__(self) -> int:
        """Number of them."""
        return len(self.centre)

    @property
    def start(self) -> Array:
        """(M,) [s]."""
        return self.centre - 0.5 * self.duration

    @property
    def end(self) -> Array:
        """(M,) [s]."""
        return self.centre + 0.5 * self.duration


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """M templates: (M,) torque [N m], its standard deviation, and z; nan, inf, 0: unseen."""

    torque: Array
    std: Array
    z: Array


@dataclass(frozen=True, slots=True, eq=False)
class RowSet:
    """Rows of one joint, over their scale (M,), with times (M,) [s] and recordings (M,)."""

    rows: JointRows
    time: Array
    run: IntArray
    scale: Array

    @classmethod
    def of(cls, rows: ArmRows, j: int, scale: Array) -> RowSet:
        """All rows of a joint, `scale` in the place of the level's shapes near turns."""
        r, by = rows.joints[j], scale[:, None]
        usual = r.observed[:, :2] / by
        own = JointRows(r.torque / scale, r.columns / by, usual, r.block, r.gap)
        return cls(own, rows.joint_times(j), rows.recording[r.block], scale)

    def part(self, kept: BoolArray) -> RowSet:
        """Some of the rows; times between them are passed over by the whitening."""
        r, time, run = self.rows, self.time[kept], self.run[kept]
        gap = np.diff(time, prepend=time[:1])
        gap[1:][np.diff(run) != 0] = 0.0
        own = JointRows(r.torque[kept], r.columns[kept], r.observed[kept], r.block[kept], gap)
        return RowSet(own, time, run, self.scale[kept])


class PulseScan:
    """One model's rows with some left out.

    Args:
        rows: The recordings.
        left_out: (M,) rows of every joint that are not used.
        scales: (M,) how much more is left of each row than of others, see `scatter`.
        levels: (6,) variances of every joint's leftover; None: those of the rows that are kept.
    """

    def __init__(
        self,
        rows: ArmRows,
        left_out: Sequence[BoolArray],
        scales: Sequence[Array],
        levels: Sequence[Array] | None = None,
    ) -> None:
        self.rows, self.left_out = rows, left_out
        self.all = [RowSet.of(rows, j, scale) for j, scale in enumerate(scales)]
        self.kept = [own.part(~out) for own, out in zip(self.all, left_out, strict=True)]
        self.levels = levels or leftover_levels(
            rows, rows.sizes, rows.friction, [own.rows for own in self.kept]
        )
        white = [self._white(j, own) for j, own in enumerate(self.kept)]
        self._sums = [(a.T @ a, a.T @ r) for r, a in white]
        self._white_kept = white
        self._whole = self._factor(np.zeros((1, 1)), np.zeros(1))

    def test_kept(self, j: int, run: int, pulses: Pulses) -> Filtered:
        """Pulses in the order of their time, by the rows that are kept."""
        parts = []
        own, (torque, columns) = self.kept[j], self._white_kept[j]
        for first in range(0, len(pulses), _CHUNK):
            some = pulses[first : first + _CHUNK]
            near = (own.run == run) & (own.time > some.start[0] - _MEMORY)
            near &= own.time < some.end[-1] + _MEMORY
            white = self._templates(j, run, own.part(near), some)
            parts.append(_filtered(white, torque[near], columns[near], self._whole))
        return Filtered(*np.concatenate(parts, axis=1))

    def test(self, j: int, run: int, pulses: Pulses) -> Filtered:
        """Any pulses of one neighbourhood, its rows used again beside all that are kept."""
        whole = self.all[j]
        inside = (whole.run == run) & (whole.time > np.min(pulses.start) - SPREAD)
        inside &= whole.time < np.max(pulses.end) + SPREAD
        own = whole.part(~self.left_out[j] | inside)
        torque, columns = self._white(j, own)
        matrix, vector = self._sums[j]
        factor = self._factor(columns.T @ columns - matrix, columns.T @ torque - vector)
        white = self._templates(j, run, own, pulses)
        return Filtered(*_filtered(white, torque, columns, factor))

    @cached_property
    def coefficients(self) -> Array:
        """(K,) of all columns, by the rows that are kept."""
        lower, y, scale = self._whole
        return np.asarray(scale * solve_triangular(lower, y, lower=True, trans=1))

    def spread(self, columns: Array) -> Array:
        """(M,) standard deviation of what rows of columns (M, K) take by all coefficients."""
        lower, _, scale = self._whole
        return np.asarray(
            np.sqrt(np.sum(solve_triangular(lower, (columns * scale).T, lower=True) ** 2, axis=0))
        )

    def left(self, j: int) -> Array:
        """(M,) whitened rows of a joint, of those that are kept, less what the columns take."""
        torque, columns = self._white_kept[j]
        return np.asarray(torque - columns @ self.coefficients)

    def _white(self, j: int, own: RowSet) -> tuple[Array, Array]:
        if not len(own.time):
            return np.zeros(0), np.zeros((0, len(self.rows.sizes)))
        torque, columns, _ = own.rows.whitened(self.levels[j])
        return torque, columns

    def _factor(self, matrix: Array, vector: Array) -> tuple[Array, Array, Array]:
        """L of all rows with some more, columns scaled; L^-1 A' r; and the scale."""
        whole = (
            np.diag(self.rows.sizes**-2.0)
            + self.rows.held.matrix
            + matrix
            + sum(s[0] for s in self._sums)
        )
        scale = 1.0 / np.sqrt(np.diag(whole))
        lower = np.asarray(np.linalg.cholesky(scale[:, None] * whole * scale))
        right = np.asarray(scale * (vector + sum(s[1] for s in self._sums)))
        return lower, np.asarray(solve_triangular(lower, right, lower=True)), np.asarray(scale)

    def _templates(self, j: int, run: int, own: RowSet, pulses: Pulses) -> Array:
        """(rows, M) whitened pulses, as the balance's filter leaves them.

        Zero where less than half of a pulse falls on rows.
        """
        arm = self.rows.balances[run].arm
        shown = np.zeros((len(own.time), len(pulses)))
        at = np.flatnonzero(own.run == run)
        for duration, edge in set(zip(pulses.duration, pulses.edge, strict=True)):
            these = np.flatnonzero((pulses.duration == duration) & (pulses.edge == edge))
            lag = np.arange(-0.5 * duration - _TAIL, 0.5 * duration + _TAIL, arm.step)
            smooth = arm.in_band(pulse_shape(lag / duration + 0.5, edge))
            values = np.interp(own.time[at, None] - pulses.centre[these], lag, smooth, 0.0, 0.0)
            whole = np.sum(smooth**2) / arm.stride
            values[:, np.sum(values**2, axis=0) < _COVERED * whole] = 0.0
            shown[np.ix_(at, these)] = values
        rows, shown = own.rows, shown / own.scale[:, None]
        both = JointRows(rows.torque, shown, rows.observed, rows.block, rows.gap)
        return both.whitened(self.levels[j])[1]


def _filtered(
    white: Array, torque: Array, columns: Array, factor: tuple[Array, Array, Array]
) -> tuple[Array, Array, Array]:
    """Torques, standard deviations and z of whitened templates (rows, M)."""
    lower, y, scale = factor
    u = solve_triangular(lower, scale[:, None] * (columns.T @ white), lower=True)
    square = np.sum(white**2, axis=0)
    den, num = square - np.sum(u**2, axis=0), white.T @ torque - u.T @ y
    seen = (den > _SEEN * square) & (square > 0.0)
    den = np.where(seen, den, np.nan)
    return (
        np.asarray(num / den),
        np.where(seen, den**-0.5, np.inf),
        np.where(seen, num / np.sqrt(den), 0.0),
    )
