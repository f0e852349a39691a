"""Coefficients of an arm's causes and tolerances together: bounded, bodies bodies, honest stds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...effects.effect import Effect
from ...types import Array, IntArray
from ..inference.constrained import NEXT_TO_NOTHING, ConstrainedProblem, PhysicalBody
from ..inference.evidence import Gram, chi_square_tail, inverse_of_positive
from .arm_candidates import ZEROS
from .arm_rows import ArmRows

_TURNING = [1, 2, 3, 5, 7, 8]
"""First moments and products of inertia: a wheel's, whose rate alone is measured, are known in one
recording only, whose first sample they are counted from."""
_ROUNDING = 1e-9  # of a size: what barriers leave of coefficients that are zero


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
    def of(cls, gram: Gram, deviations: Array) -> Posterior:
        """From sums over rows and the standard deviation (K,) of every prior."""
        precision = deviations**-2.0
        scale = 1.0 / np.sqrt(np.diag(gram.matrix) + precision)
        scaled = scale[:, None] * gram.matrix * scale + np.diag(precision * scale**2)
        covariance = scale[:, None] * inverse_of_positive(scaled) * scale
        return cls(covariance, covariance @ gram.vector, precision, gram.rows)

    def under(self, own: IntArray, deviations: Array) -> Posterior:
        """The same with other priors of some coefficients (k,), by Woodbury's identity."""
        precision = self.precision.copy()
        precision[own] = deviations**-2.0
        more = np.diag(precision[own] - self.precision[own])
        across = self.covariance[own]
        inner = np.eye(len(own)) + more @ across[:, own]
        gain = np.linalg.solve(inner, more @ across).T
        mean = self.mean - gain @ self.mean[own]
        return Posterior(self.covariance - gain @ across, mean, precision, self.rows)

    def refitted(self, gram: Gram, nothing: IntArray, free: IntArray) -> Posterior:
        """The same with some coefficients nothing and some refitted to sums; the rest is held."""
        mean = self.mean.copy()
        mean[nothing], mean[free] = 0.0, 0.0
        left = gram.vector[free] - gram.matrix[free] @ mean
        matrix = gram.matrix[np.ix_(free, free)] + np.diag(self.precision[free])
        mean[free] = np.linalg.solve(matrix, left)
        return replace(self, mean=mean)

    def implausibility(self, without: IntArray | None = None) -> float:
        """Log density that the priors of all but some coefficients lose by their values."""
        lost = 0.5 * self.mean**2 * self.precision
        return float(np.sum(lost if without is None else np.delete(lost, without)))

    def group(self, own: IntArray) -> Gram:
        """Sums for some columns alone, all others integrated out."""
        covariance = self.covariance[own[:, None], own]
        inverse = 1.0 / covariance if len(own) == 1 else np.linalg.inv(covariance)
        matrix = inverse - np.diag(self.precision[own])
        return Gram(0.5 * (matrix + matrix.T), inverse @ self.mean[own], 0.0, self.rows)


