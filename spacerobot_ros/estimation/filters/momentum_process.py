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

from dataclasses import dataclass, fields

import numpy as np
import scipy

from ...dynamics.blocks import BlockTree
from ...dynamics.rotation import skew
from ...model.robot import Robot
from ...types import Array
from ..trajectory.reference import Kinematics, ReferenceTrajectory
from ..unknowns.minimal import MinimalSet
from ..unknowns.nuisances import Nuisances
from ..unknowns.torque_hold import held_jerk

_CHUNK = (
    512  # times linearized at once; the temporaries take about a kilobyte a time and joint squared
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


class MomentumModel:
    """The constants to estimate and the momentum equation of one robot.

    Args:
        robot: Free-floating robot with revolute joints.
        minimal: Its minimal set.
        nuisances: Ids of further unknowns (see `Nuisances`).

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
        self.nuisances = Nuisances(nuisances, robot)
        self._wheels = [(g.body, g.rotation) for g in robot.target_wheels]
        self._h0 = robot.servicer_wheels.body_momentum
        self.n_aam = 3 * len(self._wheels)
        self.aam = slice(3, 3 + self.n_aam)
        self.x = slice(self.aam.stop, self.aam.stop + len(minimal))
        self.size = self.x.stop + self.nuisances.size
        self.other = slice(self.x.stop, self.size)

    @property
    def names(self) -> tuple[str, ...]:
        """Readable names of [AAM; x]."""
        links = (g.link for g in self.robot.target_wheels)
        return tuple(f'h_{link}_{axis}' for link in links for axis in 'xyz') + self.minimal.names

    def prior(self) -> Array:
        """(p,) constants that the robot file believes in; the total momentum is left zero."""
        x = self.minimal.regrouping @ self.tree.parameters()
        others = np.zeros(self.nuisances.size)
        return np.concatenate([np.zeros(3), self.robot.target_momentum, x, others])

    def regressor(self, reference: Kinematics) -> tuple[Array, Array]:
        """Rows of b = A [h_W; AAM; x] in the base frame, exact and linear; nuisances at zero.

        Returns:
            (N, 3, p) coefficients of 0 = R^T h_W - sum R_b h_b - Y x - h0, and (N, 3) right-hand
            side h0.
        """
        columns = self._coefficients(_Moving(self.tree, reference))
        return columns, np.broadcast_to(self._h0, reference.omega.shape)

    def total_momentum(self, motion: Kinematics, constants: Array) -> Array:
        """(3,) mean of h_W along a motion that all other constants imply [N m s]."""
        columns, h0 = self.regressor(motion)
        momentum = h0 - columns[..., 3:] @ constants[3:]
        return np.asarray(np.mean(motion.rotation.apply(momentum), axis=0))

    def inertia(self, q: Array, constants: Array) -> Array:
        """(N, 3 + n, 3 + n) inertia of [omega_WB_B; q'] at joint positions (N, n) [kg m^2]."""
        rotations = self.tree.rotations(q)
        pi = self.minimal.expansion @ constants[self.x]
        return self.tree.inertia(rotations, self.tree.rate_maps(rotations), pi)

    def held_jerk(
        self, trajectory: ReferenceTrajectory, constants: Array
    ) -> scipy.interpolate.CubicSpline:
        """(3 + n) jerk that held torques make (`torque_hold.held_jerk`), about constants."""
        aam = constants[self.aam].reshape(-1, 3)
        wheels = [(b, R @ h) for (b, R), h in zip(self._wheels, aam, strict=True)]
        return held_jerk(self.tree, self.minimal.expansion @ constants[self.x], wheels, trajectory)

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
        return self.linearize_again(self.regressed(reference, disturbed), constants)

    def regressed(
        self, reference: Kinematics, disturbed: Kinematics | None = None
    ) -> list[Regressed]:
        """What `linearize` needs of a reference whatever the constants, in chunks of times."""
        chunks = []
        for start in range(0, len(reference.time), _CHUNK):
            part = reference.part(slice(start, start + _CHUNK))
            moving = _Moving(self.tree, part)
            columns, off = self._coefficients(moving), None
            if disturbed is not None:
                other = _Moving(self.tree, disturbed.part(slice(start, start + _CHUNK)))
                off = (self._coefficients(other) - columns)[..., : self.x.stop]
            chunks.append(Regressed(part, moving, columns, off))
        return chunks

    def linearize_again(self, chunks: list[Regressed], constants: Array) -> RateErrorModel:
        """`linearize` of what was `regressed`, about other constants."""
        parts = [self._linearize(chunk, constants) for chunk in chunks]
        names = [each.name for each in fields(RateErrorModel)]
        return RateErrorModel(*(np.concatenate([getattr(p, n) for p in parts]) for n in names))

    def _linearize(self, chunk: Regressed, constants: Array) -> RateErrorModel:
        reference, moving, columns = chunk.reference, chunk.moving, chunk.columns.copy()
        added, by_aam = self._imbalance(reference, constants, columns)
        columns[..., self.aam] += by_aam
        known = columns[..., : self.x.stop] @ constants[: self.x.stop]
        offset = known - self._h0 + added
        external = self.other.start + np.flatnonzero(self.nuisances.is_external)
        total = columns[..., :3] @ constants[:3] + columns[..., external] @ constants[external]
        pi = self.minimal.expansion @ constants[self.x]
        inertia, changes = self.tree.inertia_turned(moving.rotations, moving.maps, pi, moving.u)
        inverse = np.linalg.inv(inertia[:, :3, :3])
        state = np.empty((len(offset), 3, 3 + 2 * self.n))
        # R^T h_W turns with the attitude, the wheels with their links, the rest with D and Dq.
        state[..., :3] = skew(total)
        state[..., 3 : 3 + self.n] = -np.swapaxes(changes[..., :3], 1, 2)
        state[..., 3 : 3 + self.n] -= self._turned_wheels(moving, columns, constants)
        state[..., 3 + self.n :] = -inertia[:, :3, 3:]
        placebo = np.zeros_like(columns)
        if chunk.off is not None:
            placebo[..., : self.x.stop] = inverse @ chunk.off
        return RateErrorModel(
            np.einsum('nab,nb->na', inverse, offset),
            inverse @ state,
            inverse @ columns,
            placebo,
        )

    def _imbalance(
        self, reference: Kinematics, constants: Array, columns: Array
    ) -> tuple[Array, Array]:
        """What nuisances add to the balance beside the wheels, and by the wheels' momentum.

        Sets the nuisances' own `columns`. What effects take of the wheels' momentum is linear in
        it: unit momenta tell it.

        Returns:
            (N, 3) and (N, 3, 3 n_links).
        """
        nuisances, values = self.nuisances, constants[self.other]
        by_aam = np.zeros((len(columns), 3, self.n_aam))
        if not nuisances.acts_on_momentum:
            return np.zeros((len(columns), 3)), by_aam
        aam = constants[self.aam]
        columns[..., self.other] = nuisances.imbalance(values, reference, aam)[1]
        rest = nuisances.imbalance(values, reference, np.zeros(self.n_aam))[0]
        for i, unit in enumerate(np.eye(self.n_aam)):
            by_aam[..., i] = nuisances.imbalance(values, reference, unit)[0] - rest
        return rest, by_aam

    def _turned_wheels(self, moving: _Moving, columns: Array, constants: Array) -> Array:
        """(N, 3, n) derivative of the captured wheels' momentum by the joint positions."""
        out = np.zeros((len(columns), 3, self.n))
        for i, (body, _) in enumerate(self._wheels):
            part = slice(3 + 3 * i, 6 + 3 * i)
            momentum = -columns[..., part] @ constants[part]
            axes = moving.maps[:, body, :, 3:]
            out += np.cross(axes, momentum[:, :, None], axisa=1, axisb=1, axisc=1)
        return out

    def _coefficients(self, moving: _Moving) -> Array:
        """(N, 3, p) by the constants; zero by the nuisances."""
        out = np.zeros((len(moving.u), 3, self.size))
        out[..., :3] = np.swapaxes(moving.attitudes, 1, 2)
        for i, (body, rotation) in enumerate(self._wheels):
            out[..., 3 + 3 * i : 6 + 3 * i] = -moving.rotations[:, body] @ rotation
        regressor = self.tree.regressor(moving.rotations, moving.maps, moving.u)
        out[..., self.x] = -regressor @ self.minimal.expansion
        return out


class _Moving:
    """Kinematics of a reference: what its regressor and its linearization share."""

    def __init__(self, tree: BlockTree, reference: Kinematics) -> None:
        self.rotations = tree.rotations(reference.q)
        self.maps = tree.rate_maps(self.rotations)
        self.u = np.concatenate([reference.omega, reference.qd], axis=1)
        self.attitudes = reference.matrices


@dataclass(frozen=True, slots=True, eq=False)
class Regressed:
    """The momentum equation along a reference, before anything is said of the constants.

    Args:
        reference: N times.
        moving: Its kinematics.
        columns: (N, 3, p) of the equation by the constants; zero by the nuisances.
        off: (N, 3, p - nuisances) by which those of the disturbed reference differ; None without.
    """

    reference: Kinematics
    moving: _Moving
    columns: Array
    off: Array | None
