"""Motion and torques of a fixed-base arm on even times, low-passed without delay.

Logged rates are not used: many are made of positions by a filter, smooth and late. Rates and
accelerations are derivatives of the low-passed positions, and efforts pass the same filter, so
that all that a torque balance is made of is smooth alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import scipy
from scipy.interpolate import BSpline, make_interp_spline
from scipy.ndimage import binary_opening, maximum_filter1d, minimum_filter1d
from scipy.spatial.transform import Rotation

from ...effects.joint import STICTION_RATE
from ...recording.record import Record
from ...types import Array, BoolArray
from ..noise_levels import fourth_difference_std, step_of
from ..trajectory.reference import Kinematics

BAND = 4.0
"""Hz; motions of arms and what friction makes of them lie below, most noise above."""
_SAMPLES = 6.0  # a period of the band at the least
_SMOOTHED = 2.5  # bands: where positions and efforts are cut
RATE = 100.0
"""Hz at which torques are balanced; a slower record is interpolated, as dry friction changes its
sign between two samples."""
_GAP = 4.0  # sample intervals without a sample
_REST_SHARE = 0.01  # of a joint's, and of the fastest motor's, 95 % rate
_WHEEL = 4.0 * np.pi  # rad; a joint that turns on and on is a wheel, fast beside any other
_SPLINE = 5  # degree: derivatives are right to 0.1 % at the band's end, six samples a period
_REST_RATE = 3.0 * STICTION_RATE
"""What is slower rests: the smoothed sign of its dry friction is not yet 1. Of an arm that crept
at 3 mrad/s friction of two joints' rates was named, whose sum is farther from zero."""
_REST_TIME = 0.2  # s
_LATE = 0.01  # s
_STANDING = 0.25  # of the way of a joint that turns round with its usual acceleration
_FEWEST_STEPS = 3.0  # of a rest
_PEAK_TO_PEAK = 6.0  # standard deviations of noise
_WATCHED = 1.0  # s in which a joint that does not stand goes farther than its readings flicker
_FEWEST_MOVING = 0.05  # of a record: a joint that moves less was only touched
_REACH = 2.0  # periods of a cut, beyond which its filter has forgotten all but 3e-4 of a step
_FEWEST_OF_BEND = 5  # samples, or a period of the cut, that an acceleration is taken from
_TOUCHED = 0.01  # of a record, rests' margins included: one that moves less stood
_END_MARGIN = 0.8  # periods of the band, in which its filter forgets 99 % of a step at an end
_REST_MARGIN = 0.35  # periods of the band, which the filter spreads an end of rest over


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """One recording on N even times.

    Args:
        record: Joint positions and efforts; sensor effects already undone.
        left_out: Starts and ends of times [s] in which something acts from outside.
    """

    record: Record
    left_out: tuple[tuple[float, float], ...] = ()

    @cached_property
    def interval(self) -> float:
        """Usual sample interval [s]."""
        return float(np.median(np.diff(self.record.joint_time)))

    @cached_property
    def band(self) -> float:
        """Frequency below which torques are compared [Hz]."""
        return min(BAND, 1.0 / (_SAMPLES * self.interval))

    @cached_property
    def _dense(self) -> Array:
        """Even times at the record's own rate [s]."""
        start, end = self.record.span
        return np.linspace(start, end, round((end - start) / self.interval) + 1)

    @cached_property
    def times(self) -> Array:
        """(N,) [s]."""
        between = max(1, round(self.interval * RATE))
        if between == 1:
            return self._dense[:: max(1, int(1.0 / (self.interval * RATE) + 1e-6))]
        start, end = self.record.span
        return np.linspace(start, end, between * (len(self._dense) - 1) + 1)

    @cached_property
    def step(self) -> float:
        """Distance of the times [s]."""
        return float(self.times[1] - self.times[0])

    @cached_property
    def kinematics(self) -> Kinematics:
        """Positions, rates and accelerations."""
        q, qd, qdd = (np.asarray(self.path(self.times, order)) for order in range(3))
        none = np.zeros((len(q), 3))
        return Kinematics(self.times, q, qd, none, Rotation.identity(len(q)), qdd, none)

    @cached_property
    def path(self) -> BSpline:
        """Positions at any times, or a derivative: `path(times, order)`."""
        return self._smooth(self.record.joint_time, self.record.q, is_path=True)

    @cached_property
    def effort(self) -> Array:
        """(N, n) [N m]."""
        if self.record.effort is None:
            raise ValueError('a torque balance needs efforts')
        efforts = np.nan_to_num(self.record.effort)
        return np.asarray(self._smooth(self.record.effort_time, efforts)(self.times))

    @cached_property
    def unpowered(self) -> BoolArray:
        """(N, n) where a joint has no motor, or one that is off, and no stop acts."""
        return self._clear(1.0)

    @cached_property
    def powered(self) -> BoolArray:
        """(N, n) where a joint has a motor that is on, and no stop acts."""
        return self._clear(0.0)

    def _clear(self, state: float) -> BoolArray:
        """(N, n) where motors are off (1) or on (0), clear of the filters' reach of a change."""
        joints = self.record.joints
        if joints is None or joints.unpowered is None:
            return ~self._stops if state == 0.0 else np.zeros_like(self._stops)
        share = [np.interp(self.times, self.record.joint_time, u) for u in joints.unpowered.T]
        return np.asarray(~_widened(np.column_stack(share) != state, self._margin) & ~self._stops)

    @cached_property
    def _stops(self) -> BoolArray:
        """(N, n) where a stop may act on a joint; on its arrival and leaving all joints jump."""
        own = self.record.stopped(self.times, self.times)
        jumps = np.any(np.diff(own, axis=0, prepend=own[:1]), axis=1)
        end = round(_END_MARGIN / self.band / self.step)
        return np.asarray(_widened(own | jumps[:, None], end))

    @property
    def _margin(self) -> int:
        """Steps over which the filters spread an end."""
        return round(_REST_MARGIN / self.band / self.step)

    @cached_property
    def is_known(self) -> BoolArray:
        """(N,) whether samples lie close by; False in gaps and next to the ends."""
        at = self.record.joint_time
        after = np.clip(np.searchsorted(at, self.times), 1, len(at) - 1)
        known = at[after] - at[after - 1] <= _GAP * max(self.interval, self.step)
        end = round(_END_MARGIN / self.band / self.step)
        known[:end] = known[-end:] = False
        return np.asarray(~_widened(~known, self._margin))

    @cached_property
    def is_moving(self) -> BoolArray:
        """(N, n) where a joint with a known effort moves and nothing acts from outside.

        At rest friction takes any value.
        """
        moving = self._moves.copy()
        for start, end in self.left_out:
            moving[(self.times >= start) & (self.times <= end)] = False
        return moving

    @cached_property
    def is_touched(self) -> BoolArray:
        """(n,) joints that go somewhere, in jerks or once, too shortly to be judged."""
        goes = np.mean(~self.rests & self.is_known[:, None], axis=0) > _TOUCHED
        return np.asarray(goes & ~self._moves.any(axis=0))

    @property
    def is_shown(self) -> BoolArray:
        """(N, n) where a joint moves, whatever acts; all known times where none does."""
        known = np.broadcast_to(self.is_known[:, None], self._moves.shape)
        return self._moves if self._moves.any() else known

    @cached_property
    def unsure(self) -> tuple[Array, Array]:
        """(M, n) twice: shapes of what friction leaves in rows: late by 10 ms, and of any size.

        The first has the signs of the turns; the second is near turns and rests.
        """
        sign = np.sign(self.kinematics.qd)
        turns = _LATE * np.gradient(sign, self.step, axis=0)
        rests = self.rests.astype(float)
        late, near, rest = (self.in_band(x)[:: self.stride] for x in (turns, np.abs(turns), rests))
        return late, np.abs(near) + np.abs(rest)

    @cached_property
    def rests(self) -> BoolArray:
        """(N, n) where a joint stands."""
        speed = np.abs(self.kinematics.qd)
        usual = (
            np.quantile(speed[self.is_known], 0.95, axis=0) if self.is_known.any() else speed[0]
        )
        # What moves no joint of its own, and no wheel, jitters while others move.
        driven = self.powered.any(axis=0) & (np.ptp(self.kinematics.q, axis=0) < _WHEEL)
        fastest = np.where(driven, np.max(usual, where=driven, initial=0.0), 0.0)
        slow = np.maximum(_REST_SHARE * np.maximum(usual, fastest), _REST_RATE)
        resting = binary_opening(speed < slow, np.ones((max(1, round(_REST_TIME / self.step)), 1)))
        return np.asarray(resting | self._sticks | self._flickers)

    @cached_property
    def _moves(self) -> BoolArray:
        is_measured = ~np.isnan(self.record.effort[0]) if self.record.effort is not None else False
        moving = ~_widened(self.rests, self._margin) & self.is_known[:, None] & is_measured
        moving &= self.powered | self.unpowered
        return np.asarray(moving & (np.mean(moving, axis=0) > _FEWEST_MOVING))

    @cached_property
    def bend(self) -> Array:
        """(n,) rms acceleration of every joint [rad/s^2]."""
        known = self.is_known[:, None]
        share = max(float(np.mean(known)), 1e-9)
        return np.asarray(np.sqrt(np.mean(self.kinematics.qdd**2 * known, axis=0) / share))

    @cached_property
    def shortest_rest(self) -> Array:
        """(n,) time for which a joint has to stand for its positions to show it [s].

        Around a turn with acceleration a a joint goes a T^2 / 8 in a time T. One that goes a
        quarter of that stands, if T is long enough for a quarter to be more than noise.
        """
        noise, step = self._noise
        time = np.sqrt(8.0 * np.maximum(noise, step) / np.maximum(_STANDING * self.bend, 1e-300))
        return np.clip(time, _FEWEST_STEPS * self.interval, _REST_TIME)

    @cached_property
    def _noise(self) -> Array:
        """(2, n) what the noise of positions goes from peak to peak, and the encoders' steps."""
        stamped, each = self.record.joint_time, self.record.q.T
        noise = [_PEAK_TO_PEAK * fourth_difference_std(q[:, None], stamped) for q in each]
        return np.array([noise, [step_of(q) for q in each]])

    @cached_property
    def _sticks(self) -> BoolArray:
        """(N, n) where a joint stands for less than `_REST_TIME`, as friction makes it."""
        out = np.zeros_like(self.kinematics.q, dtype=bool)
        for j, (bend, time) in enumerate(zip(self.bend, self.shortest_rest, strict=True)):
            if time < _REST_TIME:
                out[:, j] = self._stays(j, time, _STANDING * bend * time**2 / 8.0)
        return out

    @cached_property
    def _flickers(self) -> BoolArray:
        """(N, n) where readings flicker, between two steps of an encoder most often, for a second.

        Rates of these would pass for a motion. Noise is rounded at both ends of its way. Next to
        a motion, which begins within that way, rates tell.
        """
        way = np.sum(self._noise, axis=0)
        stays = np.column_stack([self._stays(j, _WATCHED, w) for j, w in enumerate(way)])
        return ~_widened(~stays, round(_REST_TIME / self.step))

    def _stays(self, j: int, time: float, way: float) -> BoolArray:
        """(N,) where all readings of a joint over a time [s] lie within a way [rad]."""
        q = np.interp(self._dense, self.record.joint_time, self.record.q[:, j])
        count = math.ceil(time / self.interval) + 1
        goes = maximum_filter1d(q, count) - minimum_filter1d(q, count)
        stays = _dilated(goes < way, count)
        return np.asarray(np.interp(self.times, self._dense, stays) > 0.5)

    def bridged(self, values: Array, j: int) -> Array:
        """(N, c) values of joint j, straight lines where it stands and its ends are smeared."""
        reach = round(self._margin / _SMOOTHED)
        known = np.flatnonzero(~_widened(self.rests[:, j], reach))
        if len(known) in (0, len(values)):
            return values
        after = np.searchsorted(known, np.arange(len(values)))
        low, high = known[np.maximum(after - 1, 0)], known[np.minimum(after, len(known) - 1)]
        high = np.where(high < np.arange(len(values)), low, high)
        low = np.where(low > np.arange(len(values)), high, low)
        share = (np.arange(len(values)) - low) / np.maximum(high - low, 1)
        return np.asarray(values[low] + share[:, None] * (values[high] - values[low]))

    def in_band(self, values: Array) -> Array:
        """(N, ...) values without what is faster than the band."""
        return _low_passed(values, self.band, self.step)

    @property
    def stride(self) -> int:
        """Steps from row to row: 2.5 rows a period of the band."""
        return max(1, int(1.0 / (_SMOOTHED * self.band * self.step) + 1e-6))

    def _smooth(self, at: Array, values: Array, *, is_path: bool = False) -> BSpline:
        """Values without what is faster than some bands, between samples, too."""
        dense = np.column_stack([np.interp(self._dense, at, column) for column in values.T])
        step = float(self._dense[1] - self._dense[0])
        cut = _low_passed(dense, _SMOOTHED * self.band, step, is_path=is_path)
        return make_interp_spline(self._dense, cut, _SPLINE)


