"""The one record type: validated, immutable time series from topics, bags or files.

Each sensor keeps its own stamps; nothing is resampled. What is not finite, not increasing in time,
of the wrong shape or not a unit quaternion is refused with its place, so that whoever holds a
`Record` need not look again. Dropping bad samples is the reader's work (`bag.py`), and it says so
in `notes`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import RecordingError
from ..types import Array, IntArray

UNIT_TOLERANCE = 1e-6  # of a quaternion's norm; single precision is within it


@dataclass(frozen=True, slots=True, eq=False)
class JointSeries:
    """Samples of named joints, manipulator's or wheels'.

    Args:
        names: The n joints, in the order of the columns.
        stamp_ns: (N,) sample times, increasing [ns].
        position: (N, n) [rad]; zero where a wheel has no encoder.
        velocity: (N, n) [rad/s]; None where the recording has none.
        effort: (N, n) motor torque over the step that ended at the stamp [N m]; None where the
            recording has none.
    """

    names: tuple[str, ...]
    stamp_ns: IntArray
    position: Array
    velocity: Array | None = None
    effort: Array | None = None

    def __post_init__(self) -> None:
        """Check and freeze."""
        object.__setattr__(self, 'names', tuple(self.names))
        if len(set(self.names)) != len(self.names) or not self.names:
            raise RecordingError(
                'joints.names', f'must be distinct and not empty, got {list(self.names)}'
            )
        stamps = _stamps(self.stamp_ns, 'joints.stamp_ns')
        object.__setattr__(self, 'stamp_ns', stamps)
        shape = (len(stamps), len(self.names))
        for name in ('position', 'velocity', 'effort'):
            values = getattr(self, name)
            if values is not None or name == 'position':
                object.__setattr__(
                    self, name, _values(values, shape, f'joints.{name}', self.names)
                )


@dataclass(frozen=True, slots=True, eq=False)
class RateSeries:
    """Samples of the gyro.

    Args:
        stamp_ns: (N,) sample times, increasing [ns].
        omega: (N, 3) omega_WB_B [rad/s].
    """

    stamp_ns: IntArray
    omega: Array

    def __post_init__(self) -> None:
        """Check and freeze."""
        stamps = _stamps(self.stamp_ns, 'rates.stamp_ns')
        object.__setattr__(self, 'stamp_ns', stamps)
        object.__setattr__(
            self, 'omega', _values(self.omega, (len(stamps), 3), 'rates.omega', 'xyz')
        )


@dataclass(frozen=True, slots=True, eq=False)
class AttitudeSeries:
    """Samples of the star tracker.

    Args:
        stamp_ns: (N,) sample times, increasing [ns].
        q_xyzw: (N, 4) q_WB, unit within 1e-6.
    """

    stamp_ns: IntArray
    q_xyzw: Array

    def __post_init__(self) -> None:
        """Check and freeze."""
        stamps = _stamps(self.stamp_ns, 'attitudes.stamp_ns')
        object.__setattr__(self, 'stamp_ns', stamps)
        place = 'attitudes.q_xyzw'
        q = _values(self.q_xyzw, (len(stamps), 4), place, 'xyzw')
        excess = np.abs(np.linalg.norm(q, axis=1) - 1.0)
        if np.any(excess > UNIT_TOLERANCE):
            row = int(np.argmax(excess > UNIT_TOLERANCE))
            raise RecordingError(
                f'{place}[{row}]',
                f'not a unit quaternion: its norm is {np.linalg.norm(q[row]):.9g}',
            )
        object.__setattr__(self, 'q_xyzw', q)


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What the sensors said during one run; a sensor that is absent is None.

    Args:
        joints: Manipulator joints, in the robot's order.
        rates: Gyro; a fixed base has none.
        attitudes: Star tracker; a fixed base has none.
        wheels: The servicer's own wheels (rates).
        source: Where it came from, for messages.
        notes: What whoever read it should know: dropped messages, absent topics, which stamps were
            used.
    """

    joints: JointSeries | None = None
    rates: RateSeries | None = None
    attitudes: AttitudeSeries | None = None
    wheels: JointSeries | None = None
    source: str = ''
    notes: tuple[str, ...] = ()

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last stamp of any sensor [ns]; (0, 0) for an empty record."""
        present = [
            s.stamp_ns
            for s in (self.joints, self.rates, self.attitudes, self.wheels)
            if s is not None
        ]
        if not present:
            return 0, 0
        return int(min(s[0] for s in present)), int(max(s[-1] for s in present))


def _stamps(values: IntArray, place: str) -> IntArray:
    stamps = np.array(values)
    if stamps.ndim != 1 or not len(stamps):
        raise RecordingError(place, f'expected a list of stamps, got shape {stamps.shape}')
    if not np.issubdtype(stamps.dtype, np.integer):
        raise RecordingError(place, f'expected whole nanoseconds, got {stamps.dtype}')
    stamps = stamps.astype(np.int64)
    steps = np.diff(stamps)
    if np.any(steps <= 0):
        row = int(np.argmax(steps <= 0)) + 1
        raise RecordingError(
            f'{place}[{row}]', f'{stamps[row]} ns is not after {stamps[row - 1]} ns'
        )
    stamps.setflags(write=False)
    return stamps


def _values(values: Array, shape: tuple[int, ...], place: str, columns: Sequence[str]) -> Array:
    array = np.array(values, dtype=float)
    if array.shape != shape:
        raise RecordingError(place, f'expected shape {shape}, got {array.shape}')
    bad = ~np.isfinite(array)
    if np.any(bad):
        row, column = (int(i) for i in np.argwhere(bad)[0])
        raise RecordingError(
            f'{place}[{row}] ({columns[column]})', f'{array[row, column]} is not finite'
        )
    array.setflags(write=False)
    return array
