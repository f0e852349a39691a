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

from ...estimation.balance.arm_rows import ArmRows
from ...types import Array, BoolArray
from .joint_scan import JointScan, Products, Pulses

_SEEN = 0.05  # of a template's square that columns must leave for it to say anything


@dataclass(frozen=True, slots=True, eq=False)
class Filtered:
    """M templates: (M,) torque [N m], its standard deviation, and z; nan, inf, 0: unseen."""

    torque: Array
    std: Array
    z: Array


class PulseScan:
    """One model's rows.

    Args:
        rows: The recordings.
        joints: Their rows, some left out, joint by joint.
    """

    def __init__(self, rows: ArmRows, joints: Sequence[JointScan]) -> None:
        self.rows, self.joints = rows, joints
        self._whole = self._factor(np.zeros((1, 1)), np.zeros(1))

    @classmethod
    def of(
        cls, rows: ArmRows, scales: Sequence[Array], levels: Sequence[Array | None]
    ) -> PulseScan:
        """Of all rows, by scales (M,) and levels of every joint; None: found."""
        every = enumerate(zip(scales, levels, strict=True))
        none = np.zeros(max(map(len, scales)), dtype=bool)
        joints = [JointScan(rows, j, none[: len(x)], x, level) for j, (x, level) in every]
        return cls(rows, joints)

    def without(self, left_out: Sequence[BoolArray], scales: Sequence[Array]) -> PulseScan:
        """The same with other rows (M,) of every joint left out, by other scales (M,)."""
        every = enumerate(zip(self.joints, left_out, scales, strict=True))
        joints = [
            own if own.is_of(out, scale) else JointScan(self.rows, j, out, scale)
            for j, (own, out, scale) in every
        ]
        return PulseScan(self.rows, joints)

    def test_kept(self, j: int, run: int, duration: float) -> Filtered:
        """All bells of a duration, by the rows that are kept."""
        return _filtered(self.joints[j].scanned(run, duration), self._whole)

    def test(self, j: int, run: int, pulses: Pulses) -> Filtered:
        """Any pulses of one neighbourhood, its rows used again beside all that are kept."""
        products, (matrix, vector) = self.joints[j].beside(run, pulses)
        before = self.joints[j].sums
        return _filtered(products, self._factor(matrix - before[0], vector - before[1]))

    def beside_functions(
        self, j: int, run: int, pulse: Pulses, functions: Array
    ) -> tuple[Array, Array]:
        """(1 + P, 1 + P) and (1 + P,): normal equations of one pulse and (M, P) functions.

        Every column of the balance is integrated out.
        """
        (cross, along, square), (matrix, vector) = self.joints[j].beside(run, pulse, functions)
        before, k = self.joints[j].sums, len(self.rows.sizes)
        lower, y, scale = self._factor(matrix[:k, :k] - before[0], vector[:k] - before[1])
        beside = np.column_stack([cross[:k], matrix[:k, k:]])
        u = solve_triangular(lower, scale[:, None] * beside, lower=True)
        normal = np.block([[square[:, None], cross[k:].T], [cross[k:], matrix[k:, k:]]])
        return normal - u.T @ u, np.concatenate([along, vector[k:]]) - u.T @ y

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
        own = self.joints[j]
        return np.asarray(own.torque - own.columns @ self.coefficients)

    def _factor(self, matrix: Array, vector: Array) -> tuple[Array, Array, Array]:
        """L of all rows with some more, columns scaled; L^-1 A' r; and the scale."""
        whole = (
            np.diag(self.rows.sizes**-2.0)
            + self.rows.held.matrix
            + matrix
            + sum(own.sums[0] for own in self.joints)
        )
        scale = 1.0 / np.sqrt(np.diag(whole))
        lower = np.asarray(np.linalg.cholesky(scale[:, None] * whole * scale))
        right = np.asarray(scale * (vector + sum(own.sums[1] for own in self.joints)))
        return lower, np.asarray(solve_triangular(lower, right, lower=True)), np.asarray(scale)


def _filtered(products: Products, factor: tuple[Array, Array, Array]) -> Filtered:
    """Torques, standard deviations and z of whitened templates."""
    (cross, along, square), (lower, y, scale) = products, factor
    u = solve_triangular(lower, scale[:, None] * cross, lower=True)
    den, num = square - np.sum(u**2, axis=0), along - u.T @ y
    seen = (den > _SEEN * square) & (square > 0.0)
    den = np.where(seen, den, np.nan)
    return Filtered(
        np.asarray(num / den),
        np.where(seen, den**-0.5, np.inf),
        np.where(seen, num / np.sqrt(den), 0.0),
    )
