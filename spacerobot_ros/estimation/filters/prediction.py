r"""Rows by prediction: whitened innovations of the torque-driven filter, for data and columns.

State: deviations [dphi; dq | domega; dqd] from the reference, the errors of the two effort
samples between which the step lies, so that an effort that is interpolated is not taken for two
independent ones, and those of the last measured rates of the robot's own wheels.
Innovations of data, and of data with an effect, are one linear operator applied
to what is measured and to what drives (`kalman`; Gertler 1998, ch. 6): all inference behind them
is ordinary least squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...dynamics.rotation import skew
from ...effects.motion import Motion
from ...recording.faults.joint_limits import jumps
from ...recording.record import Record
from ...sensing.reading_gains import AS_READ, Readings
from ...types import Array, IntArray
from ..noise_levels import wheel_noise
from ..trajectory.reference import Kinematics, NoiseLevels, ReferenceTrajectory
from ..trajectory.sampled_motion import SampledMotion
from ..trajectory.time_base import make_time_base, pauses
from .kalman import StateSpace, correlate, gains_of, whiten
from .linear_steps import Steps
from .measured_torque import MeasuredTorque
from .torque_process import TorqueDriven

_GAUSS = (0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15))
_CELLS = np.array([0.0, 5.0, 13.0, 18.0]) / 18.0
_PARABOLA = np.linalg.inv(np.vander(_GAUSS, 3, increasing=True))
_PASSIVE = 1e-3  # of the efforts' noise, at joints whose torque is zero
_START_STD = 0.03  # rad, rad/s; far above what the reference misses
_UNKNOWN_RATE = 1.0  # rad/s; by a step in which anything, or a joint's stop, may act


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """K directions in which a model may change.

    Args:
        acceleration: (N, m, K) change of the accelerations at the times of the filter.
        measured: Channel to (samples, width, K) change of what is measured; absent: none.
    """

    acceleration: Array
    measured: dict[str, Array]


class MeasuredMotion(SampledMotion):
    """A record on its time base, with its reference: what does not depend on a model's forces.

    Args:
        record: Sensor effects already undone.
        noise: Noise levels.
        process: A model of the robot.
        left_out: Starts and ends of times [s] in which anything may act from outside.
        readings: See `SampledMotion`.

    Attributes:
        swung: See `Motion.swung`; records at the same times may share it.
    """

    def __init__(
        self,
        record: Record,
        noise: NoiseLevels,
        process: TorqueDriven,
        left_out: tuple[tuple[float, float], ...] = (),
        readings: Readings = AS_READ,
    ) -> None:
        # through a gap, and about a stop, nobody knows where the reference goes
        self.left_out = (*left_out, *pauses(record.joint_time), *jumps(record))
        self.time_base = make_time_base(record, process.m, process.first)
        reference = ReferenceTrajectory(record, noise, self.time_base.times)
        super().__init__(record, noise, reference, self.time_base.rows, readings)
        self._process = process
        self.swung: dict[tuple[object, ...], Array] = {}

    def motion(self, process: TorqueDriven) -> Motion:
        """The reference under a model; models of one robot share it, and all found along it."""
        is_shared = process.robot is self._process.robot
        return self._shared if is_shared else self._moved(process)

    @cached_property
    def _shared(self) -> Motion:
        return self._moved(self._process)

    def _moved(self, process: TorqueDriven) -> Motion:
        motion = process.motion(self.kinematics, self.reference.effort(self.time_base.times))
        motion.swung = self.swung
        return motion

    @cached_property
    def inner(self) -> tuple[tuple[float, Kinematics], ...]:
        """Gauss's places in the step, and the reference there."""
        start, dt = self.time_base.times[:-1], np.diff(self.time_base.times)
        return tuple((place, self.reference.at(start + place * dt)) for place in _GAUSS)


