"""Pulses of torque on the joints of an arm that moves, beside every column of the balance.

Rows of every joint are divided by how much more is left of them than of others (`row_scales`), and
whitened by the level of what is left beside the pulses that were found: a push of a second passes
for a wandering friction, and several for a level beside which none stands out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from ...effects.surroundings.external import pulse_shape
from ...estimation.balance.arm_levels import leftover_level
from ...estimation.balance.arm_motion import ArmMotion
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.leftover import JointRows, KalmanGains
from ...types import Array
from .matched import Filtered, MatchedFilter, Projection
from .naming_rule import quiet_size
from .transient import Shapes, Transient

DURATIONS = (0.3, 0.6, 1.2, 2.4, 4.8)
"""Of the templates of a scan [s]; a bell half or twice as long still gives 94 % of its z."""
SPREAD = 0.15
"""Time by which the filter of the balance spreads the ends of a pulse [s]."""
_STEPS = 6  # centres a duration
_CHUNK = 50  # templates at once
_MEMORY = 20.0  # s after templates in which their whitening is looked at
_TAIL = 1.0  # s around a pulse, where its filtered shape ends
_COVERED = 0.5  # of a pulse's square that rows must see
_GUESS = 0.03  # of a joint's torque, for a first look


class JointRowsSet:
    """Whitened rows of one set of `ArmRows.joints`, of M rows.

    Args:
        rows: The recordings.
        k: Number of the set.
        scale: (M,) how much more is left of each row than of others.
        found: Transients on the joint, beside which the level is found.
        level: Variances of what is left; None: found.
    """

    def __init__(
        self,
        rows: ArmRows,
        k: int,
        scale: Array,
        found: Sequence[Transient] = (),
        level: Array | None = None,
    ) -> None:
        own = rows.joints[k].over(scale)
        self._rows, self.scale, self.found = rows, scale, tuple(found)
        self.own = replace(own, observed=own.observed[:, :2])
        self.time, self.run = rows.joint_times(k), rows.recording[own.block]
        if level is None:
            level = leftover_level(rows, k, rows.sizes, rows.friction, self._apart())
        self._gains = KalmanGains.of(self.own.observed, self.own.gap, level)
        both = self._gains.whitened(np.column_stack([self.own.torque, self.own.columns]))
        self.torque, self.columns = both[:, 0], both[:, 1:]
        self._known: dict[tuple[float, ...], Array] = {}

    def _apart(self) -> JointRows:
        """Rows apart from what was found: its shape is known too little for a level beside it."""
        kept = np.ones(len(self.time), dtype=bool)
        for p in self.found:
            inside = (self.time > p.start - SPREAD) & (self.time < p.end + SPREAD)
            kept &= (self.run != p.run) | ~inside
        time, run, own = self.time[kept], self.run[kept], self.own
        gap = np.diff(time, prepend=time[:1])
        gap[1:][np.diff(run) != 0] = 0.0
        rows = (own.torque[kept], own.columns[kept], own.observed[kept], own.block[kept])
        return JointRows(*rows, gap)

    def column(self, p: Transient) -> Array:
        """(M,) of a transient, whitened."""
        key = _key(p)
        if key not in self._known:
            ((near, white),) = self.white(p.run, Shapes.of(p))
            self._known[key] = np.zeros(len(self.torque))
            self._known[key][near] = white[:, 0]
        return self._known[key]

    def left(self, coefficients: Array, found: Sequence[Transient] = ()) -> Array:
        """(M,) torques less what columns of coefficients (K,) take, and transients [N m]."""
        own = self.own
        torque = own.torque - own.columns @ coefficients - self._pulses(found)
        return np.asarray(torque * self.scale)

    def _pulses(self, found: Sequence[Transient]) -> Array:
        """(M,) of transients, over the scale."""
        out = np.zeros(len(self.scale))
        for p in found:
            out += self.shown(p.run, slice(None), Shapes.of(p))[:, 0] * p.value[0]
        return out

    def shown(self, run: int, some: slice, shapes: Shapes) -> Array:
        """(rows, M) pulses on some rows over their scale, as the balance's filter leaves them.

        Zero where less than half of a pulse falls on rows.
        """
        arm, time = self._rows.balances[run].arm, self.time[some]
        out = np.zeros((len(time), len(shapes)))
        at = np.flatnonzero(self.run[some] == run)
        for duration, edge in set(zip(shapes.duration, shapes.edge, strict=True)):
            these = np.flatnonzero((shapes.duration == duration) & (shapes.edge == edge))
            lag, smooth = _in_band(arm, float(duration), float(edge))
            values = np.interp(time[at, None] - shapes.centre[these], lag, smooth, 0.0, 0.0)
            whole = np.sum(smooth**2) / arm.stride
            values[:, np.sum(values**2, axis=0) < _COVERED * whole] = 0.0
            out[np.ix_(at, these)] = values
        return np.asarray(out / self.scale[some, None])

    def white(self, run: int, shapes: Shapes) -> Iterator[tuple[slice, Array]]:
        """Rows that feel some pulses, and these (rows, M) whitened."""
        first, last = np.searchsorted(self.run, [run, run + 1])
        for k in range(0, len(shapes), _CHUNK):
            part = shapes[k : k + _CHUNK]
            span = np.min(part.start) - _TAIL, np.max(part.end) + _MEMORY
            near = slice(*(first + np.searchsorted(self.time[first:last], span)).tolist())
            yield near, self._gains.rows(near).whitened(self.shown(run, near, part))

    def whitened(self, functions: Array) -> Array:
        """(M, P) of functions (M, P) [N m]."""
        return self._gains.whitened(functions / self.scale[:, None])


def _key(p: Transient) -> tuple[float, ...]:
    return p.run, p.start, p.end, p.edge


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


class JointTemplates:
    """Pulses on joints; see `Templates`.

    Args:
        rows: The recordings.
        sets: Their rows.
    """

    bounds = (0.25, 10.0)
    edges: tuple[float, ...] = (0.5, 0.25, 0.1)
    durations: tuple[float, ...] = DURATIONS
    shows = 0.0

    def __init__(self, rows: ArmRows, sets: Sequence[JointRowsSet]) -> None:
        self.rows, self.sets, self.runs = rows, sets, len(rows.balances)
        self.joints: Sequence[int] = range(rows.robot.n_joints)
        self.data = np.concatenate([own.torque for own in sets])
        self.lasting = np.concatenate([own.columns for own in sets])
        prior = np.diag(rows.sizes**-2.0) + rows.held.matrix
        gram = self.lasting.T @ self.lasting
        self.projection = Projection.of(prior + gram, self.lasting.T @ self.data)

    @classmethod
    def of(cls, rows: ArmRows) -> JointTemplates:
        """Of all rows, by scales that a first look gives."""
        ones = [np.ones(len(joint.torque)) for joint in rows.joints]
        guess = [np.full(6, (_GUESS * scale) ** 2) for scale in (*rows.scale, *rows.scale)]
        each = zip(ones, guess, strict=True)
        first = cls(rows, [JointRowsSet(rows, k, x, (), g) for k, (x, g) in enumerate(each)])
        return first.rescaled(())

    def bells(self, run: int, duration: float) -> Shapes:
        """See `Templates`."""
        times = self.rows.balances[run].row_times
        step = max(1, int(duration / _STEPS / (times[1] - times[0])))
        return Shapes.bells(times[::step], duration)

    def white(self, duration: float) -> tuple[float, float]:
        """Of a normal number."""
        return math.log(quiet_size(1)), 0.0

    def about(self, found: Sequence[Transient]) -> JointTemplates:
        """Only joints with other transients than before change."""
        sets = []
        for k, own in enumerate(self.sets):
            here = [p for p in found if p.joint == k]
            same = [_key(p) for p in here] == [_key(p) for p in own.found]
            sets.append(own if same else JointRowsSet(self.rows, k, own.scale, here))
        return JointTemplates(self.rows, sets)

    def rescaled(self, found: Sequence[Transient]) -> JointTemplates:
        """By scales of what is left beside some transients, and the level beside these."""
        beside, sets = MatchedFilter(self, found), []
        left = self.data - beside.made(beside.projection.coefficients)
        for k, own in enumerate(self.sets):
            scale = row_scale(self.rows, k, left[self.of_set(k)] * own.scale)
            sets.append(JointRowsSet(self.rows, k, scale, [p for p in found if p.joint == k]))
        return JointTemplates(self.rows, sets)

    def of_set(self, j: int) -> slice:
        """Rows of a joint."""
        first = sum(len(own.torque) for own in self.sets[:j])
        return slice(first, first + len(self.sets[j].torque))

    def column(self, p: Transient) -> Array:
        """See `Templates`."""
        out = np.zeros((len(self.data), 1))
        out[self.of_set(p.joint), 0] = self.sets[p.joint].column(p)
        return out

    def test(self, beside: MatchedFilter, joint: int, run: int, shapes: Shapes) -> Filtered:
        """See `Templates`."""
        parts, own, more = [], self.sets[joint], beside.columns[self.of_set(joint)]
        for near, white in own.white(run, shapes):
            cross = np.concatenate([own.columns[near].T @ white, more[near].T @ white])
            along, square = white.T @ own.torque[near], np.sum(white**2, axis=0)
            products = cross[:, :, None], along[:, None], square[:, None, None]
            parts.append(beside.projection.filtered(*products))
        return Filtered.joined(parts)


class Arm(MatchedFilter):
    """What lasts, and all pulses, of an arm's rows."""

    templates: JointTemplates

    @property
    def coefficients(self) -> Array:
        """(K,) of what lasts."""
        return self.projection.coefficients[: len(self.templates.rows.sizes)]

    def left_of(self, j: int) -> Array:
        """(M,) of a joint's rows, less what lasts and all pulses [N m]."""
        every = zip(self.found, self.values, strict=False)
        own = [replace(p, value=value) for p, value in every if p.joint == j]
        return self.templates.sets[j].left(self.coefficients, own)

    def spread(self, columns: Array) -> Array:
        """(M,) standard deviation of what rows of columns (M, K) take by all coefficients."""
        padded = np.pad(columns, ((0, 0), (0, len(self.found))))
        return np.asarray(np.sqrt(np.sum(self.projection.taken(padded.T) ** 2, axis=0)))

    def with_functions(self, p: Transient, functions: Array) -> tuple[Array, Array]:
        """(1 + P, 1 + P) and (1 + P,): normal equations of a pulse and functions (M, P).

        The pulse is none of these columns, all of which are integrated out.
        """
        own = self.templates.sets[p.joint]
        white = np.column_stack([own.column(p), own.whitened(functions)])
        more = self.columns[self.templates.of_set(p.joint)]
        cross = np.concatenate([own.columns.T @ white, more.T @ white])
        u = self.projection.taken(cross)
        return white.T @ white - u.T @ u, self.projection.left(cross, white.T @ own.torque)


