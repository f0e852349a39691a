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
from collections.abc import Sequence

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Body, Robot
from ..types import Array, IntArray, Vector3
from .compiling import compiled, inner
from .forward_kinematics import forward_kinematics
from .rotation import cross_rows, skew
from .tree import tree_of

_SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
_AXES = 'xyz'

Wheels = Sequence[tuple[int, Vector3]]
"""Bodies that have wheels, with the wheels' momentum in their axes [N m s]."""


class BlockTree:
    """BodyKinematics of one robot's tree and the maps that are linear in its block parameters.

    Args:
        robot: Free-floating robot whose joints all turn.

    Raises:
        ConfigurationError: fixed base or prismatic joint, for which these maps do not hold.
    """

    def __init__(self, robot: Robot) -> None:
        if not robot.is_free:
            why = 'momentum-based identification needs a free base'
            raise ConfigurationError('robot.base', why)
        for name, body in zip(robot.joints, robot.bodies[1:], strict=True):
            if body.is_prismatic:
                why = 'momentum-based identification needs revolute joints'
                raise ConfigurationError(f'joint {name!r}', why)
        self.n = robot.n_joints
        self.bodies = robot.bodies
        self.pairs = tuple(itertools.combinations(range(self.n + 1), 2))
        self.moves = robot.moves
        self._tree = tree_of(robot)
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
        maps = np.zeros((len(rotations), self.n + 1, 3, 3 + self.n))
        maps[..., :3] = np.eye(3)
        for j in range(self.n):
            axis = rotations[:, j + 1] @ self.bodies[j + 1].axis
            maps[..., 3 + j][:, self.moves[j]] = axis[:, None, :]
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
        _fill_regressor(rotations, w, self._pair_indices, out)
        return out

    def inertia(self, rotations: Array, maps: Array, pi: Array) -> Array:
        """(N, 3+n, 3+n) inertia [[D, Dq], [Dq^T, Dqq]] of u = [w_0; q'], linear in pi (K,)."""
        stacked = _stack_maps(maps)
        return np.swapaxes(stacked, 1, 2) @ _stack_blocks(self._blocks(rotations, pi)) @ stacked

    def inertia_gradient(self, rotations: Array, maps: Array, pi: Array) -> tuple[Array, Array]:
        """Inertia as `inertia` and its (N, n, 3+n, 3+n) derivatives by each joint position.

        Turning with joint j, a block obeys B_kl' = tr(G') 1 - G'^T with G'^T = m_l a^x G^T - m_k
        G^T a^x, where m_k says whether the joint moves body k; an axis obeys a_i' = a_j x a_i
        where joint j moves joint i's body.
        """
        blocks = self._blocks(rotations, pi)
        stacked = _stack_maps(maps)
        weighted = _stack_blocks(blocks) @ stacked
        value = np.swapaxes(stacked, 1, 2) @ weighted
        # The diagonal blocks turn like tensors, which the same expressions give.
        g_t = (0.5 * np.trace(blocks, axis1=3, axis2=4)[..., None, None] * np.eye(3) - blocks)[
            :, None
        ]
        joints = np.arange(self.n)
        axes = maps[:, joints + 1, :, 3 + joints].swapaxes(0, 1)
        turn = skew(axes)
        moved = self.moves.astype(float)
        wide = turn[:, :, None, None]
        turned = moved[:, None, :, None, None] * (wide @ g_t) - moved[:, :, None, None, None] * (
            g_t @ wide
        )
        turned = np.trace(turned, axis1=4, axis2=5)[..., None, None] * np.eye(3) - turned
        slipped = (turn[:, :, None] @ maps[:, None, :, :, 3:]) * moved[:, None, None, 1:]
        half = np.swapaxes(_stack_maps(slipped), -1, -2) @ weighted[:, None]
        gradient = np.swapaxes(stacked, 1, 2)[:, None] @ _stack_blocks(turned) @ stacked[:, None]
        gradient[..., 3:, :] += half
        gradient[..., 3:] += np.swapaxes(half, -1, -2)
        return value, gradient

    def equation(
        self, q: Array, u: Array, pi: Array, wheels: Wheels, joint_reaction: bool = True
    ) -> tuple[Array, Array]:
        """M and bias of M u' + bias = [0; tau] at N states.

        Args:
            q: (N, n) joint positions [rad].
            u: (N, 3 + n) body rate omega_WB_B and joint rates [rad/s].
            pi: (K,) block parameters.
            wheels: Bodies and their wheels' momentum in their axes.
            joint_reaction: False omits the wheels' torque on the joints, as the paper prints it.

        Returns:
            (N, 3 + n, 3 + n) and (N, 3 + n).
        """
        rotations = self.rotations(q)
        maps = self.rate_maps(rotations)
        M, gradient = self.inertia_gradient(rotations, maps, pi)
        changes = (gradient @ u[:, None, :, None])[..., 0]
        bias = (u[:, None, 3:] @ changes)[:, 0]
        bias[:, 3:] -= 0.5 * (changes @ u[:, :, None])[..., 0]
        bias[:, :3] += cross_rows(u[:, :3], np.einsum('nab,nb->na', M[:, :3], u))
        for body, momentum in wheels:
            rate = np.einsum('nab,nb->na', maps[:, body], u)
            torque = cross_rows(rate, rotations[:, body] @ momentum)
            bias[:, :3] += torque
            if joint_reaction:
                bias[:, 3:] += np.einsum('naj,na->nj', maps[:, body, :, 3:], torque)
        return M, bias

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
        own = np.arange(self.n + 1)
        arms = np.broadcast_to(self._links, (*mass.shape[:-1], *self._links.shape)).copy()
        arms[..., own, own, :] = com
        weighted = mass[..., None, None] * arms
        first = weighted.sum(axis=-3)
        q = np.einsum('...ika,...imb->...kmab', weighted, arms, optimize=True)
        q -= (
            np.einsum('...ka,...mb->...kmab', first, first)
            / mass.sum(axis=-1)[..., None, None, None, None]
        )
        diagonal = q[..., own, own, :, :]
        trace = np.trace(diagonal, axis1=-2, axis2=-1)[..., None, None]
        blocks = inertia + trace * np.eye(3) - diagonal
        rows, columns = np.array(_SYMMETRIC).T
        parts = [blocks[..., rows, columns].reshape(*mass.shape[:-1], -1)]
        parts += [q[..., k, m, :, :].reshape(*mass.shape[:-1], 9) for k, m in self.pairs]
        return np.concatenate(parts, axis=-1)

    def _blocks(self, rotations: Array, pi: Array) -> Array:
        """(N, n+1, n+1, 3, 3) blocks B_kl."""
        bodies = self.n + 1
        own = np.zeros((bodies, bodies, 3, 3))
        diagonal = np.arange(bodies)
        for index, (a, b) in enumerate(_SYMMETRIC):
            own[diagonal, diagonal, a, b] = own[diagonal, diagonal, b, a] = pi[
                index : 6 * bodies : 6
            ]
        for index, (k, m) in enumerate(self.pairs):
            start = 6 * bodies + 9 * index
            own[k, m] = pi[start : start + 9].reshape(3, 3)
            own[m, k] = own[k, m].T
        out = rotations[:, :, None] @ own @ np.swapaxes(rotations, 2, 3)[:, None]
        off = ~np.eye(bodies, dtype=bool)
        g = out[:, off]
        out[:, off] = np.trace(g, axis1=2, axis2=3)[..., None, None] * np.eye(3) - np.swapaxes(
            g, 2, 3
        )
        return out


