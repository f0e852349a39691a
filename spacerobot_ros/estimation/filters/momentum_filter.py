r"""Rows by prediction from momentum: whitened innovations with every unknown constant a column.

State: deviations [dphi; dq, dq', dq'', dq'''] from the reference. The attitude error moves with
the rate error of the momentum equation (`MomentumModel.linearize`), needs no torque and no process
noise; each joint follows a quartic driven by white snap. The constants [h_W; AAM; x] are not
states: every innovation is an affine function of their errors. Whitened innovations are therefore
rows of a linear least-squares problem, collected in square-root form by QR: recursive, with
bounded memory, and equal to the Kalman filter with augmented state (Friedland 1969; Bierman 1977).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from ...dynamics.rotation import skew
from ...recording.record import Record
from ...types import Array, IntArray
from ..inference.square_root import SquareRootInformation
from ..trajectory.reference import NoiseLevels, ReferenceTrajectory
from ..trajectory.sampled_motion import SampledMotion
from ..trajectory.time_base import CHANNELS, channel_stamps, measured_rows
from ..unknowns.torque_hold import Holds, held_jerk
from .kalman import StateSpace, gains_of, whiten
from .momentum_process import MomentumModel, RateErrorModel
from .momentum_steps import add_stops, driven_by_joints, transitions_of

_ATTITUDE_START_STD = 0.05  # rad; the reference starts far closer to the tracker than this
# The spline's snap, seen as white noise over its knots' spacing, overstates what the filter needs:
# with this share the innovations of smooth motions have unit variance. Estimates do not depend on
# it (factors of 1000 change no digit).
_SNAP_SHARE = 0.3
_AT_ONCE = 500  # times of a part; what is computed at once stays below some 100 MB


class Part(NamedTuple):
    """Some of a stretch's times, the first of them the last of the part before.

    Args:
        times: Which N times. rows: Which R rows.
        first: (N + 1,) first row of every time, among these.
    """

    times: slice
    rows: slice
    first: IntArray


class Stretch(SampledMotion):
    """A stretch of a record, made ready for the filter.

    Args:
        record: Samples within the reference's times.
        noise: Noise levels.
        reference: Through the samples and, perhaps, some beyond.
        holds: When torques were set; None where that is of no interest.
    """

    def __init__(
        self,
        record: Record,
        noise: NoiseLevels,
        reference: ReferenceTrajectory,
        holds: Holds | None = None,
    ) -> None:
        n = record.q.shape[1]
        states = {
            'joint_position': 3 + np.arange(n),
            'joint_velocity': 3 + n + np.arange(n),
            'gyro': 3 + 4 * n + np.arange(3),  # of the first time, each later one three further
            'attitude': np.arange(3),
        }
        rows = measured_rows(reference.times, channel_stamps(record), states)
        super().__init__(record, noise, reference, rows)
        self.holds = holds

    @property
    def parts(self) -> Iterator[Part]:
        """Parts that cover it, each row once."""
        first, last = self.rows.first, len(self.reference.times) - 1
        starts = range(0, max(last, 1), _AT_ONCE)
        for start in starts:
            stop = min(start + _AT_ONCE, last)
            own = first[start : stop + 2].copy()
            if start > 0:
                own[0] = own[1]  # rows of the time that both parts have are the first one's
            yield Part(slice(start, stop + 1), slice(int(own[0]), int(own[-1])), own - own[0])

    @cached_property
    def joint_states(self) -> Array:
        """(N, 4 n) positions, rates, accelerations and jerks of the reference."""
        return np.hstack([self.reference.joints(self.reference.times, k) for k in range(4)])

    @cached_property
    def fastest(self) -> Array:
        """(3, n) largest rate, acceleration and jerk of every joint's reference."""
        return np.max(np.abs(self.joint_states), axis=0).reshape(4, -1)[1:]

    @cached_property
    def snap_density(self) -> Array:
        """(n,) power spectral density of a white snap that follows the joints as the spline."""
        joints = self.reference.joints
        snap = joints(self.reference.times, 4)
        return np.asarray(_SNAP_SHARE * np.mean(snap**2, axis=0) * joints.spacing + 1e-12)

    def misreadings(self, model: MomentumModel, constants: Array) -> tuple[Array, Array]:
        """(R,) what nuisances add to the samples, and (R, m) its derivatives by them."""
        nuisances = model.nuisances
        is_held = self.holds is not None and nuisances.torque_hold is not None
        jerk = held_jerk(model.robot_at(constants), self.reference) if is_held else None
        held_parts = {'gyro': slice(0, 3), 'joint_velocity': slice(3, None)}
        totals, columns = {}, {}
        for channel, stamps in channel_stamps(self.record).items():
            if len(stamps):
                at, held = self.at_samples(channel), None
                if jerk is not None and self.holds is not None and channel in held_parts:
                    shape = self.holds.shape(at.time)[:, None]
                    shape[self.record.stopped(at.time, at.time).any(axis=1)] = 0.0
                    held = shape * jerk(at.time)[:, held_parts[channel]]
                total, columns[channel] = nuisances.misreadings(
                    constants[model.other], channel, at, held
                )
                totals[channel] = total[..., None]
        return self.rows.of(totals)[:, 0], self.rows.of(columns)


