r"""Rows of a lone body's measured pose under known forces, window by window.

With R the attitude, w the rate, c the centre of mass, and dv, dw the model's accelerations of c
and about it under the known forces,

    (p + R c)(t) = a + b t + int int R dv,    int R w = a' + b' t + int int R dw

in the inertial frame. Starts a and rates b are each window's own, so slow disturbances do not add
up. A window's samples are turned into coefficients of ever faster curves: what disturbs such a
platform is slow, so noise has one level for every octave of them, that of what is left.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation, Slerp
from scipy.special import fdtrc

from ..effects.effect import Effect
from ..effects.motion import Motion, inverse_mass
from ..errors import RecordingError
from ..formats import counted
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array, IntArray
from .filters.torque_process import TorqueDriven
from .noise_levels import noise_levels
from .rows import ChannelError, ChannelFit
from .runs import Run
from .trajectory.reference import Kinematics

_SAMPLES, _SHORTEST, _FEWEST = 20, 1.2, 20  # samples and seconds of a window; windows, at least
_LINE = 3  # samples, of which one is more than a line
_TURNS = 1e-9  # rad a step; about an axis that never turns the body is held
_CHANNELS = (('base_position', 'm'), ('attitude', 'rad'))


@dataclass(frozen=True, slots=True, eq=False)
class _WindowPart:
    """One channel in one window.

    Args:
        channel: Index into `_CHANNELS`.
        axes: (A,) measured ones.
        steps: Steps of the attitude.
        basis: (n, n - 2) orthonormal, without a + b t, from slow to fast.
        octave: (n - 2,) of each: 0 from half the highest frequency.
        twice: (n - 2, S) of accelerations, each held for a step, integrated twice.
        times: (n,) [s].
        seen: (n, A) measured, less what the robot file says [m], [rad].
    """

    channel: int
    axes: IntArray
    steps: slice
    basis: Array
    octave: IntArray
    twice: Array
    times: Array
    seen: Array


class PoseWindows:
    """One record in windows.

    Args:
        record: With attitudes and positions of the base.
        robot: The robot file's, with the record's inputs, without joints.

    Raises:
        RecordingError: too few windows.
    """

    def __init__(self, record: Record, robot: Robot) -> None:
        self._com = robot.bodies[0].com
        self._time = record.attitude_time
        rotation = Rotation.from_quat(record.attitude_xyzw)
        turns = (rotation[:-1].inv() * rotation[1:]).as_rotvec()
        steps = np.diff(self._time)
        middle = rotation[:-1] * Rotation.from_rotvec(0.5 * turns)
        at, omega = self._time[:-1] + 0.5 * steps, turns / steps[:, None]
        none = np.zeros((len(at), 0))
        alpha = np.gradient(omega, at, axis=0)
        kinematics = Kinematics(at, none, none, omega, middle, none, alpha)
        window = np.stack([self._time[:-1], self._time[1:]], axis=1)
        self.motion = TorqueDriven(robot).motion(kinematics, none, window=window)
        series = record.inputs['base_position']
        place = series.seconds(record.origin_ns)
        inside = (place >= self._time[0]) & (place <= self._time[-1])
        centre = Slerp(self._time, rotation)(place[inside]).apply(self._com)
        axes = np.array(['xyz'.index(name) for name in series.names])
        turned = np.einsum('nij,nj->ni', self.motion.rotation, turns)
        path = np.vstack([np.zeros((1, 3)), np.cumsum(turned, axis=0)])
        turning = np.flatnonzero(np.max(np.abs(turned), axis=0) > _TURNS)
        self._measured = (
            (place[inside], series.values[inside] + centre[:, axes], axes),
            (self._time, path[:, turning], turning),
        )
        assert self.motion.acceleration is not None  # made so
        driven = self._of_centre(self.motion.acceleration[..., None])
        swing = np.cross(omega, np.cross(omega, self._com))
        driven[0][..., 0] += np.einsum('nij,nj->ni', self.motion.rotation, swing)
        self.parts = [*self._parts([d[..., 0] for d in driven])]
        self.count = len([p for p in self.parts if p.channel])
        if self.count < _FEWEST:
            raise RecordingError(
                record.source,
                f'{counted(self.count, "window")} with a pose, at least {_FEWEST} are needed',
            )

    def accelerations(self, inverse: Array, forces: Array) -> list[Array]:
        """Of the file's centre of mass and about it, (N, 3, K) each, by forces (N, 6, K).

        Args:
            inverse: (6, 6) inverse mass matrix.
            forces: On the base, in it.
        """
        return self._of_centre(np.einsum('ij,njk->nik', inverse, forces[:, :6]))

    def _of_centre(self, base: Array) -> list[Array]:
        turned = base[:, 3:6]
        moved = base[:, :3] + np.cross(turned, self._com, axisa=1, axisc=1)
        return [np.einsum('nij,njk->nik', self.motion.rotation, x) for x in (moved, turned)]

    def forces(self, inverse: Array, by: Sequence[Array]) -> Array:
        """(N, 6) whose product with any forces is that of `by`, (N, 3) each, with theirs."""
        moved, turned = (np.einsum('nji,nj->ni', self.motion.rotation, x) for x in by)
        turned = turned + np.cross(self._com, moved)
        return np.asarray(np.concatenate([moved, turned], axis=1) @ inverse)

    def _parts(self, driven: Sequence[Array]) -> Iterator[_WindowPart]:
        steps = np.diff(self._time)
        for first, last in self._windows():
            for channel, (times, values, axes) in enumerate(self._measured):
                start, end = self._time[first], self._time[last]
                inside = np.flatnonzero((times >= start) & (times <= end))
                if len(inside) < _LINE:
                    continue
                at, own = times[inside], slice(first, last)
                basis = _curves(at)
                since = at[:, None] - self._time[own]
                held = np.clip(since, 0.0, steps[own])
                twice = held * since - 0.5 * held**2
                seen = values[inside] - twice @ driven[channel][own][:, axes]
                octave = np.log2((len(at) - 1) / (2.0 + np.arange(basis.shape[1]))).astype(int)
                yield _WindowPart(channel, axes, own, basis, octave, basis.T @ twice, at, seen)

    def _windows(self) -> Iterator[tuple[int, int]]:
        """First and last attitude of each."""
        steps = np.diff(self._time)
        period = float(np.median(steps))
        count = max(_SAMPLES, round(_SHORTEST / period))
        gaps = np.flatnonzero(steps > 4.0 * period) + 1
        for part in np.split(np.arange(len(self._time)), gaps):
            for piece in np.array_split(part, max(1, len(part) // count)):
                if len(piece) >= count:
                    yield int(piece[0]), int(piece[-1])


def _curves(times: Array) -> Array:
    """(n, n - 2) orthonormal curves through samples, without a + b t, from slow to fast."""
    n = len(times)
    waves = np.cos(np.pi * np.outer(np.arange(n) + 0.5, np.arange(2, n)) / max(n, 1))
    line = np.stack([np.ones(n), times - np.mean(times)], axis=1)
    return np.asarray(np.linalg.qr(np.concatenate([line, waves], axis=1))[0][:, 2:])


class PoseRun(Run):
    """A record of a lone body's pose; its rows are windows of it.

    Args:
        record: With attitudes, positions of the base and known forces.
        robot: The robot file's robot, without joints.
        believed: Its own effects.

    Attributes:
        levels: (2, octaves) standard deviation of the coefficients: of what the model as it stands
            leaves, or some causes.
    """

    def __init__(self, record: Record, robot: Robot, believed: Sequence[Effect]) -> None:
        super().__init__(record, robot, believed, noise_levels(robot.sensors, record)[0])
        self.windows = PoseWindows(record, self.robot)
        self.levels = np.ones((2, 1 + max(int(np.max(p.octave)) for p in self.windows.parts)))
        self.levels = self._left(())

    def left_by(self, causes: Sequence[Effect]) -> PoseRun:
        """The same run at the levels that some causes leave."""
        out = copy(self)
        out.levels = self._left(causes)
        return out

    def _left(self, causes: Sequence[Effect]) -> Array:
        out = np.ones_like(self.levels)
        rows = PoseRows(self, causes, out)
        data = rows.data
        for c, o in np.ndindex(out.shape):
            own = data[(rows.channel == c) & (rows.octave == o)]
            if len(own):
                out[c, o] = max(float(np.sqrt(np.mean(own**2))), _LEAST)
        return out

    def timed(self, timing: str) -> PoseRun:
        """The same run: there are no efforts."""
        return self

    def rows(self, causes: Sequence[Effect]) -> PoseRows:
        """Rows of the robot with its own effects and some causes."""
        return PoseRows(self, causes, self.levels)


_LEAST = 1e-12  # m, rad


class PoseRows:
    """The windows' coefficients as `rows.Rows`, each over the level of its octave.

    Args:
        run: The run.
        causes: Effects beyond the robot file's.
        levels: See `PoseRun`.

    Attributes:
        channel: (R,) 0: position, 1: attitude. axis: (R,). octave: (R,).
        row_times: (R,) middle of the window [s].
    """

    is_held, spread_cost = True, 0.0

    def __init__(self, run: PoseRun, causes: Sequence[Effect], levels: Array) -> None:
        self._windows, self.levels = run.windows, levels
        self._process = TorqueDriven(run.robot, (*run.believed, *causes))
        self.robot = self._process.robot
        self.motion = run.windows.motion.of(self.robot)
        self._inverse = inverse_mass(self.robot)
        parts = run.windows.parts
        rows = [p.octave.size * len(p.axes) for p in parts]
        self.channel = np.repeat([p.channel for p in parts], rows)
        self.axis = np.concatenate([np.repeat(p.axes, p.octave.size) for p in parts])
        self.octave = np.concatenate([np.tile(p.octave, len(p.axes)) for p in parts])
        self.row_times = np.repeat([np.mean(p.times) for p in parts], rows)
        self._stds = levels[self.channel, self.octave]

    @property
    def effort_rate(self) -> Array:
        """(N, 0): there are no joints."""
        return self.motion.qd

    def samples(self) -> Mapping[str, tuple[Kinematics, Motion]]:
        """None: no fault of the cameras is asked for."""
        return {}

    def whitened(self, forces: Array, measured: Mapping[str, Array]) -> Array:
        """(R, K); see `Rows.whitened`."""
        driven = self._windows.accelerations(self._inverse, forces)
        rows = [
            np.einsum('rs,sak->ark', p.twice, driven[p.channel][p.steps][:, p.axes])
            for p in self._windows.parts
        ]
        flat = [own.reshape(-1, forces.shape[2]) for own in rows]
        return np.asarray(np.concatenate(flat) / self._stds[:, None])

    def force_correlation(self, weights: Array) -> Array:
        """(N, 6); see `Rows.force_correlation`."""
        by = [np.zeros((len(self.motion), 3)) for _ in _CHANNELS]
        scaled, row = weights / self._stds, 0
        for p in self._windows.parts:
            own = scaled[row : row + p.octave.size * len(p.axes)].reshape(len(p.axes), -1)
            by[p.channel][p.steps.start : p.steps.stop, p.axes] += (own @ p.twice).T
            row += own.size
        return self._windows.forces(self._inverse, by)

    @cached_property
    def data(self) -> Array:
        """(R,) what the model leaves of the coefficients."""
        windows = self._windows
        seen = np.concatenate([(p.basis.T @ p.seen).T.ravel() for p in windows.parts])
        force = self._process.force_error(self.motion)
        return np.asarray(seen / self._stds - self.whitened(force[..., None], {})[:, 0])

    def whiteness(self) -> tuple[float, tuple[ChannelFit, ...]]:
        """Whether slow curves have no more left than the fastest octave, which is noise alone."""
        fits, left = list[ChannelFit](), (self.data * self._stds) ** 2
        for c, a in sorted({*zip(self.channel.tolist(), self.axis.tolist(), strict=True)}):
            own = (self.channel == c) & (self.axis == a)
            slow, fast = (left[own & at] for at in (self.octave > 0, self.octave == 0))
            if not (slow.size and fast.size):
                continue
            ratio = float(np.mean(slow) / max(np.mean(fast), _LEAST**2))
            p_value = float(fdtrc(len(slow), len(fast), ratio))
            told = {'spread': ratio**0.5, 'p_value': p_value, 'frequency': 0.0, 'line_p': 1.0}
            fits.append(ChannelFit(channel=_CHANNELS[c][0], axis=a, question='slow', **told))
        return min([1.0, *(len(fits) * fit.p_value for fit in fits)]), tuple(fits)

    def channels(self) -> tuple[ChannelError, ...]:
        """What is left of every axis, less the line of its window."""
        left, row = self.data * self._stds, 0
        errors: dict[tuple[int, int], list[tuple[Array, Array, Array]]] = {}
        for p in self._windows.parts:
            for k, axis in enumerate(p.axes.tolist()):
                own = p.basis @ left[row : row + p.octave.size]
                errors.setdefault((p.channel, axis), []).append((p.times, p.seen[:, k], own))
                row += p.octave.size
        out = []
        for (c, axis), pieces in sorted(errors.items()):
            times, seen, own = (np.concatenate(column) for column in zip(*pieces, strict=True))
            name, unit = _CHANNELS[c]
            floor = float(self.levels[c, 0])
            out.append(ChannelError(f'{name}/{"xyz"[axis]}', unit, times, seen, own, floor))
        return tuple(out)
