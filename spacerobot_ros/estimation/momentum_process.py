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

from ..dynamics.blocks import BlockTree
from ..dynamics.rotation import skew
from ..model.robot import Robot
from ..types import Array
from .minimal import MinimalSet
from .nuisances import Nuisances
from .reference import Kinematics, ReferenceTrajectory
from .torque_hold import held_jerk

_CHUNK = (
    512  # times linearised at once; the temporaries take about a kilobyte a time and joint squared
)


@dataclass(frozen=True, slots=True, eq=False)
class RateErrorModel:
    """Body-rate error dw = offset + state @ z + constants @ t at N times.

    Args:
        offset: (N, 3) [rad/s].
        state: (N, 3, 3 + 2 n) by z = [dphi; q - q_ref; q' - q'_ref].
        constants: (N, 3, p) by the errors of [h_W; AAM; x; nuisances].
        placebo: (N, 3, p) what the reference's own error makes of `constants`: columns without any
            meaning, against which excitation is judged.
    """

    offset: Array
    state: Array
    constants: Array
    placebo: Array

    def tail(self) -> RateErrorModel:
        """The last time alone."""
        return RateErrorModel(
            self.offset[-1:], self.state[-1:], self.constants[-1:], self.placebo[-1:]
        )

    def after(self, first: RateErrorModel) -> RateErrorModel:
        """This model behind another."""
        return join_models([first, self])

    def with_absolute_joints(self, reference: Kinematics) -> Array:
        """(N, 3, 1 + 2 p) of dw by 1, placebo and constants, with absolute joint states."""
        joints = np.concatenate([reference.q, reference.qd], axis=1)
        offset = self.offset - np.einsum('nab,nb->na', self.state[..., 3:], joints)
        return np.concatenate([offset[..., None], self.placebo, self.constants], axis=2)


def join_models(models: list[RateErrorModel]) -> RateErrorModel:
    """Models of consecutive times as one."""
    return RateErrorModel(
        np.concatenate([model.offset for model in models]),
        np.concatenate([model.state for model in models]),
        np.concatenate([model.constants for model in models]),
        np.concatenate([model.placebo for model in models]),
    )


