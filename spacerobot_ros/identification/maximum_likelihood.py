"""Maximum-likelihood estimate by the momentum filter, iterated, and continued as data come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_filter import MomentumFilter, Stretch
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import NoiseLevels, ReferenceTrajectory
from ..estimation.trajectory.time_base import channel_stamps, filter_times, refuse_long_gaps
from ..estimation.unknowns.torque_hold import Holds
from ..inference.square_root import marginal
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from .momentum_posterior import MomentumPosterior, posterior_of
from .outliers import FURTHEST
from .validity_limits import (
    BACKTRACK,
    CLOSE,
    CONTRACTION,
    CONVERGED,
    LINEAR,
    MOST_PASSES,
    NEARER,
    SETTLED,
    WORSE,
)


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What data told of some of the constants: |factor (t - origin) - values|^2 is least.

    Args:
        part: Which m of [h_W; AAM; y; nuisances].
        origin: (m,) about which everything was linearized.
        factor: (m, m) square-root information, upper triangular; without the bodies' prior.
        values: (m,).
        best: (m,) most probable values, the bodies' prior included.
    """

    part: slice
    origin: Array
    factor: Array
    values: Array
    best: Array

    def of(self, part: slice) -> Known:
        """What is known of some of these constants, the others eliminated."""
        part = slice(max(part.start, self.part.start), min(part.stop, self.part.stop))
        inside = slice(part.start - self.part.start, part.stop - self.part.start)
        left = marginal(
            np.column_stack([self.factor, self.values]), np.arange(inside.start, inside.stop)
        )
        return Known(part, self.origin[inside], left[:, :-1], left[:, -1], self.best[inside])


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
        joint_share: Largest momentum so far that the joints' motion alone had [N m s].
    """

    def __init__(
        self, model: MomentumModel, settings: IdentifierSettings, known: Known | None = None
    ) -> None:
        self._model, self._settings, self._known = model, settings, known
        self._prior: tuple[Array, Array] | None = None
        self._filter = MomentumFilter(model)
        self.constants = model.prior()
        self.is_converged = self.is_abandoned = False
        self.joint_share = 0.0
        self._beyond = 0.0
        self._left = np.ones(2)  # share of a shift, of momenta and bodies, that a pass leaves

    def anew(self) -> MaximumLikelihood:
        """Another one that knows what this one knew at first."""
        return MaximumLikelihood(self._model, self._settings, self._known)

    @property
    def known(self) -> Known | None:
        """What other segments of the run may know; None: nothing yet."""
        if self._prior is None or not self.is_converged:
            return self._known
        factor, origin = self._filter.information.factor.copy(), self.constants.copy()
        best = self.posterior().mean
        return Known(slice(0, len(origin)), origin, factor[:, :-1], factor[:, -1], best)

    @property
    def misfit(self) -> tuple[float, int]:
        """Sum of squared residuals of the data so far, and their number of rows.

        What is beyond six standard deviations of a row does not count, so that a lone outlier
        that was not found is no misfit; what it does to the others' residuals is.
        """
        information = self._filter.information
        return information.residual - self._beyond, information.rows

    def solve(self, stretch: Stretch) -> None:
        """Estimate from a stretch alone, from the prior or from what was found last.

        Damped Gauss-Newton steps on the posterior.

        Raises:
            IdentificationError: it is abandoned.
        """
        if self._prior is None:
            self._prior = self._prior_of(stretch)
            self.constants = self._prior[0].copy()
            if self._known is not None:
                self.constants[self._known.part] = self._known.best
        best, goal, least = self.constants, self.constants, np.inf
        asked, share = np.full(2, np.inf), 1.0
        for _ in range(MOST_PASSES):
            if self.is_abandoned:
                raise IdentificationError('nobody waits for it any more')
            self._restart()
            values = self._filter.run(stretch, self.constants)
            posterior = self.posterior()
            cost, before, now = self._cost(posterior), asked, self._shift_asked(posterior)
            worse = cost - least
            is_nearer = np.max(now) < np.max(before) and worse < NEARER * len(values)
            if not (worse <= WORSE or is_nearer):
                share *= BACKTRACK
                self.constants = self._towards(best, goal, share)
                continue
            least, best, asked = cost, self.constants, now
            if np.all(before < np.inf):
                self._left = np.minimum(1.0, CONTRACTION * asked / before)
            left = asked * self._left
            self.is_converged = bool(left[0] < CONVERGED)
            self._beyond = _beyond(values) if np.max(asked) < 1.0 else 0.0
            if self.is_converged and (left[1] < SETTLED or asked[1] < CLOSE):
                break
            share, goal = min(1.0, share / BACKTRACK), self._goal()
            self.constants = self._towards(best, goal, share)
        self._shift(self.posterior().mean)
        self.joint_share = self._model.joint_share(stretch.kinematics, self.constants)

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
        self._filter.run(stretch, self.constants, rows)
        constants = self.posterior().mean
        change = constants - self.constants
        self._beyond += sum(_beyond(values - columns @ change) for columns, values in rows)
        self._shift(constants)
        share = self._model.joint_share(stretch.kinematics, self.constants)
        self.joint_share = max(self.joint_share, share)
        return stretch

    def posterior(self) -> MomentumPosterior:
        """The estimate so far."""
        if self._prior is None:
            raise ValueError('nothing was solved yet')
        factor = self._filter.information.factor
        return posterior_of(self._model, factor, self.constants, self._prior[1])

    def _prior_of(self, stretch: Stretch) -> tuple[Array, Array]:
        """(p,) mean and standard deviations; the bodies' are in `robot.uncertainty`.

        The total momentum is centred on what the robot file's values imply and left free.
        """
        model, wide = self._model, self._settings.momentum_prior_std
        mean = model.prior()
        mean[:3] = model.total_momentum(stretch.kinematics, mean)
        std = np.full(len(mean), wide)
        std[:3] = 10.0 * (wide + np.linalg.norm(mean[:3]))
        std[model.y] = model.bodies.std
        mean[model.other], std[model.other] = model.nuisances.prior(stretch.holds)
        return mean, std

    def _restart(self) -> None:
        """A filter that knows what was known before the stretch, about the constants."""
        assert self._prior is not None
        self._filter = MomentumFilter(self._model)
        mean, std = self._prior
        rows, values = np.diag(1.0 / std), (mean - self.constants) / std
        rows[self._model.y], values[self._model.y] = 0.0, 0.0
        if (known := self._known) is not None:
            part = known.part
            rows[part, :], values[part] = 0.0, 0.0
            rows[part, part] = known.factor
            values[part] = known.values - known.factor @ (self.constants[part] - known.origin)
        self._filter.information.add(rows, values)
        self._filter.information.reset_residual()
        self._beyond = 0.0

    def _cost(self, posterior: MomentumPosterior) -> float:
        """Twice the negative logarithm of the constants' probability."""
        y = self.constants[self._model.y] / (posterior.bodies.factor * self._model.bodies.std)
        return self._filter.information.misfit + 2.0 * self._filter.log_spread + float(y @ y)

    def _goal(self) -> Array:
        """(p,) constants to go to from where the filter was linearized.

        Levenberg's damping in the metric of the prior: all is told with a variance by which the
        shift of an unknown is `LINEAR` standard deviations, which is one as the iteration settles
        (Yamashita and Fukushima, Computing Suppl. 15 (2001) 239).
        """
        assert self._prior is not None
        factor = self._filter.information.factor
        asked = float(np.sum(factor[:, -1] ** 2)) / len(factor)
        factor = factor / max(1.0, np.sqrt(asked) / LINEAR)
        return posterior_of(self._model, factor, self.constants, self._prior[1]).mean

    def _towards(self, constants: Array, goal: Array, share: float) -> Array:
        """(p,) constants a share of the way from some to a goal that is linear about them."""
        step, y = share * (goal - constants), self._model.y
        out = constants + step
        out[y] = self._model.bodies.stepped(constants[y], step[y])
        return out

    def _shift_asked(self, posterior: MomentumPosterior) -> Array:
        """(2,) largest shift of momenta and nuisances, and of bodies, in standard deviations."""
        shift = np.abs(posterior.mean - self.constants) / np.sqrt(np.diag(posterior.covariance))
        y = self._model.y
        return np.array([np.max(np.delete(shift, y)), np.max(shift[y], initial=1e-300)])

    def _shift(self, constants: Array) -> None:
        self._filter.shift_constants(constants - self.constants)
        self.constants = constants


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