@dataclass(frozen=True, eq=False)
class ArmFit:
    """Chosen causes with values.

    Args:
        rows: The recordings.
        whole: Sums over all rows, whitened.
        chosen: Numbers of candidates.
        plain: Sums over the rows as they are, by which values are fitted: what is left goes with
            the motion, and whitened rows trust its fast part. None: those of `whole`.
    """

    rows: ArmRows
    whole: Gram
    chosen: tuple[int, ...]
    plain: Gram | None = None

    @cached_property
    def deviations(self) -> Array:
        """(K,) prior standard deviations: sizes of what is chosen, tolerances of the rest."""
        return self.rows.deviations(self.chosen)

    @cached_property
    def posterior(self) -> Posterior:
        """Over all recordings."""
        return Posterior.of(self.whole, self.deviations)

    @cached_property
    def values(self) -> Array:
        """(K,) most probable coefficients within bounds, bodies bodies.

        A delay leaves a derivative of torques, of which rows as they are show next to nothing
        under what is slow in them: it is what whitened rows say.
        """
        gram, used = self.plain or self.whole, self._used
        late = np.isin(used, self._delays)
        held, used = used[late], used[~late]
        known = np.clip(self.posterior.mean[held], self.rows.lower[held], self.rows.upper[held])
        at = np.ix_(used, used)
        problem = ConstrainedProblem(
            gram.matrix[at] + np.diag(self.deviations[used] ** -2.0),
            gram.vector[used] - gram.matrix[np.ix_(used, held)] @ known,
            self.deviations[used],
            self.rows.lower[used],
            self.rows.upper[used],
            self._bodies(used),
        )
        out = np.zeros(len(self.deviations))
        out[used], out[held] = problem.solve(), known
        out[np.abs(out) < _ROUNDING * self.deviations] = 0.0
        return out

    def covariance(self, i: int, wider: float = 1.0) -> Array:
        """(k, k) of a candidate's coefficients.

        Where two ways to weigh the rows differ, what is left is no noise: by so much, too, values
        are uncertain, all in that one direction.

        Args:
            i: The candidate.
            wider: Times by which deviations are larger than whitened rows say.
        """
        own = self.rows.places[i]
        weighing = self.values[own] - self.posterior.mean[own]
        return wider**2 * self.posterior.covariance[np.ix_(own, own)] + np.outer(
            weighing, weighing
        )

    def spread(self, i: int, wider: float = 1.0) -> Array:
        """(k,) standard deviations of a candidate's coefficients, see `covariance`."""
        return np.asarray(np.sqrt(np.diag(self.covariance(i, wider))))

    def chance(self, i: int, wider: float, which: Sequence[int] | slice = slice(None)) -> float:
        """Probability that a candidate's coefficients are so far from nothing by chance (Wald).

            v' V^-1 v ~ chi-square of as many numbers as the data tell, trace(1 - V / prior^2)

        Args:
            i: The candidate.
            wider: See `covariance`.
            which: Of its coefficients; all others are free.
        """
        own = self.rows.places[i][which]
        scale = self.deviations[own]
        values = self.values[own] / scale
        covariance = self.covariance(i, wider)[which][:, which] / np.outer(scale, scale)
        prior_share = np.diag(self.posterior.covariance)[own] / scale**2
        square = float(values @ np.linalg.solve(covariance, values))
        return chi_square_tail(square, max(1.0, float(np.sum(1.0 - prior_share))))

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

    @property
    def _delays(self) -> list[int]:
        """Columns of chosen delays of efforts."""
        rows = self.rows
        late = (i for i in self.chosen if rows.candidates[i].kind.id == 'effort_delay')
        return [int(k) for i in late for k in rows.places[i]]

    @property
    def _used(self) -> IntArray:
        """Columns with a say, and all of a body that has one: what is not seen bounds the rest.

        A gain that is not named stays in the measured torques, in whose units all values are.
        """
        named = [self.rows.candidates[i].where for i in self.chosen if self.is_gain(i)]
        out = np.diag(self.whole.matrix) > 0.0
        for i, at in enumerate(self.rows.places):
            if self.rows.candidates[i].kind.id == 'inertial_parameters':
                out[at] = out[at].any()
            if self.is_gain(i) and self.rows.candidates[i].where not in named:
                out[at] = False
        return np.flatnonzero(out)

    def is_gain(self, i: int) -> bool:
        """Whether a candidate is the gain of a joint's measured torques."""
        return self.rows.candidates[i].kind.id == 'joint_torque_constant'

    def _bodies(self, used: IntArray) -> tuple[PhysicalBody, ...]:
        robot = self.rows.robot
        names = [body.name for body in robot.bodies]
        found = [
            PhysicalBody(
                np.searchsorted(used, self.rows.places[i]),
                robot.inertial_parameters[names.index(str(c.where))]
                if c.recordings is None
                else NEXT_TO_NOTHING,  # a load
            )
            for i, c in enumerate(self.rows.candidates)
            if c.kind.id == 'inertial_parameters'
            and (i in self.chosen or self.rows.is_tolerated(i))
            and np.all(np.isin(self.rows.places[i], used))
        ]
        return tuple(body for body in found if body.is_body)

    def effects(self, which: Sequence[int]) -> list[Effect]:
        """Some candidates with their values.

        With a gain of g a motor gives g times what is measured: columns are of measured torques,
        needed / g + effects / g, so that the coefficient of the gain is 1 - 1 / g. What a reading
        is off by is no torque of the motor.
        """
        rows = self.rows
        gains = {
            rows.candidates[i].where: 1.0 / (1.0 - min(float(self.values[rows.places[i][0]]), 0.9))
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
        used = self._used
        return [
            i
            for i, at in enumerate(self.rows.places)
            if i not in self.chosen and self.rows.is_tolerated(i) and np.all(np.isin(at, used))
        ]
