r"""Error-state filter in momentum mode, with every unknown constant as a column.

State z = [dphi; q, q', q'', q''' a joint]: the attitude error about the reference moves with the
rate error of the momentum equation (`linearize`), needs no torque and no process noise; each joint
follows a quartic driven by white snap. The constants [h_W; AAM; x] are not states: the filter's
mean is an affine function m + C t of their errors t, and so is every innovation. Whitened
innovations are therefore rows of a linear least-squares problem in t, collected in square-root
form by QR: recursive, with bounded memory, and equal to the Kalman filter with augmented state
(Friedland 1969; Bierman 1977).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from scipy.spatial.transform import Rotation

from ..types import Array
from .momentum_process import RateErrorModel
from .momentum_recursions import forward
from .nuisances import SensorColumns
from .reference import Kinematics

_ATTITUDE_START_STD = (
    0.05  # rad; the reference starts aligned with the tracker far better than this
)


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """Standard deviations of one sample, and the joints' smoothness.

    Args:
        joint_position: [rad]. joint_velocity: [rad/s]. gyro: [rad/s]. attitude: [rad].
        snap: (n,) power spectral density of the joints' snap [rad^2/s^7].
    """

    joint_position: float
    joint_velocity: float
    gyro: float
    attitude: float
    snap: Array


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """What was measured at each of N times; NaN where nothing was.

    Args:
        q: (N, n). qd: (N, n). gyro: (N, 3) deviation from the reference rate. attitude: (N, 3)
            deviation log(R_ref^T R_measured).
    """

    q: Array
    qd: Array
    gyro: Array
    attitude: Array
    columns: SensorColumns | None = None


class SquareRootInformation:
    """Least squares in square-root form: min |R t - z|^2, rows added by QR.

    Args:
        size: Number of unknowns.
    """

    def __init__(self, size: int) -> None:
        self.size = size
        self.factor = np.zeros((size, size + 1))
        self.residual = 0.0
        self.rows = 0

    def add(self, columns: Array, values: Array) -> None:
        """Add rows columns @ t = values, of unit variance; (r, p) and (r,)."""
        size = self.size
        stacked = np.vstack([self.factor, np.column_stack([columns, values])])
        (triangle,) = scipy.linalg.qr(stacked, mode='r', check_finite=False)
        self.factor = np.zeros((size, size + 1))
        kept = min(size, len(triangle))
        self.factor[:kept] = triangle[:kept]
        if len(triangle) > size:
            self.residual += float(triangle[size, size] ** 2)
        self.rows += len(values)

    def reset_residual(self) -> None:
        """Count residual and rows from here: a prior is no part of the goodness of fit."""
        self.residual, self.rows = 0.0, 0

    def shift(self, change: Array) -> None:
        """Count the unknowns from a new origin: t -> t - change."""
        self.factor[:, -1] -= self.factor[:, :-1] @ change

    def solve(self) -> tuple[Array, Array]:
        """Estimate (p,) and covariance (p, p); directions without information stay at zero."""
        R, z = self.factor[:, :-1], self.factor[:, -1]
        scale = np.linalg.norm(R, axis=0)
        scale[scale == 0.0] = 1.0
        left, singular, right = np.linalg.svd(R / scale)
        known = (
            singular > 1e-13 * singular[0]
            if singular[0] > 0.0
            else np.zeros(len(singular), dtype=bool)
        )
        inverse = right[known].T / singular[known]
        estimate = inverse @ (left[:, known].T @ z) / scale
        covariance = (inverse @ inverse.T) / np.outer(scale, scale)
        return estimate, covariance


class MomentumFilter:
    """Advances the filter block by block.

    Args:
        size: Number of constants p.
        noise: Noise levels.
        joint_start: (4, n) joint positions, rates, accelerations and jerks at the first time.
        joint_start_std: (4, n) their standard deviations: wide against the noise, but no wider
            than the motion, since a covariance that spans twenty decades loses its sign.
    """

    def __init__(
        self, size: int, noise: Noise, joint_start: Array, joint_start_std: Array
    ) -> None:
        self.n = joint_start.shape[1]
        self.noise = noise
        self.information = SquareRootInformation(size)
        start = np.concatenate([np.full(3, _ATTITUDE_START_STD), joint_start_std.ravel()])
        self.covariance = np.diag(start**2)
        self.placebo = SquareRootInformation(size)
        self.affine = np.zeros((3 + 4 * self.n, 1 + 2 * size))
        self.affine[3:, 0] = joint_start.ravel()
        self.last: tuple[Kinematics, RateErrorModel] | None = None

    def run(self, reference: Kinematics, model: RateErrorModel, measured: Measurements) -> None:
        """Process N times in order; the first continues where the last block ended.

        Args:
            reference: At the N times, in one piece with that of the last block.
            model: Rate error about the current constants at the N times.
            measured: Measurements at the N times.
        """
        if self.last is not None:
            reference, model = _join(self.last[0], reference), model.after(self.last[1])
        drives = model.with_absolute_joints(reference)
        levels = self.noise
        columns = measured.columns or SensorColumns.none(len(measured.q), self.n)
        self.affine, self.covariance, rows = forward(
            transitions(reference, model.state, drives, levels.snap),
            model.state,
            drives,
            (measured.q, measured.qd, measured.attitude, measured.gyro),
            (columns.q, columns.qd, columns.attitude, columns.gyro),
            np.array([levels.joint_position, levels.joint_velocity, levels.attitude, levels.gyro]),
            0 if self.last is None else 1,
            self.affine,
            self.covariance,
        )
        if len(rows):
            p = self.information.size
            self.information.add(-rows[:, 1 + p :], rows[:, 0])
            self.placebo.add(rows[:, 1 : 1 + p], np.zeros(len(rows)))
        self.last = (reference.part(slice(-1, None)), model.tail())

    def shift_constants(self, change: Array) -> None:
        """Count the constants' errors from a new origin."""
        self.information.shift(change)
        self.affine[:, 0] += self.affine[:, 1 + len(change) :] @ change

    def take_attitude(self) -> Array:
        """Return the mean attitude error (3,) at the end and set it to zero."""
        error = self.affine[:3, 0].copy()
        self.affine[:3, 0] = 0.0
        return error


