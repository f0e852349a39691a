r"""How the free base moves, and what torque that takes, when the joints follow given motions.

Nothing pushes the robot, so its total momentum is constant, and with the centre of mass at rest

    h_B' = h_B x w,    w = D^-1 (h_B - Dq q' - h0 - sum_b R_b h_b)

gives momentum h_B and rate w of the base, in its own axes, from the joints alone; the attitude
follows from R' = R w^x, and h_B = R^T h_W closes the circle. Torques follow from the bodies'
accelerations (Newton and Euler), the base's own from the condition that no wrench acts on it.

Everything is computed for all candidates and times at once, in base coordinates about the base
origin; only h_B and R are advanced step by step. Symbols: N = B T states, n joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from ..dynamics.blocks import BlockTree
from ..dynamics.rotation import skew
from ..model.robot import Robot
from ..types import Array, Matrix3, Vector3


@dataclass(frozen=True, slots=True, eq=False)
class BaseMotion:
    """Motion of B candidates at T times.

    Args:
        time: (T,) [s].
        q, qd, qdd: (B, T, n) joint positions, rates and accelerations.
        omega: (B, T, 3) omega_WB_B [rad/s].
        R_WB: (B, T, 3, 3) attitudes.
        torque: (B, T, n) joint torques [N m].
        inverse: (B, T, 3, 3) D^-1 [1/(kg m^2)]. coupling: (B, T, 3, n) D^-1 Dq.
        h_W: (B, 3) total momentum, inertial frame [N m s].
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    omega: Array
    R_WB: Array
    torque: Array
    inverse: Array
    coupling: Array
    h_W: Array


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """How the base starts.

    Args:
        attitude_xyzw: (4,) q_WB.
        omega: (3,) omega_WB_B [rad/s].
    """

    attitude_xyzw: Array
    omega: Vector3


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """Bodies at N configurations, base coordinates about the base origin.

    Args:
        R: (N, n+1, 3, 3). origin, com: (N, n+1, 3) [m]. axis: (N, n+1, 3), the base's is unused.
        tensor: (N, n+1, 3, 3) inertia about the own centre of mass [kg m^2].
        D: (N, 3, 3), Dq: (N, 3, n) momentum about the system's centre of mass [kg m^2].
    """

    R: Array
    origin: Array
    com: Array
    axis: Array
    tensor: Array
    D: Array
    Dq: Array


