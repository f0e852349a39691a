r"""The momentum equation, linear about a measured reference trajectory.

With the attitude R = R_ref exp(dphi) and u = [w; q'], conservation of the total momentum h_W says

    R (A(q) u + h0 + sum_b R_b h_b) = h_W          A = [D, Dq]

so a reference that misses by e = R_ref^T h_W - A u_ref - h0 - sum_b R_b h_b has the rate error dw
= D^-1 (e + E z + V t) to first order in the state errors z = [dphi; dq; dq'] and linear, exactly,
in the errors t of the constants [h_W; AAM; x]. The reference comes from the data (splines), not
from the constants, so wrong constants do not bend it.

Symbols: N times, n joints, p = 3 + 3 n_links + k constants.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ..dynamics.blocks import BlockTree
from ..dynamics.rotation import skew
from ..model.robot import Robot
from ..types import Array
from .minimal import MinimalSet

_CHUNK = (
    512  # times linearised at once; the temporaries take about a kilobyte a time and joint squared
)


@dataclass(frozen=True, slots=True, eq=False)
class Reference:
    """Reference trajectory at N times.

    Args:
        time: (N,) [s].
        q: (N, n) joint positions [rad]. qd: (N, n) joint rates [rad/s].
        omega: (N, 3) body rate omega_WB_B [rad/s].
        rotation: Attitudes R_WB, N of them.
    """

    time: Array
    q: Array
    qd: Array
    omega: Array
    rotation: Rotation

    def between(self, start: int, stop: int | None = None) -> Reference:
        """The times with indices from start to before stop."""
        part = slice(start, stop)
        return Reference(
            self.time[part], self.q[part], self.qd[part], self.omega[part], self.rotation[part]
        )

    def tail(self) -> Reference:
        """The last time alone."""
        return self.between(len(self.time) - 1)

    def turned(self, correction: Rotation) -> Reference:
        """The same with every attitude R replaced by R times the correction."""
        return Reference(self.time, self.q, self.qd, self.omega, self.rotation * correction)


def join(first: Reference, second: Reference) -> Reference:
    """Two references in a row."""
    return Reference(
        np.concatenate([first.time, second.time]),
        np.concatenate([first.q, second.q]),
        np.concatenate([first.qd, second.qd]),
        np.concatenate([first.omega, second.omega]),
        Rotation.concatenate([first.rotation, second.rotation]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class RateErrorModel:
    """Body-rate error dw = offset + state @ z + constants @ t at N times.

    Args:
        offset: (N, 3) [rad/s].
        state: (N, 3, 3 + 2 n) by z = [dphi; q - q_ref; q' - q'_ref].
        constants: (N, 3, p) by the errors of [h_W; AAM; x].
    """

    offset: Array
    state: Array
    constants: Array

    def tail(self) -> RateErrorModel:
        """The last time alone."""
        return RateErrorModel(self.offset[-1:], self.state[-1:], self.constants[-1:])

    def after(self, first: RateErrorModel) -> RateErrorModel:
        """This model behind another."""
        return RateErrorModel(
            np.concatenate([first.offset, self.offset]),
            np.concatenate([first.state, self.state]),
            np.concatenate([first.constants, self.constants]),
        )

    def with_absolute_joints(self, reference: Reference) -> Array:
        """(N, 3, 1 + p) of dw by 1 and the constants, with absolute joint states."""
        joints = np.concatenate([reference.q, reference.qd], axis=1)
        offset = self.offset - np.einsum('nab,nb->na', self.state[..., 3:], joints)
        return np.concatenate([offset[..., None], self.constants], axis=2)


class MomentumModel:
    """The constants to estimate and the momentum equation of one robot.

    Args:
        robot: Free-floating robot with revolute joints.
        minimal: Its minimal set.
    """

    def __init__(self, robot: Robot, minimal: MinimalSet) -> None:
        self.tree = BlockTree(robot)
        self.minimal = minimal
        self.robot = robot
        self.n = robot.n_joints
        self._wheels = [(g.body, g.rotation) for g in robot.target_wheels]
        self._h0 = robot.servicer_wheels.body_momentum
        self.n_aam = 3 * len(self._wheels)
        self.size = 3 + self.n_aam + len(minimal)

    def prior(self) -> Array:
        """(p,) constants that the robot file believes in; the total momentum is left zero."""
        x = self.minimal.grouping @ self.tree.parameters()
        return np.concatenate([np.zeros(3), self.robot.target_momentum, x])

    def regressor(self, reference: Reference) -> tuple[Array, Array]:
        """Rows of b = A [h_W; AAM; x] in the base frame, exact and linear.

        Returns:
            (N, 3, p) coefficients of 0 = R^T h_W - sum R_b h_b - Y x - h0, and (N, 3) right-hand
            side h0.
        """
        rotations = self.tree.rotations(reference.q)
        maps = self.tree.rate_maps(rotations)
        u = np.concatenate([reference.omega, reference.qd], axis=1)
        return self._coefficients(reference, rotations, maps, u), np.broadcast_to(
            self._h0, (len(u), 3)
        )

    def linearize(self, reference: Reference, constants: Array) -> RateErrorModel:
        """Body-rate error of the reference, about given constants (p,)."""
        parts = [
            self._linearize(reference.between(start, start + _CHUNK), constants)
            for start in range(0, len(reference.time), _CHUNK)
        ]
        return RateErrorModel(
            np.concatenate([part.offset for part in parts]),
            np.concatenate([part.state for part in parts]),
            np.concatenate([part.constants for part in parts]),
        )

    def _linearize(self, reference: Reference, constants: Array) -> RateErrorModel:
        rotations = self.tree.rotations(reference.q)
        maps = self.tree.rate_maps(rotations)
        u = np.concatenate([reference.omega, reference.qd], axis=1)
        columns = self._coefficients(reference, rotations, maps, u)
        pi = self.minimal.lift @ constants[3 + self.n_aam :]
        inertia, gradient = self.tree.inertia_gradient(rotations, maps, pi)
        inverse = np.linalg.inv(inertia[:, :3, :3])
        offset = columns @ constants - self._h0
        h_B = columns[..., :3] @ constants[:3]
        state = np.empty((len(u), 3, 3 + 2 * self.n))
        state[..., :3] = skew(h_B)
        state[..., 3 : 3 + self.n] = -np.einsum('njab,nb->naj', gradient[:, :, :3], u)
        for i, (body, _) in enumerate(self._wheels):
            momentum = -columns[..., 3 + 3 * i : 6 + 3 * i] @ constants[3 + 3 * i : 6 + 3 * i]
            turned = np.cross(
                maps[:, body, :, 3:], momentum[:, :, None], axisa=1, axisb=1, axisc=1
            )
            state[..., 3 : 3 + self.n] -= turned
        state[..., 3 + self.n :] = -inertia[:, :3, 3:]
        return RateErrorModel(
            np.einsum('nab,nb->na', inverse, offset), inverse @ state, inverse @ columns
        )

    def _coefficients(
        self, reference: Reference, rotations: Array, maps: Array, u: Array
    ) -> Array:
        out = np.empty((len(u), 3, self.size))
        out[..., :3] = np.swapaxes(reference.rotation.as_matrix(), 1, 2)
        for i, (body, rotation) in enumerate(self._wheels):
            out[..., 3 + 3 * i : 6 + 3 * i] = -rotations[:, body] @ rotation
        out[..., 3 + self.n_aam :] = -self.tree.regressor(rotations, maps, u) @ self.minimal.lift
        return out