class MomentumModel:
    """The constants to estimate and the momentum equation of one robot.

    Args:
        robot: Free-floating robot with revolute joints.
        minimal: Its minimal set.
        nuisances: Ids of further unknowns (`nuisances.NUISANCES`).

    Attributes:
        size: Number p of constants, in the order [h_W; AAM; x; nuisances].
        aam: Their slice of wheel momentum. x: Their slice of minimal parameters.
        other: Their slice of nuisances.
    """

    def __init__(self, robot: Robot, minimal: MinimalSet, nuisances: tuple[str, ...] = ()) -> None:
        self.tree = BlockTree(robot)
        self.minimal = minimal
        self.robot = robot
        self.n = robot.n_joints
        self.nuisances = Nuisances(nuisances, self.n)
        self._wheels = [(g.body, g.rotation) for g in robot.target_wheels]
        self._h0 = robot.servicer_wheels.body_momentum
        self.n_aam = 3 * len(self._wheels)
        self.aam = slice(3, 3 + self.n_aam)
        self.x = slice(self.aam.stop, self.aam.stop + len(minimal))
        self.size = self.x.stop + self.nuisances.size
        self.other = slice(self.x.stop, self.size)

    def prior(self) -> Array:
        """(p,) constants that the robot file believes in; the total momentum is left zero."""
        x = self.minimal.grouping @ self.tree.parameters()
        others = np.zeros(self.nuisances.size)
        return np.concatenate([np.zeros(3), self.robot.target_momentum, x, others])

    def regressor(self, reference: Kinematics) -> tuple[Array, Array]:
        """Rows of b = A [h_W; AAM; x] in the base frame, exact and linear; nuisances at zero.

        Returns:
            (N, 3, p) coefficients of 0 = R^T h_W - sum R_b h_b - Y x - h0, and (N, 3) right-hand
            side h0.
        """
        moving = _Moving(self.tree, reference)
        h0 = np.broadcast_to(self._h0, (len(reference.time), 3))
        return self._coefficients(moving, np.ones((len(h0), 1, 1))), h0

    def held_jerk(self, trajectory: ReferenceTrajectory, time: Array, constants: Array) -> Array:
        """(N, 3 + n) jerk that held torques make (`torque_hold.held_jerk`), about constants."""
        aam = constants[self.aam].reshape(-1, 3)
        wheels = [(b, R @ h) for (b, R), h in zip(self._wheels, aam, strict=True)]
        pi = self.minimal.lift @ constants[self.x]
        return held_jerk(self.tree, pi, wheels, trajectory, time)

    def linearize(
        self, reference: Kinematics, constants: Array, disturbed: Kinematics | None = None
    ) -> RateErrorModel:
        """Body-rate error of the reference, about given constants (p,).

        Args:
            reference: N times.
            constants: (p,).
            disturbed: The reference with its own error once more, for the placebo columns; without
                it they are zero.
        """
        parts = []
        for start in range(0, len(reference.time), _CHUNK):
            chunk = slice(start, start + _CHUNK)
            other = None if disturbed is None else disturbed.part(chunk)
            parts.append(self._linearize(reference.part(chunk), constants, other))
        return join_models(parts)

    def _linearize(
        self, reference: Kinematics, constants: Array, disturbed: Kinematics | None
    ) -> RateErrorModel:
        moving = _Moving(self.tree, reference)
        time, others = reference.time, constants[self.other]
        left = self.nuisances.decay('target_wheel_drag', others, time)
        h0 = self._h0 * self.nuisances.decay('servicer_wheel_drag', others, time)[:, None]
        columns = self._coefficients(moving, left[:, None, None])
        wheels = -columns[..., self.aam] @ constants[self.aam]
        own = self.nuisances.momentum_columns(time, moving.attitudes, wheels, h0)
        torque = own[..., self.nuisances.linear] @ others[self.nuisances.linear]
        offset = columns[..., : self.x.stop] @ constants[: self.x.stop] - h0 + torque
        columns[..., self.other] = own
        inertia, gradient = self.tree.inertia_gradient(
            moving.rotations, moving.maps, self.minimal.lift @ constants[self.x]
        )
        inverse = np.linalg.inv(inertia[:, :3, :3])
        state = np.empty((len(time), 3, 3 + 2 * self.n))
        # R^T h_W turns with the attitude, the wheels with their links, the rest with D and Dq.
        state[..., :3] = skew(
            offset + h0 + wheels + np.einsum('nab,nb->na', inertia[:, :3], moving.u)
        )
        state[..., 3 : 3 + self.n] = -np.einsum('njab,nb->naj', gradient[:, :, :3], moving.u)
        state[..., 3 : 3 + self.n] -= self._turned_wheels(moving, columns, constants)
        state[..., 3 + self.n :] = -inertia[:, :3, 3:]
        placebo = np.zeros_like(columns)
        if disturbed is not None:
            shifted = self._coefficients(_Moving(self.tree, disturbed), left[:, None, None])
            part = slice(0, self.x.stop)
            placebo[..., part] = inverse @ (shifted - columns)[..., part]
        return RateErrorModel(
            np.einsum('nab,nb->na', inverse, offset),
            inverse @ state,
            inverse @ columns,
            placebo,
        )

    def _turned_wheels(self, moving: _Moving, columns: Array, constants: Array) -> Array:
        """(N, 3, n) derivative of the captured wheels' momentum by the joint positions."""
        out = np.zeros((len(columns), 3, self.n))
        for i, (body, _) in enumerate(self._wheels):
            part = slice(3 + 3 * i, 6 + 3 * i)
            momentum = -columns[..., part] @ constants[part]
            axes = moving.maps[:, body, :, 3:]
            out += np.cross(axes, momentum[:, :, None], axisa=1, axisb=1, axisc=1)
        return out

    def _coefficients(self, moving: _Moving, left: Array) -> Array:
        """(N, 3, p) by the constants, with the share `left` (N, 1, 1) of the wheels' momentum."""
        out = np.zeros((len(moving.u), 3, self.size))
        out[..., :3] = np.swapaxes(moving.attitudes, 1, 2)
        for i, (body, rotation) in enumerate(self._wheels):
            out[..., 3 + 3 * i : 6 + 3 * i] = -left * (moving.rotations[:, body] @ rotation)
        regressor = self.tree.regressor(moving.rotations, moving.maps, moving.u)
        out[..., self.x] = -regressor @ self.minimal.lift
        return out


class _Moving:
    """Kinematics of a reference: what its regressor and its linearisation share."""

    def __init__(self, tree: BlockTree, reference: Kinematics) -> None:
        self.rotations = tree.rotations(reference.q)
        self.maps = tree.rate_maps(self.rotations)
        self.u = np.concatenate([reference.omega, reference.qd], axis=1)
        self.attitudes = reference.matrices
