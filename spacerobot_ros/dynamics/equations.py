r"""Equations of motion of a tree of bodies with spinning wheels.

Forward dynamics are compiled (`aba`), all else is on top of Pinocchio.

A gyrostat on body b carries the relative momentum h_b, constant in the body's frame. It changes
neither the mass matrix nor the kinetic energy of the locked system; it adds the angular momentum
R_Wb h_b and the torque -omega_b x h_b on its body (docs/equations.md, section 2). That torque
loads every joint between the body and the base: the term that the printed joint equations of the
identification paper lack,

    Dq^T w0' + Dqq q'' + c2 + F_b^T (w_b x R_0b h_b) = tau

True rotors are joints of the tree like any other and need no such term.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from ..model.robot import Robot
from ..types import Array, IntArray, Matrix3, Vector3, Vector6
from . import aba
from .rotation import skew
from .state import State
from .tree import machine_of


@dataclass(frozen=True, slots=True, eq=False)
class ReducedEquation:
    """Joint equation with the base eliminated: H(q) q'' + c = tau.

    Args:
        H: (n, n) reduced inertia [kg m^2].
        c: (n,) velocity-dependent and gravity torques [N m].
    """

    H: Array
    c: Array


@dataclass(frozen=True, slots=True, eq=False)
class InertiaBlocks:
    """Angular momentum map about the system's centre of mass, in base coordinates.

        h = D omega_WB_B + Dq q'                      # eqs. (3), (19) of the identification paper
        H = Dqq - Dq^T D^-1 Dq

    Args:
        D: (3, 3). Dq: (3, n). Dqq: (n, n), all [kg m^2].
    """

    D: Matrix3
    Dq: Array
    Dqq: Array


class Dynamics:
    """Forward and inverse dynamics, momentum and energy of one robot.

    Joint vectors are in the order of `robot.joints`; the base force and torque act at the base
    origin in base coordinates. Keeps scratch memory, so one object serves one thread.

    Args:
        robot: The robot.
        joint_reaction: False drops the wheels' torque from the joint equations and keeps it in the
            base's: eqs. (16) to (20) as the identification paper prints them. For comparison only;
            no such machine exists.
    """

    def __init__(self, robot: Robot, *, joint_reaction: bool = True) -> None:
        self.robot = robot
        self._joint_reaction = joint_reaction
        self.machine = machine_of(robot, joint_reaction)
        self._model = robot.pin_model
        self._data = self._model.createData()
        self._n = robot.n_joints
        self._base_dim = 6 if robot.is_free else 0
        order = robot.velocity_indices
        in_order = bool(np.array_equal(order, np.arange(self._n)))
        self._order: slice | IntArray = slice(0, self._n) if in_order else order
        # The joints' places in Pinocchio's velocity, behind the base.
        base = self._base_dim
        self._joints: slice | IntArray = slice(base, base + self._n) if in_order else base + order
        self._wheels = _wheels_by_joint(robot)
        self._external = pin.StdVec_Force([pin.Force.Zero() for _ in range(self._model.njoints)])
        self._x, self._tau = np.zeros(13 + 2 * self._n), np.zeros(self._n)
        self._wrench = np.zeros(6)
        # Views into Pinocchio's memory, which lives as long as this object. A wheel's
        # torque is -omega x h = skew(h) @ omega.
        self._wheel_views = [
            (skew(h), self._data.v[joint].angular, self._external[joint].angular)
            for joint, h in self._wheels
        ]

    def rate(self, x: Array, tau: Array, base_wrench: Vector6 | None = None) -> Array:
        """Time derivative of the state vector.

        Args:
            x: (13 + 2 n,) state as `State.to_vector`; the quaternion is normalised before use.
            tau: (n,) joint torques [N m].
            base_wrench: (6,) [force; torque] on the base in base coordinates [N, N m]; ignored for
                a fixed base.

        Returns:
            (13 + 2 n,) rate; the quaternion is integrated by its own rate, which keeps momentum to
            the order of the integrator.
        """
        out = np.empty(13 + 2 * self._n)
        aba.rate(self.machine, *self.inputs(x, tau, base_wrench), out)
        return out

    def inputs(
        self, x: Array, tau: Array, base_wrench: Vector6 | None = None
    ) -> tuple[Array, Array, Vector6]:
        """State, torques and wrench as the compiled functions take them.

        Copies into memory of this object, which the next call overwrites: whatever their types
        and layouts, the compiled functions see one, and lengths are checked.
        """
        self._x[:] = x
        self._tau[:] = tau
        self._wrench[:] = 0.0 if base_wrench is None else base_wrench
        return self._x, self._tau, self._wrench

    def inverse(
        self, state: State, base_acceleration: Vector6, qdd: Array
    ) -> tuple[Vector6, Array]:
        """Base wrench and joint torques that produce an acceleration.

        Args:
            state: Configuration and velocity.
            base_acceleration: (6,) time derivative of [v_WB_B; omega_WB_B]; ignored for a fixed
                base.
            qdd: (n,) joint accelerations [rad/s^2].

        Returns:
            (6,) [force; torque] on the base in base coordinates (zero for a fixed base), and (n,)
            joint torques.
        """
        q_pin, v_pin = self._to_pin(state.to_vector())
        a_pin = np.zeros(self._base_dim + self._n)
        a_pin[: self._base_dim] = base_acceleration[: self._base_dim]
        a_pin[self._joints] = qdd
        force = pin.rnea(
            self._model, self._data, q_pin, v_pin, a_pin, self._wheel_forces(q_pin, v_pin)
        )
        base = force[:6].copy() if self._base_dim else np.zeros(6)
        return base, force[self._joints].copy()

    def mass_matrix(self, q: Array) -> Array:
        """(6 + n, 6 + n) inertia, base [linear; angular] first; (n, n) for a fixed base."""
        M = pin.crba(self._model, self._data, self._configuration(_AT_ORIGIN, q))
        M = np.triu(M) + np.triu(M, 1).T
        if isinstance(self._order, slice):
            return M
        order = np.concatenate([np.arange(self._base_dim), self._base_dim + self._order])
        return M[np.ix_(order, order)]

    def reduced(self, state: State) -> ReducedEquation:
        """Joint equation with the unactuated base eliminated.

        Eqs. (18)-(20) of the identification paper, with the joint term that they lack.
        """
        M = self.mass_matrix(state.q)
        base_bias, joint_bias = self.inverse(state, np.zeros(6), np.zeros(self._n))
        if not self._base_dim:
            return ReducedEquation(M, joint_bias)
        coupling = np.linalg.solve(M[:6, :6], np.column_stack([M[:6, 6:], base_bias]))
        return ReducedEquation(
            M[6:, 6:] - M[6:, :6] @ coupling[:, :-1], joint_bias - M[6:, :6] @ coupling[:, -1]
        )

    def inertia_blocks(self, q: Array) -> InertiaBlocks:
        """D, Dq and Dqq at joint positions q; only for a free base."""
        M = self.mass_matrix(q)
        rest = M[3:, 3:] - M[3:, :3] @ np.linalg.solve(M[:3, :3], M[:3, 3:])
        return InertiaBlocks(rest[:3, :3], rest[:3, 3:], rest[3:, 3:])

    def momentum(self, state: State) -> Vector6:
        """Total momentum, wheels included.

        Returns:
            (6,) [linear (N s); angular about the system's centre of mass (N m s)] in the inertial
            frame.
        """
        q_pin, v_pin = self._to_pin(state.to_vector())
        total = np.array(
            pin.computeCentroidalMomentum(self._model, self._data, q_pin, v_pin).vector
        )
        for joint, momentum in self._wheels:
            total[3:] += self._data.oMi[joint].rotation @ momentum
        return total

    def energy(self, state: State) -> tuple[float, float]:
        """Kinetic energy without the gyrostats' constant part, and potential energy [J]."""
        q_pin, v_pin = self._to_pin(state.to_vector())
        # Pinocchio 4.1's own kinetic energy forgets the motors of joints about skew axes.
        upper = np.triu(pin.crba(self._model, self._data, q_pin))
        kinetic = v_pin @ upper @ v_pin - 0.5 * v_pin @ (np.diag(upper) * v_pin)
        potential = pin.computePotentialEnergy(self._model, self._data, q_pin)
        return float(kinetic), float(potential)

    def body_position(self, state: State, body: int, point: Vector3) -> Vector3:
        """(3,) position in the base frame of a point given in a body's frame [m]."""
        q_pin, _ = self._to_pin(state.to_vector())
        pin.forwardKinematics(self._model, self._data, q_pin)
        base, link = (self._data.oMi[self.robot.pin_joint_ids[b]] for b in (0, body))
        return np.array(base.actInv(link).act(np.asarray(point, dtype=float)))

    def at_rest_centre(self, state: State) -> State:
        """The same state with the base velocity that keeps the system's centre of mass at rest."""
        if not self._base_dim:
            return state
        M = self.mass_matrix(state.q)
        v = -np.linalg.solve(M[:3, :3], M[:3, 3:] @ np.concatenate([state.omega_WB_B, state.qd]))
        return State(state.p_WB, state.q_WB_xyzw, state.q, v, state.omega_WB_B, state.qd)

    def _to_pin(self, x: Array) -> tuple[Array, Array]:
        """Pinocchio's configuration and velocity of a state vector, quaternion normalised."""
        n = self._n
        q_pin = self._configuration(x[:7], x[7 : 7 + n])
        if isinstance(self._order, slice):
            return q_pin, x[13 + n - self._base_dim :]
        v_pin = np.empty(self._base_dim + n)
        v_pin[: self._base_dim] = x[7 + n : 7 + n + self._base_dim]
        v_pin[self._joints] = x[13 + n :]
        return q_pin, v_pin

    def _configuration(self, pose: Array, q: Array) -> Array:
        n = self._n
        if not self._base_dim:
            q_pin = np.empty(n)
            q_pin[self._order] = q
            return q_pin
        q_pin = np.empty(7 + n)
        q_pin[:7] = pose
        attitude = q_pin[3:7]
        attitude /= math.sqrt(attitude @ attitude)
        q_pin[7:][self._order] = q
        return q_pin

    def _wheel_forces(self, q_pin: Array, v_pin: Array) -> pin.StdVec_Force:
        """Torque of the wheels on each of Pinocchio's joints, in its frame."""
        if not self._wheels:
            return self._external
        pin.forwardKinematics(self._model, self._data, q_pin, v_pin)
        if self._joint_reaction:
            for matrix, omega, torque in self._wheel_views:
                np.dot(matrix, omega, out=torque)
            return self._external
        base = self.robot.pin_joint_ids[0]
        total = np.zeros(3)
        for (joint, _), (matrix, omega, _) in zip(self._wheels, self._wheel_views, strict=True):
            total += self._data.oMi[joint].rotation @ (matrix @ omega)
        self._external[base].angular = self._data.oMi[base].rotation.T @ total
        return self._external


_AT_ORIGIN = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def _wheels_by_joint(robot: Robot) -> list[tuple[int, Vector3]]:
    """Pinocchio joint and momentum in its frame, one entry a body that carries gyrostats."""
    momenta: dict[int, Vector3] = {}
    for g in robot.gyrostats:
        if g.momentum.any() and (robot.is_free or g.body > 0):
            joint = robot.pin_joint_ids[g.body]
            momenta[joint] = momenta.get(joint, np.zeros(3)) + g.body_momentum
    return list(momenta.items())
