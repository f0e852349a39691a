r"""Equations of motion of a tree of bodies with spinning wheels.

One state at a time, on the compiled recursions of this folder (`aba`, `rnea`, `crba`).

A gyrostat on body b carries the relative momentum h_b, constant in the body's frame. It changes
neither the mass matrix nor the kinetic energy of the locked system; it adds the angular momentum
R_Wb h_b and the torque -omega_b x h_b on its body (docs/equations.md, section 2). That torque
loads every joint between the body and the base: the term that the printed joint equations of the
identification paper lack,

    Dq^T w0' + Dqq q'' + c2 + F_b^T (w_b x R_0b h_b) = tau

True rotors are joints of the tree like any other and need no such term.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.robot import Robot
from ..types import Array, Matrix3, Vector3, Vector6
from .aba import aba, robot_records
from .crba import crba
from .forward_kinematics import BodyKinematics, body_accelerations, forward_kinematics
from .reduction import ReducedEquation, equation_of_motion, reduced
from .rnea import rnea
from .rotation import cross, rotation_matrix, skew
from .state import State
from .tree import tree_of

_NONE = np.zeros(3)


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
        self.robot, n = robot, robot.n_joints
        self.machine = robot_records(robot, joint_reaction)
        self._tree, self._n, self._joint_reaction = tree_of(robot), n, joint_reaction
        self._first = 0 if robot.is_free else 6
        self._still = self._tree.copy()  # with its wheels stopped
        self._still['wheels'] = 0.0
        in_order = self._tree[np.argsort(self._tree['number'])]
        self._rows, self._wheels = in_order['inertial'], in_order['wheels']
        self._motors, self._mass = in_order['motor'][1:], float(np.sum(self._rows[:, 0]))
        self._inertias = spatial_inertias(self._rows)
        self._trees = self._tree, self._tree if joint_reaction else self._still
        self._one = np.zeros((1, n)), np.zeros((1, 6 + n)), np.zeros((1, 6 + n))
        self._buffers = np.zeros((1, 13 + 2 * n)), (np.zeros((1, n)), np.zeros((1, 6)))
        self._x, self._tau, self._wrench = (b[0] for b in (self._buffers[0], *self._buffers[1]))

    def rate(self, x: Array, tau: Array, base_wrench: Vector6 | None = None) -> Array:
        """Time derivative of the state vector.

        Args:
            x: (13 + 2 n,) state as `State.to_vector`; the quaternion is normalized before use.
            tau: (n,) joint torques [N m].
            base_wrench: (6,) [force; torque] on the base in base coordinates [N, N m]; ignored for
                a fixed base.

        Returns:
            (13 + 2 n,) rate; the quaternion is integrated by its own rate, which keeps momentum to
            the order of the integrator.
        """
        out = np.empty((1, 13 + 2 * self._n))
        state, held = self.inputs(x, tau, base_wrench)
        aba(self.machine, state, *held, out)
        return out[0]

    def inputs(
        self, x: Array, tau: Array, base_wrench: Vector6 | None = None
    ) -> tuple[Array, tuple[Array, Array]]:
        """State, and torques and wrench, as the compiled functions take them: (1, ...) each.

        Copies into memory of this object, which the next call overwrites: whatever their types
        and layouts, the compiled functions see one, and lengths are checked.
        """
        self._x[:], self._tau[:] = x, tau
        self._wrench[:] = 0.0 if base_wrench is None else base_wrench
        return self._buffers

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
        kinematics, joints = self._kinematics(state), np.array([qdd], dtype=float)
        acceleration = np.concatenate([[base_acceleration], joints], axis=1)
        acceleration[0, :3] += self._lift(state)
        accelerations = body_accelerations(self._tree, kinematics, acceleration)
        force = rnea(self._tree, kinematics, accelerations, joints)[0]
        if not self._joint_reaction:
            force[6:] = rnea(self._still, kinematics, accelerations, joints)[0, 6:]
        return force[:6], force[6:]

    def _lift(self, state: State) -> Vector3:
        """(3,) acceleration for gravity, which RNEA takes in base coordinates [m/s^2]."""
        g = self.robot.gravity
        if not (self.robot.is_free and g.any()):
            return _NONE
        return np.asarray(g - rotation_matrix(state.q_WB_xyzw).T @ g)

    def mass_matrix(self, q: Array) -> Array:
        """(6 + n, 6 + n) inertia, base [linear; angular] first; (n, n) for a fixed base."""
        M = crba(self._tree, self._at(q, np.zeros(6 + self._n)))
        return np.asarray(M[0, self._first :, self._first :])

    def reduced(self, state: State) -> ReducedEquation:
        """Joint equation with the unactuated base eliminated.

        Eqs. (18)-(20) of the identification paper, with the joint term that they lack.
        """
        q, rates, acceleration = self._one
        q[0], rates[0, :3], rates[0, 3:6] = state.q, state.v_WB_B, state.omega_WB_B
        rates[0, 6:], acceleration[0, :3] = state.qd, self._lift(state)
        equation = equation_of_motion(self._trees, q, rates, acceleration)
        if self._first:
            return ReducedEquation(equation[6:, 6:-1], equation[6:, -1])
        return reduced(equation, 6)[0]

    def momentum(self, state: State) -> Vector6:
        """Total momentum, wheels included.

        Returns:
            (6,) [linear (N s); angular about the system's centre of mass (N m s)] in the inertial
            frame.
        """
        k = self._kinematics(state)
        own = self._momenta(k)
        own[:, 3:] += self._wheels
        parts = own.reshape(-1, 2, 3) @ np.swapaxes(k.rotations[0], 1, 2)
        W = k.origins[0].T @ parts[:, 0]  # its skew part is the sum of r x p
        total, angular = parts.sum(axis=0)
        angular += [W[1, 2] - W[2, 1], W[2, 0] - W[0, 2], W[0, 1] - W[1, 0]]
        angular -= cross(self._centre(k), total)
        return np.asarray((np.array([total, angular]) @ self._attitude(state).T).ravel())

    def energy(self, state: State) -> tuple[float, float]:
        """Kinetic energy without the gyrostats' constant part, and potential energy [J]."""
        k = self._kinematics(state)
        doubled = np.vdot(self._momenta(k), k.twists[0]) + state.qd**2 @ self._motors
        position = self._attitude(state) @ self._centre(k)
        if self.robot.is_free:
            position = position + state.p_WB
        return 0.5 * float(doubled), float(-self._mass * position @ self.robot.gravity)

    def body_position(self, state: State, body: int, point: Vector3) -> Vector3:
        """(3,) position in the base frame of a point given in a body's frame [m]."""
        k = self._kinematics(state)
        return np.asarray(k.origins[0, body] + k.rotations[0, body] @ np.asarray(point))

    def at_rest_centre(self, state: State) -> State:
        """The same state with the base velocity that keeps the system's centre of mass at rest."""
        if not self.robot.is_free:
            return state
        M, rates = self.mass_matrix(state.q), np.concatenate([state.omega_WB_B, state.qd])
        return replace(state, v_WB_B=-M[:3, 3:] @ rates / M[0, 0])

    def _kinematics(self, state: State) -> BodyKinematics:
        rates = np.concatenate([state.v_WB_B, state.omega_WB_B, state.qd])
        return self._at(state.q, rates)

    def _at(self, q: Array, rates: Array) -> BodyKinematics:
        positions, rates = np.array([q], dtype=float), np.array([rates], dtype=float)
        return forward_kinematics(self._tree, positions, rates, rates[:, 6:].copy())

    def _momenta(self, kinematics: BodyKinematics) -> Array:
        """(n + 1, 6) momentum of every body without its wheels, in its frame."""
        return np.asarray((self._inertias @ kinematics.twists[0][..., None])[..., 0])

    def _centre(self, kinematics: BodyKinematics) -> Vector3:
        """(3,) centre of mass in base coordinates."""
        moments = (kinematics.rotations[0] @ self._rows[:, 1:4, None])[..., 0].sum(axis=0)
        return np.asarray((moments + self._rows[:, 0] @ kinematics.origins[0]) / self._mass)

    def _attitude(self, state: State) -> Matrix3:
        return rotation_matrix(state.q_WB_xyzw) if self.robot.is_free else np.eye(3)


def joint_torques(robot: Robot, q: Array, qd: Array, qdd: Array, omega: Array) -> Array:
    """(N, n) joint torques that motions of the joints need; a free base gives way.

    Args:
        robot: The robot.
        q: (N, n) joint positions.
        qd: (N, n) joint rates.
        qdd: (N, n) joint accelerations.
        omega: (N, 3) omega_WB_B; zero for a fixed base [rad/s].
    """
    tree = tree_of(robot)
    q, qd, qdd = (np.ascontiguousarray(x, dtype=float) for x in (q, qd, qdd))
    rates, acceleration = np.zeros((2, len(q), 6 + robot.n_joints))
    rates[:, 3:6], rates[:, 6:], acceleration[:, 6:] = omega, qd, qdd
    kinematics = forward_kinematics(tree, q, rates, qd)
    force = rnea(tree, kinematics, body_accelerations(tree, kinematics, acceleration), qdd)
    if not robot.is_free:
        return np.asarray(force[:, 6:])
    M = crba(tree, kinematics)
    base = np.linalg.solve(M[:, :6, :6], force[:, :6, None])
    return np.asarray(force[:, 6:] - (M[:, 6:, :6] @ base)[..., 0])


def without_translation(M: Array) -> Array:
    """(..., 3 + n, 3 + n) inertia of [omega; q'] with the base's translation eliminated.

    [[D, Dq], [Dq^T, Dqq]]: the angular momentum about the centre of mass is D omega + Dq q', eqs.
    (3), (19) of the identification paper.
    """
    linear = M[..., :3, 3:] / M[..., :1, :1]
    return np.asarray(M[..., 3:, 3:] - np.swapaxes(M[..., :3, 3:], -1, -2) @ linear)


def spatial_inertias(rows: Array) -> Array:
    """(b, 6, 6) of inertial parameters (b, 10)."""
    out = np.zeros((len(rows), 6, 6))
    out[:, [0, 1, 2], [0, 1, 2]] = rows[:, :1]
    out[:, 3:, :3] = skew(rows[:, 1:4])
    out[:, :3, 3:] = -out[:, 3:, :3]
    out[:, 3:, 3:] = rows[:, [[4, 5, 7], [5, 6, 8], [7, 8, 9]]]
    return out
