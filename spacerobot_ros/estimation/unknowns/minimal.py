r"""Minimal (base) parameters: the combinations of the bodies' numbers that momentum can tell.

With `structure='generic'` they are the entries of the matrix W of `dynamics.blocks`. Momentum
alone reaches the full set of the reduced dynamics: kinetic energy tells no more.

With `structure='symmetric'` the set is restricted to what robots with the URDF's zeros can have:
an inertia product or a centre-of-mass coordinate of a link that is exactly zero in the URDF stays
zero; the base's centre of mass is free. It is found numerically among the entries for all three
axes of every body: a regressor at random states spans what any motion can excite; going through
its columns in order and keeping each one that is not a combination of those kept gives the set,
and least squares gives how the dropped ones regroup (identification paper, section III).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...dynamics.blocks import BlockTree
from ...model.robot import Robot
from ...types import Array
from ..trajectory.reference import Kinematics

_RANK_TOLERANCE = 1e-9  # the gap lies between 1e-3 (kept) and 1e-15 (dropped) for unit columns
_DISTANCES = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-7)  # of a column from the span of those before it
_SEED = 20  # any seed gives the same set; a fixed one gives the same rounding
_PANEL = 32  # columns that are cleared of those kept before at once
_CHUNK = 500  # samples of a regressor before they are regrouped


@dataclass(frozen=True, slots=True, eq=False)
class MinimalSet:
    """Minimal parameters x of one robot, for one assumed structure.

    Args:
        structure: `symmetric` or `generic`.
        tree: Gives the K entries that x are, or are combinations of.
        names: (k,) name of the entry that each parameter stands for.
        units: (k,) of them.
        rank_gap: Smallest kept over largest dropped singular value of the unit-column regressor.
        expansion: (K, k) entries = expansion @ x that give the same dynamics; None: x itself.
        regrouping: (k, K) x = regrouping @ entries for any that have the assumed structure.
    """

    structure: str
    tree: BlockTree
    names: tuple[str, ...]
    units: tuple[str, ...]
    rank_gap: float = np.inf
    expansion: Array | None = None
    regrouping: Array | None = None

    def __len__(self) -> int:
        """Number k of minimal parameters."""
        return len(self.names)

    def of_bodies(self, mass: Array, com: Array, inertia: Array) -> Array:
        """(..., k) parameters of any bodies on this tree.

        Args:
            mass: (..., b) [kg].
            com: (..., b, 3) centres of mass in the body frames [m].
            inertia: (..., b, 3, 3) about the centres of mass, body axes [kg m^2].
        """
        entries = self.tree.entries(mass, com, inertia)
        return entries if self.regrouping is None else entries @ self.regrouping.T

    def of_robot(self, robot: Robot) -> Array:
        """(k,) parameters of a robot with this tree."""
        bodies = robot.bodies
        return self.of_bodies(
            np.array([b.mass for b in bodies]),
            np.array([b.com for b in bodies]),
            np.array([b.inertia for b in bodies]),
        )

    def matrix(self, parameters: Array) -> Array:
        """(G, G) matrix W of the tree's vectors for parameters (k,)."""
        expansion = self.expansion
        return self.tree.matrix(parameters if expansion is None else expansion @ parameters)


def minimal_regressor(minimal: MinimalSet, motion: Kinematics) -> Array:
    """(N, 3, k) regressor Y of the angular momentum without the robot's wheels: h_B = Y x."""
    u = np.hstack([motion.omega, motion.qd])
    return _regressor(minimal.tree, motion.q, u, minimal.expansion)


def _regressor(tree: BlockTree, q: Array, u: Array, expansion: Array | None) -> Array:
    if expansion is None:
        return tree.regressor(q, u)
    out = np.empty((3 * len(u), expansion.shape[1]))
    for start in range(0, len(u), _CHUNK):
        part = slice(start, start + _CHUNK)
        rows = tree.regressor(q[part], u[part]).reshape(-1, len(expansion))
        out[3 * start : 3 * (start + _CHUNK)] = rows @ expansion
    return out.reshape(len(u), 3, -1)


