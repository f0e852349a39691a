r"""Whitened innovations of the torque-driven filter, for the data and for any column.

State: deviations [dphi; dq | domega; dqd] from the reference, and the errors of the two effort
samples between which the step lies, so that an effort that is interpolated is not taken for two
independent ones. The filter is linear, its gains depend on no data; so the innovations of data,
and of data with an effect, are one linear operator applied to what is measured and to what drives
(Gertler 1998, ch. 6; Willsky and Jones 1976). All inference is then ordinary least squares.
"""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..types import Array, IntArray
from .filter_recursions import adjoint_pass, covariance_pass, mean_pass
from .linear_steps import Steps
from .observations import Observations
from .reference import Kinematics, NoiseLevels, ReferenceTrajectory
from .time_base import CHANNELS, make_grid
from .torque_process import TorqueDriven

_GAUSS = (0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15))
_PARABOLA = np.linalg.inv(np.vander(_GAUSS, 3, increasing=True))
_START_STD = 0.03  # rad, rad/s; far above what the reference misses
_THREADS = 2
TIMINGS = {'sampled': None, 'held_before': 1.0, 'held_after': 0.0}
"""How efforts act: interpolated between samples, or held over the interval that a sample ends or
begins. The number is the interval's end that counts."""


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """K directions in which a model may change.

    Args:
        acceleration: (N, m, K) change of the accelerations at the grid's times.
        measured: Channel to (samples, width, K) change of what is measured; absent: none.
    """

    acceleration: Array
    measured: dict[str, Array]


class Scene:
    """Observations with their grid and reference: what does not depend on the model's forces.

    Args:
        observed: Sensor effects already undone.
        noise: Noise levels.
        process: Any model of the robot, for the number of its velocities.
    """

    def __init__(self, observed: Observations, noise: NoiseLevels, process: TorqueDriven) -> None:
        self.observed = observed
        self.noise = noise
        self.grid = make_grid(observed, process.m, process.first)
        self.reference = ReferenceTrajectory(observed, noise, self.grid.times)
        self.kinematics = self.reference.at(self.grid.times)
        self._at: dict[str, Kinematics] = {}

    @cached_property
    def inner(self) -> tuple[tuple[float, Kinematics], ...]:
        """Gauss's places in the step, and the reference there."""
        start, dt = self.grid.times[:-1], np.diff(self.grid.times)
        return tuple((place, self.reference.at(start + place * dt)) for place in _GAUSS)

    def at_samples(self, channel: str) -> Kinematics:
        """The reference at the (corrected) times of a channel's samples."""
        observed = self.observed
        times = {
            'joint_position': observed.joint_time,
            'joint_velocity': observed.joint_time,
            'joint_effort': observed.joint_time,
            'gyro': observed.rate_time,
            'attitude': observed.attitude_time,
        }[channel]
        if channel not in self._at:
            self._at[channel] = self.reference.at(
                np.clip(times, self.grid.times[0], self.grid.times[-1])
            )
        return self._at[channel]

    @cached_property
    def deviations(self) -> Array:
        """(R,) measured less reference."""
        observed = self.observed
        joints = self.at_samples('joint_position')
        values = {'joint_position': observed.q - joints.q}
        if observed.qd is not None:
            values['joint_velocity'] = observed.qd - joints.qd
        if len(observed.rate_time):
            values['gyro'] = observed.omega - self.at_samples('gyro').omega
        if observed.attitude is not None:
            reference = self.at_samples('attitude').rotation
            values['attitude'] = (reference.inv() * observed.attitude).as_rotvec()
        return self.by_row(values)

    def by_row(self, values: Mapping[str, Array | None]) -> Array:
        """(R,) of channel arrays (samples, width)."""
        rows, out = self.grid.rows, np.zeros(len(self.grid.rows.state))
        for c, name in enumerate(CHANNELS):
            samples = values.get(name)
            if samples is not None:
                at = rows.channel == c
                out[at] = samples[rows.sample[at], rows.axis[at]]
        return out


