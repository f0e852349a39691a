"""The identifier's core: asynchronous samples in, estimates out, in bounded memory.

Samples are collected a sensor at a time, late ones put in their place as long as their stretch is
not solved, whatever came meanwhile: anything up to `identifier.lateness` behind the newest joint
and gyro samples. Each `solve` smooths the newest stretch (with some context before and a lag
behind it, because a spline is worst at its ends), runs the momentum filter over it and continues
the square-root information. While the whole run fits into the buffer it is run through again each
time its length has doubled, about the better constants; later stretches are linearized about
constants that no longer move.

Samples that contradict their neighbours are left out (`outliers`). Where joints or gyro pause for
longer than splines bridge, where the clock jumps or a solution fails, another segment begins:
what was learned of wheels and parameters is kept, total momentum unless the clock jumped. So it
does behind a stretch that contradicts what was learned: all that is in it is left out. Where the
next does, too, sensors may have changed, or something acted from outside: nuisances and total
momentum are sought anew; from the third in a row on the estimate is not valid.
"""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.noise_levels import noise_levels
from ..estimation.trajectory.reference import NoiseLevels
from ..estimation.trajectory.time_base import LONGEST_GAP
from ..estimation.unknowns.minimal import minimal_set
from ..estimation.unknowns.torque_hold import Holds, find_holds
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.buffer import SampleBuffer
from ..recording.faults.kinematics import contradictions
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate
from .maximum_likelihood import Known, MaximumLikelihood, prepare
from .misfit import Misfit
from .outliers import LONGEST_PAUSE, common_time, first_pause, without_outliers
from .saved_knowledge import load, save
from .summary import Identification, Source, conclude, nothing_known
from .validity_limits import FIRST, MOVED, SHORTEST

_LAG = 0.5  # s of data kept back at least, where the spline is not settled yet
_CONTEXT = 2.0  # s of data before a new stretch that its spline also fits
_LARGEST = 20_000
"""Samples of one sensor in one solution: it takes 36 kB of memory for each (servicer)."""
_FAILURES = (ArithmeticError, LookupError, RuntimeError, ValueError)
"""What numerical libraries raise where data defeat them (`LinAlgError` is a ValueError)."""
_Screened = tuple[Record, Callable[..., Counter[str]]]
"""A record without outliers, and what counts them between two times [s]."""
_WORDS = {'joints': 'joint states', 'imu': 'gyro', 'attitude': 'attitude'}


