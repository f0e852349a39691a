r"""What gyro and magnetometer of a spinning body say, window by window: linear in what is wrong.

By the magnetometer the spin is w about the body's main axis e and s across it, window by window;
the gyro's mean is g. Of moments I_s about the axis and I_a, I_b across, of products p and a
nutation at kappa of the spin,

    s_a = w p_a / (I_s - I_a),    g = w e + s + what the gyro's faults make of w e,
    kappa^2 = (I_s - I_a) (I_s - I_b) / (I_a I_b).

Only ratios of moments are told: I_a and I_b are the robot file's. Means scatter by more than
samples do; the variance of that is what is left of each axis where all may be wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..effects.effect import Effect
from ..effects.motion import Motion
from ..inference.decisive import CLUSTERS
from ..inference.gram_blocks import GramBlocks
from ..model.robot import Robot
from ..types import Array
from .spin import Nutation, SpinWindow

_QUIET = 1e-9  # rad/s; below any scatter
_PASSES = 3  # of the levels, by which the rows are weighed that they come from
_GYRO, _FIELD, _NUTATION = range(0, 3), range(3, 6), 6


class SpinRows:
    """R rows of each of M windows, cut into pieces so that there are enough blocks.

    Columns are those of the gyro's faults, of products with both axes across the spin, in order,
    and of the moment about it.

    Args:
        windows: In which the body spins.
        noise: (M,) of one sample of the gyro [rad/s].
        faults: Of the gyro, each a small step from doing nothing, with that step.
        robot: Without joints.
        line: Nutation, where there is one.

    Attributes:
        main: Axis of the spin. others: Those across. products: (2,) the file's with them.
        moments: (3,) the file's, that about the spin as the nutation needs it [kg m^2].
        apart: (2,) that moment less those across.
    """

    def __init__(
        self,
        windows: Sequence[SpinWindow],
        noise: Array,
        faults: Sequence[tuple[Effect, float]],
        robot: Robot,
        line: Nutation | None,
    ) -> None:
        self._windows, self._faults, self._robot = windows, faults, robot
        self.main = int(np.argmax(np.sum([w.spin**2 for w in windows], axis=0)))
        self.others = [i for i in range(3) if i != self.main]
        self.moments = np.diag(robot.bodies[0].inertia).copy()
        self.products = robot.bodies[0].inertia[self.main, self.others]
        file, pieces = float(self.moments[self.main]), math.ceil(CLUSTERS / len(windows))
        gyros = [w.gyro if line is None else line.taken_from(w) for w in windows]
        cut = [np.array_split(gyro, pieces) for gyro in gyros]
        counts = np.array([[len(piece) for piece in own] for own in cut])
        means = np.array([np.mean(piece, axis=0) for own in cut for piece in own])
        stds = np.repeat(noise[:, None] / np.sqrt(counts), 3, axis=1)
        field = np.array([w.spin for w in windows])[:, self.others]
        data, known = [means.reshape(len(windows), -1), field], [stds, np.zeros_like(field)]
        self.axis = np.array([*pieces * [*_GYRO], *(_FIELD[i] for i in self.others)])
        self.piece = np.append(np.repeat(np.arange(pieces), 3), [0, 0])
        if line is not None:
            ends = (line.share - line.std, line.share, line.share + line.std)
            low, self.moments[self.main], high = (self._moment(file, kappa) for kappa in ends)
            slope = (high - low) / (2.0 * line.std)
            at = self.moments[self.main] - file + slope * (line.shares - line.share)
            data, known = [*data, at[:, None]], [*known, abs(slope) * line.stds[:, None]]
            self.axis, self.piece = np.append(self.axis, _NUTATION), np.append(self.piece, 0)
        self.apart = self.moments[self.main] - self.moments[self.others]
        self._seen, self.noise = np.concatenate(data, axis=1), np.concatenate(known, axis=1)
        self.about(1.0)

    def _moment(self, file: float, kappa: float) -> float:
        """About the spin's axis, as a nutation needs it: the one nearer to the file's."""
        a, b = self.moments[self.others].tolist()
        half = 0.5 * math.sqrt((a - b) ** 2 + 4.0 * kappa**2 * a * b)
        return min((0.5 * (a + b) + half, 0.5 * (a + b) - half), key=lambda x: abs(x - file))

    def about(self, cosine: float) -> None:
        """Make data (M, R) and columns (M, R, K) for an angle between spin and gyro.

        A window tells its rate far better than its axis.
        """
        count, faults = len(self._windows), len(self._faults)
        self.rates = np.array(
            [np.linalg.norm(w.spin) * np.sign(w.spin[self.main]) for w in self._windows]
        )
        spin, none = np.zeros((count, 3)), np.zeros((count, 0))
        spin[:, self.main] = cosine * self.rates
        time = np.array([np.mean(w.time) for w in self._windows])
        motion = Motion(self._robot, time, none, none, none, omega=spin)
        own = np.zeros((count, 7, faults + 3))
        for k, (effect, step) in enumerate(self._faults):
            own[:, _GYRO, k] = (effect.sense('gyro', spin, motion) - spin) / step
        for k, i in enumerate(self.others):
            if self.apart[k]:
                tilted = spin[:, self.main] / self.apart[k]
                own[:, i, faults + k] = own[:, _FIELD[i], faults + k] = tilted
        own[:, _NUTATION, -1] = 1.0
        self.columns = own[:, self.axis]
        self.data = self._seen.copy()
        self.data[:, self.axis == self.main] -= spin[:, self.main, None]
        self.data -= self.columns[..., faults : faults + 2] @ self.products

    def across(self, mean: Array) -> Array:
        """(2,) of the gyro across the main axis by the spin's rate, by coefficients (K,)."""
        return np.asarray(self.columns[0, self.others] @ mean / self.rates[0])

    def left(self, mean: Array) -> Array:
        """(M, R) by coefficients (K,)."""
        return np.asarray(self.data - self.columns @ mean)

    def stds(self, sizes: Array) -> Array:
        """(M, R) standard deviation of every row, where coefficients have sizes (K,)."""
        known = self.noise**2
        excess = np.append(np.full(_NUTATION, np.mean(known[:, :3])), 0.0)
        for _ in range(_PASSES):
            stds = np.sqrt(np.maximum(known + excess[self.axis], _QUIET**2))
            design = (self.columns * sizes / stds[..., None]).reshape(-1, len(sizes))
            spread = np.linalg.inv(design.T @ design + np.eye(len(sizes)))
            left = self.left(sizes * (spread @ (design.T @ (self.data / stds).ravel())))
            used = np.einsum('rk,kl,rl->r', design, spread, design).reshape(stds.shape)
            for axis in np.unique(self.axis[self.axis < _NUTATION]).tolist():
                own = self.axis == axis
                count = np.count_nonzero(own)
                freedom = max(len(left) - float(np.sum(used[:, own])), 1.0)
                seen = float(np.sum(np.mean(left[:, own], axis=1) ** 2)) / freedom
                excess[axis] = max(count * seen - float(np.mean(known[:, own])), 0.0)
        return np.asarray(np.sqrt(np.maximum(known + excess[self.axis], _QUIET**2)))

    def blocks(self, stds: Array) -> GramBlocks:
        """The rows over their deviations (M, R), by window and piece."""
        out = GramBlocks(self.columns.shape[2])
        for k, window in enumerate(self._windows):
            for piece in np.unique(self.piece):
                own = self.piece == piece
                columns = self.columns[k, own] / stds[k, own, None]
                out.add(columns, self.data[k, own] / stds[k, own], window.recording)
        return out