class MomentumFilter:
    """Advances the filter stretch by stretch.

    Args:
        model: The constants and the momentum equation.

    Attributes:
        information: Of the constants' errors.
    """

    def __init__(self, model: MomentumModel) -> None:
        self._model = model
        self.information = SquareRootInformation(model.filter_size)
        self._last: tuple[float, scipy.spatial.transform.Rotation] | None = None
        self._covariance = np.zeros((0, 0))
        # Mean by 1 and constants; joints count from zero between stretches.
        self._mean = np.zeros((3 + 4 * model.n, 1 + model.filter_size))

    def run(
        self,
        stretch: Stretch,
        constants: Array,
        rows: list[tuple[Array, Array]] | None = None,
        *,
        is_near: bool = True,
    ) -> Array:
        """Process a stretch, linearized about constants; a later one begins at the last's end.

        Args:
            stretch: The stretch.
            constants: (p,).
            rows: Takes columns (r, g) and values (r,) of the rows that the information gets; None:
                they are not kept.
            is_near: See `MomentumModel.linearize`.

        Returns:
            (R,) values of the rows.
        """
        joints, values = stretch.joint_states, []
        if self._last is None:
            self._covariance = _start_covariance(joints)
        else:
            self._mean[3:, 0] -= joints[0]
        misread, sensors = stretch.misreadings(self._model, constants)
        for part in stretch.parts:
            motion = stretch.kinematics.part(part.times)
            rate = self._model.linearize(motion, constants, is_near=is_near)
            found = self._run_part(stretch, part, rate, (misread, sensors))
            values.append(found[1])
            if rows is not None:
                rows.append(found)
        self._mean[3:, 0] += joints[-1]
        self._last = float(stretch.reference.times[-1]), stretch.kinematics.rotation[-1]
        return np.concatenate(values)

    def _run_part(
        self, stretch: Stretch, part: Part, rate: RateErrorModel, sensors: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        misread, by_nuisances = (each[part.rows] for each in sensors)
        space, defects = state_space(stretch, part, rate)
        drives = np.concatenate([rate.offset[..., None], rate.constants], axis=2)
        measured = _less_at_gyro(stretch, part, drives)
        measured[:, 0] += stretch.deviations[part.rows] - misread
        measured[:, self._model.filter_other.start + 1 :] -= by_nuisances
        gains = gains_of(space, self._covariance)
        rows = whiten(space, gains, self._mean, drives, defects, measured)
        self._covariance = gains.end
        columns, values = -rows[:, 1:], rows[:, 0]
        self.information.add(columns, values)
        return columns, values

    def take_end(self) -> tuple[float, scipy.spatial.transform.Rotation]:
        """Time at which the last stretch ended, and the attitude from which the next one starts.

        That is the best known: what was known of the deviation is taken into the reference.
        """
        if self._last is None:
            raise ValueError('no stretch was run yet')
        time, rotation = self._last
        correction, self._mean[:3, 0] = (
            scipy.spatial.transform.Rotation.from_rotvec(self._mean[:3, 0].copy()),
            0.0,
        )
        return time, rotation * correction

    def shift_constants(self, change: Array) -> None:
        """Count the constants' errors from a new origin: t -> t - change."""
        factor = self.information.factor
        factor[:, -1] -= factor[:, :-1] @ change
        self._mean[:, 0] += self._mean[:, 1:] @ change


def state_space(stretch: Stretch, part: Part, rate: RateErrorModel) -> tuple[StateSpace, Array]:
    """The model of the deviations, and what the joints' quartic misses of the reference.

    Args:
        stretch: The stretch.
        part: N times, R rows.
        rate: Rate error at the times.

    Returns:
        The model of d = 3 + 4 n states, and (N-1, d) changes by each step.
    """
    joints = stretch.joint_states[part.times]
    n = joints.shape[1] // 4
    size, durations = 3 + 4 * n, np.diff(stretch.reference.times[part.times])
    matrices = np.zeros((len(joints), 3, size))
    matrices[:, :, : 3 + 2 * n] = rate.state
    matrices[:, :, :3] -= skew(stretch.kinematics.omega[part.times])
    slopes = np.ascontiguousarray(rate.state[:, :, 3:])
    noise, defects = driven_by_joints(durations, stretch.snap_density, slopes, joints)
    ends = stretch.reference.times[part.times]
    stopped = np.asarray(stretch.record.stopped(ends[:-1], ends[1:]).any(axis=1))
    add_stops(noise, durations, slopes[1:, :, n:], stopped, stretch.fastest)
    rows = stretch.rows
    is_gyro = rows.channel[part.rows] == CHANNELS.index('gyro')
    at = np.repeat(np.arange(len(joints)), np.diff(part.first))
    by_gyro = np.zeros((3 * len(joints), size))
    by_gyro[:, : 3 + 2 * n] = rate.state.reshape(-1, 3 + 2 * n)
    space = StateSpace(
        durations,
        transitions_of(durations, matrices),
        noise,
        np.zeros((len(durations), 0), dtype=np.int64),
        np.zeros((len(durations), 0)),
        0,
        part.first,
        rows.state[part.rows] + np.where(is_gyro, 3 * at, 0),
        by_gyro,
        stretch.row_variance[part.rows],
    )
    return space, defects


def _less_at_gyro(stretch: Stretch, part: Part, drives: Array) -> Array:
    """(R, c) less what drives the rate, (N, 3, c), at the gyro's rows; zero at others."""
    rows = stretch.rows
    at = np.repeat(np.arange(len(drives)), np.diff(part.first))
    is_gyro = rows.channel[part.rows] == CHANNELS.index('gyro')
    out = np.zeros((len(at), drives.shape[2]))
    out[is_gyro] = -drives[at[is_gyro], rows.axis[part.rows][is_gyro]]
    return out


def _start_covariance(joints: Array) -> Array:
    """(d, d) wide against the noise, but no wider than the motion.

    A covariance that spans twenty decades would lose its sign.
    """
    n = joints.shape[1] // 4
    spread = np.concatenate(
        [np.std(joints[:, :n], axis=0), np.sqrt(np.mean(joints[:, n:] ** 2, axis=0))]
    )
    return np.diag(np.concatenate([np.full(3, _ATTITUDE_START_STD), spread + 1e-6]) ** 2)