def _link_vectors(bodies: tuple[Body, ...]) -> Array:
    """(n+1, n+1, 3) vectors g_ik of body i along its proper ancestor k, in k's frame."""
    vectors = np.zeros((len(bodies), len(bodies), 3))
    for i in range(len(bodies)):
        child = i
        while child:
            vectors[i, bodies[child].parent] = bodies[child].translation
            child = bodies[child].parent
    return vectors


def _stack_maps(maps: Array) -> Array:
    """(..., b, 3, m) maps one below the other: (..., 3 b, m)."""
    return maps.reshape(*maps.shape[:-3], 3 * maps.shape[-3], maps.shape[-1])


def _stack_blocks(blocks: Array) -> Array:
    """(..., b, b, 3, 3) blocks as one matrix (..., 3 b, 3 b)."""
    size = 3 * blocks.shape[-3]
    return np.swapaxes(blocks, -3, -2).reshape(*blocks.shape[:-4], size, size)


# Vectorised over samples NumPy needs 7 us a sample-row here (strided temporaries of 9 columns a
# pair of bodies); compiled it is 0.15 us on one core.
@compiled  # type: ignore[untyped-decorator]
def _fill_regressor(rotations: Array, w: Array, pairs: IntArray, out: Array) -> None:
    """Write the regressor's columns, bodies' blocks first and pairs' blocks behind.

    Args:
        rotations: (N, b, 3, 3) body to base coordinates.
        w: (N, b, 3) angular velocities in base coordinates [rad/s].
        pairs: (P, 2) indices k < m of the pairs of bodies.
        out: (N, 3, 6 b + 9 P) written.
    """
    bodies = rotations.shape[1]
    for s in range(rotations.shape[0]):
        for k in range(bodies):
            _fill_body(rotations, w, s, k, out)
        for p in range(pairs.shape[0]):
            _fill_pair(rotations, w, s, pairs[p, 0], pairs[p, 1], 6 * bodies + 9 * p, out)


