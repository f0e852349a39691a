r"""Minimal (base) parameters: the combinations of block parameters that angular momentum can tell.

The set is found numerically: a regressor at random states spans what any motion can excite; going
through its columns in order and keeping each one that is not a combination of those kept gives the
minimal set, and least squares gives how the dropped ones regroup (identification paper, section
III; docs/equations.md). Momentum alone reaches the full set of the reduced dynamics: adding
kinetic-energy rows never raises the rank.

With `structure='symmetric'` the set is restricted to what robots with the URDF's zeros can have:
an inertia product or a centre-of-mass coordinate of a link that is exactly zero in the URDF stays
zero; the base's centre of mass is free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...dynamics.blocks import BlockTree
from ...model.robot import Body, Robot
from ...types import Array

_RANK_TOLERANCE = 1e-9  # the gap lies between 1e-3 (kept) and 1e-15 (dropped) for unit columns
_DISTANCES = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-7)  # of a column from the span of those before it
_SEED = 20  # any seed gives the same set; a fixed one gives the same rounding


@dataclass(frozen=True, slots=True, eq=False)
class MinimalSet:
    """Minimal parameters x of one robot, for one assumed structure.

    Args:
        names: (k,) name of the block parameter that each kept column stands for.
        expansion: (K, k) block parameters pi = expansion @ x that give the same dynamics.
        regrouping: (k, K) x = regrouping @ pi for every pi that has the assumed structure.
        rank_gap: Smallest kept over largest dropped singular value of the unit-column regressor.
        unit: Unit of every entry of x.
    """

    names: tuple[str, ...]
    expansion: Array
    regrouping: Array
    rank_gap: float
    unit: str = 'kg m^2'

    def __len__(self) -> int:
        """Number k of minimal parameters."""
        return len(self.names)


@lru_cache(maxsize=8)  # a controller asks with every estimate, and has no time to find it again
def minimal_set(robot: Robot, structure: str) -> MinimalSet:
    """Find the minimal parameters of a free-floating robot.

    Args:
        robot: Robot with revolute joints; only its tree and, for `symmetric`, its zeros matter.
        structure: `symmetric` or `generic`.

    Raises:
        ConfigurationError: fixed base or prismatic joints.
    """
    tree = BlockTree(robot)
    rng = np.random.default_rng(_SEED)
    if structure == 'symmetric':
        span, chosen = _structured_span(tree, robot, rng)
    else:
        span, chosen = np.eye(len(tree.names)), list(range(len(tree.names)))
    regressor = _random_regressor(tree, rng) @ span
    norms = np.linalg.norm(regressor, axis=0)
    unit = regressor / np.where(norms > 0.0, norms, 1.0)
    kept = independent_columns(unit)
    singular = np.linalg.svd(unit, compute_uv=False)
    left = singular[len(kept)] if len(kept) < len(singular) else 0.0
    gap = singular[len(kept) - 1] / left if left else np.inf
    combined = np.linalg.lstsq(regressor[:, kept], regressor, rcond=None)[0]
    combined[np.abs(combined) < _RANK_TOLERANCE] = 0.0
    combined[:, kept] = np.eye(len(kept))
    regrouping = np.zeros((len(kept), len(tree.names)))
    regrouping[:, chosen] = combined
    names = tuple(tree.names[chosen[i]] for i in kept)
    return MinimalSet(names, span[:, kept], regrouping, float(gap))


def independent_columns(matrix: Array) -> list[int]:
    """Indices of columns that span a matrix with unit columns, the left ones first.

    Columns that point clearly out of the span of those before are taken first, so that the chosen
    ones are well conditioned; taking every column that is merely independent would regroup with
    factors of thousands.
    """
    kept: list[int] = []
    basis = np.zeros((len(matrix), 0))
    for distance in _DISTANCES:
        for index in sorted(set(range(matrix.shape[1])) - set(kept)):
            column = matrix[:, index]
            rest = column - basis @ (basis.T @ column)
            rest -= basis @ (basis.T @ rest)  # twice is enough (Kahan)
            norm = np.linalg.norm(rest)
            if norm > distance:
                kept.append(index)
                basis = np.column_stack([basis, rest / norm])
    return sorted(kept)


def _random_regressor(tree: BlockTree, rng: np.random.Generator) -> Array:
    samples = max(150, len(tree.names))
    q = rng.uniform(-np.pi, np.pi, (samples, tree.n))
    u = rng.normal(size=(samples, 3 + tree.n))
    rotations = tree.rotations(q)
    return tree.regressor(rotations, tree.rate_maps(rotations), u).reshape(3 * samples, -1)


def _structured_span(
    tree: BlockTree, robot: Robot, rng: np.random.Generator
) -> tuple[Array, list[int]]:
    """Map (K, s) from s independent block parameters to all of them, and the indices of the s."""
    count = len(tree.names) + 20
    samples = np.array([tree.parameters(_random_alike(robot, rng)) for _ in range(count)])
    norms = np.linalg.norm(samples, axis=0)
    unit = samples / np.where(norms > 0.0, norms, 1.0)
    chosen = independent_columns(unit)
    span = np.linalg.lstsq(samples[:, chosen], samples, rcond=None)[0].T
    span[np.abs(span) < _RANK_TOLERANCE] = 0.0
    return span, chosen


def _random_alike(robot: Robot, rng: np.random.Generator) -> Robot:
    """A robot with the same tree and zeros, but other numbers; the base's centre is free."""
    bodies = [
        _random_body(body, rng, is_base=index == 0) for index, body in enumerate(robot.bodies)
    ]
    return replace(robot, bodies=tuple(bodies))


def _random_body(body: Body, rng: np.random.Generator, is_base: bool) -> Body:
    com = rng.normal(size=3)
    inertia = rng.normal(size=(3, 3))
    inertia = inertia + inertia.T
    if not is_base:
        com = np.where(body.com == 0.0, 0.0, com)
        products = np.where(body.inertia == 0.0, 0.0, inertia)
        inertia = np.where(np.eye(3, dtype=bool), inertia, products)
    else:
        inertia = np.where(np.eye(3, dtype=bool) | (body.inertia != 0.0), inertia, 0.0)
    return replace(body, mass=float(rng.uniform(0.5, 2.0)), com=com, inertia=inertia)
