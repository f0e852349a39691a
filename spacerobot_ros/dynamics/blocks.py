r"""The momentum-block regressor: free-floating dynamics, linear in block parameters.

For any tree of revolute joints: with the centre of mass at rest everything follows from the
bodies' rotations. Body k turns with w_k = w_0 + F_k q' (base coordinates), and s_i - S = sum_k
R_k g_ik with constant g_ik (own centre of mass, or the joint towards i), so that with

    psi_k = sum_i m_i g_ik          Q_kl = sum_i m_i g_ik g_il^T - psi_k psi_l^T / M
    J_k = I_k + tr(Q_kk) 1 - Q_kk   B_kk = R_k J_k R_k^T   B_kl = tr(G) 1 - G^T, G = R_k Q_kl R_l^T

momentum and kinetic energy are h = sum_kl B_kl w_l and T = 1/2 sum_kl w_k^T B_kl w_l
(docs/equations.md). Stacking w_k = P_k u with u = [w_0; q'] gives the (3+n, 3+n) inertia [[D, Dq],
[Dq^T, Dqq]] = P^T B P. All of it is linear in pi = {J_k (6 each), Q_kl (9 each, k < l)}; no joint
position, base velocity or total mass is needed.

Lagrange's equations in u, with M the inertia, wheels h_b and the joint term that the paper's eqs.
(17) to (20) lack (docs/equations.md), have

    base bias   n0 = (M' u)_0 + w0 x (M u)_0 + sum_b w_b x R_b h_b
    joint bias  nq = (M' u)_q - 1/2 u^T dM/dq u + sum_b F_b^T (w_b x R_b h_b)

Symbols: N samples, n joints, bodies 0..n, K = 6 (n+1) + 9 n (n+1) / 2 block parameters.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Body, Robot
from ..types import Array, Vector3
from .block_kernels import (
    equation_of_rates,
    fill_blocks,
    fill_changes,
    fill_parameters,
    fill_regressor,
)
from .forward_kinematics import forward_kinematics
from .tree import tree_of

_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_AXES = 'xyz'

Wheels = Sequence[tuple[int, Vector3]]
"""Bodies that have wheels, with the wheels' momentum in their axes [N m s]."""


def check_momentum(robot: Robot) -> None:
    """Refuse a robot whose momentum does not tell its parameters.

    Raises:
        ConfigurationError: fixed base or prismatic joint, for which the maps do not hold.
    """
    if not robot.is_free:
        why = 'momentum-based identification needs a free base'
        raise ConfigurationError('robot.base', f'{why}; for an arm on the ground use `diagnose`')
    for name, body in zip(robot.joints, robot.bodies[1:], strict=True):
        if body.is_prismatic:
            why = 'momentum-based identification needs revolute joints; use `diagnose`'
            raise ConfigurationError(f'joint {name!r}', why)


