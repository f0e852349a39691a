"""Maximum-likelihood estimate by the momentum filter, iterated, and continued as data come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_filter import MomentumFilter, Stretch
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.inference.square_root import marginal
from ..estimation.trajectory.reference import NoiseLevels, ReferenceTrajectory
from ..estimation.trajectory.time_base import channel_stamps, filter_times, refuse_long_gaps
from ..estimation.unknowns.torque_hold import Holds
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from . import validity_limits as limits
from .momentum_posterior import MomentumPosterior, posterior_of, prior_of
from .outliers import FURTHEST


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What data told of some of the filter's constants t: |factor (t - t(best)) - values|^2.

    Args:
        part: Which m of the filter's constants.
        best: (p,) most probable constants, the bodies' prior included.
        factor: (m, m) square-root information, upper triangular; without the bodies' prior.
        values: (m,).
    """

    part: slice
    best: Array
    factor: Array
    values: Array

    def of(self, part: slice) -> Known:
        """What is known of some of these constants, the others eliminated."""
        part = slice(max(part.start, self.part.start), min(part.stop, self.part.stop))
        inside = np.arange(part.start - self.part.start, part.stop - self.part.start)
        left = marginal(np.column_stack([self.factor, self.values]), inside)
        return Known(part, self.best, left[:, :-1], left[:, -1])


