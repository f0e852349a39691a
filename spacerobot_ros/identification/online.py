"""The identifier's core: asynchronous samples in, estimates out, in bounded memory.

Samples are collected a sensor at a time, late ones put in their place as long as their stretch is
not solved: anything up to `identifier.lateness` behind the newest joint and gyro samples. Each
`solve` smooths the newest stretch (with some context before and a lag behind it, because a spline
is worst at its ends), runs the momentum filter over it and continues the square-root information.
While the whole run fits into the buffer it is run through again each time its length has doubled,
about the better constants; later stretches are linearized about constants that no longer move.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..errors import MessageRejectedError
from ..estimation.minimal import minimal_set
from ..estimation.momentum_process import MomentumModel
from ..estimation.noise_levels import noise_levels
from ..estimation.reference import NoiseLevels
from ..estimation.time_base import LONGEST_GAP
from ..estimation.torque_hold import Holds, find_holds
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.buffer import SampleBuffer
from ..recording.faults.kinematics import contradictions
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate, estimated_values
from .maximum_likelihood import MaximumLikelihood, prepare
from .summary import Identification, Source, conclude
from .validity_limits import FIRST, MOVED

_LAG = 0.5  # s of data kept back at least, where the spline is not settled yet
_CONTEXT = 2.0  # s of data before a new stretch that its spline also fits
_WORDS = {'joints': 'joint states', 'imu': 'gyro', 'attitude': 'attitude'}


class OnlineIdentifier:
    """Recursive estimate of wheel momentum and minimal parameters.

    Args:
        robot: What the robot file believes.
        settings: The identifier's settings.

    Raises:
        ConfigurationError: fixed base or prismatic joints.
    """

    def __init__(self, robot: Robot, settings: IdentifierSettings) -> None:
        self._settings = settings
        self._lag = max(_LAG, settings.lateness)
        self._model = MomentumModel(
            robot, minimal_set(robot, settings.structure), settings.nuisances
        )
        self._joints = robot.joints[: self._model.n]
        self.reset()

    def reset(self) -> None:
        """Forget everything that was measured."""
        self.rejected = 0
        self.samples = SampleBuffer(self._joints, self._lag, LONGEST_GAP)
        self._likelihood = MaximumLikelihood(self._model, self._settings)
        self._noise: NoiseLevels | None = None
        self._source = Source(0, 0)
        self._first_joints: float | None = None  # from which holds count
        self._done = 0.0
        self._next_rerun = 0.0
        self._rerun_constants, self._rerun_std = self._model.prior(), np.zeros(self._model.size)
        self._last: Identification | None = None

    def add_joints(self, stamp_ns: int, q: Array, qd: Array) -> None:
        """Add a joint sample: q (n,) [rad], qd (n,) [rad/s].

        Raises:
            MessageRejectedError: not finite, wrong length, a stamp seen before, one so late that
                its stretch is solved, or one far ahead of all others; the sample is not used.
        """
        self._count(self.samples.add_joints, stamp_ns, q, qd)

    def add_rate(self, stamp_ns: int, omega_WB_B: Array) -> None:
        """Add a gyro sample omega_WB_B (3,) [rad/s]; raises as `add_joints`."""
        self._count(self.samples.add_rate, stamp_ns, omega_WB_B)

    def add_attitude(self, stamp_ns: int, q_WB_xyzw: Array) -> None:
        """Add an attitude (4,); raises as `add_joints`, also for a norm off by more than 1e-3."""
        self._count(self.samples.add_attitude, stamp_ns, q_WB_xyzw)

    def solve(self, until_ns: int | None = None) -> Estimate:
        """Use all settled samples; it says why it isn't valid while they don't suffice.

        Args:
            until_ns: Last stamp to look at [ns]; None: the newest. What came later by the order
                of arrival then makes no difference.
        """
        missing = [word for sensor, word in _WORDS.items() if sensor in self.samples.missing]
        record = self.samples.record(None, until_ns)
        if missing or record.joints is None or record.rates is None:
            return self._nothing(f'no {" and no ".join(missing or _WORDS.values())} yet')
        end = float(min(record.joint_time[-1], record.rate_time[-1])) - self._lag
        is_first = self._noise is None
        if end - self._done < 1e-3 or (is_first and end < FIRST):
            seconds = f'only {max(end, 0.0):.1f} s of data yet, {FIRST:g} s are needed'
            return self._nothing(seconds) if self._last is None else self._last.estimate
        if is_first or (end <= self._settings.buffer and self._is_rerun_due(end)):
            self._run_all(record.between(-np.inf, end), end)
        else:
            self._run_new(record, end)
        return self._conclude(end)

    def _count(self, add: Callable[..., None], *sample: int | Array) -> None:
        """Add a sample; count what is rejected."""
        try:
            add(*sample)
        except MessageRejectedError:
            self.rejected += 1
            raise

    def _run_all(self, record: Record, end: float) -> None:
        self._noise, notes = noise_levels(self._model.robot.sensors, record, is_checked=False)
        stretch = prepare(record, self._noise, self._holds(record))
        self._likelihood.solve(stretch)
        self._rerun_constants, self._rerun_std = self._likelihood.constants, self._likelihood.std
        self._source = Source(len(record.joint_time), 0, notes, contradictions(record))
        self._done = float(stretch.reference.times[-1])
        self._next_rerun = 2.0 * end

    def _run_new(self, record: Record, end: float) -> None:
        new = record.between(self._done, end)
        if self._noise is None or not (len(new.joint_time) or len(new.rate_time)):
            return
        context = record.between(self._done - _CONTEXT, np.inf)
        stretch = self._likelihood.extend(new, context, self._noise, self._holds(record))
        samples = self._source.samples + len(new.joint_time)
        self._source = replace(self._source, samples=samples)
        self._done = float(stretch.reference.times[-1])

    def _is_rerun_due(self, end: float) -> bool:
        """Whether the linearization of what was run through is no longer good enough."""
        if not self._likelihood.is_converged or end >= self._next_rerun:
            return True
        moved = np.abs(self._likelihood.constants - self._rerun_constants)
        return bool(np.any(moved > MOVED * self._rerun_std))

    def _holds(self, record: Record) -> Holds:
        if self._first_joints is None:
            self._first_joints = float(record.joint_time[0])
        period = self._settings.torque_hold_period
        return find_holds(record, period, self._first_joints)

    def _conclude(self, end: float) -> Estimate:
        """Forget what is no longer needed, and say what is known."""
        whole = end <= self._settings.buffer
        keep = self._settings.buffer if whole else _CONTEXT + self._lag
        stamp_ns = (self.samples.origin_ns or 0) + round(self._done * 1e9)
        self.samples.close(stamp_ns, round(keep * 1e9))
        solution = self._likelihood.solution('online')
        if not self._likelihood.is_converged:
            doubt = 'the estimate still moves when the data are run through again'
            solution = replace(solution, doubt=doubt)
        source = replace(self._source, stamp_ns=stamp_ns)
        start = None if self._last is None else self._last.coordinates
        found = conclude(self._model, self._settings, solution, source, start)
        self._last = found if found.coordinates is not None else replace(found, coordinates=start)
        return found.estimate

    def _nothing(self, reason: str) -> Estimate:
        """The prior as an estimate that is not valid."""
        model, settings = self._model, self._settings
        prior = model.prior()
        std = np.full(model.size, settings.prior_std * np.max(np.abs(prior[model.x])))
        std[:3], std[model.aam] = 10.0 * settings.momentum_prior_std, settings.momentum_prior_std
        known = estimated_values(model, prior, np.diag(std**2))
        return Estimate(
            method='online',
            valid=False,
            reason=reason,
            rank=0,
            condition=float('inf'),
            unexcited=('every direction',),
            chi2_per_dof=0.0,
            samples=0,
            stamp_ns=self.samples.newest_ns or 0,
            **{**known, 'nuisances': ()},
        )