class FreeBase:
    """A robot whose joints follow given motions.

    Args:
        robot: Free-floating, revolute joints; its captured wheels' momentum as assumed.

    Raises:
        ConfigurationError: fixed base or prismatic joints.
    """

    def __init__(self, robot: Robot) -> None:
        self._tree = BlockTree(robot)
        self._bodies = robot.bodies
        self._wheels = [(g.body, g.body_momentum) for g in robot.gyrostats]
        self._mass = np.array([b.mass for b in robot.bodies])

    def spun_up(self, q: Array, h0: Vector3) -> Vector3:
        """(3,) rate of a robot at rest just after wheels of its base were spun up to h0.

        The wheels' spin-up takes no angular momentum from outside: D w + h0 = 0, eq. (30) of the
        identification paper.
        """
        return np.asarray(-np.linalg.solve(self._place(q[None]).D[0], h0), dtype=float)

    def move(self, time: Array, q: Array, qd: Array, qdd: Array, start: Start) -> BaseMotion:
        """Follow joint motions.

        Args:
            time: (T,) increasing, equally spaced [s].
            q: (B, T, n) joint positions [rad].
            qd: (B, T, n) joint rates [rad/s].
            qdd: (B, T, n) joint accelerations [rad/s^2].
            start: Of the base, the same for all.
        """
        batch, steps, n = q.shape
        placed = self._place(q.reshape(-1, n))
        shape = (batch, steps)
        inverse = np.asarray(np.linalg.inv(placed.D), dtype=float)
        coupling = inverse @ placed.Dq
        spin = np.zeros((batch * steps, 3))
        for body, h in self._wheels:
            spin += placed.R[:, body] @ h
        own = _apply(inverse, spin) + _apply(coupling, qd.reshape(-1, n))
        inverse, own = inverse.reshape((*shape, 3, 3)), own.reshape((*shape, 3))
        attitude = Rotation.from_quat(start.attitude_xyzw).as_matrix()
        h_B0 = _apply(np.linalg.inv(inverse[:, 0]), start.omega + own[:, 0])
        h_W = h_B0 @ attitude.T
        h_B = _carry_momentum(time, inverse, own, h_B0)
        R_WB = _integrate_attitude(time, _apply(inverse, h_B) - own, attitude)
        omega = _apply(inverse, np.einsum('btij,bi->btj', R_WB, h_W)) - own
        torque = self._torque(
            placed, omega.reshape(-1, 3), qd.reshape(-1, n), qdd.reshape(-1, n)
        ).reshape(*shape, n)
        coupling = coupling.reshape(*shape, 3, n)
        return BaseMotion(time, q, qd, qdd, omega, R_WB, torque, inverse, coupling, h_W)

    def _place(self, q: Array) -> _Placed:
        R = self._tree.rotations(q)
        origin = np.zeros((len(q), len(self._bodies), 3))
        axis = np.zeros_like(origin)
        com = np.zeros_like(origin)
        tensor = np.empty_like(R)
        for k, body in enumerate(self._bodies):
            tensor[:, k] = R[:, k] @ body.inertia @ np.swapaxes(R[:, k], 1, 2)
            axis[:, k] = R[:, k] @ body.axis
        for k in self._tree.order:
            parent = self._bodies[k].parent
            origin[:, k] = origin[:, parent] + R[:, parent] @ self._bodies[k].translation
        for k, body in enumerate(self._bodies):
            com[:, k] = origin[:, k] + R[:, k] @ body.com
        D, Dq = self._momentum_maps(origin, com, axis, tensor)
        return _Placed(R, origin, com, axis, tensor, D, Dq)

    def _momentum_maps(
        self, origin: Array, com: Array, axis: Array, tensor: Array
    ) -> tuple[Array, Array]:
        """D and Dq from composite bodies, each a joint's outboard part."""
        mass = self._mass.copy()
        first = self._mass[:, None] * com
        second = tensor + self._mass[:, None, None] * _steiner(com)
        for k in reversed(self._tree.order):
            parent = self._bodies[k].parent
            mass[parent] += mass[k]
            first[:, parent] += first[:, k]
            second[:, parent] += second[:, k]
        centre = first[:, 0] / mass[0]
        D = second[:, 0] - mass[0] * _steiner(centre)
        Dq = np.empty((len(com), 3, self._tree.n))
        for k in self._tree.order:
            a, p = axis[:, k], origin[:, k]
            lever = _cross(a, p)
            linear = _cross(a, first[:, k]) - mass[k] * lever
            about_origin = _apply(second[:, k], a) - _cross(first[:, k], lever)
            Dq[:, :, k - 1] = about_origin - _cross(centre, linear)
        return D, Dq

    def _torque(self, placed: _Placed, omega: Array, qd: Array, qdd: Array) -> Array:
        """(N, n) joint torques of states and joint accelerations, the base being free."""
        force, moment = self._inertial_wrenches(placed, omega, qd, qdd)
        share = self._mass / self._mass.sum()
        force -= share[:, None] * force.sum(axis=1, keepdims=True)  # the base gives way
        centre = np.einsum('k,nka->na', share, placed.com)
        about_centre = moment + _cross(placed.com - centre[:, None], force)
        alpha = -np.linalg.solve(placed.D, about_centre.sum(axis=1)[..., None])[..., 0]
        moment += _cross(placed.com, force)  # about the base origin from here on
        for k in reversed(self._tree.order):
            parent = self._bodies[k].parent
            force[:, parent] += force[:, k]
            moment[:, parent] += moment[:, k]
        at_joint = moment - _cross(placed.origin, force)
        torque = np.einsum('nka,nka->nk', placed.axis[:, 1:], at_joint[:, 1:])
        return torque + np.einsum('naj,na->nj', placed.Dq, alpha)

    def _inertial_wrenches(
        self, placed: _Placed, omega: Array, qd: Array, qdd: Array
    ) -> tuple[Array, Array]:
        """Force (N, n+1, 3) and moment about the own centre of every body, base held."""
        w, alpha, at_origin = (np.zeros_like(placed.com) for _ in range(3))
        w[:, 0] = omega
        for k in self._tree.order:
            parent = self._bodies[k].parent
            turn = placed.axis[:, k] * qd[:, k - 1, None]
            w[:, k] = w[:, parent] + turn
            alpha[:, k] = alpha[:, parent] + placed.axis[:, k] * qdd[:, k - 1, None]
            alpha[:, k] += _cross(w[:, parent], turn)
            d = placed.origin[:, k] - placed.origin[:, parent]
            at_origin[:, k] = at_origin[:, parent] + _cross(alpha[:, parent], d)
            at_origin[:, k] += _cross(w[:, parent], _cross(w[:, parent], d))
        r = placed.com - placed.origin
        force = self._mass[:, None] * (at_origin + _cross(alpha, r) + _cross(w, _cross(w, r)))
        spin = _apply(placed.tensor, w)
        for body, h in self._wheels:
            spin[:, body] += placed.R[:, body] @ h
        return force, _apply(placed.tensor, alpha) + _cross(w, spin)