class MaximumLikelihood:
    """Total momentum, AAM, bodies and nuisances from stretches of data.

    Args:
        model: Robot and unknowns.
        settings: The identifier's settings, for the prior of the wheels.
        known: What earlier data of the same robot told; None: nothing.

    Attributes:
        constants: (p,) about which everything is linearized; the robot file's at first.
        is_converged: Whether another pass of `solve` would move the AAM by less than 0.01 sigma.
        is_abandoned: Whether `solve` shall end before its next pass.
    """

    def __init__(
        self, model: MomentumModel, settings: IdentifierSettings, known: Known | None = None
    ) -> None:
        self.model, self._settings, self._known = model, settings, known
        self._prior: tuple[Array, Array] | None = None
        self._filter = MomentumFilter(model)
        self.constants = model.prior()
        self.is_converged = self.is_abandoned = False
        self._joint_share = self._beyond = 0.0
        self._share = 1.0  # of a shift, that a pass leaves
        self._posterior: MomentumPosterior | None = None

    @property
    def known(self) -> Known | None:
        """What other segments of the run may know; None: nothing yet."""
        if self._prior is None or not self.is_converged:
            return self._known
        factor, best = self._filter.information.factor.copy(), self.posterior().mean
        return Known(slice(0, len(factor)), best, factor[:, :-1], self._left_at(best))

    @property
    def misfit(self) -> tuple[float, int]:
        """Sum of squared residuals of the data so far at the estimate, and their number of rows.

        What is beyond six standard deviations of a row does not count, so that a lone outlier
        that was not found is no misfit; what it does to the others' residuals is.
        """
        left = self._left_at(self.posterior().mean)
        squares = self._filter.information.residual + float(left @ left) - self._beyond
        return max(squares, 0.0), self._filter.information.rows

    @property
    def chi2_per_dof(self) -> float:
        """Residual chi-square per degree of freedom."""
        squares, rows = self.misfit
        return squares / max(rows - self.posterior().rank, 1)

    @property
    def is_settled(self) -> bool:
        """Whether the iteration and the bodies have converged."""
        return self.is_converged and self.posterior().is_settled

    @property
    def is_explained(self) -> bool:
        """Whether they have, and the model explains the data."""
        return self.is_settled and self.chi2_per_dof <= limits.LARGEST_CHI2

    @property
    def limit(self) -> float:
        """Largest deviation of the captured wheels' momentum that is valid [N m s].

        A share of it, or of the most that the joints' motion alone had, if that is more.
        """
        aam = float(np.linalg.norm(self.posterior().mean[self.model.aam]))
        return self._settings.valid_std * max(aam, self._joint_share, 1e-9)

    def solve(self, stretch: Stretch, on_pass: Callable[[int], None] = lambda _: None) -> None:
        """Estimate from a stretch alone, from the prior or from what was found last.

        Passes of the filter about ever better constants; see `curved_posterior` for the steps that
        are taken within a pass.

        Args:
            stretch: The stretch.
            on_pass: Called with the number of passes that are done.

        Raises:
            IdentificationError: it is abandoned.
        """
        if self._prior is None:
            # the total momentum is centred on what the robot file's values imply
            total = self.model.total_momentum(stretch.kinematics, self.model.prior())
            wide = self._settings.momentum_prior_std
            self._prior = prior_of(self.model, wide, total, stretch.holds)
            self.constants = self._prior[0].copy()
            if self._known is not None:
                part = slice(self._known.part.start, self.model.y.stop)
                self.constants[part] = self._known.best[part]
        else:
            self.constants = self.posterior().mean
        is_near, self.is_converged, asked = self.is_converged, False, np.inf
        for done in range(limits.MOST_PASSES):
            on_pass(done)
            if self.is_abandoned:
                raise IdentificationError('nobody waits for it any more')
            if done:
                self.constants = self.posterior().mean
            self._restart()
            try:
                values = self._filter.run(stretch, self.constants, is_near=is_near)
                before, asked = asked, self._shift_asked()
            except (np.linalg.LinAlgError, ValueError):  # of numbers that are not finite
                self._restart()
                break
            if before < np.inf:
                self._share = min(1.0, limits.CONTRACTION * asked / before)
            self.is_converged = is_near and asked * self._share < limits.CONVERGED
            if self.is_converged:
                self._beyond = _beyond(values)
                break
            is_near = True
        self._joint_share = self._move_on(stretch)

    def extend(self, record: Record, context: Record, noise: NoiseLevels, holds: Holds) -> Stretch:
        """Continue with what came since the last stretch.

        Args:
            record: Samples since then.
            context: The same with some before and after, through which the splines go too.
            noise: Noise levels.
            holds: When torques were set.
        """
        if self._prior is None:
            raise ValueError('nothing was solved yet')
        start, attitude = self._filter.take_end()
        stamps = [t for t in channel_stamps(record).values() if len(t)]
        times = filter_times([*stamps, np.array([start])], (start, max(t[-1] for t in stamps)))
        refuse_long_gaps(times)
        span = min(context.joint_time[0], start), max(context.joint_time[-1], times[-1])
        reference = ReferenceTrajectory(context, noise, times, attitude, span)
        stretch = Stretch(record, noise, reference, holds)
        rows: list[tuple[Array, Array]] = []
        self._posterior = None
        self._filter.run(stretch, self.constants, rows)
        change = self._told_change(self.posterior().mean)
        self._beyond += sum(_beyond(values - columns @ change) for columns, values in rows)
        self._joint_share = max(self._joint_share, self._move_on(stretch))
        return stretch

    def posterior(self) -> MomentumPosterior:
        """The estimate so far."""
        if self._prior is None:
            raise ValueError('nothing was solved yet')
        if self._posterior is None:
            factor = self._filter.information.factor
            self._posterior = posterior_of(self.model, factor, self.constants, self._prior[1])
        return self._posterior

    def _restart(self) -> None:
        """A filter that knows what was known before the stretch, about the constants."""
        assert self._prior is not None
        model, (mean, std) = self.model, self._prior
        self._filter, self._posterior = MomentumFilter(model), None
        others = np.delete(np.arange(model.size), model.y)
        size = model.filter_size
        rows, values = np.zeros((size, size)), np.zeros(size)
        at = np.delete(np.arange(size), model.filter_bodies)
        rows[at, at] = 1.0 / std[others]
        values[at] = (mean - self.constants)[others] / std[others]
        if (known := self._known) is not None:
            part = known.part
            off = model.filtered(self.constants) - model.filtered(known.best)
            rows[part, :], values[part] = 0.0, 0.0
            rows[part, part] = known.factor
            values[part] = known.values - known.factor @ off[part]
        self._filter.information.add(rows, values)
        self._filter.information.reset_residual()
        self._beyond = 0.0

    def _left_at(self, constants: Array) -> Array:
        """(g,) what the square-root information leaves unexplained at (p,) constants."""
        factor = self._filter.information.factor
        return np.asarray(factor[:, -1] - factor[:, :-1] @ self._told_change(constants))

    def _told_change(self, constants: Array) -> Array:
        return self.model.filtered(constants) - self.model.filtered(self.constants)

    def _move_on(self, stretch: Stretch) -> float:
        """Go on about the best constants where nothing that was told depends on that.

        Where momentum is not linear in what is told, stretches about different ones would
        disagree, and what no motion tells would seem told (Huang, Mourikis and Roumeliotis, IJRR
        29 (2010) 502).

        Returns:
            Largest momentum that the joints' motion alone had [N m s].
        """
        mean = self.posterior().mean
        if self.model.is_minimal:
            self._filter.shift_constants(self._told_change(mean))
            self.constants = mean
        return self.model.joint_share(stretch.kinematics, mean)

    def _shift_asked(self) -> float:
        """Largest shift of the constants, in standard deviations."""
        posterior = self.posterior()
        shift = np.abs(posterior.mean - self.constants) / np.sqrt(np.diag(posterior.covariance))
        return float(np.max(shift))


def _beyond(residuals: Array) -> float:
    """What squares of residuals have beyond those of the furthest that noise makes."""
    return float(np.sum(np.maximum(residuals**2 - FURTHEST**2, 0.0)))


def prepare(record: Record, noise: NoiseLevels, holds: Holds | None = None) -> Stretch:
    """A record with a reference that is aligned with the measured attitudes.

    Args:
        record: Samples, at least a second of each sensor.
        noise: Noise levels.
        holds: When torques were set; None where that is of no interest.

    Raises:
        IdentificationError: a gap that can not be bridged.
    """
    # Splines say nothing outside the samples they are fitted to.
    start = max(record.joint_time[0], record.rate_time[0])
    end = min(record.joint_time[-1], record.rate_time[-1])
    record = record.between(np.nextafter(start, -np.inf), end)
    stamps = list(channel_stamps(record).values())
    refuse_long_gaps(np.unique(np.concatenate(stamps)))
    reference = ReferenceTrajectory(record, noise, filter_times(stamps, (start, end)))
    return Stretch(record, noise, reference, holds)