class Innovations:
    """The filter of one model on one run.

    Args:
        scene: The run, its sensors as the model believes them.
        process: The model.
        timing: How efforts act, a key of `TIMINGS`.
    """

    def __init__(self, scene: Scene, process: TorqueDriven, timing: str = 'sampled') -> None:
        self.process = process
        self.observed, self.noise, self.timing = scene.observed, scene.noise, timing
        self.m, self.n = process.m, process.n
        self.grid, self.reference = scene.grid, scene.reference
        self.kinematics = scene.kinematics
        self._scene = scene
        self.motion = process.motion(self.kinematics, self.reference.effort(self.grid.times))
        self._linear = self.process.linearize(self.motion)
        self._transitions = self._make_transitions()
        rows = self.grid.rows
        self._gains, self.stds = covariance_pass(
            self._transitions,
            self.grid.fresh,
            self._effort_variance(),
            rows.first,
            rows.state,
            self._row_variance(),
            self._start(),
            self._extra_variance(),
        )

    @property
    def durations(self) -> Array:
        """(N-1,) length of each step [s]."""
        return np.diff(self.grid.times)

    @property
    def rows(self) -> int:
        """Number of scalar measurements."""
        return len(self.grid.rows.state)

    @cached_property
    def row_times(self) -> Array:
        """(R,) time of every scalar measurement [s]."""
        return np.repeat(self.grid.times, np.diff(self.grid.rows.first))

    @cached_property
    def measured(self) -> Array:
        """(R,) measured values; for the attitude the turn since the first sample [rad]."""
        observed = self.observed
        values: dict[str, Array | None] = {
            'joint_position': observed.q,
            'joint_velocity': observed.qd,
        }
        values['gyro'] = observed.omega
        if observed.attitude is not None:
            values['attitude'] = (observed.attitude[0].inv() * observed.attitude).as_rotvec()
        return self._scene.by_row(values)

    @property
    def deviations(self) -> Array:
        """(R,) measured less reference."""
        return self._scene.deviations

    @property
    def rate_by_impulse(self) -> Array:
        """(N, m, m) change of rates by an impulse on base (torque) and joints."""
        return self._linear.by_force[:, :, self.process.first :]

    @cached_property
    def data(self) -> Array:
        """(R,) whitened innovations of the data under the model: white and of unit variance."""
        accelerations = np.zeros((len(self.grid.times), self.m, 1))
        return self._pass(accelerations, self.deviations[:, None], self._kicks())[:, 0]

    @cached_property
    def log_determinant(self) -> float:
        """Sum of ln of the innovations' variances."""
        return float(2.0 * np.sum(np.log(self.stds)))

    def columns(self, columns: Columns) -> Array:
        """(R, K) whitened innovations that each column leaves in the data of a model without it.

        What drives the truth and not the model shows in the data with the sign of its effect on
        the model reversed.
        """
        parts = np.array_split(np.arange(columns.acceleration.shape[2]), _THREADS)
        with ThreadPoolExecutor(_THREADS) as pool:
            done = pool.map(
                lambda part: self._pass(
                    np.negative(columns.acceleration[..., part], order='C'),
                    self._measured_rows(columns.measured, part),
                    np.zeros((0, 0)),
                ),
                [part for part in parts if len(part)],
            )
        return np.concatenate(list(done), axis=1)

    def _measured_rows(self, measured: Mapping[str, Array], part: IntArray) -> Array:
        """(R, columns of the part) of what is measured; empty where nothing is."""
        out = np.zeros((self.rows if measured else 0, len(part)))
        rows = self.grid.rows
        for c, name in enumerate(CHANNELS):
            if name in measured:
                at = np.flatnonzero(rows.channel == c)
                out[at] = measured[name][rows.sample[at], rows.axis[at], part[0] : part[-1] + 1]
        return out

    def wanted_force(self, weights: Array) -> Array:
        """(N, 6 + n) correlation of a generalised force at each time with weights of the rows.

        Its product with a column's force, summed over times and components, is `weights` times the
        column's whitened innovations: one pass backwards instead of one a column.
        """
        rows = self.grid.rows
        pushes = -adjoint_pass(
            self.durations,
            self._transitions,
            self.grid.fresh,
            rows.first,
            rows.state,
            self._gains,
            self.stds,
            weights,
            self.m,
            self.n,
        )
        return np.asarray(np.einsum('nm,nmi->ni', pushes, self._linear.by_force))

    def accelerations(self, forces: Array) -> Array:
        """(N, m, K) accelerations by generalised forces (N, 6 + n, K) at the grid's times."""
        return np.asarray(self._linear.by_force @ forces)

    def at_samples(self, channel: str) -> Kinematics:
        """The reference at the (corrected) times of a channel's samples."""
        return self._scene.at_samples(channel)

    def _pass(self, accelerations: Array, measured: Array, kicks: Array) -> Array:
        rows = self.grid.rows
        mean = np.zeros((2 * self.m + 2 * self.n, accelerations.shape[2]))
        return np.asarray(
            mean_pass(
                mean,
                (0, len(self.grid.times)),
                self.durations,
                self._transitions,
                self.grid.fresh,
                accelerations,
                kicks,
                rows.first,
                rows.state,
                self._gains,
                self.stds,
                measured,
                self.n,
            )
        )

    @cached_property
    def _steps(self) -> Steps:
        m, linear = self.m, self._linear
        a = np.zeros((len(self.grid.times), 2 * m, 2 * m))
        a[:, :m, m:] = np.eye(m)
        a[:, m:, :m] = linear.by_position
        a[:, m:, m:] = linear.by_velocity
        if m > self.n:
            a[:, :3, :3] = -_skew(self.kinematics.omega)
        return Steps(self.durations, a)

    def _make_transitions(self) -> Array:
        """(N-1, d, d); errors of effort samples push the velocities along the whole step."""
        m, n = self.m, self.n
        out = np.zeros((len(self.durations), 2 * m + 2 * n, 2 * m + 2 * n))
        out[:, : 2 * m, : 2 * m] = self._steps.transitions
        push = _between(self._linear.by_force, 0.5)[:, :, 6:]
        start, growth = (x[:, None, None] for x in self._late_shares())
        late = self._steps.driven(start * push, growth * push)
        out[:, : 2 * m, 2 * m : 2 * m + n] = late - self._steps.driven(push)
        out[:, : 2 * m, 2 * m + n :] = -late
        out[:, 2 * m :, 2 * m :] = np.eye(2 * n)
        return out

    def _late_shares(self) -> tuple[Array, Array]:
        """(N-1,) share of the later effort sample at each step's start, and its growth over it."""
        end = TIMINGS[self.timing]
        if end is not None:
            held = np.full(len(self.durations), end)
            return held, np.zeros(len(held))
        growth = self.durations / np.diff(self.observed.effort_time)[self.grid.interval]
        return self.grid.fraction - 0.5 * growth, growth

    def _effort(self, times: Array, interval: IntArray) -> Array:
        """(M, n) motor torque at times within given effort intervals."""
        observed = self.observed
        if observed.effort is None:
            return np.zeros((len(times), self.n))
        early, late = observed.effort[interval], observed.effort[interval + 1]
        end = TIMINGS[self.timing]
        if end is not None:
            return late if end else early
        stamps = observed.effort_time
        share = (times - stamps[interval]) / (stamps[interval + 1] - stamps[interval])
        share = np.clip(share, 0.0, 1.0)[:, None]
        # straight between the samples, bent as the smooth torque bends
        bend = self.reference.effort(times)
        bend -= (1.0 - share) * self.reference.effort(stamps[interval])
        bend -= share * self.reference.effort(stamps[interval + 1])
        return (1.0 - share) * early + share * late + bend

    def _kicks(self) -> Array:
        """(N-1, 2 m) what the model's accelerations miss of the reference over each step.

        The error is a parabola e_0 + e_1 s + e_2 s^2 through Gauss's points of the step.
        """
        errors = []
        for place, kinematics in self._scene.inner:
            effort = self._effort(kinematics.time, self.grid.interval)
            motion = self.process.motion(kinematics, effort)
            by_force = _between(self._linear.by_force, place)
            errors.append(np.einsum('nij,nj->ni', by_force, self.process.force_error(motion)))
        parabola = np.einsum('pg,gnm->pnm', _PARABOLA, np.stack(errors))[..., None]
        return self._steps.driven(*parabola)[..., 0]

    def _row_variance(self) -> Array:
        noise = self.noise
        levels = np.array([noise.joint_position, noise.joint_velocity, noise.gyro, noise.attitude])
        return np.asarray(levels[self.grid.rows.channel] ** 2)

    def _effort_variance(self) -> Array:
        """(N-1, n) variance of the effort samples that enter with each step."""
        variance = np.full((len(self.durations), self.n), self.noise.joint_effort**2)
        effort = self.observed.effort
        if effort is None:
            return variance + _UNKNOWN_EFFORT**2
        variance[self.grid.blind] += np.var(effort, axis=0) + self.noise.joint_effort**2
        return variance

    def _extra_variance(self) -> Array:
        """(N-1, d) variance that enters each step beside the efforts' own."""
        return np.zeros((len(self.durations), 2 * self.m + 2 * self.n))

    def _start(self) -> Array:
        size = 2 * self.m
        variance = np.full(size + 2 * self.n, _START_STD**2)
        variance[size:] = self.noise.joint_effort**2
        return np.diag(variance)


_UNKNOWN_EFFORT = 1e3  # N m; internal torques unknown: only momentum is left to judge by


def _between(x: Array, place: float) -> Array:
    return np.asarray((1.0 - place) * x[:-1] + place * x[1:])


def _skew(v: Array) -> Array:
    out = np.zeros((len(v), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -v[:, 2], v[:, 1], -v[:, 0]
    return out - np.swapaxes(out, 1, 2)
