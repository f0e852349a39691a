r"""Rows by balance: the torques that a model misses along a measured motion, where effects act.

    H(q) q'' + c(q, q') - tau - believed effects = sum of effects + inertial errors + leftover

Rows are the left side below `BAND`, sampled critically, in units of what no effect of the
catalogue explains. Nothing is integrated, so a model that is wrong everywhere is as good a start
as any: this is for data whose noise nobody knows. Real joints have torques that are in no
catalogue, links are not as in the file, and sensors are filtered before they are logged, so that
next to no noise is left by which to judge: every effect would be significant. So what inertial
errors and the whole catalogue together leave is taken for noise, with what so large a fit takes
from pure noise allowed for (the inadequacy of a model: Kennedy and O'Hagan, J. R. Stat. Soc. B 63
(2001); here its level alone is estimated).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
from scipy.fft import dct, idct
from scipy.linalg import solve_triangular

from ..effects.motion import Motion
from ..recording.record import Record
from ..types import Array
from .prediction import MeasuredMotion
from .reference import Kinematics, NoiseLevels
from .rows import ChannelError, ChannelFit
from .torque_process import TorqueDriven

BAND = 4.0
"""Hz; motions of arms and what friction makes of them lie below, most noise above."""
_PASSES = 4
_LEAST = 1e-3  # of an effort's spread: no torque sensor is as good
_SMALL = 1e-4  # rad; a position error so small that inverse dynamics are linear in it
_SHOWN = 25.0  # Hz, of the channels
_FILTERED = 1e-4  # of the efforts' spread: noise below it is no sensor's


def band_limited(values: Array, times: Array) -> Array:
    """(N, ...) values without what is faster than `BAND`."""
    terms = dct(values, axis=0, norm='ortho')
    terms[max(4, int(2.0 * BAND * (times[-1] - times[0]))) :] = 0.0
    return np.asarray(idct(terms, axis=0, norm='ortho'))


class Balance:
    """Rows of one model of one record of a fixed-base robot with measured torques.

    Args:
        measured: The record, its sensors as the model believes them.
        process: The model.
        levels: (n,) rms of the leftover in the band [N m]; None: of what the model misses.
    """

    log_determinant = 0.0  # the levels belong to the record, not to the model

    def __init__(
        self, measured: MeasuredMotion, process: TorqueDriven, levels: Array | None = None
    ) -> None:
        self.robot = process.robot
        self._process, self._measured = process, measured
        self.times = measured.time_base.times
        effort = measured.reference.effort(self.times)
        given = process.motion(measured.kinematics, effort)
        self.missed = -process.force_error(given)[:, 6:]
        # A fault of measured torques is taken to scale those that the model needs: else a gain of
        # zero and no masses would explain everything.
        self.motion = process.motion(measured.kinematics, self._required(given))
        self._sample_times = np.arange(self.times[0], self.times[-1], 0.5 / BAND)
        self._least = _LEAST * np.std(effort, axis=0)
        own = np.sqrt(np.mean(self._in_band(self.missed) ** 2, axis=0))
        self.levels = np.maximum(own, self._least) if levels is None else levels

    @cached_property
    def effort_rate(self) -> Array:
        """(N, n) time derivative of the torques that the model needs [N m/s]."""
        return np.gradient(self.motion.effort, self.times, axis=0)

    @cached_property
    def data(self) -> Array:
        """(R,) torques that the model misses, row by row all joints, by their levels."""
        return np.asarray((self._in_band(self.missed) / self.levels).ravel())

    @property
    def row_times(self) -> Array:
        """(R,) time of every row [s]."""
        return np.repeat(self._sample_times, len(self.levels))

    def samples(self) -> Mapping[str, tuple[Kinematics, Motion]]:
        """Joint positions at the times of the balance: rates and accelerations follow them."""
        return {'joint_position': (self._measured.kinematics, self.motion)}

    def whitened(self, forces: Array, measured: Mapping[str, Array]) -> Array:
        """(R, K); see `Rows.whitened`."""
        torques = forces[:, 6:].copy()
        if 'joint_position' in measured:
            for k, error in enumerate(np.moveaxis(measured['joint_position'], 2, 0)):
                if error.any():
                    torques[:, :, k] += self._misread(error)
        rows = self._in_band(torques) / self.levels[:, None]
        return np.asarray(rows.reshape(-1, rows.shape[2]))

    def force_correlation(self, weights: Array) -> Array:
        """(N, 6 + n); see `Rows.force_correlation`."""
        out = self.motion.zeros()
        torques = weights.reshape(-1, len(self.levels)) / self.levels
        place = np.searchsorted(self.times, self._sample_times)
        np.add.at(out[:, 6:], np.minimum(place, len(self.times) - 1), torques)
        out[:, 6:] = band_limited(out[:, 6:], self.times)
        return out

    def whiteness(self) -> tuple[None, tuple[ChannelFit, ...]]:
        """Not tested: the level of the leftover comes from the data themselves."""
        return None, ()

    def channels(self) -> tuple[ChannelError, ...]:
        """Missed torque of every joint in the band."""
        stride = max(1, round(len(self.times) / (self.times[-1] - self.times[0]) / _SHOWN))
        error = band_limited(self.missed, self.times)[::stride]
        time, none = self.times[::stride], np.zeros(0)
        return tuple(
            ChannelError(f'joint_torque/{name}', 'N m', time, none, error[:, i], float(level))
            for i, (name, level) in enumerate(zip(self.robot.joints, self.levels, strict=True))
        )

    def levels_left_by(self, columns: Array, sizes: Array) -> Array:
        """(n,) levels of what a fit of the whole catalogue leaves [N m].

        Args:
            columns: (R, K) of all candidates, whitened by this model's levels.
            sizes: (K,) their plausible sizes.
        """
        levels, n = self.levels, len(self.levels)
        torques = columns.reshape(-1, n, columns.shape[1]) * levels[:, None] * sizes
        missed = self._in_band(self.missed)
        for _ in range(_PASSES):
            levels = np.maximum(_left(torques, missed, levels), self._least)
        return np.asarray(levels)

    def _required(self, motion: Motion) -> Array:
        """(N, n) motor torque that the model needs for a motion, effects included [N m]."""
        return (self._process.needed(motion) - self._process.forces(motion))[:, 6:]

    def _in_band(self, values: Array) -> Array:
        """(M, ...) values (N, ...) below `BAND`, at twice that rate."""
        limited = band_limited(values, self.times)
        place = np.clip(np.searchsorted(self.times, self._sample_times), 1, len(self.times) - 1)
        early, late = self.times[place - 1], self.times[place]
        share = (self._sample_times - early) / (late - early)
        share = share.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray((1.0 - share) * limited[place - 1] + share * limited[place])

    def _misread(self, error: Array) -> Array:
        """(N, n) torque that inverse dynamics add where positions are read by `error` too large.

        Args:
            error: (N, n) by a unit of a coefficient [rad].
        """
        scale = _SMALL / float(np.max(np.abs(error)))
        at = self._measured.kinematics
        off = scale * error
        slope = np.gradient(off, at.time, axis=0)
        bend = np.gradient(slope, at.time, axis=0)
        read = Kinematics(
            at.time, at.q + off, at.qd + slope, at.omega, at.rotation, at.qdd + bend, at.alpha
        )
        required = self._required(self._process.motion(read, self.motion.effort))
        return np.asarray((required - self._required(self.motion)) / scale)


def _left(columns: Array, missed: Array, levels: Array) -> Array:
    """(n,) levels of what a fit leaves of (M, n) torques, weighted by levels (n,)."""
    count, n, width = columns.shape
    design = (columns / levels[:, None]).reshape(count * n, width)
    data = (missed / levels).ravel()
    factor = np.linalg.cholesky(design.T @ design + np.eye(width))
    hat = solve_triangular(factor, design.T, lower=True)  # hat.T @ hat takes data to their fit
    rest = (data - hat.T @ (hat @ data)).reshape(count, n)
    used = np.sum(hat**2, axis=0).reshape(count, n)
    free = np.maximum(np.sum(1.0 - used, axis=0), 1.0)
    return np.asarray(levels * np.sqrt(np.sum(rest**2, axis=0) / free))


def noise_shown(record: Record, noise: NoiseLevels) -> bool:
    """Whether measured efforts show noise of their own; those filtered before logging do not."""
    effort = record.effort
    return effort is None or noise.joint_effort >= _FILTERED * float(np.std(effort))