def _low_passed(values: Array, cut: float, step: float, *, is_path: bool = False) -> Array:
    """Third-order Butterworth, forwards and backwards: no delay.

    Args:
        values: (N, ...) at even times.
        cut: Frequency [Hz].
        step: Distance of the times [s].
        is_path: Whether second derivatives are asked of it.
    """
    reach = min(len(values) - 1, math.ceil(_REACH / (cut * step)))
    whole = _extended(values, reach, round(1.0 / (cut * step))) if is_path else values
    sections, steady = _butterworth(cut * step)
    steady = steady.reshape(*steady.shape, *[1] * (values.ndim - 1))
    out = _extended(whole, reach)
    for _ in range(2):  # forwards, then backwards, as if the first value had always been
        out = scipy.signal.sosfilt(sections, out, axis=0, zi=steady * out[0])[0][::-1]
    margin = reach * (1 + is_path)
    return np.asarray(out[margin : margin + len(values)])


def _extended(path: Array, reach: int, few: int = 0) -> Array:
    """A path (N, ...) and so many samples beyond both ends: its reflections in them.

    The reflection in an end alone has another sign of the acceleration, and none at the end: it is
    bent by that of so few samples, if any.
    """
    before = 2.0 * path[0] - path[reach:0:-1]
    after = 2.0 * path[-1] - path[-2 : -reach - 2 : -1]
    if few:
        few = min(len(path), max(_FEWEST_OF_BEND, few))
        bent = np.arange(reach, 0, -1.0)[:, None] ** 2
        before = before + bent * _bend(path[:few])
        after = after + bent[::-1] * _bend(path[-few:])
    return np.concatenate([before, path, after])


def _bend(values: Array) -> Array:
    """(n,) second differences of (N, n) values, by the parabola that comes closest."""
    at = np.arange(len(values)) - 0.5 * (len(values) - 1)
    square = at**2 - np.mean(at**2)
    return np.asarray(2.0 * square @ values / (square @ square))


@cache
def _butterworth(cut: float) -> tuple[Array, Array]:
    """(S, 6) sections of the filter, and (S, 2) their states at a steady 1.

    `cut` is by the rate of samples.
    """
    sections = scipy.signal.butter(3, cut, fs=1.0, output='sos')
    return np.asarray(sections), np.asarray(scipy.signal.sosfilt_zi(sections))


def _widened(where: BoolArray, margin: int) -> BoolArray:
    return _dilated(where, 2 * margin + 1)


def _dilated(where: BoolArray, count: int) -> BoolArray:
    """`scipy.ndimage.binary_dilation` by a column of `count`, whose cost does not grow with it."""
    shift = count % 2 - 1
    most = maximum_filter1d(where.astype(np.uint8), count, axis=0, mode='constant', origin=shift)
    return np.asarray(most > 0)
