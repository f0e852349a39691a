"""The one record type: validated, immutable time series from topics, bags or files to filters.

Each sensor keeps its own stamps; nothing is resampled. What is not finite, not increasing in time,
of the wrong shape or not a unit quaternion is refused with its place, so that whoever holds a
`Record` need not look again. Dropping bad samples is the reader's work (`bag.py`), and it says so
in `notes`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import scipy

from ..errors import RecordingError
from ..types import Array, BoolArray, IntArray
from .integral import integral
from .series import InputSeries, SampleSeries

UNIT_TOLERANCE = 1e-6  # of a quaternion's norm; single precision is within it


@dataclass(frozen=True, slots=True, eq=False)
class JointSeries(SampleSeries):
    """Samples of named joints, manipulator's or wheels'.

    Args:
        names: The n joints, in the order of the columns; none of a robot without joints, whose
            stamps are then the times of its record.
        stamp_ns: (N,) sample times, increasing [ns].
        position: (N, n) [rad]; zero where a wheel has no encoder. A joint whose positions are NaN
            throughout has the integrals of its rates instead, from zero.
        velocity: (N, n) [rad/s]; None where the recording has none.
        effort: (N, n) torque over the step that ended at the stamp [N m], NaN throughout for a
            joint without; None where the recording has none.
        effort_delay: Time by which the efforts are older than their stamps [s].
        unpowered: (N, n) where a joint has no motor, or one that is off: its effort is zero,
            whatever a sensor says; None: nowhere.
        stopped: (N, n) where a joint is at a limit, so that a stop may act beside its motor; None:
            nowhere (`faults.joint_limits`).
        rate_only: Joints whose positions are such integrals.
        in_amperes: Joints whose efforts are currents [A], as nobody states their torques.
    """

    names: tuple[str, ...]
    stamp_ns: IntArray
    position: Array
    velocity: Array | None = None
    effort: Array | None = None
    effort_delay: float = 0.0
    unpowered: BoolArray | None = None
    stopped: BoolArray | None = None
    rate_only: tuple[str, ...] = ()
    in_amperes: tuple[str, ...] = ()
    _may_lack: ClassVar[tuple[str, ...]] = ('velocity', 'effort')

    def __post_init__(self) -> None:
        """Check and freeze."""
        object.__setattr__(self, 'names', tuple(self.names))
        if len(set(self.names)) != len(self.names):
            raise RecordingError('joints.names', f'must be distinct, got {list(self.names)}')
        if self.position is None:
            raise RecordingError('joints.position', 'is missing')
        self._integrate()
        self._freeze('joints', **dict.fromkeys(('position', 'velocity', 'effort'), self.names))
        if self.unpowered is not None:
            self._check_unpowered(np.array(self.unpowered, dtype=bool))

    def _integrate(self) -> None:
        """Fill positions that nobody measures."""
        position = np.array(self.position, dtype=float)
        if position.ndim != 2 or not np.isnan(position).any():
            return
        lacking = np.isnan(position).all(axis=0)
        for j in np.flatnonzero(lacking).tolist():
            rate = None if self.velocity is None else np.asarray(self.velocity, dtype=float)
            if rate is None or np.isnan(rate[:, j]).any():
                raise RecordingError(
                    f'joints.position ({self.names[j]})', 'is missing, and so is its rate'
                )
            seconds = (self.stamp_ns - self.stamp_ns[0]) / 1e9
            position[:, j] = integral(seconds, rate[:, j])
        own = tuple(name for name, lacks in zip(self.names, lacking, strict=True) if lacks)
        object.__setattr__(self, 'position', position)
        object.__setattr__(self, 'rate_only', (*self.rate_only, *own))

    def _check_unpowered(self, off: BoolArray) -> None:
        """Freeze where motors are off; efforts are zero there."""
        if off.shape != self.position.shape:
            raise RecordingError(
                'joints.unpowered', f'expected shape {self.position.shape}, got {off.shape}'
            )
        effort = np.full(off.shape, np.nan) if self.effort is None else np.array(self.effort)
        effort[off] = 0.0
        off.setflags(write=False)
        effort.setflags(write=False)
        object.__setattr__(self, 'unpowered', off)
        object.__setattr__(self, 'effort', effort)

    @property
    def passive(self) -> tuple[str, ...]:
        """Joints without a motor: their torque is zero throughout."""
        if self.unpowered is None:
            return ()
        columns = zip(self.names, self.unpowered.T, strict=True)
        return tuple(name for name, off in columns if off.all())

    @property
    def without_effort(self) -> tuple[str, ...]:
        """Joints that have no effort."""
        if self.effort is None:
            return self.names
        columns = zip(self.names, self.effort.T, strict=True)
        return tuple(name for name, column in columns if np.isnan(column).all())


@dataclass(frozen=True, slots=True, eq=False)
class RateSeries(SampleSeries):
    """Samples of the gyro.

    Args:
        stamp_ns: (N,) sample times, increasing [ns].
        omega: (N, 3) omega_WB_B [rad/s]; an axis that is NaN throughout has no gyro, and zeros
            instead.
        axes: Those that have one.
    """

    stamp_ns: IntArray
    omega: Array
    axes: tuple[int, ...] = (0, 1, 2)

    def __post_init__(self) -> None:
        """Check and freeze."""
        omega = np.array(self.omega, dtype=float)
        if omega.ndim > 1 and len(omega):
            lacking = np.isnan(omega).all(axis=0)
            if lacking.all():
                raise RecordingError('rates.omega', 'no axis is measured')
            omega[:, lacking] = 0.0
            axes = tuple(i for i in self.axes if not lacking[i : i + 1].any())
            object.__setattr__(self, 'axes', axes)
        object.__setattr__(self, 'omega', omega)
        self._freeze('rates', omega='xyz')

    def completed(self, attitudes: AttitudeSeries) -> RateSeries:
        """The same with the rates of an attitude about axes that have no gyro."""
        seconds = (attitudes.stamp_ns - self.stamp_ns[0]) / 1e9
        rotation = scipy.spatial.transform.Rotation.from_quat(attitudes.q_xyzw)
        rates = (rotation[:-1].inv() * rotation[1:]).as_rotvec() / np.diff(seconds)[:, None]
        omega, at = self.omega.copy(), 0.5 * (seconds[1:] + seconds[:-1])
        for i in set(range(3)) - set(self.axes) if len(at) else ():
            omega[:, i] = np.interp(self.seconds(int(self.stamp_ns[0])), at, rates[:, i])
        return replace(self, omega=omega)


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeSeries(SampleSeries):
    """Samples of the star tracker.

    Args:
        stamp_ns: (N,) sample times, increasing [ns].
        q_xyzw: (N, 4) q_WB, unit within 1e-6.
    """

    stamp_ns: IntArray
    q_xyzw: Array

    def __post_init__(self) -> None:
        """Check and freeze."""
        self._freeze('attitudes', q_xyzw='xyzw')
        norms = np.linalg.norm(self.q_xyzw, axis=1)
        bad = np.abs(norms - 1.0) > UNIT_TOLERANCE
        if bad.any():
            row = int(np.argmax(bad))
            raise RecordingError(
                f'attitudes.q_xyzw[{row}]', f'not a unit quaternion: its norm is {norms[row]:.9g}'
            )


SENSORS: dict[str, Any] = {
    'joints': JointSeries,
    'rates': RateSeries,
    'attitudes': AttitudeSeries,
    'wheels': JointSeries,
}
"""Samples of a `Record` by the name of their field."""


@dataclass(frozen=True, eq=False)
class Record:
    """What the sensors said during one run, or in a part of it.

    A sensor that is absent is None. The flat views (`q`, `omega`, ...) are what filters work on:
    seconds from one origin, and no samples where a sensor is absent.

    Args:
        joints: Manipulator joints, in the robot's order.
        rates: Gyro; a fixed base has none.
        attitudes: Star tracker; a fixed base has none.
        wheels: The servicer's own wheels (rates).
        source: Where it came from, for messages.
        notes: What whoever read it should know: dropped messages, absent topics, which stamps were
            used.
        zero_ns: Stamp that seconds count from [ns]; None: the first of any sensor.
        inputs: What else was measured or commanded, under free names or known ones
            (`thrusters`, and those of `units.INPUTS`).
        description: URDF that was published beside; empty where there was none.
        faults_are_known: Whether its user takes it with its faults (`--force-data`).
    """

    joints: JointSeries | None = None
    rates: RateSeries | None = None
    attitudes: AttitudeSeries | None = None
    wheels: JointSeries | None = None
    source: str = ''
    notes: tuple[str, ...] = ()
    zero_ns: int | None = None
    inputs: Mapping[str, InputSeries] = field(default_factory=dict)
    description: str = ''
    faults_are_known: bool = False

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last stamp of any sensor [ns]; (0, 0) for an empty record."""
        series = (getattr(self, name) for name in SENSORS)
        present = [s.stamp_ns for s in series if s is not None and len(s)]
        if not present:
            return 0, 0
        return int(min(s[0] for s in present)), int(max(s[-1] for s in present))

    @cached_property
    def origin_ns(self) -> int:
        """Stamp that seconds count from [ns]."""
        return self.span_ns[0] if self.zero_ns is None else self.zero_ns

    def corrected(self, sensors: Mapping[str, Any], *notes: str) -> Record:
        """With other samples of some sensors, seconds counted as before, and more notes.

        Args:
            sensors: By the name of their field.
            notes: What is to be said of them.
        """
        return replace(self, zero_ns=self.origin_ns, notes=(*self.notes, *notes), **sensors)

    def stopped(self, start: Array, end: Array) -> BoolArray:
        """(M, n) whether a joint is at a limit at or next to a time between (M,) and (M,) [s]."""
        joints = self.joints
        if joints is None or joints.stopped is None:
            return np.zeros((len(start), self.q.shape[1]), dtype=bool)
        count = np.cumsum(np.vstack([np.zeros_like(joints.stopped[:1]), joints.stopped]), axis=0)
        first = np.searchsorted(self.joint_time, start, side='right') - 1
        last = np.searchsorted(self.joint_time, end, side='left')
        first, last = (np.clip(k, 0, len(joints) - 1) for k in (first, last))
        return np.asarray(count[last + 1] > count[first])

    @property
    def span(self) -> tuple[float, float]:
        """First and last time of the joint samples [s]; there must be some."""
        return float(self.joint_time[0]), float(self.joint_time[-1])

    @cached_property
    def joint_time(self) -> Array:
        """(Nj,) [s]."""
        return self._time(self.joints)

    @property
    def q(self) -> Array:
        """(Nj, n) joint positions [rad]."""
        return np.zeros((0, 0)) if self.joints is None else self.joints.position

    @property
    def qd(self) -> Array | None:
        """(Nj, n) joint rates [rad/s]; None where they were not measured."""
        return None if self.joints is None else self.joints.velocity

    @property
    def effort(self) -> Array | None:
        """(Nj, n) motor torques [N m] at `effort_time`; None where they were not measured."""
        return None if self.joints is None else self.joints.effort

    @cached_property
    def effort_time(self) -> Array:
        """(Nj,) times that the efforts belong to [s]."""
        return self.joint_time - (0.0 if self.joints is None else self.joints.effort_delay)

    @cached_property
    def rate_time(self) -> Array:
        """(Ng,) [s]; empty without a gyro."""
        return self._time(self.rates)

    @property
    def gyro_axes(self) -> list[int]:
        """Axes that have a gyro."""
        return [] if self.rates is None else [*self.rates.axes]

    @property
    def omega(self) -> Array:
        """(Ng, 3) omega_WB_B [rad/s]."""
        return np.zeros((0, 3)) if self.rates is None else self.rates.omega

    @cached_property
    def attitude_time(self) -> Array:
        """(Na,) [s]; empty without a star tracker."""
        return self._time(self.attitudes)

    @property
    def attitude_xyzw(self) -> Array:
        """(Na, 4) q_WB."""
        return np.zeros((0, 4)) if self.attitudes is None else self.attitudes.q_xyzw

    @cached_property
    def attitude(self) -> scipy.spatial.transform.Rotation | None:
        """Na rotations R_WB; None where there are none."""
        q_xyzw = self.attitude_xyzw
        return scipy.spatial.transform.Rotation.from_quat(q_xyzw) if len(q_xyzw) else None

    def between(self, start: float, end: float) -> Record:
        """The samples with start < t <= end [s], counted from the same origin.

        Inputs keep the sample before, too: it may hold until the next one.
        """
        parts: dict[str, Any] = {}
        for name in SENSORS:
            series = getattr(self, name)
            if series is not None:
                ends = np.searchsorted(self._time(series), [start, end], side='right')
                parts[name] = series.at(slice(*ends.tolist()))
        parts['inputs'] = inputs = {}
        for key, given in self.inputs.items():
            first, last = np.searchsorted(self._time(given), [start, end], side='right').tolist()
            inputs[key] = given.at(slice(max(first - 1, 0), last))
        return replace(self, zero_ns=self.origin_ns, **parts)

    def _time(self, series: SampleSeries | None) -> Array:
        return np.zeros(0) if series is None else series.seconds(self.origin_ns)


def to_stamps(seconds: Array, origin_ns: int = 0) -> IntArray:
    """(N,) stamps [ns] of times counted from an origin [s]."""
    return np.asarray(origin_ns + np.round(seconds * 1e9).astype(np.int64))


def shown(seconds: float) -> str:
    """A time with all its digits down to microseconds, such as `1579660012.25 s`."""
    if abs(seconds) < 1e-6:
        return f'{seconds:.3g} s'
    return f'{seconds:.6f}'.rstrip('0').rstrip('.') + ' s'
