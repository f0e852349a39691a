"""What a comparison of recordings found: changes, how surely, and what is left by them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from ...effects.effect import Effect
from ...effects.prior import RUN_TO_RUN
from ...estimation.balance.arm_rows import ArmRows
from ...inference.decisive import CLUSTERS, NAMED
from ...inference.hypotheses import Hypotheses
from ...inference.inferred import Inferred, InferredCause, infer
from ...inference.marginal import Marginal
from ...inference.model_search import best_set
from ...types import Array, IntArray
from ..limits import CLEAR, DIFFERENT
from .change_hypotheses import change_hypotheses
from .two_groups import TwoGroups


@dataclass(frozen=True, eq=False)
class Changes:
    """What a comparison found.

    Args:
        groups: The recordings.
        hypotheses: What may have changed.
        inferred: What the rows say of it.
    """

    groups: TwoGroups
    hypotheses: Hypotheses
    inferred: Inferred

    @classmethod
    def of(cls, groups: TwoGroups) -> Changes:
        """Found at the level that a first choice leaves."""
        mean, effects = _rough(groups)
        about = groups.about(effects)
        if about is not groups:
            groups, (mean, _) = about, _rough(about)
        groups = groups.left_by(mean)
        every = change_hypotheses(groups)
        return cls(groups, Hypotheses(groups.blocks, every), infer(groups.blocks, every))

    @cached_property
    def chosen(self) -> frozenset[int]:
        """Numbers of the hypotheses that are causes."""
        keys = {c.key for c in self.inferred.causes}
        return frozenset(i for i, h in enumerate(self.hypotheses.every) if h.key in keys)

    @cached_property
    def marginal(self) -> Marginal:
        """Of all rows under them."""
        return self.hypotheses.marginal(self.chosen)

    @cached_property
    def _likely(self) -> list[InferredCause]:
        """Changes whose evidence is no chance of few blocks, and of which one number is clear."""
        prior = self.hypotheses.log_odds
        return [
            c
            for c in self.inferred.causes
            if self.log_evidence(c) + prior[self.number(c)] > NAMED
            and np.any(np.abs(c.values) > CLEAR * np.sqrt(np.diag(self.covariance(c))))
        ]

    @cached_property
    def named(self) -> list[InferredCause]:
        """These, surest first, but for changes at a joint where something else changed.

        What no cause explains there is in part explained by any.
        """
        rows = self.groups.rows
        different = {rows.robot.joints[j] for j in self.different}
        places = [rows.candidates[cast(int, c.key)].where for c in self._likely]
        pairs = zip(self._likely, places, strict=True)
        return [c for c, where in pairs if where not in different]

    def number(self, cause: InferredCause) -> int:
        """Of its hypothesis."""
        return next(i for i in self.chosen if self.hypotheses.every[i].key == cause.key)

    def covariance(self, cause: InferredCause) -> Array:
        """(k, k) of its coefficients, cluster-robust."""
        at, robust = self._at(cause), self.inferred.covariance
        assert robust is not None  # of causes
        return robust.matrix[np.ix_(at, at)]

    def log_evidence(self, cause: InferredCause) -> float:
        """For a change beside the others over what the machine differs by anyway.

        By the scatter of few blocks: Student's t in place of a normal distribution.
        """
        at, robust = self._at(cause), self.inferred.covariance
        assert robust is not None  # of causes
        gone = self.hypotheses.exchange((), [self.number(cause)])
        gain = self.marginal.log_density - self.marginal.changed(*gone).log_density
        gain, freedom = gain / np.max(robust.wider[at]) ** 2, float(np.min(robust.freedom[at]))
        return 0.5 * (freedom + 1.0) * math.log1p(max(2.0 * gain / freedom, 0.0))

    def _at(self, cause: InferredCause) -> IntArray:
        assert self.inferred.covariance is not None  # of causes
        return np.searchsorted(self.inferred.covariance.columns, cause.hypothesis.columns)

    @cached_property
    def left(self) -> tuple[ArmRows, ArmRows]:
        """Torques that the named changes leave, by group."""
        return self.groups.left(self.mean(self.named))

    def mean(self, changes: Sequence[InferredCause]) -> Array:
        """(P,) coefficients, of the changes some alone."""
        out = self.inferred.mean.copy()
        for cause in self.inferred.causes:
            if cause not in changes:
                out[cause.hypothesis.columns] = 0.0
        return out

    @cached_property
    def rms(self) -> Array:
        """(2, n) of what is left where joints move, by group; NaN of one that does not [N m]."""
        n = self.groups.rows.robot.n_joints
        return np.array([[_rms(own.torque) for own in group.joints[:n]] for group in self.left])

    @cached_property
    def different(self) -> list[int]:
        """Joints at which clearly more is left afterwards than ever before.

        More than friction differs from run to run, too, and of rows enough to say so.
        """
        rows, out = self.groups.rows, list[int]()
        first, second = self.groups.left(self.mean(self._likely))
        pairs = zip(first.in_clusters.joints, second.joints, rows.scale.tolist(), strict=False)
        for j, (before, after, scale) in enumerate(pairs):
            if min(len(before.torque), len(after.torque)) < CLUSTERS:
                continue
            own = (before.torque[before.block == k] for k in np.unique(before.block))
            excess = _rms(after.torque) ** 2 - _rms(before.torque) ** 2
            is_other = _rms(after.torque) > DIFFERENT * max(map(_rms, own))
            if is_other and excess > (RUN_TO_RUN * scale) ** 2:
                out.append(j)
        return out

    @cached_property
    def undisturbed(self) -> Hypotheses:
        """The hypotheses as if nothing had changed that is not identified.

        What is different is taken from the torques afterwards, whose level is that before.
        """
        if not self.different:
            return self.hypotheses
        groups, rows = self.groups, self.groups.rows
        torques = [t.copy() for t in rows.torques]
        for torque, left in zip(torques[groups.count :], self.left[1].torques, strict=True):
            torque[:, self.different] -= left[:, self.different]
        levels = [list(own) for own in groups.levels]
        for j in self.different:
            for k in (j, j + rows.robot.n_joints):
                levels[1][k] = levels[0][k]
        quiet = rows.about_others(rows.columns, torques)
        groups = replace(groups, rows=quiet, levels=(levels[0], levels[1]))
        return Hypotheses(groups.blocks, change_hypotheses(groups))


def _rough(groups: TwoGroups) -> tuple[Array, list[Effect]]:
    """(P,) coefficients with a first choice of changes, and these."""
    rough = Hypotheses(groups.blocks, change_hypotheses(groups))
    first = best_set(rough)
    mean = rough.mean(first.marginal, first.chosen)
    chosen = (rough.every[i] for i in sorted(first.chosen))
    pairs = ((groups.rows.candidates[cast(int, h.key)], h) for h in chosen)
    return mean, [c.applied(c.values(mean[h.columns])) for c, h in pairs]


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else math.nan
