"""Causes of an arm with values: within bounds, bodies bodies, robust deviations."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...effects.effect import Effect
from ...estimation.balance.arm_candidates import GAIN, ZEROS
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.inference.evidence import chi_square_tail
from ...inference.cluster_robust import robust_covariance
from ...inference.gram_blocks import GramBlocks
from ...inference.hypotheses import Hypotheses
from ...inference.marginal import Marginal
from ...types import Array, IntArray
from .arm_hypotheses import arm_hypotheses, blocks_of

_TURNING = [1, 2, 3, 5, 7, 8]
"""First moments and products of inertia: a wheel's, whose rate alone is measured, are known in one
recording only, whose first sample they are counted from."""


@dataclass(frozen=True, eq=False)
class FittedArm:
    """Chosen causes with values.

    Args:
        rows: The recordings.
        blocks: They in clusters, whitened.
        chosen: Numbers of candidates.
    """

    rows: ArmRows
    blocks: GramBlocks
    chosen: tuple[int, ...]

    @classmethod
    def of(cls, rows: ArmRows, levels: Sequence[Array], chosen: Collection[int]) -> FittedArm:
        """By (8,) variances of what is left of every set of `ArmRows.joints`."""
        return cls(rows, blocks_of(rows, levels), tuple(sorted(chosen)))

    @cached_property
    def hypotheses(self) -> Hypotheses:
        """Every candidate."""
        return Hypotheses(self.blocks, arm_hypotheses(self.rows))

    @cached_property
    def values(self) -> Array:
        """(K,) most probable coefficients.

        A gain that is not named stays in the measured torques, in whose units all values are.
        """
        every = [
            replace(h, spike=np.zeros_like(h.spike)) if self.is_gain(i) else h
            for i, h in enumerate(arm_hypotheses(self.rows))
        ]
        held = Hypotheses(self.blocks, every)
        return held.mean(held.marginal(self.chosen), self.chosen)

    @cached_property
    def mean(self) -> Array:
        """(K,) the same with gains of measured torques within their tolerance."""
        return self.hypotheses.mean(self._marginal, self.chosen)

    @cached_property
    def _marginal(self) -> Marginal:
        return self.hypotheses.marginal(self.chosen)

    @cached_property
    def _covariance(self) -> tuple[Array, Array]:
        """(K, K) of all coefficients by the noise as it is thought; (K,) times it is more."""
        every = range(len(self.hypotheses.every))
        columns, variances = np.arange(self.blocks.count), self.hypotheses.variances(self.chosen)
        basis = self.hypotheses.basis(every)
        own = basis @ self._marginal.covariance(columns, variances) @ basis.T
        wider = np.ones(len(columns))
        if self.chosen:
            fitted = self.hypotheses.fitted(self._marginal, self.chosen)
            robust = robust_covariance(self.hypotheses, fitted, self.chosen)
            wider[robust.columns] = robust.wider
        return own, wider

    def covariance(self, columns: IntArray) -> Array:
        """(k, k) of some coefficients."""
        own, wider = self._covariance
        return wider[columns, None] * own[np.ix_(columns, columns)] * wider[columns]

    def spread(self, i: int) -> Array:
        """(k,) standard deviations of a candidate's coefficients."""
        return np.asarray(np.sqrt(np.diag(self.covariance(self.rows.places[i]))))

    def chance(self, i: int, which: Sequence[int] | slice = slice(None)) -> float:
        """Probability that a cause's coefficients are so far from nothing by chance (Wald).

            v' V^-1 v ~ chi-square of as many numbers as the data tell, trace(1 - V / prior^2)

        Args:
            i: The cause.
            which: Of its coefficients; all others are free.
        """
        own = self.rows.places[i][which]
        values, covariance = self.values[own], self.covariance(own)
        square = float(values @ np.linalg.solve(covariance, values))
        told = 1.0 - np.diag(self._covariance[0])[own] / self.rows.sizes[own] ** 2
        return chi_square_tail(square, max(1.0, float(np.sum(np.clip(told, 0.0, 1.0)))))

    def share(self, i: int, which: Sequence[int] | slice = slice(None)) -> float:
        """Rms of a candidate's torques by `ArmRows.judged_by`, at the joint where it is most.

        Args:
            i: The candidate.
            which: Of its coefficients.
        """
        own, shares = self.rows.places[i][which], [0.0]
        for k, rows in enumerate(self.rows.joints):
            whole = float(self.rows.judged_by[k % self.rows.robot.n_joints])
            if len(rows.torque) and whole:
                torque = rows.columns[:, own] @ self.values[own]
                shares.append(float(np.sqrt(np.mean(torque**2))) / whole)
        return max(shares)

    def is_gain(self, i: int) -> bool:
        """Whether a candidate is the gain of a joint's measured torques."""
        return self.rows.candidates[i].kind.id == GAIN

    def effects(self, which: Collection[int]) -> list[Effect]:
        """Some candidates with their values.

        With a gain of g a motor gives g times what is measured: columns are of measured torques,
        needed / g + effects / g, so that the coefficient of the gain is 1 - 1 / g. What a reading
        is off by is no torque of the motor.
        """
        rows = self.rows
        gains = {
            rows.candidates[i].where: 1.0 / (1.0 - float(self.values[rows.places[i][0]]))
            for i in self.chosen
            if self.is_gain(i)
        }
        out = []
        for i in which:
            c, values = rows.candidates[i], self.lasting(i, self.values)
            if self.is_gain(i):
                values = np.array([gains[c.where] - 1.0])
            elif c.where in gains and c.kind.id not in ZEROS:
                values = gains[c.where] * values
            out.append(c.applied(c.values(values)).canonical())
        return out

    def lasting(self, i: int, every: Array) -> Array:
        """(k,) of (K,) values of a candidate, without what goes round with an unknown angle."""
        c, values = self.rows.candidates[i], every[self.rows.places[i]]
        robot = self.rows.robot
        bodies = [robot.bodies[1 + robot.joints.index(joint)].name for joint in robot.rate_only]
        if c.kind.id == 'inertial_parameters' and c.where in bodies:
            values[_TURNING] = 0.0
        return values

    @property
    def calibration(self) -> list[int]:
        """Candidates that stay within the tolerance of any file, fitted beside what is named."""
        every = self.hypotheses
        return [
            i
            for i in every.active(self.chosen)
            if i not in self.chosen and self.rows.is_tolerated(i) and not self.is_gain(i)
        ]
