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


@dataclass(frozen=True, slots=True, eq=False)
class MinimalSet:
    """Minimal parameters x of one robot, for one assumed structure.

    Args:
        structure: `symmetric` or `generic`.
        tree: Gives the K entries that x are, or are combinations of.
        names: (k,) name of the entry that each parameter stands for.
        units: (k,) of them.
        expansion: (K, k) entries = expansion @ x that give the same dynamics; None: x itself.
        regrouping: (k, K) x = regrouping @ entries for any that have the assumed structure.
    """

    structure: str
    tree: BlockTree
    names: tuple[str, ...]
    units: tuple[str, ...]
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
    regressor = minimal.tree.regressor(motion.q, np.hstack([motion.omega, motion.qd]))
    expansion = minimal.expansion
    return regressor if expansion is None else np.asarray(regressor @ expansion)


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
    rows = (tree.regressor(q, u) @ span).reshape(3 * samples, -1)
    regressor = np.asarray(np.linalg.qr(rows, mode='r'))  # lengths and angles stay
    kept = independent_columns(_unit_columns(regressor))
    combined = _combinations(regressor, kept)
    regrouping = np.zeros((len(kept), len(tree.pairs)))
    regrouping[:, chosen] = combined
    names, units = (tuple(each[chosen[i]] for i in kept) for each in (tree.names, tree.units))
    return MinimalSet(structure, tree, names, units, span[:, kept], regrouping)


def independent_columns(matrix: Array) -> list[int]:
    """Indices of columns that span a matrix with unit columns, the left ones first.

    Columns that point clearly out of the span of those before are taken first, so that the chosen
    ones are well conditioned; taking every column that is merely independent would regroup with
    factors of thousands.
    """
    left, kept = matrix.copy(), []
    for distance in _DISTANCES:
        for index in range(matrix.shape[1]):
            norm = np.linalg.norm(left[:, index])
            if norm > distance:
                unit = left[:, index] / norm
                left -= np.outer(unit, unit @ left)
                kept.append(index)
    return sorted(kept)


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
    mass, com = rng.uniform(0.5, 2.0, shape), rng.normal(size=(*shape, 3))
    inertia = rng.normal(size=(*shape, 3, 3))
    inertia += np.swapaxes(inertia, -1, -2)
    is_free = np.array([(b.com != 0.0) | (b.parent < 0) for b in robot.bodies])
    may_be = np.array([(b.inertia != 0.0) | np.eye(3, dtype=bool) for b in robot.bodies])
    samples = tree.entries(mass, com * is_free, inertia * may_be)
    chosen = independent_columns(_unit_columns(samples))
    return _combinations(samples, chosen).T, chosen
