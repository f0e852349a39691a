"""Maximum-likelihood estimate by the momentum filter, iterated, and continued as data come."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_filter import MomentumFilter, Stretch
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import NoiseLevels, ReferenceTrajectory
from ..estimation.trajectory.time_base import channel_stamps, filter_times, refuse_long_gaps
from ..estimation.unknowns.torque_hold import Holds
from ..inference.curved_posterior import LINEAR
from ..inference.square_root import marginal
from ..model.robot import Robot
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


def model_of(robot: Robot, settings: IdentifierSettings) -> MomentumModel:
    """What is identified of a robot.

    Raises:
        ConfigurationError: fixed base.
    """
    is_minimal = robot.n_joints <= limits.MOST_MINIMAL
    return MomentumModel(robot, settings.structure, settings.nuisances, is_minimal=is_minimal)


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
        self._posterior: MomentumPosterior | None = None

    def anew(self) -> MaximumLikelihood:
        """Another one that knows what this one knew at first."""
        return MaximumLikelihood(self._model, self._settings, self._known)

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
        squares = self._squares_at(self.posterior().mean) - self._beyond
        return max(squares, 0.0), self._filter.information.rows

    def solve(self, stretch: Stretch, on_pass: Callable[[int], None] = lambda _: None) -> None:
        """Estimate from a stretch alone, from the prior or from what was found last.

        Passes of the filter about ever better constants; see `curved_posterior` for those that
        are taken within a pass.

        Args:
            stretch: The stretch.
            on_pass: Called with the number of passes that are done.

        Raises:
            IdentificationError: it is abandoned.
        """
        if self._prior is None:
            # the total momentum is centred on what the robot file's values imply
            total = self._model.total_momentum(stretch.kinematics, self._model.prior())
            wide = self._settings.momentum_prior_std
            self._prior = prior_of(self._model, wide, total, stretch.holds)
            self.constants = self._prior[0].copy()
            if self._known is not None:
                part = slice(self._known.part.start, self._model.y.stop)
                self.constants[part] = self._known.best[part]
        else:
            self.constants = self.posterior().mean
        best, goal, least = self.constants, self.constants, np.inf
        asked, share = np.full(2, 0.0 if self.is_converged else np.inf), 1.0
        for done in range(limits.MOST_PASSES):
            on_pass(done)
            if self.is_abandoned:
                raise IdentificationError('nobody waits for it any more')
            is_near = bool(asked[1] < (np.inf if self._model.is_minimal else limits.NEAR))
            cost, values = self._pass(stretch, is_near=is_near)
            before, worse = asked, cost - least
            now = self._shift_asked() if np.isfinite(cost) else np.full(2, np.inf)
            is_nearer = np.max(now) < np.max(before) and worse < limits.NEARER * len(values)
            is_taken = np.isfinite(cost) and self._model.is_minimal
            if not (is_taken or worse <= limits.WORSE or is_nearer):
                share *= limits.BACKTRACK
                self.constants = self._towards(best, goal, share)
                continue
            least, best, asked = cost, self.constants, now
            if np.all((before > 0.0) & (before < np.inf)):
                self._left = np.minimum(1.0, limits.CONTRACTION * asked / before)
            left = asked * self._left
            self.is_converged = bool(left[0] < limits.CONVERGED) and is_near
            if self.is_converged and (left[1] < limits.SETTLED or asked[1] < limits.CLOSE):
                break
            share, goal = min(1.0, share / limits.BACKTRACK), self._goal()
            self.constants = self._towards(best, goal, share)
        else:
            self.constants, self.is_converged = best, False
            _, values = self._pass(stretch)
        self._beyond = _beyond(values) if self.is_converged else 0.0
        self._move_on()
        self.joint_share = self._model.joint_share(stretch.kinematics, self.posterior().mean)

    def _pass(self, stretch: Stretch, *, is_near: bool = True) -> tuple[float, Array]:
        """Twice the negative log probability of the constants, and the values of all rows.

        Infinite where no filter can be run about them. While they are far the prior is as stated:
        noise in the columns would count as evidence against it.
        """
        self._restart()
        assert self._prior is not None
        try:
            values = self._filter.run(stretch, self.constants, is_near=is_near)
            factor, scale = self._filter.information.factor, None if is_near else 1.0
            found = posterior_of(self._model, factor, self.constants, self._prior[1], scale=scale)
        except (np.linalg.LinAlgError, ValueError):  # of numbers that are not finite
            self._restart()
            return np.inf, np.zeros(0)
        self._posterior = found
        cost = self._cost(found)
        return (cost if np.isfinite(cost) else np.inf), values

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
        mean = self.posterior().mean
        change = self._told_change(mean)
        self._beyond += sum(_beyond(values - columns @ change) for columns, values in rows)
        self._move_on()
        share = self._model.joint_share(stretch.kinematics, mean)
        self.joint_share = max(self.joint_share, share)
        return stretch

    def posterior(self) -> MomentumPosterior:
        """The estimate so far."""
        if self._prior is None:
            raise ValueError('nothing was solved yet')
        if self._posterior is None:
            factor = self._filter.information.factor
            self._posterior = posterior_of(self._model, factor, self.constants, self._prior[1])
        return self._posterior

    def _restart(self) -> None:
        """A filter that knows what was known before the stretch, about the constants."""
        assert self._prior is not None
        model, (mean, std) = self._model, self._prior
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

    def _cost(self, posterior: MomentumPosterior) -> float:
        """Twice the negative logarithm of the constants' probability.

        Where the filter tells minimal parameters, of the most probable ones: the pass has them.
        """
        at = posterior.mean if self._model.is_minimal else self.constants
        stretched = at[self._model.y] / (posterior.bodies.factor * self._model.bodies.std)
        squares = self._squares_at(at) + float(np.sum(stretched**2))
        return squares + 2.0 * self._filter.log_spread

    def _squares_at(self, constants: Array) -> float:
        """Sum of squared residuals at (p,) constants."""
        return self._filter.information.residual + float(np.sum(self._left_at(constants) ** 2))

    def _left_at(self, constants: Array) -> Array:
        """(g,) what the square-root information leaves unexplained at (p,) constants."""
        factor = self._filter.information.factor
        return np.asarray(factor[:, -1] - factor[:, :-1] @ self._told_change(constants))

    def _told_change(self, constants: Array) -> Array:
        return self._model.filtered(constants) - self._model.filtered(self.constants)

    def _goal(self) -> Array:
        """(p,) constants to go to from where the filter was linearized, damped."""
        assert self._prior is not None
        if self._model.is_minimal:
            return self.posterior().mean
        factor = self._filter.information.factor
        asked = float(np.sum(factor[:, -1] ** 2)) / len(factor)
        factor = factor / max(1.0, np.sqrt(asked) / LINEAR)
        return posterior_of(self._model, factor, self.constants, self._prior[1]).mean

    def _towards(self, constants: Array, goal: Array, share: float) -> Array:
        """(p,) constants a share of the way from some to a goal that is linear about them."""
        step, y = share * (goal - constants), self._model.y
        out = constants + step
        if not self._model.is_minimal:
            out[y] = self._model.bodies.stepped(constants[y], step[y])
        return out

    def _shift_asked(self) -> Array:
        """(2,) largest shift of momenta and nuisances, and of bodies, in standard deviations."""
        posterior = self.posterior()
        shift = np.abs(posterior.mean - self.constants) / np.sqrt(np.diag(posterior.covariance))
        y = self._model.y
        return np.array([np.max(np.delete(shift, y)), np.max(shift[y], initial=1e-300)])

    def _move_on(self) -> None:
        """Go on about the best constants where nothing that was told depends on that.

        Where bodies were told, stretches about different ones would disagree, and what no motion
        tells would seem told (Huang, Mourikis and Roumeliotis, IJRR 29 (2010) 502).
        """
        if self._model.is_minimal:
            mean = self.posterior().mean
            self._filter.shift_constants(self._told_change(mean))
            self.constants = mean


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
