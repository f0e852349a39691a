"""Rows of one joint with some left out, whitened by the level of what is left of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

import numpy as np

from ...effects.surroundings.external import pulse_shape
from ...estimation.balance.arm_levels import leftover_level
from ...estimation.balance.arm_motion import ArmMotion
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.leftover import JointRows, KalmanGains
from ...types import Array, BoolArray, IntArray

SPREAD = 0.15
"""Time by which the filter of the balance spreads the ends of a pulse [s]."""
_STEPS = 6  # centres a duration
_CHUNK = 50  # templates at once
_MEMORY = 20.0  # s after templates in which their whitening is looked at
_TAIL = 1.0  # s around a pulse, where its filtered shape ends
_COVERED = 0.5  # of a pulse's square that rows must see

Products = tuple[Array, Array, Array]
"""Of M whitened templates with columns (K, M), with torques (M,), and with themselves (M,)."""


@dataclass(frozen=True, slots=True, eq=False)
class Pulses:
    """Shapes of M pulses: (M,) centre and duration [s], and the share of their edges."""

    centre: Array
    duration: Array
    edge: Array

    def __getitem__(self, at: slice) -> Pulses:
        """Some of them."""
        return Pulses(self.centre[at], self.duration[at], self.edge[at])

    def __len__(self) -> int:
        """Number of them."""
        return len(self.centre)

    @property
    def start(self) -> Array:
        """(M,) [s]."""
        return self.centre - 0.5 * self.duration

    @property
    def end(self) -> Array:
        """(M,) [s]."""
        return self.centre + 0.5 * self.duration


@dataclass(frozen=True, slots=True, eq=False)
class RowSet:
    """Rows of one joint, over their scale (M,), with times (M,) [s] and recordings (M,)."""

    rows: JointRows
    time: Array
    run: IntArray
    scale: Array

    @classmethod
    def of(cls, rows: ArmRows, j: int, scale: Array) -> RowSet:
        """All rows of a joint, `scale` in the place of the level's shapes near turns."""
        r = rows.joints[j].over(scale)
        own = replace(r, observed=r.observed[:, :2])
        return cls(own, rows.joint_times(j), rows.recording[r.block], scale)

    def part(self, kept: BoolArray) -> RowSet:
        """Some of the rows; times between them are passed over by the whitening."""
        r, time, run = self.rows, self.time[kept], self.run[kept]
        gap = np.diff(time, prepend=time[:1])
        gap[1:][np.diff(run) != 0] = 0.0
        own = JointRows(r.torque[kept], r.columns[kept], r.observed[kept], r.block[kept], gap)
        return RowSet(own, time, run, self.scale[kept])

    def left(self, coefficients: Array) -> Array:
        """(M,) of the torques less what columns of coefficients (K,) take [N m]."""
        own = self.rows
        return np.asarray((own.torque - own.columns @ coefficients) * self.scale)

    def within(self, run: int, start: float, end: float) -> slice:
        """The rows of a time [s] of a recording."""
        first, last = np.searchsorted(self.run, [run, run + 1])
        at = first + np.searchsorted(self.time[first:last], [start, end])
        return slice(*at.tolist())


