"""Coefficients of an arm's causes and tolerances together: bounded, bodies bodies, honest stds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..effects.effect import Effect
from ..types import Array, IntArray
from .arm_rows import ArmRows
from .constrained import ConstrainedProblem, PhysicalBody
from .evidence import Gram, sum_of

_FEW_NATS = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """Every coefficient under its prior, without bounds.

    Args:
        covariance: (K, K). mean: (K,). precision: (K,) of the priors. rows: Number of rows.
    """

    covariance: Array
    mean: Array
    precision: Array
    rows: int

    @classmethod
    def of(cls, gram: Gram, precision: Array) -> Posterior:
        """From sums over rows and the precision (K,) of every prior."""
        scale = 1.0 / np.sqrt(np.diag(gram.matrix) + precision)
        scaled = scale[:, None] * gram.matrix * scale + np.diag(precision * scale**2)
        covariance = scale[:, None] * np.linalg.inv(scaled) * scale
        return cls(covariance, covariance @ gram.vector, precision, gram.rows)

    def group(self, own: IntArray) -> Gram:
        """Sums for some columns alone, all others integrated out."""
        inverse = np.linalg.inv(self.covariance[np.ix_(own, own)])
        matrix = inverse - np.diag(self.precision[own])
        return Gram(0.5 * (matrix + matrix.T), inverse @ self.mean[own], 0.0, self.rows)


@dataclass(frozen=True, eq=False)
class ArmFit:
    """Chosen causes with values.

    Args:
        rows: The recordings.
        parts: Their Gram matrices, fold by fold.
        chosen: Numbers of candidates.
    """

    rows: ArmRows
    parts: Sequence[Gram]
    chosen: tuple[int, ...]

    @cached_property
    def deviations(self) -> Array:
        """(K,) prior standard deviations: sizes of what is chosen, tolerances of the rest."""
        return self.rows.deviations(self.chosen)

    @cached_property
    def posterior(self) -> Posterior:
        """Over all recordings."""
        return Posterior.of(sum_of(self.parts), self.deviations**-2.0)

    @cached_property
    def values(self) -> Array:
        """(K,) most probable coefficients within bounds, bodies bodies."""
        gram, rows = sum_of(self.parts), self.rows
        lower, upper = (
            np.concatenate([getattr(c, name) for c in rows.candidates])
            for name in ('lower', 'upper')
        )
        # what is not named of a gain stays in the measured torques, in whose units all values are
        named = np.concatenate([rows.places[i] for i in self.chosen] or [np.zeros(0, int)])
        gains = [
            at
            for c, at in zip(rows.candidates, rows.places, strict=True)
            if c.kind.id == 'joint_torque_constant'
        ]
        tolerated = np.setdiff1d(np.concatenate(gains), named)
        import os; used = np.flatnonzero(np.diag(gram.matrix) > 0.0) if "G" in os.environ else np.setdiff1d(np.flatnonzero(np.diag(gram.matrix) > 0.0), tolerated)
        where = {int(k): i for i, k in enumerate(used)}
        robot = rows.balances[0].robot
        names = [body.name for body in robot.bodies]
        bodies = tuple(
            PhysicalBody(
                np.array([where[int(k)] for k in at]),
                robot.inertial_parameters[names.index(str(c.where))],
            )
            for i, (c, at) in enumerate(zip(rows.candidates, rows.places, strict=True))
            if c.kind.id == 'inertial_parameters'
            and all(int(k) in where for k in at)
            and (i in self.chosen or np.any(rows.tolerances[at] > 1e-3 * rows.sizes[at]))
        )
        information = gram.matrix[np.ix_(used, used)] + np.diag(self.deviations[used] ** -2.0)
        problem = ConstrainedProblem(
            information,
            gram.vector[used],
            self.deviations[used],
            lower[used],
            upper[used],
            tuple(b for b in bodies if b.inverse(np.zeros(len(used))) is not None),
        )
        out = np.zeros(len(self.deviations))
        out[used] = problem.solve()
        return out

    def effects(self, which: Sequence[int]) -> list[Effect]:
        """Some candidates with their values.

        With a gain of g a motor gives g times what is measured: columns are of measured torques,
        needed / g + effects / g, so that a coefficient c of the gain is 1 - 1 / g.
        """
        rows = self.rows
        gains = {}
        for c, at in zip(rows.candidates, rows.places, strict=True):
            if c.kind.id == 'joint_torque_constant':
                gains[c.where] = 1.0 / (1.0 - min(float(self.values[at[0]]), 0.9))
        out = []
        for i in which:
            c, values = rows.candidates[i], self.values[rows.places[i]]
            if c.kind.id == 'joint_torque_constant':
                values = np.array([gains[c.where] - 1.0])
            elif c.kind.group == 'joint' or c.kind.id == 'torque_sensor_bias':
                values = gains.get(c.where, 1.0) * values
            out.append(c.applied(c.values(values)))
        return out

    @cached_property
    def calibration(self) -> list[int]:
        """Candidates within their tolerance: what every machine has."""
        rows = self.rows
        return [
            i
            for i, at in enumerate(rows.places)
            if i not in self.chosen and np.any(self.values[at] != 0.0)
            and np.any(rows.tolerances[at] > 1e-3 * rows.sizes[at])
        ]
