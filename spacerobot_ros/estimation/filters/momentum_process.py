r"""The momentum equation, linear about a measured reference trajectory and about given bodies.

With the attitude R = R_ref exp(dphi) and u = [w; q'], conservation of the total momentum h_W says

    R (A(q) u + h0 + sum_b R_b h_b) = h_W          A = [D, Dq]

so a reference that misses by e = R_ref^T h_W - A u_ref - h0 - sum_b R_b h_b has the rate error dw
= D^-1 (e + E z + V t) to first order in the state errors z = [dphi; dq; dq'] and in the errors t
of the constants: the momenta, in which it is linear, and the coordinates y of the bodies
(`body_coordinates`), in which it is not. D depends on z and t, too, so E and V are those at the
rate w_ref + D^-1 e that conserves momentum: taken at w_ref, whose noise e is made of, they would
be noise that agrees with the data. The reference comes from the data (splines), not from the
constants, so wrong constants do not bend it.

The filter's constants have the minimal parameters x(y) in place of y: momentum is linear in them,
so what is told of them stays right wherever the bodies turn out to be. Arms of many joints have
fewer inertial parameters than these; momentum is linear in them but for the whole's centre of
mass.

Symbols: N times, n joints, m coordinates, p = 3 + 3 n_links + m + nuisances constants; of the
filter g are as many with x, or the inertial parameters, in place of y.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from ...dynamics.angular_momentum import AngularMomentum, angular_momentum
from ...dynamics.blocks import check_momentum
from ...dynamics.rotation import skew
from ...dynamics.tree import Records, tree_of
from ...model.robot import Robot
from ...types import Array
from ..trajectory.reference import Kinematics
from ..unknowns.body_coordinates import BodyCoordinates
from ..unknowns.minimal import minimal_regressor, minimal_set
from ..unknowns.nuisances import Nuisances

_MOST_MINIMAL = 8
"""Joints up to which the filter tells minimal parameters, (n + 2)(2n + 3) of them: with more there
are twice as many as inertial parameters, ten a body, and a pass takes as much longer."""


@dataclass(frozen=True, slots=True, eq=False)
class RateErrorModel:
    """Body-rate error dw = offset + state @ z + constants @ t at N times.

    Args:
        offset: (N, 3) [rad/s].
        state: (N, 3, 3 + 2 n) by z = [dphi; q - q_ref; q' - q'_ref].
        constants: (N, 3, g) by the errors of the filter's constants.
    """

    offset: Array
    state: Array
    constants: Array


class MomentumModel:
    """The constants to estimate and the momentum equation of one robot.

    Args:
        robot: Free-floating robot.
        structure: Of its bodies, `generic` or `symmetric` (`BodyCoordinates`).
        nuisances: Ids of further unknowns (see `Nuisances`).

    Attributes:
        bodies: Coordinates of the bodies.
        size: Number p of constants, in the order [h_W; AAM; y; nuisances].
        aam: Their slice of wheel momentum. y: Their slice of bodies.
        other: Their slice of nuisances.
        filter_size: Number g of the filter's constants, in the same order.
        filter_bodies: Their slice of bodies. filter_other: Their slice of nuisances.

    Raises:
        ConfigurationError: fixed base.
    """

    def __init__(self, robot: Robot, structure: str, nuisances: tuple[str, ...] = ()) -> None:
        check_momentum(robot)
        self.robot, self.structure = robot, structure
        self.bodies = BodyCoordinates(robot, structure)
        self.n = robot.n_joints
        self.nuisances = Nuisances(nuisances, robot)
        self._wheels = [(g.body, g.rotation) for g in robot.target_wheels]
        self._h0 = robot.servicer_wheels.body_momentum
        self._moves = robot.moves
        self.n_aam = 3 * len(self._wheels)
        self.aam = slice(3, 3 + self.n_aam)
        self.y = slice(self.aam.stop, self.aam.stop + self.bodies.size)
        self.size = self.y.stop + self.nuisances.size
        self.other = slice(self.y.stop, self.size)
        self._minimal = minimal_set(robot, structure) if self.n <= _MOST_MINIMAL else None
        has_mass = [body.mass > 0.0 for body in robot.bodies]
        self._inertial = np.flatnonzero(np.repeat(has_mass, 10))
        count = len(self._inertial if self._minimal is None else self._minimal)
        self.filter_bodies = slice(self.y.start, self.y.start + count)
        self.filter_size = self.filter_bodies.stop + self.nuisances.size
        self.filter_other = slice(self.filter_bodies.stop, self.filter_size)

    @property
    def is_minimal(self) -> bool:
        """Whether the filter tells minimal parameters, in which momentum is linear."""
        return self._minimal is not None

    def filtered(self, constants: Array) -> Array:
        """(g,) the filter's constants for constants (p,)."""
        bodies = self.told_of(constants[self.y])
        return np.concatenate([constants[: self.y.start], bodies, constants[self.other]])

    def told_of(self, y: Array) -> Array:
        """(k,) what the filter tells of bodies at coordinates (m,)."""
        if self._minimal is None:
            return self.bodies.rows(y).ravel()[self._inertial]
        return self._minimal.of_bodies(*self.bodies.bodies(y))

    def told_slopes(self, y: Array) -> Array:
        """(k, m) derivatives of `told_of`."""
        if self._minimal is None:
            slopes = scipy.linalg.block_diag(*self.bodies.slopes(y))
            return np.asarray(slopes[np.ix_(self._inertial, self.bodies.free.ravel())])
        return self.bodies.derivatives(self._minimal.of_bodies, y)

    def stepped(self, y: Array, step: Array) -> Array:
        """(m,) coordinates after a step (m,), see `BodyCoordinates.stepped`."""
        return self.bodies.stepped(y, step)

    def prior(self) -> Array:
        """(p,) constants that the robot file believes in; the total momentum is left zero."""
        out = np.zeros(self.size)
        out[self.aam] = self.robot.target_momentum
        return out

    def robot_at(self, constants: Array) -> Robot:
        """The robot whose bodies and captured wheels are those of constants (p,)."""
        robot = self.bodies.robot(constants[self.y])
        return robot.with_target_momentum(constants[self.aam])

    def balance(self, motion: Kinematics, constants: Array) -> tuple[Array, Array]:
        """Momentum that is missing along a motion, nuisances at zero, and its derivatives.

        Returns:
            (N, 3) R^T h_W - A u - h0 - sum R_b h_b in the base frame, and (N, 3, p) its
            derivatives by the constants.
        """
        moving = self._moving(motion, constants)
        missing, by_momenta = self._by_momenta(motion, moving, constants)
        columns = np.zeros((len(missing), 3, self.size))
        columns[..., : self.y.start] = by_momenta
        columns[..., self.y] = -self._by_bodies(moving, constants)
        return missing, columns

    def total_momentum(self, motion: Kinematics, constants: Array) -> Array:
        """(3,) mean of h_W along a motion that all other constants imply [N m s]."""
        others = constants.copy()
        others[:3] = 0.0
        missing, _ = self._by_momenta(motion, self._moving(motion, others), others)
        return np.asarray(np.mean(motion.rotation.apply(-missing), axis=0))

    def joint_share(self, motion: Kinematics, constants: Array) -> float:
        """Largest angular momentum that the joints' motion alone has, Dq q' [N m s]."""
        inertia = self._moving(motion, constants).inertia[:, :, 3:]
        share = np.einsum('naj,nj->na', inertia, motion.qd)
        return float(np.max(np.linalg.norm(share, axis=1), initial=0.0))

    def linearize(
        self, reference: Kinematics, constants: Array, *, is_near: bool = True
    ) -> RateErrorModel:
        """Body-rate error of the reference, about given constants (p,).

        Args:
            reference: N times.
            constants: (p,).
            is_near: Whether they are near enough for the rates that conserve momentum with them;
                otherwise E and V are those at the measured rates.
        """
        moving = self._moving(reference, constants)
        missing, by_momenta = self._by_momenta(reference, moving, constants)
        columns = np.zeros((len(missing), 3, self.filter_size))
        columns[..., : self.y.start] = by_momenta
        if self.nuisances.acts_on_momentum:
            values = constants[self.other], reference, constants[self.aam]
            added, columns[..., self.filter_other], by_aam = self.nuisances.imbalance(*values)
            missing += added
            columns[..., self.aam] += by_aam
        inverse = np.linalg.inv(moving.inertia[:, :, :3])
        offset = np.einsum('nab,nb->na', inverse, missing)
        if is_near:
            reference = replace(reference, omega=reference.omega + offset)
            moving = self._moving(reference, constants)
        if self._minimal is None:
            columns[..., self.filter_bodies] = -moving.by_bodies[..., self._inertial]
        else:
            columns[..., self.filter_bodies] = -minimal_regressor(self._minimal, reference)
        external = np.flatnonzero(self.nuisances.is_external)
        by_external = columns[..., self.filter_other.start + external]
        total = columns[..., :3] @ constants[:3]
        total += by_external @ constants[self.other.start + external]
        state = np.empty((len(offset), 3, 3 + 2 * self.n))
        # R^T h_W turns with the attitude, the wheels with their links, the rest with D and Dq.
        state[..., :3] = skew(total)
        state[..., 3 : 3 + self.n] = -moving.by_joints
        state[..., 3 : 3 + self.n] -= self._turned_wheels(moving, columns, constants)
        state[..., 3 + self.n :] = -moving.inertia[:, :, 3:]
        return RateErrorModel(offset, inverse @ state, inverse @ columns)

    def _moving(self, motion: Kinematics, constants: Array) -> AngularMomentum:
        q, omega, qd = (np.ascontiguousarray(x) for x in (motion.q, motion.omega, motion.qd))
        return AngularMomentum(*angular_momentum(self._tree(constants), q, omega, qd))

    def _tree(self, constants: Array) -> Records:
        tree = tree_of(self.robot).copy()
        tree['inertial'] = self.bodies.rows(constants[self.y])[tree['number']]
        return tree

    def _by_momenta(
        self, motion: Kinematics, moving: AngularMomentum, constants: Array
    ) -> tuple[Array, Array]:
        """Momentum that is missing (N, 3), and its derivatives by [h_W; AAM] alone."""
        columns = np.empty((len(motion.time), 3, self.y.start))
        columns[..., :3] = np.swapaxes(motion.matrices, 1, 2)
        for i, (body, rotation) in enumerate(self._wheels):
            columns[..., 3 + 3 * i : 6 + 3 * i] = -moving.rotations[:, body] @ rotation
        momenta = columns @ constants[: self.y.start]
        return momenta - moving.momentum - self._h0, columns

    def _by_bodies(self, moving: AngularMomentum, constants: Array) -> Array:
        """(N, 3, m) derivative of the bodies' momentum by their coordinates."""
        slopes = self.bodies.slopes(constants[self.y])
        by_rows = moving.by_bodies.reshape(-1, len(slopes), 10)
        by_coordinates = np.moveaxis(np.moveaxis(by_rows, 1, 0) @ slopes, 0, 1)
        return by_coordinates[:, self.bodies.free].reshape(len(moving.momentum), 3, -1)

    def _turned_wheels(self, moving: AngularMomentum, columns: Array, constants: Array) -> Array:
        """(N, 3, n) derivative of the captured wheels' momentum by the joint positions."""
        out = np.zeros((len(columns), 3, self.n))
        for i, (body, _) in enumerate(self._wheels):
            part = slice(3 + 3 * i, 6 + 3 * i)
            momentum = -columns[..., part] @ constants[part]
            axes = np.swapaxes(moving.axes * self._moves[:, body, None], 1, 2)
            out += np.cross(axes, momentum[:, :, None], axisa=1, axisb=1, axisc=1)
        return out
