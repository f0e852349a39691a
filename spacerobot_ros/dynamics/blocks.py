r"""Free-floating dynamics as vectors that move, and a constant matrix that weighs them.

With the centre of mass at rest, momentum and kinetic energy depend on the bodies only through a
symmetric matrix W over vectors z_j(t), each fixed in a body or sliding along it: the base's three
axes; of a body k that turns two unit vectors across its joint's axis (the axis itself is fixed in
the parent too, whose vectors give it); of one that slides R_k a q_k. Body i's axes are R_i e =
sum_j T_i[j] z_j and its centre lies at sum_j g_ij z_j from the base's origin, with constant T and
g, so that with second moments S_i = tr(I_i)/2 1 - I_i and gbar the mean of g by mass

    W = sum_i [T_i S_i T_i^T + m_i (g_i - gbar) (g_i - gbar)^T]
    h = sum_jk W_jk z_j x z_k'        2 T = sum_jk W_jk z_j' . z_k'

and with z_j' = Z_j u, u = [w_0; q'], virtual power gives M u' + bias = [0; tau] with

    M = sum_jk W_jk Z_j^T Z_k         bias = sum_jk W_jk Z_j^T z_k'' + wheels,    z'' at u' = 0.

The wheels' torque is w_b x R_b h_b on their bodies; the paper's eqs. (17) to (20) lack what it
does at the joints (docs/equations.md). No joint's place, base velocity or total mass is needed.

The upper triangle of W is what any motion can tell: K = G (G + 1) / 2 numbers of G = 3 + 2 n_r +
n_s vectors, (n + 2)(2 n + 3) where all joints turn. All this holds for any vectors that give the
bodies' axes and centres, so for all three axes of every body too, as the paper has it; W then has
entries that no motion tells apart.

Symbols: N samples, n joints, b = n + 1 bodies, m = 3 + n rates.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from ..errors import ConfigurationError
from ..model.robot import Body, Robot, tree_order
from ..types import Array, BoolArray, IntArray
from .compiling import Triple, compiled, inner
from .forward_kinematics import BodyKinematics, body_accelerations, forward_kinematics
from .rnea import rnea
from .spatial import cross, get, plus, put, put_column, rotate, times, unit
from .tree import PRISMATIC, Records, tree_of

_CHUNK = 100  # bodies of so many samples at once: at 30 joints 10 MB
_IS_AXIS = 1.0 - 1e-12
_UNITS = 'kg m^2', 'kg m', 'kg'  # by how many of the two vectors slide


def check_momentum(robot: Robot) -> None:
    """Refuse a robot whose momentum is not kept.

    Raises:
        ConfigurationError: fixed base.
    """
    if not robot.is_free:
        why = 'momentum-based identification needs a free base'
        raise ConfigurationError('robot.base', f'{why}; for an arm on the ground use `diagnose`')


class Vectors(NamedTuple):
    """The G vectors of a tree, as compiled functions take them.

    Args:
        bodies: (G,) they are fixed in.
        local: (G, 3) unit vectors in these.
        slides: (G,) whether the vector is as long as the body's joint has slid.
        moves: (n, b) whether a joint moves a body.
    """

    bodies: IntArray
    local: Array
    slides: BoolArray
    moves: BoolArray


class BlockTree:
    """One robot's vectors, and the maps that are linear in the entries of its W.

    The entries x are those of the upper triangle, a body's own before those of two bodies. Of
    three axes of one body, and of the base always, x has the moments of inertia J = tr(S) 1 - S of
    their block S.

    Args:
        robot: Free-floating robot; only its tree matters.
        whole: Three axes of every body that turns, instead of two.

    Attributes:
        pairs: (K, 2) the two vectors of each entry.

    Raises:
        ConfigurationError: fixed base.
    """

    def __init__(self, robot: Robot, *, whole: bool = False) -> None:
        check_momentum(robot)
        own = [_vectors(k, body, whole) for k, body in enumerate(robot.bodies)]
        counts = np.array([len(local) for _, local in own])
        carriers = np.repeat(np.arange(len(own)), counts)
        slides = np.array([body.is_prismatic for body in robot.bodies])[carriers]
        local = np.vstack([local for _, local in own])
        self._vectors = Vectors(carriers, local, slides, robot.moves)
        self._letters = ''.join(letters for letters, _ in own)
        self._tree = tree_of(robot).copy()  # of wheels alone, which `equation` is told
        for name in ('inertial', 'wheels', 'motor'):
            self._tree[name] = 0.0
        self._axes, self._origins = _combinations(robot.bodies, self._vectors)
        self.pairs = _pairs(carriers)
        entries = counts * (counts + 1) // 2
        self._moments = (np.cumsum(entries) - entries)[counts == 3]  # where those of a body begin

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the K entries: `J0xy`, `S2xu` of body 2, `Q0_2xy` of bodies 0 and 2.

        Letters are x, y, z for axes of the body, u and v for other vectors, s for one that slides.
        """
        names, bodies = [], self._vectors.bodies
        whole = set(bodies[self.pairs[self._moments, 0]])
        for i, j in self.pairs:
            k, m, letters = bodies[i], bodies[j], self._letters[i] + self._letters[j]
            kind = f'Q{k}_{m}' if k != m else f'J{k}' if k in whole else f'S{k}'
            names.append(kind + letters)
        return tuple(names)

    @property
    def units(self) -> tuple[str, ...]:
        """Units of the K entries."""
        slides = self._vectors.slides[self.pairs].sum(axis=1)
        return tuple(_UNITS[count] for count in slides)

    def entries(self, mass: Array, com: Array, inertia: Array) -> Array:
        """(..., K) entries x of any bodies on this tree.

        Args:
            mass: (..., b) [kg].
            com: (..., b, 3) centres of mass in the body frames [m].
            inertia: (..., b, 3, 3) about the centres of mass, body axes [kg m^2].
        """
        shape, bodies = mass.shape[:-1], mass.shape[-1]
        mass, com = mass.reshape(-1, bodies), com.reshape(-1, bodies, 3)
        inertia = inertia.reshape(-1, bodies, 3, 3)
        out = np.empty((len(mass), len(self.pairs)))
        for start in range(0, len(mass), _CHUNK):
            part = slice(start, start + _CHUNK)
            W = self._weights(mass[part], com[part], inertia[part])
            out[part] = W[:, self.pairs[:, 0], self.pairs[:, 1]]
        self._exchange(out, 1.0)
        return out.reshape(*shape, -1)

    def matrix(self, x: Array) -> Array:
        """(G, G) the matrix W of entries x (K,)."""
        size, x = len(self._letters), np.array(x, dtype=float)
        self._exchange(x, 0.5)
        W = np.empty((size, size))
        W[self.pairs[:, 0], self.pairs[:, 1]] = W[self.pairs[:, 1], self.pairs[:, 0]] = x
        return W

    def regressor(self, q: Array, u: Array) -> Array:
        """(N, 3, K) angular momentum regressor without wheels: h_B = Y x.

        Args:
            q: (N, n) joint positions.
            u: (N, m) body rate omega_WB_B and joint rates.
        """
        q, u = (np.ascontiguousarray(x, dtype=float) for x in (q, u))
        out = momentum_columns(self._tree, self._vectors, self.pairs, q, u)
        self._exchange(out, 0.5)
        return np.asarray(out)

    def equation(
        self, q: Array, u: Array, W: Array, wheels: Array, joint_reaction: bool = True
    ) -> Array:
        """(N, m, m + 1) M and beside it the bias of M u' + bias = [0; tau] at N states.

        Args:
            q: (N, n) joint positions.
            u: (N, m) body rate omega_WB_B and joint rates.
            W: (G, G) from `matrix`.
            wheels: (b, 3) momentum of the wheels of every body, in its axes [N m s].
            joint_reaction: False omits the wheels' torque on the joints, as the paper prints it.
        """
        q, u = (np.ascontiguousarray(x, dtype=float) for x in (q, u))
        tree = self._tree.copy()
        tree['wheels'] = wheels[tree['number']]
        Z, torques = rates_of_change(tree, self._vectors, q, u)
        stacked = Z.reshape(len(q), -1, Z.shape[-1])
        weighed = (W @ Z.reshape(len(q), len(W), -1)).reshape(stacked.shape)
        out = np.swapaxes(stacked[..., :-1], 1, 2) @ weighed
        driven = None if joint_reaction else 3
        out[:, :driven, -1] += torques[:, :driven]
        return np.asarray(out)

    def _weights(self, mass: Array, com: Array, inertia: Array) -> Array:
        """(S, G, G) matrices W of bodies (S, b)."""
        size = self._axes.shape[-1]
        second = 0.5 * np.trace(inertia, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - inertia
        spread = (second @ self._axes).reshape(len(mass), -1, size)
        g = self._origins + (com[:, :, None] @ self._axes)[:, :, 0]
        g -= mass[:, None] @ g / mass.sum(axis=1)[:, None, None]
        between = np.swapaxes(g, 1, 2) @ (mass[..., None] * g)
        return np.asarray(self._axes.reshape(-1, size).T @ spread + between)

    def _exchange(self, x: Array, share: float) -> None:
        """Write share tr(S) 1 - S over S, the blocks of three axes of one body in x (..., K).

        Moments of inertia for second moments by a share of 1; back, and for columns of a
        regressor, by 1/2.
        """
        for start in self._moments:
            x[..., start : start + 6] *= -1.0
            trace = x[..., start : start + 3].sum(axis=-1, keepdims=True)
            x[..., start : start + 3] -= share * trace


def _vectors(index: int, body: Body, whole: bool) -> tuple[str, Array]:
    """Letters of a body's vectors, and these (r, 3) in its axes."""
    if index and body.is_prismatic:
        return 's', body.axis[None]
    if whole or not index:
        return 'xyz', np.eye(3)
    least = int(np.argmin(np.abs(body.axis)))
    first = np.eye(3)[least] - body.axis[least] * body.axis
    first /= np.linalg.norm(first)
    local, letters = np.array([first, np.cross(body.axis, first)]), ''
    for v, other in zip(local, 'uv', strict=True):
        main = int(np.argmax(np.abs(v)))
        is_axis = abs(v[main]) > _IS_AXIS
        letters += 'xyz'[main] if is_axis else other
        v *= np.sign(v[main]) if is_axis else 1.0
    return letters, local


def _combinations(bodies: tuple[Body, ...], vectors: Vectors) -> tuple[Array, Array]:
    """(b, 3, G) bodies' axes and (b, G) their origins, as sums of the vectors."""
    units = np.eye(len(vectors.bodies))
    axes, origins = np.zeros((len(bodies), 3, len(units))), np.zeros((len(bodies), len(units)))
    for k in (0, *tree_order(bodies)):
        body, is_own = bodies[k], vectors.bodies == k
        if k:
            axes[k] = body.rotation.T @ axes[body.parent]
            origins[k] = origins[body.parent] + body.translation @ axes[body.parent]
        if k and body.is_prismatic:
            origins[k] += units[is_own][0]
        else:
            own = vectors.local[is_own]
            axes[k] += own.T @ (units[is_own] - own @ axes[k])
    return axes, origins


def _pairs(bodies: IntArray) -> IntArray:
    """(K, 2) pairs of vectors: a body's own, squares first, then those of two bodies."""
    groups = [np.flatnonzero(bodies == k) for k in range(bodies[-1] + 1)]
    pairs = [
        pair
        for group in groups
        for pair in (*((j, j) for j in group), *itertools.combinations(group, 2))
    ]
    for group, other in itertools.combinations(groups, 2):
        pairs += itertools.product(group, other)
    return np.array(pairs, dtype=np.int64)


@inner
def _move(
    kinematics: BodyKinematics, vectors: Vectors, q: Array, u: Array, s: int, out: Array
) -> None:
    """Write z, z' and z'' at u' = 0 of sample s (3, G, 3)."""
    for j in range(len(vectors.bodies)):
        k, length, rate = vectors.bodies[j], 1.0, 0.0
        if vectors.slides[j]:
            length, rate = q[s, k - 1], u[s, 2 + k]
        R = kinematics.rotations[s, k]
        direction = rotate(R, get(vectors.local[j], 0))
        w, alpha = rotate(R, get(kinematics.twists[s, k], 3)), get(kinematics.drifts[s, k], 3)
        z, slip = times(length, direction), times(rate, direction)
        turning = cross(w, z)
        inward = cross(w, plus(turning, times(2.0, slip)))
        put(out[0, j], 0, z)
        put(out[1, j], 0, plus(turning, slip))
        put(out[2, j], 0, plus(inward, cross(alpha, z)))


@compiled
def momentum_columns(
    tree: Records, vectors: Vectors, pairs: IntArray, q: Array, u: Array
) -> Array:
    """(N, 3, K) z_j x z_k' + z_k x z_j' of pairs of vectors, half of it for a square.

    Args:
        tree: `BODY` records.
        vectors: Its vectors.
        pairs: (K, 2).
        q: (N, n) joint positions.
        u: (N, m) body rate and joint rates.
    """
    kinematics = _kinematics(tree, q, u)
    motion, out = np.empty((3, len(vectors.bodies), 3)), np.empty((len(q), 3, len(pairs)))
    z, rates = motion[0], motion[1]
    for s in range(len(q)):
        _move(kinematics, vectors, q, u, s, motion)
        for p in range(len(pairs)):
            j, k = pairs[p, 0], pairs[p, 1]
            column = cross(_row(z, j), _row(rates, k))
            if j != k:
                column = plus(column, cross(_row(z, k), _row(rates, j)))
            put_column(out[s], p, column)
    return out


@compiled
def rates_of_change(tree: Records, vectors: Vectors, q: Array, u: Array) -> tuple[Array, Array]:
    """Z (N, G, 3, m + 1), z'' at u' = 0 its last column, and torques (N, m) of the wheels.

    Args:
        tree: `BODY` records that have wheels alone.
        vectors: Its vectors.
        q: (N, n) joint positions.
        u: (N, m) body rate and joint rates.
    """
    count, n, size = len(q), q.shape[1], len(vectors.bodies)
    kinematics = _kinematics(tree, q, u)
    accelerations = body_accelerations(tree, kinematics, np.zeros((count, 6 + n)))
    torques = rnea(tree, kinematics, accelerations, np.zeros((count, n)))[:, 3:].copy()
    axes, motion = np.empty((n, 3)), np.empty((3, size, 3))
    out = np.zeros((count, size, 3, 4 + n))
    for s in range(count):
        for i in range(1, len(tree)):
            k = tree[i].number
            put(axes[k - 1], 0, rotate(kinematics.rotations[s, k], get(tree[i].axis, 0)))
        _move(kinematics, vectors, q, u, s, motion)
        for j in range(size):
            Z, z, k = out[s, j], _row(motion[0], j), vectors.bodies[j]
            for a in range(3):
                put_column(Z, a, cross(unit(a), z))
            for i in range(1, len(tree)):
                c = tree[i].number
                if vectors.moves[c - 1, k] and tree[i].kind != PRISMATIC:
                    put_column(Z, 2 + c, cross(_row(axes, c - 1), z))
            if vectors.slides[j]:
                put_column(Z, 2 + k, _row(axes, k - 1))
            put_column(Z, 3 + n, _row(motion[2], j))
    return out, torques


@inner
def _row(x: Array, j: int) -> Triple:  # a view of it would cost more than what it is for
    return x[j, 0], x[j, 1], x[j, 2]


@inner
def _kinematics(tree: Records, q: Array, u: Array) -> BodyKinematics:
    rates = np.zeros((len(q), 3 + u.shape[1]))
    rates[:, 3:] = u
    return forward_kinematics(tree, q, rates, u[:, 3:].copy())
