r"""A lone body's pose under known forces, window by window: linear in all unknowns.

With f_k, m_k force and torque about the centre of mass c of thruster k in the base, u_k its
command, R the measured attitude and J the inertia, the momenta of a free body give

    m (p + R c)(t) = a + b t + sum_k g_k int int R f_k u_k(t - d) + m gamma t^2 / 2,
    int R J w      = a' + b' t + sum_k g_k int int R m_k u_k(t - d) + tau t^2 / 2,

in the inertial frame. Starts and rates are each window's own, so slow disturbances do not add up;
the gains g, an acceleration gamma and a torque tau are shared, and so is the delay d, which is
tried. Mass and inertia are the file's: only thrust over mass, torque over inertia are seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..model.inputs import Inputs
from ..model.robot import Robot
from ..recording.record import Record
from ..recording.robot_inputs import with_inputs
from ..types import Array, IntArray

_SAMPLES, _SHORTEST = 20, 1.2  # samples and seconds of a window, at least
Name = tuple[str, str | None, str]
"""Effect, place and parameter of an unknown."""


@dataclass(frozen=True, slots=True, eq=False)
class WindowGrams:
    """Products of columns, the data the last one, window by window.

    Args:
        names: (P,) the unknowns.
        position: (W, P + 1, P + 1) of positions [m^2]. angle: (W, P + 1, P + 1) of angles [rad^2].
        counts: (2,) rows of each, starts and rates taken off.
    """

    names: tuple[Name, ...]
    position: Array
    angle: Array
    counts: Array


class MomentumWindows:
    """One record, cut into windows.

    Args:
        record: With attitudes, positions of the base and commands.
        robot: The robot file's, without joints.
    """

    def __init__(self, record: Record, robot: Robot) -> None:
        self.robot = with_inputs(robot, record)
        body = robot.bodies[0]
        self.mass, self.com, self.inertia = body.mass, body.com, body.inertia
        self.time = record.attitude_time
        self.rotation = Rotation.from_quat(record.attitude_xyzw)
        steps = (self.rotation[:-1].inv() * self.rotation[1:]).as_rotvec()
        self.steps = np.diff(self.time)
        self.turns = steps
        self.middle = (self.rotation[:-1] * Rotation.from_rotvec(0.5 * steps)).as_matrix()
        series = record.inputs['base_position']
        self.at = series.seconds(record.origin_ns)
        self.axes = ['xyz'.index(name) for name in series.names]
        self.position = series.values
        # about an axis that never turns the body is held
        turned = np.einsum('nij,nj->ni', self.middle, steps)
        self.turning = [i for i in range(3) if np.max(np.abs(turned[:, i])) > 1e-9]
        self.windows = self._windows()

    def _windows(self) -> list[IntArray]:
        period = float(np.median(self.steps))
        count = max(_SAMPLES, round(_SHORTEST / period))
        gaps = np.flatnonzero(self.steps > 4.0 * period) + 1
        parts = np.split(np.arange(len(self.time)), gaps)
        return [
            piece
            for part in parts
            if len(part) >= count
            for piece in np.array_split(part, len(part) // count)
        ]

    @property
    def names(self) -> tuple[Name, ...]:
        """The unknowns."""
        gains = [('thruster_gain', t.name, 'gain') for t in self.robot.thrusters]
        shifts = [('gravity_error', None, 'xyz'[i]) for i in self.axes]
        torques = [('external_torque_inertial', None, 'xyz'[i]) for i in self.turning]
        return (*gains, *shifts, *torques)

    def grams(self, delay: float) -> WindowGrams:
        """Products under a delay of the commands [s]."""
        position, angle = self._columns(delay)
        parts: tuple[list[Array], list[Array]] = ([], [])
        counts = np.zeros(2)
        for window in self.windows:
            start, end = self.time[window[0]], self.time[window[-1]]
            inside = np.flatnonzero((self.at >= start) & (self.at <= end))
            for k, (time, values) in enumerate(
                ((self.at[inside], position[inside]), (self.time[window], angle[window]))
            ):
                left = _without_line(time, values)
                parts[k].append(np.einsum('nai,naj->ij', left, left))
                counts[k] += max(len(time) - 2, 0) * values.shape[1]
        return WindowGrams(self.names, np.array(parts[0]), np.array(parts[1]), counts)

    def _columns(self, delay: float) -> tuple[Array, Array]:
        """Columns of all unknowns and the data: (Np, axes, P + 1) [m], (Na, turning, P + 1) [rad].

        Angles are momenta over the file's largest moment of inertia.
        """
        inputs = (self.robot.inputs or Inputs()).delayed(delay)
        shares = np.zeros((len(self.steps), 0))
        if inputs.commands is not None:
            shares = inputs.commands.mean(self.time[:-1], self.time[1:])
        known = np.zeros((len(self.steps), 6))
        if inputs.wrench is not None:
            known = inputs.wrench.mean(self.time[:-1], self.time[1:])
        wrenches = np.array([t.wrench for t in self.robot.thrusters]).reshape(-1, 6)
        scale = float(np.max(np.linalg.eigvalsh(self.inertia)))
        paths = [self._twice(shares[:, k, None] * w) for k, w in enumerate(wrenches)]
        total = sum(paths, self._twice(known))
        since = 0.5 * (self.time - self.time[0]) ** 2
        rotation = self.rotation.as_matrix()
        line = [path[:, :3] / self.mass for path in paths]
        turn = [path[:, 3:] / scale for path in paths]
        nothing = np.zeros((len(self.time), 3))
        for i in self.axes:
            line.append(np.outer(since, np.eye(3)[i]))
            turn.append(nothing)
        for i in self.turning:
            line.append(nothing)
            turn.append(np.outer(since, np.eye(3)[i]) / scale)
        seen = self._path(self.inertia) / scale - total[:, 3:] / scale
        free = total[:, :3] / self.mass - np.einsum('nij,j->ni', rotation, self.com)
        known_line = np.stack([np.interp(self.at, self.time, free[:, i]) for i in self.axes], 1)
        columns = np.stack(line, axis=2)[:, self.axes]
        at_samples = np.array(
            [[np.interp(self.at, self.time, c) for c in axis.T] for axis in columns.swapaxes(0, 1)]
        )
        position = np.concatenate(
            [at_samples.transpose(2, 0, 1), (self.position - known_line)[..., None]], axis=2
        )
        angle = np.concatenate([np.stack(turn, axis=2), seen[..., None]], axis=2)
        return position, angle[:, self.turning]

    def _twice(self, wrench: Array) -> Array:
        """(N, 6) force and torque about the centre of mass, integrated twice, inertial frame.

        Args:
            wrench: (N - 1, 6) on the base at its origin, in base coordinates.
        """
        dt, pull = self.steps[:, None], wrench[:, :3]
        torque = wrench[:, 3:] - np.cross(self.com, pull)
        parts = [np.einsum('nij,nj->ni', self.middle, w) for w in (pull, torque)]
        force = np.concatenate(parts, axis=1)
        rate = np.cumsum(force * dt, axis=0)
        path = np.cumsum((rate - 0.5 * force * dt) * dt, axis=0)
        return np.vstack([np.zeros((1, 6)), path])

    def _path(self, inertia: Array) -> Array:
        """(N, 3) integral of R J w."""
        turned = np.einsum('nij,jk,nk->ni', self.middle, inertia, self.turns)
        return np.vstack([np.zeros((1, 3)), np.cumsum(turned, axis=0)])


def _without_line(time: Array, values: Array) -> Array:
    """Values (N, a, K) less the line a + b t of each column that fits best."""
    if len(time) < 3:
        return values[:0]
    design = np.stack([np.ones_like(time), time - np.mean(time)], axis=1)
    basis = np.linalg.qr(design)[0]
    flat = values.reshape(len(values), -1)
    return np.asarray((flat - basis @ (basis.T @ flat)).reshape(values.shape))


def all_grams(windows: Sequence[MomentumWindows], delay: float) -> WindowGrams:
    """Products of several records under one delay."""
    each = [w.grams(delay) for w in windows]
    return WindowGrams(
        each[0].names,
        np.concatenate([g.position for g in each]),
        np.concatenate([g.angle for g in each]),
        np.sum([g.counts for g in each], axis=0),
    )