class JointScan:
    """One joint of a `PulseScan`, which see.

    Args:
        rows: The recordings.
        j: Number of its set of rows.
        left_out: (M,) rows that are not used.
        scale: (M,) how much more is left of each row than of others.
        level: Variances of what is left; None: found.
    """

    def __init__(
        self,
        rows: ArmRows,
        j: int,
        left_out: BoolArray,
        scale: Array,
        level: Array | None = None,
    ) -> None:
        self._rows, self.left_out, self._scale = rows, left_out, scale
        self.whole = RowSet.of(rows, j, scale)
        self.kept = self.whole.part(~left_out)
        if level is None:
            level = leftover_level(rows, j, rows.sizes, rows.friction, self.kept.rows)
        self._level = level
        self._gains = self._gains_of(self.kept)
        self.torque, self.columns = _white(self.kept, self._gains)
        """(M,) and (M, K) whitened, of the rows that are kept."""
        self.sums = self.columns.T @ self.columns, self.columns.T @ self.torque
        self._scanned: dict[tuple[int, float], Products] = {}

    def is_of(self, left_out: BoolArray, scale: Array) -> bool:
        """Whether these rows are left out of it, by this scale."""
        return np.array_equal(self.left_out, left_out) and np.array_equal(self._scale, scale)

    def scanned(self, run: int, duration: float) -> Products:
        """Of all `bells` of a duration, by the rows that are kept."""
        if (run, duration) not in self._scanned:
            every, parts = bells(self._rows, run, duration), []
            for first in range(0, len(every), _CHUNK):
                some = every[first : first + _CHUNK]
                near = self.kept.within(run, some.start[0] - _TAIL, some.end[-1] + _MEMORY)
                white = self._templates(run, self.kept, near, some, self._gains)
                parts.append(_products(white, self.torque[near], self.columns[near]))
            cross, along, square = (np.concatenate(x, axis=-1) for x in zip(*parts, strict=True))
            self._scanned[run, duration] = cross, along, square
        return self._scanned[run, duration]

    def beside(
        self, run: int, pulses: Pulses, functions: Array | None = None
    ) -> tuple[Products, tuple[Array, Array]]:
        """Of any pulses of one neighbourhood, whose own rows are used again, and all sums then.

        Args:
            run: Their recording.
            pulses: The pulses.
            functions: (M, P) more columns, of all rows of the joint [N m].
        """
        whole = self.whole
        inside = (whole.run == run) & (whole.time > np.min(pulses.start) - SPREAD)
        inside &= whole.time < np.max(pulses.end) + SPREAD
        used = ~self.left_out | inside
        own = whole.part(used)
        gains = self._gains_of(own)
        torque, columns = _white(own, gains)
        if functions is not None:
            scaled = functions[used] / own.scale[:, None]
            columns = np.column_stack([columns, gains.whitened(scaled)])
        white = self._templates(run, own, slice(None), pulses, gains)
        return _products(white, torque, columns), (columns.T @ columns, columns.T @ torque)

    def _gains_of(self, own: RowSet) -> KalmanGains:
        return KalmanGains.of(own.rows.observed, own.rows.gap, self._level)

    def _templates(
        self, run: int, own: RowSet, some: slice, pulses: Pulses, gains: KalmanGains
    ) -> Array:
        """(rows, M) whitened pulses on some rows, as the balance's filter leaves them.

        Zero where less than half of a pulse falls on rows.
        """
        arm = self._rows.balances[run].arm
        time, scale = own.time[some], own.scale[some]
        shown = np.zeros((len(time), len(pulses)))
        at = np.flatnonzero(own.run[some] == run)
        for duration, edge in set(zip(pulses.duration, pulses.edge, strict=True)):
            these = np.flatnonzero((pulses.duration == duration) & (pulses.edge == edge))
            lag, smooth = _in_band(arm, duration, edge)
            values = np.interp(time[at, None] - pulses.centre[these], lag, smooth, 0.0, 0.0)
            whole = np.sum(smooth**2) / arm.stride
            values[:, np.sum(values**2, axis=0) < _COVERED * whole] = 0.0
            shown[np.ix_(at, these)] = values
        return gains.rows(some).whitened(shown / scale[:, None])


_FILTERED: WeakKeyDictionary[ArmMotion, dict[tuple[float, float], tuple[Array, Array]]] = (
    WeakKeyDictionary()
)
"""Pulses of a motion by duration and edge, as long as there is that motion."""


def _in_band(arm: ArmMotion, duration: float, edge: float) -> tuple[Array, Array]:
    """Times about its centre [s] of a pulse, and what the balance's filter leaves of it there.

    Every joint's search asks for the same few: a fifth of the time of all events was spent here.
    """
    known = _FILTERED.setdefault(arm, {})
    if (duration, edge) not in known:
        lag = np.arange(-0.5 * duration - _TAIL, 0.5 * duration + _TAIL, arm.step)
        known[duration, edge] = lag, arm.in_band(pulse_shape(lag / duration + 0.5, edge))
    return known[duration, edge]


def bells(rows: ArmRows, run: int, duration: float) -> Pulses:
    """Bells of a duration [s] all along a recording."""
    times = rows.balances[run].row_times
    centres = times[:: max(1, int(duration / _STEPS / (times[1] - times[0])))]
    return Pulses(centres, *(np.full(len(centres), x) for x in (duration, 0.5)))


def _white(own: RowSet, gains: KalmanGains) -> tuple[Array, Array]:
    """Torques (M,) and columns (M, K)."""
    both = gains.whitened(np.column_stack([own.rows.torque, own.rows.columns]))
    return both[:, 0], both[:, 1:]


def _products(white: Array, torque: Array, columns: Array) -> Products:
    return columns.T @ white, white.T @ torque, np.sum(white**2, axis=0)