_SLOW = 0.1  # of the 95 % rate: over which friction turns
_FLOOR = 0.1  # of the median of what is left: less is as good as that
_RIDGE = 10.0  # rows without any scatter


def row_scale(rows: ArmRows, k: int, left: Array) -> Array:
    """(M,) scale of the rows of a set, by what is left of them (M,), whitened [N m].

        log |left| = x' c + noise,

    over features x of a joint's rows: how slow it is, how fast, how fast the whole arm is, how
    much it accelerates, and the recording. Rows are divided by exp(x' c), and no scale is below
    its median. Without it a reversal looks like a push, and all other rows like noise; so does a
    rough drive's recording among smooth ones.
    """
    usual = float(np.median(np.abs(left))) if len(left) else 0.0
    if not usual > 0.0:
        return np.ones(len(left))
    x = _features(rows, k)
    x = (x - np.mean(x, axis=0)) / np.maximum(np.std(x, axis=0), 1e-9)
    logs = np.log(np.abs(left) / usual + _FLOOR)
    square = x.T @ x + _RIDGE * np.eye(x.shape[1])
    share = np.exp(x @ np.linalg.solve(square, x.T @ (logs - np.mean(logs))))
    return np.asarray(np.maximum(share / np.median(share), 1.0))


def _features(rows: ArmRows, k: int) -> Array:
    """(M, 4 + R) of the rows of a set, the last of them each recording's."""
    out, j = [], k % rows.robot.n_joints
    for run, balance in enumerate(rows.balances):
        arm = balance.arm
        rate, turn = np.abs(arm.kinematics.qd), np.abs(arm.kinematics.qdd)
        usual = np.maximum(np.quantile(rate, 0.95, axis=0), 1e-9)
        slow = np.exp(-((rate[:, j] / (_SLOW * usual[j])) ** 2))
        each = [slow, rate[:, j] / usual[j], np.mean(rate / usual, axis=1)]
        each.append(np.mean(turn / np.maximum(np.quantile(turn, 0.95, axis=0), 1e-9), axis=1))
        smooth = np.maximum(arm.in_band(np.column_stack(each)), 0.0)
        smooth[:, 1:] = np.log(smooth[:, 1:] + 0.05)
        moving = smooth[:: arm.stride][rows.rows_at(balance, k)]
        own = np.arange(len(rows.balances)) == run
        out.append(np.column_stack([moving, np.tile(own, (len(moving), 1))]))
    return np.concatenate(out)
