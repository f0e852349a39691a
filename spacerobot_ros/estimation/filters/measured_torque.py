"""The motors' torque over the steps of a filter: interpolated between samples, or held."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...recording.faults.gaps import ONE_LOST
from ...recording.faults.neighbours import NORMAL
from ...recording.record import Record
from ...types import Array, BoolArray, IntArray
from ..trajectory.reference import ReferenceTrajectory
from ..trajectory.time_base import TimeBase

TIMINGS = {'sampled': None, 'held_before': 1.0, 'held_after': 0.0, 'held_about': 0.5}
"""How efforts act: interpolated between samples, or held over the interval that a sample ends or
begins, or whose mean about a sample is measured. The number is the share of the interval's later
end in what is held."""

_UNKNOWN = 1e3  # N m; internal torques unknown: only momentum is left to judge by


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredTorque:
    """Torques of n joints over N - 1 steps.

    Where one sample of torques that are held is missing, nothing is known of the torque that it
    would have told but those beside it: their mean is taken, with what samples usually have about
    that mean. Where more are missing torques are unknown.

    Args:
        record: With efforts, or without.
        reference: The motion, whose smooth torque tells how torques bend between samples.
        time_base: The filter's times and the effort interval of every step.
        noise: (n,) variance of a sample [N^2 m^2].
        timing: How efforts act, a key of `TIMINGS`.
    """

    record: Record
    reference: ReferenceTrajectory
    time_base: TimeBase
    noise: Array
    timing: str

    def at(self, times: Array, interval: IntArray) -> Array:
        """(M, n) at times within given effort intervals [N m]."""
        record = self.record
        if record.effort is None:
            return np.zeros((len(times), len(self.noise)))
        early, late = record.effort[interval], record.effort[interval + 1]
        end = TIMINGS[self.timing]
        if end is not None:
            lost = self._is_lost(times, interval)[:, None]
            return np.where(lost, 0.5 * (early + late), (1.0 - end) * early + end * late)
        stamps = record.effort_time
        share = (times - stamps[interval]) / (stamps[interval + 1] - stamps[interval])
        share = np.clip(share, 0.0, 1.0)[:, None]
        # straight between the samples, bent as the smooth torque bends
        bend = self.reference.effort(times)
        bend -= (1.0 - share) * self.reference.effort(stamps[interval])
        bend -= share * self.reference.effort(stamps[interval + 1])
        return (1.0 - share) * early + share * late + bend

    def late_shares(self) -> tuple[Array, Array]:
        """(N-1,) share of the later sample at each step's start, and its growth over it."""
        end, durations = TIMINGS[self.timing], np.diff(self.time_base.times)
        if end is not None:
            return np.full(len(durations), end), np.zeros(len(durations))
        growth = durations / np.diff(self.record.effort_time)[self.time_base.interval]
        return self.time_base.fraction - 0.5 * growth, growth

    def sample_variance(self) -> Array:
        """(N-1, n) variance of the samples that enter with each step [N^2 m^2]."""
        variance = np.tile(self.noise, (len(self.time_base.times) - 1, 1))
        effort = self.record.effort
        if effort is None:
            return variance + _UNKNOWN**2
        variance[self.time_base.blind] += np.var(effort, axis=0) + self.noise
        return variance

    def lost_variance(self) -> Array:
        """(N-1, n) variance of the torque over each step about its sample, which is lost.

        That of samples about the mean of those beside them [N^2 m^2].
        """
        base, effort = self.time_base, self.record.effort
        middle = 0.5 * (base.times[:-1] + base.times[1:])
        lost = self._is_lost(middle, base.interval) & ~base.blind
        if effort is None or not lost.any():
            return np.zeros((len(middle), len(self.noise)))
        is_whole = np.diff(self.record.effort_time) <= ONE_LOST * base.usual
        beside = is_whole[:-1] & is_whole[1:]
        bends = (effort[1:-1] - 0.5 * (effort[:-2] + effort[2:]))[beside]
        usual = NORMAL * np.median(np.abs(bends), axis=0) if len(bends) else 0.0
        return np.asarray(lost[:, None] * usual**2)

    def _is_lost(self, times: Array, interval: IntArray) -> BoolArray:
        """(M,) times of which a missing sample would have told most.

        A sample holds for as long as usual: of two that are twice as far apart one is missing, and
        with it half of each of two means; between samples of a torque the nearest tells most.
        """
        end, stamps = TIMINGS[self.timing], self.record.effort_time
        before, after = times - stamps[interval], stamps[interval + 1] - times
        usual = self.time_base.usual
        is_long = before + after > ONE_LOST * usual
        away = {
            1.0: after,
            0.0: before,
            0.5: np.maximum(before, after),
            None: np.minimum(before, after) + 0.5 * usual,
        }[end]
        return np.asarray(is_long & (away > usual))
