"""The identifier's core: asynchronous samples in, estimates out, in bounded memory.

Samples are collected a sensor at a time, late ones put in their place as long as their stretch is
not solved, whatever came meanwhile: anything up to `identifier.lateness` behind the newest joint
and gyro samples. Each `solve` smooths the newest stretch (with some context before and a lag
behind it, because a spline is worst at its ends) and runs the momentum filter over it (`segment`).

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
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.time_base import LONGEST_GAP
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.buffer import SampleBuffer
from ..recording.faults.joint_limits import with_stops
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate
from .maximum_likelihood import Known
from .outliers import LONGEST_PAUSE, first_pause
from .saved_knowledge import Knowledge
from .segment import Past, Screened, Segment
from .summary import Identification, Source, conclude, nothing_known

_LAG = 0.5  # s of data kept back at least, where the spline is not settled yet
_CONTEXT = 2.0  # s of data before a new stretch that its spline also fits
_FORGIVEN = 2  # stretches in a row that contradict what was learned, before that is doubted
_FAILURES = (ArithmeticError, LookupError, RuntimeError, ValueError)
"""What numerical libraries raise where data defeat them (`LinAlgError` is a ValueError)."""
_WORDS = {'joints': 'joint states', 'imu': 'gyro', 'attitude': 'attitude'}


class OnlineIdentifier:
    """Recursive estimate of wheel momentum, bodies and minimal parameters.

    Args:
        robot: What the robot file believes.
        settings: The identifier's settings.

    Attributes:
        model: Of the robot, whose constants are estimated.
        samples: Where the samples of the present segment are collected.

    Raises:
        ConfigurationError: fixed base.
    """

    def __init__(self, robot: Robot, settings: IdentifierSettings) -> None:
        self._settings = settings
        self._lag = max(_LAG, settings.lateness)
        self.model = MomentumModel(robot, settings.structure, settings.nuisances)
        self._joints = robot.joints[: self.model.n]
        self.reset()

    def reset(self) -> None:
        """Forget everything that was measured."""
        self._forget(Source(0, 0))

    def begin_segment(self) -> None:
        """Take what comes now as another run of the same robot, whatever its stamps."""
        self.samples = SampleBuffer(self._joints, LONGEST_GAP, LONGEST_GAP)
        self._begin(-np.inf, self._known_from(3))

    def copy(self) -> OnlineIdentifier:
        """What `reset`, `begin_segment` or `go_on` may change while a thread solves this one."""
        return copy.copy(self)

    def abandon(self) -> None:
        """Have a solution that is under way in another thread end soon, as a failure."""
        self._segment.likelihood.is_abandoned = True

    @property
    def last(self) -> Identification:
        """The last estimate, and the bodies behind it; before the first the robot file's."""
        if self._last is None:
            return Identification(self._nothing('no data yet'), self.model.robot)
        return self._last

    @property
    def knowledge(self) -> Knowledge | None:
        """What is known that a file does not; None where the last estimate is not valid."""
        last = self._last
        return self._learned if last is not None and last.estimate.valid else None

    def go_on(self, saved: Knowledge) -> None:
        """Forget everything that was measured, and begin another segment with what was saved."""
        source = Source(saved.estimate.samples, saved.estimate.stamp_ns)
        self._forget(source, saved.known, Identification(saved.estimate))

    @property
    def left_out(self) -> Counter[str]:
        """Samples that contradict their neighbours, or what was learned, by sensor."""
        return self._segment.left_out

    def _forget(
        self, source: Source, known: Known | None = None, last: Identification | None = None
    ) -> None:
        """Know nothing but what comes from somewhere else."""
        self._last = last
        self._known = known  # when `_last` was concluded
        self._learned: Knowledge | None = None  # the two together, but for what was read
        self.samples = SampleBuffer(self._joints, LONGEST_GAP, LONGEST_GAP)
        past = Past(source, Counter(), 0)
        self._segment = Segment(self.model, self._settings, self.samples, -np.inf, known, past)

    def _begin(self, start: float, known: Known | None) -> None:
        """Begin another segment after a time [s], knowing of the robot what is known."""
        last = self._segment
        past = Past(last.source, last.left_out, last.contradicted)
        self._segment = Segment(self.model, self._settings, self.samples, start, known, past)

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
            start = np.inf if newest_ns is None else self.samples.seconds(newest_ns)
            self._begin(start, self._known)
            raise _unusable('newest samples', error) from error

    def _use(self, until_ns: int | None) -> Estimate:
        segment = self._segment
        self.samples.forget(self._settings.buffer + LONGEST_GAP)
        missing = [word for sensor, word in _WORDS.items() if sensor in self.samples.missing]
        record = with_stops(self.samples.record(None, until_ns), self.model.robot)
        record = record.between(segment.start, np.inf)
        if missing or not (len(record.joint_time) and len(record.rate_time)):
            return self._nothing(f'no {" and no ".join(missing or _WORDS.values())} yet')
        if lacking := segment.lacking(record, self._settled(record)):
            return self._nothing(lacking)
        tail, count = segment.screened(record.between(segment.done - _CONTEXT, np.inf))
        if not (len(tail.joint_time) and len(tail.rate_time)):
            return self._nothing('no samples that agree with each other')
        end = min(self._settled(tail), segment.longest(record))
        before, after = first_pause(tail)
        if end <= before:
            return self._solve(record, end, (tail, count))
        if min(after, end) - before <= LONGEST_PAUSE:  # late samples may still fill it
            return self._solve(record, before, (tail, count))
        record, tail = (each.between(-np.inf, before) for each in (record, tail))
        with suppress(IdentificationError):
            self._solve(record, before, (tail, count))
        self._begin(0.5 * (before + after), self._known_from(0))
        return self._use(until_ns)

    def _solve(self, record: Record, end: float, newest: Screened) -> Estimate:
        """Use a record without long pauses up to a time [s], of which the newest is screened."""
        segment = self._segment
        if lacking := segment.lacking(record, end):
            return self._nothing(lacking)
        before = copy.copy(segment)
        try:
            if doubt := segment.learn(record, end, newest):
                return self._leave_out(record, end, doubt, before)
            self._known = segment.likelihood.known
            segment.accept()
            return self._conclude(end)
        except _FAILURES as error:
            self._begin(end, self._known_from(0))
            raise _unusable(f'samples up to {end:.6g} s', error) from error

    def _settled(self, record: Record) -> float:
        """Up to when joints and gyro are there for good [s]."""
        return float(min(record.joint_time[-1], record.rate_time[-1])) - self._lag

    def _leave_out(self, record: Record, end: float, doubt: str, before: Segment) -> Estimate:
        """Do without what is new up to a time [s]: another segment begins behind all that came."""
        contradicted = self._segment.contradicted + 1
        if self._known is None:
            self._conclude(end)
        else:
            self._segment = before
            times = (record.joint_time, record.rate_time, record.attitude_time)
            new = {s: int(np.sum(t > before.done)) for s, t in zip(_WORDS, times, strict=True)}
            before.left_out = before.left_out + Counter(new)
        if contradicted > 1:
            self._known = self._known_from(3)
        if self._last is not None and (self._known is None or contradicted > _FORGIVEN):
            doubted = replace(self._last.estimate, valid=False, reason=doubt)
            self._last = replace(self._last, estimate=doubted)
        self._segment.contradicted = contradicted
        self._begin(float(max(record.joint_time[-1], record.rate_time[-1])), self._known)
        return self._nothing(doubt)

    def _known_from(self, first: int) -> Known | None:
        """What is known of the constants from one on, nuisances aside."""
        stop = self.model.filter_bodies.stop
        return None if self._known is None else self._known.of(slice(first, stop))

    def _conclude(self, end: float) -> Estimate:
        """Forget what is no longer needed, and say what is known."""
        segment, known = self._segment, self._known
        keep = self._settings.buffer if segment.is_kept_up_to(end) else _CONTEXT + self._lag
        stamp_ns = (self.samples.origin_ns or 0) + round(segment.done * 1e9)
        self.samples.close(stamp_ns, round(keep * 1e9))
        source = replace(segment.source, stamp_ns=stamp_ns)
        self._last = found = conclude(segment.likelihood, 'online', source)
        self._learned = None if known is None else Knowledge(self.model, known, found.estimate)
        return found.estimate

    def _nothing(self, reason: str) -> Estimate:
        """The last estimate; before the first the prior, not valid."""
        if self._last is not None:
            return self._last.estimate
        stamp_ns = self.samples.newest_ns or 0
        return nothing_known(self.model, self._settings, reason, stamp_ns)


def _unusable(which: str, error: Exception) -> IdentificationError:
    return IdentificationError(f'the {which} can not be used, another segment begins: {error}')