class OnlineIdentifier:
    """Recursive estimate of wheel momentum and minimal parameters.

    Args:
        robot: What the robot file believes.
        settings: The identifier's settings.

    Attributes:
        left_out: Samples that contradict their neighbours, by sensor.

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
        self._likelihood = MaximumLikelihood(self._model, self._settings)
        self._last: Identification | None = None
        self._known: Known | None = None  # when `_last` was concluded
        self._is_news = False  # whether it was learned since the last one was saved
        self._misfit = Misfit()
        self._earlier = Source(0, 0)  # of segments before this one
        self._left_out_earlier: Counter[str] = Counter()
        self.left_out: Counter[str] = Counter()
        self._source = self._earlier
        self.begin_segment()

    def begin_segment(self) -> None:
        """Take what comes now as another run of the same robot, whatever its stamps."""
        self.samples = SampleBuffer(self._joints, LONGEST_GAP, LONGEST_GAP)
        self._begin(-np.inf, self._known_of(3, self._model.x.stop))

    def copy(self) -> OnlineIdentifier:
        """What `reset`, `begin_segment` or `load` may change while a thread solves this one."""
        return copy.copy(self)

    def abandon(self) -> None:
        """Have a solution that is under way in another thread end soon, as a failure."""
        self._likelihood.is_abandoned = True

    def save(self, path: Path, now_ns: int) -> bool:
        """Save what is known at a wall time [ns]; False where nothing valid is new.

        What was known before, saved again, would pass for younger than it is.

        Raises:
            ConfigurationError: it can not be written.
        """
        known, last = self._known, self._last
        if known is None or last is None or not (self._is_news and last.estimate.valid):
            return False
        self._is_news = False
        save(path, self._model, known, last.estimate, now_ns)
        return True

    def load(self, path: Path, now_ns: int) -> None:
        """Begin another segment with what a file knows at a wall time [ns].

        Raises:
            RecordingError: it can not be used; nothing has changed.
        """
        saved = load(path, self._model, now_ns)
        self.reset()
        self._known = saved.known
        self._begin(-np.inf, saved.known)
        self._last = Identification(saved.estimate)
        self._source = Source(saved.estimate.samples, saved.estimate.stamp_ns)
        self._earlier = self._source

    def _begin(self, start: float, known: Known | None) -> None:
        """Begin another segment after a time [s], knowing of the robot what is known."""
        self._likelihood = MaximumLikelihood(self._model, self._settings, known)
        self._earlier, self._left_out_earlier = self._source, self.left_out.copy()
        self._noise: NoiseLevels | None = None
        self._first_joints: float | None = None  # from which holds count
        self._start, self._is_kept = start, True
        self._done = max(start, 0.0)
        self._next_rerun = 0.0
        self._misfit = self._misfit.anew()
        self._rerun_constants, self._rerun_std = self._model.prior(), np.zeros(self._model.size)

    def add_joints(self, stamp_ns: int, q: Array, qd: Array) -> None:
        """Add a joint sample: q (n,) [rad], qd (n,) [rad/s].

        Raises:
            MessageRejectedError: not finite, wrong length, a stamp seen before, one so late that
                its stretch is solved, or one far ahead of all others; the sample is not used.
        """
        self.samples.add_joints(stamp_ns, q, qd)

    def add_rate(self, stamp_ns: int, omega_WB_B: Array) -> None:
        """Add a gyro sample omega_WB_B (3,) [rad/s]; raises as `add_joints`."""
        self.samples.add_rate(stamp_ns, omega_WB_B)

    def add_attitude(self, stamp_ns: int, q_WB_xyzw: Array) -> None:
        """Add an attitude (4,); raises as `add_joints`, also for a norm off by more than 1e-3."""
        self.samples.add_attitude(stamp_ns, q_WB_xyzw)

    def solve(self, until_ns: int | None = None) -> Estimate:
        """Use all settled samples; it says why it isn't valid while they don't suffice.

        Args:
            until_ns: Last stamp to look at [ns]; None: the newest. What came later by the order
                of arrival then makes no difference.

        Raises:
            IdentificationError: the newest samples defeat the solution; it goes on behind them.
        """
        try:
            with np.errstate(over='ignore', invalid='ignore', divide='ignore'):
                return self._use(until_ns)  # what is not finite is no solution
        except IdentificationError:
            raise
        except _FAILURES as error:
            newest_ns = self.samples.newest_ns
            self._begin(
                np.inf if newest_ns is None else self.samples.seconds(newest_ns), self._known
            )
            raise _unusable('newest samples', error) from error

    def _use(self, until_ns: int | None) -> Estimate:
        self.samples.forget(self._settings.buffer + LONGEST_GAP)
        missing = [word for sensor, word in _WORDS.items() if sensor in self.samples.missing]
        record = self.samples.record(None, until_ns).between(self._start, np.inf)
        if missing or not (len(record.joint_time) and len(record.rate_time)):
            return self._nothing(f'no {" and no ".join(missing or _WORDS.values())} yet')
        if lacking := self._lacking(record, self._settled(record)):
            return self._nothing(lacking)
        tail, count = self._screened(record.between(self._done - _CONTEXT, np.inf))
        if not (len(tail.joint_time) and len(tail.rate_time)):
            return self._nothing('no samples that agree with each other')
        end = min(
            self._settled(tail),
            *(self._longest(time) for time in (record.joint_time, record.rate_time)),
        )
        before, after = first_pause(tail)
        if end <= before:
            return self._solve(record, end, (tail, count))
        if min(after, end) - before <= LONGEST_PAUSE:  # late samples may still fill it
            return self._solve(record, before, (tail, count))
        record, tail = (each.between(-np.inf, before) for each in (record, tail))
        with suppress(IdentificationError):
            self._solve(record, before, (tail, count))
        self._begin(0.5 * (before + after), self._known_of(0, self._model.x.stop))
        return self._use(until_ns)

    def _solve(self, record: Record, end: float, newest: _Screened) -> Estimate:
        """Use a record without long pauses up to a time [s], of which the newest is screened."""
        if lacking := self._lacking(record, end):
            return self._nothing(lacking)
        learned = self._done, self._source, self.left_out
        try:
            if doubt := self._learn(record, end, newest):
                return self._leave_out(record, end, doubt, learned)
            self._known = self._likelihood.known
            self._misfit = Misfit(*self._likelihood.misfit)
            return self._conclude(end)
        except _FAILURES as error:
            self._begin(end, self._known_of(0, self._model.x.stop))
            raise _unusable(f'samples up to {end:.6g} s', error) from error

    def _settled(self, record: Record) -> float:
        """Up to when joints and gyro are there for good [s]."""
        return float(min(record.joint_time[-1], record.rate_time[-1])) - self._lag

    def _lacking(self, record: Record, end: float) -> str:
        """Why a record does not suffice up to a time [s], empty where it does."""
        is_first, known = self._noise is None, self._known
        seconds, least = common_time(record, end), FIRST if known is None else SHORTEST
        if end - self._done < 1e-3 or (is_first and seconds < least):
            return f'only {max(seconds, 0.0):.1f} s of data yet, {least:g} s are needed'
        return ''

    def _learn(self, record: Record, end: float, newest: _Screened) -> str:
        """Run through what is new up to a time [s]; why it does not fit, empty where it does."""
        if self._noise is not None and not (self._is_whole(end) and self._is_rerun_due(end)):
            self._run_new(record, end, *newest)
            doubt = self._misfit.doubt(*self._likelihood.misfit)
            if not (doubt and self._is_whole(end)):
                return doubt  # otherwise it may be linearized too far away
        self._run_all(record, end)
        if (doubt := self._doubt()) and not self._likelihood.is_converged:
            self._likelihood = self._likelihood.anew()  # caught where the first seconds led
            self._run_all(record, end)
            doubt = self._doubt()
        return doubt

    def _doubt(self) -> str:
        """Why the data that were run through do not fit; empty where they do."""
        # about constants that have not settled, what old and new data leave moves between them
        earlier = self._misfit if self._likelihood.is_converged else Misfit()
        return '; '.join(self._source.faults) or earlier.doubt(*self._likelihood.misfit)

    def _leave_out(
        self, record: Record, end: float, doubt: str, learned: tuple[float, Source, Counter[str]]
    ) -> Estimate:
        """Do without what is new up to a time [s]: another segment begins behind all that came."""
        self._misfit = self._misfit.left_out()
        if self._known is None:
            self._conclude(end)
        else:
            self._done, self._source, self.left_out = learned
            times = (record.joint_time, record.rate_time, record.attitude_time)
            new = {s: int(np.sum(t > self._done)) for s, t in zip(_WORDS, times, strict=True)}
            self.left_out = self.left_out + Counter(new)
        if self._misfit.contradicted > 1:
            self._known = self._known_of(3, self._model.x.stop)
        if self._last is not None and (self._known is None or self._misfit.is_lasting):
            doubted = replace(self._last.estimate, valid=False, reason=doubt)
            self._last = replace(self._last, estimate=doubted)
        self._begin(float(max(record.joint_time[-1], record.rate_time[-1])), self._known)
        return self._nothing(doubt)

    def _screened(self, record: Record) -> _Screened:
        noise = self._noise
        if noise is None:
            noise, _ = noise_levels(self._model.robot.sensors, record, is_checked=False)
        kept, found = without_outliers(record, noise)
        return kept, partial(found.counted, record)

    def _run_all(self, record: Record, end: float) -> None:
        record = record.between(-np.inf, end)
        self._noise, notes = noise_levels(self._model.robot.sensors, record, is_checked=False)
        record, count = self._screened(record)
        stretch = prepare(record, self._noise, self._holds(record))
        self._likelihood.solve(stretch)
        self._rerun_constants, self._rerun_std = self._likelihood.constants, self._likelihood.std
        samples = self._earlier.samples + len(record.joint_time)
        self._source = Source(samples, 0, notes, contradictions(record))
        self.left_out = self._left_out_earlier + count()
        self._done = float(stretch.reference.times[-1])
        begun = max(self._start, 0.0)
        self._next_rerun = begun + 2.0 * (end - begun)

    def _run_new(
        self, record: Record, end: float, context: Record, count: Callable[..., Counter[str]]
    ) -> None:
        new = context.between(self._done, end)
        if self._noise is None or not (len(new.joint_time) or len(new.rate_time)):
            return
        self.left_out = self.left_out + count(self._done, end)
        stretch = self._likelihood.extend(new, context, self._noise, self._holds(record))
        samples = self._source.samples + len(new.joint_time)
        self._source = replace(self._source, samples=samples)
        self._done = float(stretch.reference.times[-1])

    def _known_of(self, first: int, stop: int) -> Known | None:
        """What is known of the constants from one up to another."""
        return None if self._known is None else self._known.of(slice(first, stop))

    def _is_whole(self, end: float) -> bool:
        """Whether the buffer holds the whole segment up to a time [s], few enough to run again."""
        few = all(len(s.stamps) <= _LARGEST for s in self.samples.streams.values())
        return self._is_kept and few and end - max(self._start, 0.0) <= self._settings.buffer

    def _longest(self, time: Array) -> float:
        """Up to when samples at some times [s] are few enough for one solution [s]."""
        last = int(np.searchsorted(time, self._done)) + _LARGEST
        return float(time[last]) if last < len(time) else np.inf

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
        self._is_kept = self._is_whole(end)
        keep = self._settings.buffer if self._is_kept else _CONTEXT + self._lag
        stamp_ns = (self.samples.origin_ns or 0) + round(self._done * 1e9)
        self.samples.close(stamp_ns, round(keep * 1e9))
        solution = self._likelihood.solution('online')
        if not self._likelihood.is_converged:
            doubt = 'the estimate still moves when the data are run through again'
            solution = replace(solution, doubt=doubt)
        source = replace(self._source, stamp_ns=stamp_ns)
        start = None if self._last is None else self._last.coordinates
        found = conclude(self._model, self._settings, solution, source, start)
        self._is_news = True
        self._last = found if found.coordinates is not None else replace(found, coordinates=start)
        return found.estimate

    def _nothing(self, reason: str) -> Estimate:
        """The last estimate; before the first the prior, not valid."""
        if self._last is not None:
            return self._last.estimate
        stamp_ns = self.samples.newest_ns or 0
        return nothing_known(self._model, self._settings, reason, stamp_ns)


def _unusable(which: str, error: Exception) -> IdentificationError:
    return IdentificationError(f'the {which} can not be used, another segment begins: {error}')