class BlockTree:
    """BodyKinematics of one robot's tree and the maps that are linear in its block parameters.

    Args:
        robot: Free-floating robot whose joints all turn.

    Raises:
        ConfigurationError: fixed base or prismatic joint, for which these maps do not hold.
    """

    def __init__(self, robot: Robot) -> None:
        check_momentum(robot)
        self.n = robot.n_joints
        self.bodies = robot.bodies
        self.pairs = tuple(itertools.combinations(range(self.n + 1), 2))
        self._moves = robot.moves.astype(float)
        self._tree = tree_of(robot)
        self._axes = np.array([body.axis for body in robot.bodies[1:]]).reshape(-1, 3)
        self._links = _link_vectors(robot.bodies)
        self._pair_indices = np.array(self.pairs, dtype=np.int64).reshape(-1, 2)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the K block parameters: `J2xy` of body 2, `Q0_2xy` of bodies 0 and 2."""
        blocks = [f'J{k}{_AXES[a]}{_AXES[b]}' for k in range(self.n + 1) for a, b in _SYMMETRIC]
        return (*blocks, *(f'Q{k}_{m}{a}{b}' for k, m in self.pairs for a in _AXES for b in _AXES))

    def rotations(self, q: Array) -> Array:
        """(N, n+1, 3, 3) rotations taking body to base coordinates, from q (N, n)."""
        q = np.ascontiguousarray(q, dtype=float)
        still = np.zeros((len(q), 6 + self.n))
        return forward_kinematics(self._tree, q, still, q).rotations

    def rate_maps(self, rotations: Array) -> Array:
        """(N, n+1, 3, 3+n) maps P_k with w_k = P_k [w_0; q'] in base coordinates."""
        axes = (rotations[:, 1:] @ self._axes[..., None])[..., 0]
        maps = np.empty((len(rotations), self.n + 1, 3, 3 + self.n))
        maps[..., :3] = np.eye(3)
        maps[..., 3:] = self._moves.T[:, None] * np.swapaxes(axes, 1, 2)[:, None]
        return maps

    def regressor(self, rotations: Array, maps: Array, u: Array) -> Array:
        """(N, 3, K) angular momentum regressor without wheels: h_B = Y pi.

        Args:
            rotations: From `rotations`.
            maps: From `rate_maps`.
            u: (N, 3+n) body rate omega_WB_B and joint rates [rad/s].
        """
        w = np.einsum('nkai,ni->nka', maps, u)
        out = np.empty((len(u), 3, 6 * (self.n + 1) + 9 * len(self.pairs)))
        fill_regressor(rotations, w, self._pair_indices, out)
        return out

    def inertia(self, rotations: Array, maps: Array, pi: Array) -> Array:
        """(N, 3+n, 3+n) inertia [[D, Dq], [Dq^T, Dqq]] of u = [w_0; q'], linear in pi (K,)."""
        return _inertia(self._blocks(rotations, pi), maps)

    def inertia_turned(
        self, rotations: Array, maps: Array, pi: Array, u: Array
    ) -> tuple[Array, Array]:
        """Inertia as `inertia`, and (N, n, 3+n) its derivatives by each joint position, times u.

        Turning with joint j, a block obeys B_kl' = tr(G') 1 - G'^T with G'^T = m_l a^x G^T - m_k
        G^T a^x, where m_k says whether the joint moves body k; an axis obeys a_i' = a_j x a_i
        where joint j moves joint i's body. The diagonal blocks turn like tensors, which the same
        expressions give.
        """
        blocks = self._blocks(rotations, pi)
        turned = np.zeros((len(u), self.n, 3 + self.n))
        fill_changes(blocks, maps, np.ascontiguousarray(u), self._moves, turned)
        return _inertia(blocks, maps), turned

    def equation(
        self, q: Array, u: Array, pi: Array, wheels: Wheels, joint_reaction: bool = True
    ) -> Array:
        """(N, 3 + n, 4 + n) M and beside it the bias of M u' + bias = [0; tau] at N states.

        Args:
            q: (N, n) joint positions [rad].
            u: (N, 3 + n) body rate omega_WB_B and joint rates [rad/s].
            pi: (K,) block parameters.
            wheels: Bodies and their wheels' momentum in their axes.
            joint_reaction: False omits the wheels' torque on the joints, as the paper prints it.
        """
        q, u, pi = (np.ascontiguousarray(x, dtype=float) for x in (q, u, pi))
        wheel_momentum = np.zeros((self.n + 1, 3))
        for body, momentum in wheels:
            wheel_momentum[body] += momentum
        geometry = self._tree, self._axes, self._moves, self._pair_indices
        return np.asarray(equation_of_rates(geometry, q, u, pi, wheel_momentum, joint_reaction))

    def parameters(self, robot: Robot | None = None) -> Array:
        """(K,) block parameters of a robot with this tree (default: the one it was made from)."""
        bodies = self.bodies if robot is None else robot.bodies
        return self.block_parameters(
            np.array([b.mass for b in bodies]),
            np.array([b.com for b in bodies]),
            np.array([b.inertia for b in bodies]),
        )

    def block_parameters(self, mass: Array, com: Array, inertia: Array) -> Array:
        """(..., K) block parameters of any bodies on this tree.

        Args:
            mass: (..., n+1) [kg].
            com: (..., n+1, 3) centres of mass in the body frames [m].
            inertia: (..., n+1, 3, 3) about the centres of mass, body axes [kg m^2].
        """
        shape, bodies = mass.shape[:-1], self.n + 1
        stacks = (
            np.ascontiguousarray(x, dtype=float).reshape(-1, bodies, *x.shape[len(shape) + 1 :])
            for x in (mass, com, inertia)
        )
        out = np.empty((math.prod(shape), 6 * bodies + 9 * len(self.pairs)))
        fill_parameters(*stacks, self._links, self._pair_indices, out)
        return out.reshape(*shape, -1)

    def _blocks(self, rotations: Array, pi: Array) -> Array:
        """(N, n+1, n+1, 3, 3) blocks B_kl."""
        blocks = np.empty((len(rotations), self.n + 1, self.n + 1, 3, 3))
        pi = np.ascontiguousarray(pi, dtype=float)
        fill_blocks(rotations, pi, self._pair_indices, blocks)
        return blocks


def _link_vectors(bodies: tuple[Body, ...]) -> Array:
    """(n+1, n+1, 3) vectors g_ik of body i along its proper ancestor k, in k's frame."""
    vectors = np.zeros((len(bodies), len(bodies), 3))
    for i in range(len(bodies)):
        child = i
        while child:
            vectors[i, bodies[child].parent] = bodies[child].translation
            child = bodies[child].parent
    return vectors


def _inertia(blocks: Array, maps: Array) -> Array:
    """(N, m, m) P^T B P of blocks (N, b, b, 3, 3) and maps P (N, b, 3, m)."""
    count, size, rates = len(blocks), 3 * blocks.shape[1], maps.shape[-1]
    stacked = maps.reshape(count, size, rates)
    square = np.swapaxes(blocks, 2, 3).reshape(count, size, size)
    return np.asarray(np.swapaxes(stacked, 1, 2) @ square @ stacked)