@lru_cache(maxsize=8)  # a controller asks with every estimate, and has no time to find it again
def minimal_set(robot: Robot, structure: str) -> MinimalSet:
    """Find the minimal parameters of a free-floating robot.

    Args:
        robot: Only its tree and, for `symmetric`, its zeros matter.
        structure: `symmetric` or `generic`.

    Raises:
        ConfigurationError: fixed base.
    """
    tree = BlockTree(robot, whole=structure == 'symmetric')
    if structure == 'generic':
        return MinimalSet(structure, tree, tree.names, tree.units)
    rng = np.random.default_rng(_SEED)
    span, chosen = _structured_span(tree, robot, rng)
    samples, n = max(150, len(tree.pairs)), robot.n_joints
    q, u = rng.uniform(-np.pi, np.pi, (samples, n)), rng.normal(size=(samples, 3 + n))
    rows = _regressor(tree, q, u, span).reshape(3 * samples, -1)
    regressor = np.asarray(np.linalg.qr(rows, mode='r'))  # lengths and angles stay
    unit = _unit_columns(regressor)
    kept = independent_columns(unit)
    singular = np.linalg.svd(unit, compute_uv=False)
    left = singular[len(kept)] if len(kept) < len(singular) else 0.0
    gap = singular[len(kept) - 1] / left if left else np.inf
    combined = _combinations(regressor, kept)
    combined[:, kept] = np.eye(len(kept))
    regrouping = np.zeros((len(kept), len(tree.pairs)))
    regrouping[:, chosen] = combined
    names, units = ([words[chosen[i]] for i in kept] for words in (tree.names, tree.units))
    found = span[:, kept], regrouping
    return MinimalSet(structure, tree, tuple(names), tuple(units), float(gap), *found)


def independent_columns(matrix: Array) -> list[int]:
    """Indices of columns that span a matrix with unit columns, the left ones first.

    Columns that point clearly out of the span of those before are taken first, so that the chosen
    ones are well conditioned; taking every column that is merely independent would regroup with
    factors of thousands.
    """
    kept: list[int] = []
    basis = np.empty((len(matrix), min(matrix.shape)), order='F')
    rest = np.flatnonzero(np.any(matrix, axis=0)).tolist()
    for distance in _DISTANCES:
        left, rest = rest, []
        for start in range(0, len(left), _PANEL):
            panel = matrix[:, left[start : start + _PANEL]]
            for _ in range(2):  # twice is enough (Kahan)
                panel = _outside(panel, basis[:, : len(kept)])
            for place, index in enumerate(left[start : start + _PANEL]):
                norm = np.linalg.norm(panel[:, place])
                if norm > distance:
                    found = _outside(panel[:, place] / norm, basis[:, : len(kept)])
                    basis[:, len(kept)] = found / np.linalg.norm(found)
                    panel = _outside(panel, basis[:, len(kept), None])
                    kept.append(index)
                elif norm > _DISTANCES[-1]:
                    rest.append(index)
    return sorted(kept)


def _outside(vectors: Array, basis: Array) -> Array:
    """What vectors have besides the span of orthonormal ones."""
    return np.asarray(vectors - basis @ (basis.T @ vectors))


def _unit_columns(matrix: Array) -> Array:
    norms = np.linalg.norm(matrix, axis=0)
    return np.asarray(matrix / np.where(norms > 0.0, norms, 1.0))


def _combinations(matrix: Array, kept: list[int]) -> Array:
    """(k, columns) how independent columns combine to all."""
    q, r = np.linalg.qr(matrix[:, kept])
    combined = np.linalg.solve(r, q.T @ matrix)
    combined[np.abs(combined) < _RANK_TOLERANCE] = 0.0
    return np.asarray(combined)


def _structured_span(
    tree: BlockTree, robot: Robot, rng: np.random.Generator
) -> tuple[Array, list[int]]:
    """Map (K, s) from s independent entries to all of them, and the indices of the s.

    From random bodies with the robot's zeros; the base's centre of mass is free.
    """
    shape = len(tree.pairs) + 20, len(robot.bodies)
    drawn = [(rng.normal(size=12), rng.uniform(0.5, 2.0)) for _ in range(math.prod(shape))]
    numbers = np.array([normal for normal, _ in drawn]).reshape(*shape, 4, 3)
    mass = np.array([uniform for _, uniform in drawn]).reshape(shape)
    com, inertia = numbers[:, :, 0], numbers[:, :, 1:] + np.swapaxes(numbers[:, :, 1:], -1, -2)
    is_free = np.array([(b.com != 0.0) | (b.parent < 0) for b in robot.bodies])
    may_be = np.array([(b.inertia != 0.0) | np.eye(3, dtype=bool) for b in robot.bodies])
    samples = tree.entries(mass, com * is_free, inertia * may_be)
    chosen = independent_columns(_unit_columns(samples))
    return _combinations(samples, chosen).T, chosen
