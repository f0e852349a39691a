"""Maximum-likelihood estimate by the momentum filter, iterated, and continued as data come."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_filter import MomentumFilter, SquareRootInformation, Stretch
from ..estimation.filters.momentum_process import MomentumModel, Regressed
from ..estimation.trajectory.reference import NoiseLevels, ReferenceTrajectory
from ..estimation.trajectory.time_base import channel_stamps, filter_times, refuse_long_gaps
from ..estimation.unknowns.torque_hold import Holds
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from .outliers import FURTHEST
from .summary import Solution, marginal
from .validity_limits import CONVERGED
from .weak_prior import Prior, weak_prior

_PASSES = 5
_ANOTHER = 3.0
"""By how much the share of a shift that a pass leaves may exceed the one before: in ten flights of
the servicer shares were 0.002 to 0.04 at first and fell later, in one they rose threefold."""


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What is known of some of the constants: |factor (t - origin) - values|^2 is least.

    Args:
        part: Which m of [h_W; AAM; x; nuisances].
        origin: (m,) about which everything was linearized.
        factor: (m, m) square-root information, upper triangular.
        values: (m,).
    """

    part: slice
    origin: Array
    factor: Array
    values: Array

    @property
    def best(self) -> Array:
        """(m,) most probable values."""
        return np.asarray(self.origin + np.linalg.solve(self.factor, self.values))

    def of(self, part: slice) -> Known:
        """What is known of some of these constants, the others eliminated."""
        part = slice(max(part.start, self.part.start), min(part.stop, self.part.stop))
        inside = slice(part.start - self.part.start, part.stop - self.part.start)
        factor, values = marginal(np.column_stack([self.factor, self.values]), inside)
        return Known(part, self.origin[inside], factor, values)


class MaximumLikelihood:
    """Total momentum, AAM, minimal parameters and nuisances from stretches of data.

    Args:
        model: Robot and minimal set.
        settings: The identifier's settings, for the prior.
        known: What earlier data of the same robot told; None: nothing.

    Attributes:
        constants: (p,) about which everything is linearized; the robot file's at first.
        is_converged: Whether another pass of `solve` would move them by less than 0.01 sigma.
        is_abandoned: Whether `solve` shall end before its next pass.
    """

    def __init__(
        self, model: MomentumModel, settings: IdentifierSettings, known: Known | None = None
    ) -> None:
        self._model, self._settings, self._known = model, settings, known
        self._prior: Prior | None = None
        self._filter = MomentumFilter(model)
        self.constants = model.prior()
        self.is_converged = self.is_abandoned = False
        self._beyond = 0.0
        self._left = np.inf  # share of a shift that the next pass asked for

    def anew(self) -> MaximumLikelihood:
        """Another one that knows what this one knew at first."""
        return MaximumLikelihood(self._model, self._settings, self._known)

    @property
    def known(self) -> Known | None:
        """What other segments of the run may know; None: nothing yet."""
        if self._prior is None or not self.is_converged:
            return self._known
        factor, origin = self._filter.information.factor.copy(), self.constants.copy()
        return Known(slice(0, len(origin)), origin, factor[:, :-1], factor[:, -1])

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

        Raises:
            IdentificationError: it is abandoned.
        """
        if self._prior is None:
            self._prior = weak_prior(
                self._model, stretch.kinematics, self._settings, stretch.holds
            )
            self.constants = self._prior.mean.copy()
            if self._known is not None:
                self.constants[self._known.part] = self._known.best
        prior, regressed, last = self._prior, self._filter.regressed(stretch), 0.0
        for _ in range(_PASSES):
            if self.is_abandoned:
                raise IdentificationError('nobody waits for it any more')
            self._filter = MomentumFilter(self._model)
            information = self._filter.information
            self._add_prior(information, prior)
            information.reset_residual()
            self._beyond = 0.0
            before, change = self.constants, self._advance(stretch, prior, regressed)
            asked, moved = np.max(np.abs([change, self.constants - before]) / self.std, axis=1)
            is_held_back = moved < 0.9 * asked
            if last > 0.0 and not is_held_back:
                self._left = asked / last
            last = 0.0 if is_held_back else asked
            share = 1.0 if is_held_back else min(1.0, _ANOTHER * self._left)
            self.is_converged = bool(share * asked < CONVERGED)
            # also where they are held back and stay: the next pass would be this one
            if self.is_converged or moved < CONVERGED:
                break

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
        self._advance(stretch, self._prior)
        return stretch

    @property
    def std(self) -> Array:
        """(p,) standard deviations of the constants."""
        return np.sqrt(np.diag(self._filter.information.solve()[1]))

    def solution(self, method: str) -> Solution:
        """The estimate so far.

        The information's own solution is the best one, also where the point of linearization was
        held back.
        """
        if self._prior is None:
            raise ValueError('nothing was solved yet')
        information = self._filter.information
        best = self.constants + information.solve()[0]
        return Solution(method, best, information, self._prior, self._filter.placebo)

    def _add_prior(self, information: SquareRootInformation, prior: Prior) -> None:
        """What was known before: what earlier segments told of the robot, and the prior."""
        rows, values = np.diag(1.0 / prior.std), (prior.mean - self.constants) / prior.std
        if (known := self._known) is not None:
            part = known.part
            rows[part, :], values[part] = 0.0, 0.0
            rows[part, part] = known.factor
            values[part] = known.values - known.factor @ (self.constants[part] - known.origin)
        information.add(rows, values)

    def _advance(
        self, stretch: Stretch, prior: Prior, regressed: list[Regressed] | None = None
    ) -> Array:
        """Run through a stretch and move the constants; (p,) change that the data ask for."""
        columns, values = self._filter.run(stretch, self.constants, regressed)
        change, _ = self._filter.information.solve()
        squares = (values - columns @ change) ** 2
        self._beyond += float(np.sum(np.maximum(squares - FURTHEST**2, 0.0)))
        proposed = prior.admissible(
            self._model, stretch.kinematics, self.constants, self.constants + change
        )
        self._filter.shift_constants(proposed - self.constants)
        self.constants = proposed
        return change


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