def _join(first: Kinematics, second: Kinematics) -> Kinematics:
    """Two references in a row."""
    return Kinematics(
        np.concatenate([first.time, second.time]),
        np.concatenate([first.q, second.q]),
        np.concatenate([first.qd, second.qd]),
        np.concatenate([first.omega, second.omega]),
        Rotation.concatenate([first.rotation, second.rotation]),
    )


def transitions(
    reference: Kinematics, rate_by_state: Array, drives: Array, snap: Array
) -> tuple[Array, Array, Array]:
    """Steps between N times: transition, drive of the attitude error, and noise.

    Shapes (N-1, d, d), (N-1, 3, 1+p) and (N-1, d, d) with d = 3 + 4 n.

    The attitude error obeys dphi' = -w x dphi + dw, carried over exactly by the reference's own
    rotation and driven by
    the trapezoid of dw, whose end depends on the new state: solved for it.

    Args:
        reference: N times.
        rate_by_state: (N, 3, 3 + 2 n) dw by dphi, q and q'.
        drives: (N, 3, 1 + p) dw by 1 and by the constants.
        snap: (n,) power spectral density of the joints' snap.
    """
    n = len(snap)
    half = 0.5 * np.diff(reference.time)[:, None, None]
    joint, joint_noise = _joint_steps(np.diff(reference.time), snap)
    back = (reference.rotation[1:].inv() * reference.rotation[:-1]).as_matrix()
    implicit = np.linalg.inv(np.eye(3) - half * rate_by_state[1:, :, :3])
    transition = np.zeros((len(half), 3 + 4 * n, 3 + 4 * n))
    transition[:, 3:, 3:] = joint
    ahead = half * rate_by_state[1:, :, 3:] @ joint[:, : 2 * n]
    ahead[:, :, : 2 * n] += half * back @ rate_by_state[:-1, :, 3:]
    transition[:, :3, 3:] = implicit @ ahead
    transition[:, :3, :3] = implicit @ (back + half * back @ rate_by_state[:-1, :, :3])
    drive = implicit @ (half * (back @ drives[:-1] + drives[1:]))
    spread = np.zeros((len(half), 3 + 4 * n, 4 * n))
    spread[:, 3:] = np.eye(4 * n)
    spread[:, :3, : 2 * n] = implicit @ (half * rate_by_state[1:, :, 3:])
    return transition, drive, spread @ joint_noise @ np.swapaxes(spread, 1, 2)


def _joint_steps(dt: Array, snap: Array) -> tuple[Array, Array]:
    """(M, 4n, 4n) transition and noise of joint position to jerk, driven by white snap."""
    step, noise = np.zeros((len(dt), 4, 4)), np.zeros((len(dt), 4, 4))
    for i in range(4):
        for j in range(i, 4):
            step[:, i, j] = dt ** (j - i) / math.factorial(j - i)
        for j in range(4):
            noise[:, i, j] = dt ** (7 - i - j) / (
                math.factorial(3 - i) * math.factorial(3 - j) * (7 - i - j)
            )
    return _kron(step, np.eye(len(snap))), _kron(noise, np.diag(snap))


def _kron(stack: Array, matrix: Array) -> Array:
    """(M, ab, ab) Kronecker products of each of (M, a, a) with (b, b)."""
    size = stack.shape[1] * len(matrix)
    return np.einsum('mij,kl->mikjl', stack, matrix).reshape(len(stack), size, size)