def _carry_momentum(time: Array, inverse: Array, own: Array, h_B: Array) -> Array:
    """(B, T, 3) h_B along the motion: classical Runge-Kutta, maps interpolated in between."""
    middle = 0.5 * (time[1:] + time[:-1])
    mid_inverse = CubicSpline(time, inverse, axis=1)(middle)
    mid_own = CubicSpline(time, own, axis=1)(middle)
    out = np.empty_like(own)
    out[:, 0] = h_B
    size = np.linalg.norm(h_B, axis=1)  # constant; kept, so that no candidate is too fast to judge
    dt = time[1] - time[0]

    def rate(h: Array, maps: Array, offset: Array) -> Array:
        return _cross(h, _apply(maps, h) - offset)

    for k in range(len(time) - 1):
        h = out[:, k]
        k1 = rate(h, inverse[:, k], own[:, k])
        k2 = rate(h + 0.5 * dt * k1, mid_inverse[:, k], mid_own[:, k])
        k3 = rate(h + 0.5 * dt * k2, mid_inverse[:, k], mid_own[:, k])
        k4 = rate(h + dt * k3, inverse[:, k + 1], own[:, k + 1])
        moved = h + dt / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        out[:, k + 1] = moved * (size / np.maximum(np.linalg.norm(moved, axis=1), 1e-300))[:, None]
    return out


def _integrate_attitude(time: Array, omega: Array, first: Matrix3) -> Array:
    """(B, T, 3, 3) attitudes of body rates (B, T, 3): fourth-order Magnus steps."""
    dt = time[1] - time[0]
    shift = np.sqrt(3.0) / 6.0
    between = CubicSpline(time, omega, axis=1)
    early, late = (between(time[:-1] + (0.5 + s) * dt) for s in (-shift, shift))
    turns = 0.5 * dt * (early + late) + 0.5 * shift * dt**2 * _cross(early, late)
    steps = Rotation.from_rotvec(turns.reshape(-1, 3)).as_matrix().reshape(*turns.shape, 3)
    out = np.empty((*omega.shape, 3))
    out[:, 0] = first
    for k in range(len(time) - 1):
        out[:, k + 1] = out[:, k] @ steps[:, k]
    return out


def _steiner(arm: Array) -> Array:
    """(..., 3, 3) inertia about the origin of a unit mass at the arm (..., 3): -arm^x arm^x."""
    cross = skew(arm)
    return -cross @ cross


def _apply(matrix: Array, vector: Array) -> Array:
    """Stacked matrices (..., a, b) on stacked vectors (..., b)."""
    return (matrix @ vector[..., None])[..., 0]


def _cross(a: Array, b: Array) -> Array:
    """Cross products of stacked vectors; several times faster than `np.cross`."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0], axis=-1)
