"""Channels of a robot whose sensors' noise is known: torques that its model misses, from its fit.

    tau_missed = H q'' + c - tau - effects        joints, and the base about its three axes

along the smoothed motion, the base's translation such that no force acts on the whole. Here no
level was estimated before: the spectrum is that of the terms alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.signal import butter, sosfiltfilt

from ...effects.bodies import NAMES as INERTIAL
from ...effects.catalogue import CATALOGUE
from ...effects.learned_torque import input_of
from ...effects.motion import Motion
from ...effects.parameter import Parameter
from ...estimation.columns import candidate_at
from ...estimation.refit import Fit
from ...estimation.response import Response
from ...estimation.torque_process import TorqueDriven
from ...types import Array, IntArray
from .arm_channels import FIFTHS
from .possible_laws import Extent, Law, base_laws, joint_laws
from .spectral_terms import SpectralTerms, cosines
from .time_sines import TimeSines

_BAND = 4.0  # Hz
_RATE = 10.0  # Hz, of rows: 2.5 a period of the band
_FREE = 10.0  # times what is missed: a named cause's prior deviation
_END = 0.5  # s, at either end of the record, where derivatives of splines are loose


@dataclass(frozen=True, eq=False)
class FlightTorques:
    """Torques that a fitted model misses, and what may be made of them.

    Args:
        fit: The named causes with values.
    """

    fit: Fit

    @cached_property
    def motion(self) -> Motion:
        """Along the record, at the times of the filter."""
        return self.fit.rows.motion

    @cached_property
    def _process(self) -> TorqueDriven:
        return TorqueDriven(self.fit.run.robot, (*self.fit.run.believed, *self.fit.causes))

    @cached_property
    def missed(self) -> Array:
        """(N, 6 + n) generalised forces [N, N m]."""
        return -self._process.force_error(self.motion)

    @cached_property
    def nuisance(self) -> Array:
        """(N, 6 + n, K) forces of named causes, and of inertial errors by their deviations."""
        robot, motion = self.motion.robot, self.motion
        columns = [self._of_cause(i, p) for i, p in self.fit.free]
        kind, response = CATALOGUE['inertial_parameters'], Response(robot, motion)
        share = robot.inertia_uncertainty
        first = 0 if robot.is_free else 1
        for body, row in zip(robot.bodies[first:], robot.inertial_parameters[first:], strict=True):
            candidate = candidate_at(kind, robot, body.name, {})
            if candidate is None:
                continue
            size = share * _plausible(row)
            for k, (effect, step) in enumerate(candidate.small_steps):
                columns.append(response.force(effect) / step * size[k])
        return np.stack(columns, axis=2)

    def _of_cause(self, i: int, parameter: Parameter) -> Array:
        """(N, 6 + n) of one number of a cause, many times as large as what is missed."""
        run, causes = self.fit.run, self.fit.causes
        _, moved, _ = self.fit.neighbours(i, parameter)
        process = TorqueDriven(run.robot, (*run.believed, *causes[:i], moved, *causes[i + 1 :]))
        change = -process.force_error(self.motion.of(process.robot)) - self.missed
        largest, missed = (float(np.sqrt(np.mean(x**2))) for x in (change, self.missed))
        return change * (_FREE * missed / largest) if largest > 0.0 else change

    @cached_property
    def times(self) -> Array:
        """(R,) of rows [s]."""
        start, end = float(self.motion.time[0]) + _END, float(self.motion.time[-1]) - _END
        return np.arange(start, end, 1.0 / _RATE)

    def rows(self, values: Array) -> Array:
        """(R, ...) rows of values (N, ...) without what is faster than the band."""
        step = float(np.median(np.diff(self.motion.time)))
        even = np.arange(self.motion.time[0], self.motion.time[-1], min(step, 0.5 / _RATE))
        flat = values.reshape(len(values), -1)
        dense = np.column_stack([np.interp(even, self.motion.time, c) for c in flat.T])
        sections = butter(3, _BAND, fs=1.0 / (even[1] - even[0]), output='sos')
        low = sosfiltfilt(sections, dense, axis=0)
        out = np.column_stack([np.interp(self.times, even, c) for c in low.T])
        return out.reshape(len(self.times), *values.shape[1:])

    @cached_property
    def extent(self) -> Extent:
        """What the motion covers."""
        names = self.motion.robot.joints
        fast = np.maximum(np.quantile(np.abs(self.motion.qd), 0.95, axis=0), 1e-3)
        low, high = np.min(self.motion.q, axis=0), np.max(self.motion.q, axis=0)
        ends = [dict(zip(names, x.tolist(), strict=True)) for x in (fast, low, high)]
        return Extent(ends[0], ends[1], ends[2], float(np.ptp(self.motion.time)))

    @cached_property
    def missed_rows(self) -> Array:
        """(R, 6 + n) `missed`."""
        return self.rows(self.missed)

    @cached_property
    def nuisance_rows(self) -> Array:
        """(R, 6 + n, K) `nuisance`."""
        return self.rows(self.nuisance)


@dataclass(frozen=True, eq=False)
class TorqueChannel:
    """One component of the missed torques.

    Args:
        torques: All. place: Joint, or axis of the base such as `base_link/x`. column: Of both.
    """

    torques: FlightTorques
    place: str
    column: int

    @cached_property
    def laws(self) -> Sequence[Law]:
        """That may be."""
        joints = self.torques.motion.robot.arm
        if '/' in self.place:
            return base_laws(self.torques.extent)
        return joint_laws(self.place, joints, (), self.torques.extent)

    @cached_property
    def clocks(self) -> TimeSines | None:
        """Of the record."""
        return TimeSines(self.times)

    @property
    def times(self) -> Array:
        """(R,) of rows [s]."""
        return self.torques.times

    @cached_property
    def part(self) -> IntArray:
        """(R,) fifth of each row."""
        count = len(self.times)
        return np.arange(count) * FIFTHS // count

    @cached_property
    def terms(self) -> SpectralTerms:
        """The leftover's."""
        nuisance = self.torques.nuisance_rows[:, self.column]
        return SpectralTerms.of(self.torques.missed_rows[:, self.column], nuisance, self.whitened)

    @property
    def speed(self) -> Array:
        """(N,) of the joint; empty of the base [rad/s]."""
        motion = self.torques.motion
        return np.abs(motion.qd[:, self.column - 6]) if self.column >= 6 else np.zeros(0)

    def law_columns(self, law: Law) -> Array:
        """(N, k) a law's columns along the motion."""
        inputs = [input_of(name, self.torques.motion) for name in law.inputs]
        return law.form([np.asarray(x) for x in inputs], law.options)

    def ranges(self, law: Law) -> dict[str, tuple[float, float]]:
        """Smallest and largest of every input."""
        motion = self.torques.motion
        inputs = {name: np.asarray(input_of(name, motion)) for name in law.inputs}
        return {name: (float(np.min(x)), float(np.max(x))) for name, x in inputs.items()}

    def columns(self, law: Law) -> Array:
        """(M, k) terms of a law's columns."""
        return cosines(self.torques.rows(self.law_columns(law)))

    def whitened(self, values: Array) -> Array:
        """Rows as they are."""
        return values


def _plausible(row: Array) -> Array:
    """(10,) sizes of a body's mass, first moments and inertia."""
    mass = float(row[0])
    com = float(np.linalg.norm(row[1:4])) / max(mass, 1e-9)
    gyration = float(np.sqrt(max(row[4] + row[6] + row[9], 0.0) / max(mass, 1e-9)))
    arm = max(com, gyration)
    return mass * np.array([1.0, *[arm] * 3, *[arm**2] * (len(INERTIAL) - 4)])