class Innovations:
    """The filter of one model on one record.

    Args:
        measured: The record, its sensors as the model believes them.
        process: The model.
        timing: How efforts act, a key of `measured_torque.TIMINGS`.

    Attributes:
        size: Number of states.
    """

    def __init__(
        self, measured: MeasuredMotion, process: TorqueDriven, timing: str = 'sampled'
    ) -> None:
        self.process = process
        self.record, self.noise, self.timing = measured.record, measured.noise, timing
        self.m, self.n = process.m, process.n
        self.time_base, self.reference = measured.time_base, measured.reference
        self.kinematics = measured.kinematics
        self.at_samples, self.deviations = measured.at_samples, measured.deviations
        self._measured = measured
        passive = np.isin(process.robot.joints, process.robot.passive_joints)
        noise = np.where(passive, _PASSIVE, 1.0) ** 2 * measured.noise.joint_effort**2
        self._wheels = wheel_noise(process.robot, self.record)
        self.size = 2 * (self.m + self.n + len(self._wheels))
        self._torque = MeasuredTorque(self.record, self.reference, self.time_base, noise, timing)
        self.motion = measured.motion(process)
        self._linear = self.process.linearize(self.motion)
        self._model = self._state_space()
        self._gains = gains_of(self._model, self._start())

    @property
    def durations(self) -> Array:
        """(N-1,) length of each step [s]."""
        return np.diff(self.time_base.times)

    @property
    def stds(self) -> Array:
        """(R,) standard deviation of every innovation."""
        return self._gains.std

    @property
    def spread_cost(self) -> float:
        """See `SampledMotion.spread_cost`."""
        return self._measured.spread_cost

    @cached_property
    def row_times(self) -> Array:
        """(R,) time of every scalar measurement [s]."""
        return np.repeat(self.time_base.times, np.diff(self.time_base.rows.first))

    @cached_property
    def measured(self) -> Array:
        """(R,) measured values; for the attitude the turn since the first sample [rad]."""
        record = self.record
        values: dict[str, Array] = {'joint_position': record.q, 'gyro': record.omega}
        if record.qd is not None:
            values['joint_velocity'] = record.qd
        if record.attitude is not None:
            values['attitude'] = (record.attitude[0].inv() * record.attitude).as_rotvec()
        return self.time_base.rows.of({c: v[..., None] for c, v in values.items()})[:, 0]

    @property
    def rate_by_impulse(self) -> Array:
        """(N, m, m) change of rates by an impulse on base (torque) and joints."""
        return self._linear.by_force[:, :, self.process.first :]

    @cached_property
    def data(self) -> Array:
        """(R,) whitened innovations of the data under the model: white and of unit variance."""
        rates = np.zeros((len(self.time_base.times), self.m, 1))
        return self._whiten(rates, self._defects(), self.deviations[:, None])[:, 0]

    def columns(self, columns: Columns) -> Array:
        """(R, K) whitened innovations that each column leaves in the data of a model without it.

        What drives the truth and not the model shows in the data with the sign of its effect on
        the model reversed.
        """
        measured = self._by_row(columns.measured, columns.acceleration.shape[2])
        rates = np.negative(columns.acceleration, order='C')
        return self._whiten(rates, np.zeros((0, 0)), measured)

    def force_correlation(self, weights: Array) -> Array:
        """(N, 6 + n) correlation of a generalized force at each time with weights of the rows.

        Its product with a column's force, summed over times and components, is `weights` times the
        column's whitened innovations: one pass backwards instead of one a column.
        """
        weights = np.ascontiguousarray(weights)  # else it is compiled twice
        impulses = -correlate(self._model, self._gains, weights, self.m)
        return np.asarray(np.einsum('nm,nmi->ni', impulses, self._linear.by_force))

    def accelerations(self, forces: Array) -> Array:
        """(N, m, K) accelerations by generalized forces (N, 6 + n, K) at the filter's times."""
        return np.asarray(self._linear.by_force @ forces)

    def _whiten(
        self, rates: Array, defects: Array, measured: Array, mean: Array | None = None
    ) -> Array:
        if mean is None:
            mean = np.zeros((self.size, rates.shape[2]))
        return np.asarray(whiten(self._model, self._gains, mean, rates, defects, measured))

    def _by_row(self, measured: Mapping[str, Array], count: int) -> Array:
        """(R, count) of what is measured; (0, count) where nothing is."""
        if not measured:
            return np.zeros((0, count))
        return self.time_base.rows.of(dict(measured))

    @cached_property
    def _steps(self) -> Steps:
        m, linear = self.m, self._linear
        a = np.zeros((len(self.time_base.times), 2 * m, 2 * m))
        a[:, :m, m:] = np.eye(m)
        a[:, m:, :m] = linear.by_position
        a[:, m:, m:] = linear.by_velocity
        if m > self.n:
            a[:, :3, :3] = -skew(self.kinematics.omega)
        return Steps(self.durations, a)

    def _state_space(self) -> StateSpace:
        """The model about the reference.

        A step that lies in another effort interval than the last begins with the sample that the
        last one ended with, and with a new one at its end; errors of both act along the step.
        """
        rows, steps = self.time_base.rows, self._steps
        by_effort, grows = self._linear.by_effort[:-1], np.diff(self._linear.by_effort, axis=0)
        start, growth = (x[:, None, None] for x in self._torque.late_shares())
        late_drives = start * by_effort, growth * by_effort + start * grows, growth * grows
        late, driven = -steps.driven(*late_drives), steps.driven(by_effort, grows)
        by_wheels = self._by_wheel_errors()
        f = np.concatenate([steps.transitions, -late - driven, late, *by_wheels], axis=2)
        noise = self._unknown()
        lost = self._torque.lost_variance()
        if lost.any():
            noise += (driven * lost[:, None]) @ np.swapaxes(driven, 1, 2)
        ends = self.time_base.times
        stopped = self.record.stopped(ends[:-1], ends[1:])
        if stopped.any():
            # a torque between two links that sets in at any time of the step
            own = by_effort[:, self.m - self.n :].diagonal(axis1=1, axis2=2)
            size = stopped * _UNKNOWN_RATE / np.abs(own * self.durations[:, None])
            for push in (steps.driven(by_effort), steps.driven(0.0 * by_effort, by_effort)):
                noise += (push * size[:, None] ** 2) @ np.swapaxes(push, 1, 2)
        handed, variance = self._fresh_errors()
        return StateSpace(
            self.durations,
            f,
            noise,
            handed,
            variance,
            self.m,
            rows.first,
            rows.state,
            np.zeros((0, self.size)),
            self._measured.row_variance,
        )

    def _fresh_errors(self) -> tuple[IntArray, Array]:
        """`handed` and `fresh_variance` of efforts and own wheels' rates, early and late."""
        n, own, fresh = self.n, len(self._wheels), self.time_base.fresh[:, None]
        late, following = n + np.arange(n), 2 * n + own + np.arange(own)
        handed = np.full((len(fresh), 2 * (n + own)), -1)
        handed[:, :n] = np.select([fresh == 0, fresh == 1], [np.arange(n), late], -1)
        handed[:, late] = np.where(fresh == 0, late, -1)
        handed[:, 2 * n : 2 * n + own] = following
        variance = np.ones(handed.shape)
        variance[:, : 2 * n] = np.tile(self._torque.sample_variance(), 2)
        return handed, np.where(handed < 0, variance, 0.0)

    def _by_wheel_errors(self) -> tuple[Array, Array]:
        """(N-1, 2 m, w) each: change by errors of the own wheels' last and next measured rates.

        What is read too much, n, is taken from the base, and given back with the next sample:
        n' + w x n.
        """
        length, inverse = self.durations[:, None, None], self._linear.by_force[1:, :, 3:6]
        jump = inverse @ self._wheels.T
        turn = 0.5 * length * inverse @ skew(self.kinematics.omega[1:]) @ self._wheels.T
        last, following = (
            np.concatenate([0.5 * length * rates, rates], axis=1)
            for rates in (turn - jump, turn + jump)
        )
        return last, following

    def _defects(self) -> Array:
        """(N-1, 2 m) what the model's accelerations miss of the reference over each step.

        The error is a parabola e_0 + e_1 s + e_2 s^2 through Gauss's points of the step.
        """
        errors = []
        for place, kinematics in self._measured.inner:
            effort = self._torque.at(kinematics.time, self.time_base.interval)
            motion = self.process.motion(kinematics, effort, window=self._cells(place))
            by_force = _between(self._linear.by_force, place)
            errors.append(np.einsum('nij,nj->ni', by_force, self.process.force_error(motion)))
        parabola = np.einsum('pg,gnm->pnm', _PARABOLA, np.stack(errors))[..., None]
        return self._steps.driven(*parabola)[..., 0]

    def _cells(self, place: float) -> Array:
        """(N-1, 2) part of every step that one of Gauss's points stands for, by its weight."""
        k = _GAUSS.index(place)
        starts = self.time_base.times[:-1, None]
        return np.asarray(starts + self.durations[:, None] * _CELLS[k : k + 2])

    def _unknown(self) -> Array:
        """(N-1, 2 m, 2 m) covariance that enters each step by what may act from outside.

        It is as white as can be: with a standard deviation s of the rate's change in a step of
        length T, that of the position is s T / sqrt(3), their covariance s^2 T / 2. A change of
        the rate alone has the position go on at the rate before it.
        """
        eye, times = np.eye(self.m), self.time_base.times
        out = np.zeros((len(self.durations), 2 * self.m, 2 * self.m))
        for start, end in self._measured.left_out:
            for k in np.flatnonzero((times[1:] > start) & (times[:-1] < end)):
                length = self.durations[k]
                shares = np.array([[length**2 / 3.0, 0.5 * length], [0.5 * length, 1.0]])
                out[k] = _UNKNOWN_RATE**2 * np.kron(shares, eye)
        return out

    def _start(self) -> Array:
        size = 2 * self.m
        variance = np.full(size + 2 * self.n, _START_STD**2)
        variance[size:] = np.tile(self._torque.noise, 2)
        return np.diag(np.append(variance, np.ones(self.size - len(variance))))


def _between(x: Array, place: float) -> Array:
    return np.asarray((1.0 - place) * x[:-1] + place * x[1:])