# Whole arrays and indices are passed: views of them would cost more than the arithmetic.
@inner  # type: ignore[untyped-decorator]
def _fill_body(R: Array, w: Array, s: int, k: int, out: Array) -> None:
    """Columns of J_k: e_a (e_b . w), and e_b (e_a . w) too where a and b differ."""
    x = R[s, k, 0, 0] * w[s, k, 0] + R[s, k, 1, 0] * w[s, k, 1] + R[s, k, 2, 0] * w[s, k, 2]
    y = R[s, k, 0, 1] * w[s, k, 0] + R[s, k, 1, 1] * w[s, k, 1] + R[s, k, 2, 1] * w[s, k, 2]
    z = R[s, k, 0, 2] * w[s, k, 0] + R[s, k, 1, 2] * w[s, k, 1] + R[s, k, 2, 2] * w[s, k, 2]
    for i in range(3):
        out[s, i, 6 * k] = R[s, k, i, 0] * x
        out[s, i, 6 * k + 1] = R[s, k, i, 1] * y
        out[s, i, 6 * k + 2] = R[s, k, i, 2] * z
        out[s, i, 6 * k + 3] = R[s, k, i, 0] * y + R[s, k, i, 1] * x
        out[s, i, 6 * k + 4] = R[s, k, i, 0] * z + R[s, k, i, 2] * x
        out[s, i, 6 * k + 5] = R[s, k, i, 1] * z + R[s, k, i, 2] * y


@inner  # type: ignore[untyped-decorator]
def _fill_pair(R: Array, w: Array, s: int, k: int, m: int, start: int, out: Array) -> None:
    """Columns of Q_km: e_ka x (w_m x e_mb) + e_mb x (w_k x e_ka), the triple products expanded."""
    for a in range(3):
        for b in range(3):
            dot, along_m, along_k = 0.0, 0.0, 0.0
            for i in range(3):
                dot += R[s, k, i, a] * R[s, m, i, b]
                along_m += R[s, k, i, a] * w[s, m, i]
                along_k += R[s, m, i, b] * w[s, k, i]
            for i in range(3):
                turning = (w[s, k, i] + w[s, m, i]) * dot
                column = turning - R[s, m, i, b] * along_m - R[s, k, i, a] * along_k
                out[s, i, start + 3 * a + b] = column
