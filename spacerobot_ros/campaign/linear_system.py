r"""The paper's linear system A x = b, as printed: every sample's momentum against the first's.

A = [R0 RN - (R0 RN)_in, Y - Y_in]   b = (R0_in - R0) h0   # eqs. (27), (28)
A = [R0 RN - (R0 RN)_in, Y]          b = -R0 h0            # eqs. (31), (32), after a spin-up
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..dynamics.blocks import BlockTree
from ..estimation.minimal import MinimalSet, minimal_set
from ..estimation.momentum_process import MomentumModel
from ..estimation.reference import Kinematics
from ..model.robot import Robot
from ..types import Array
from . import paper
from .scenario import forward_motion, momentum_motion, scenario

_KINDS = ('momentum_integrated', 'forward_integrated')


@dataclass(frozen=True, slots=True, eq=False)
class LinearSystem:
    """A x = b with x = [AAM; minimal parameters].

    Args:
        A: (3 N, 3 + k). b: (3 N,).
    """

    A: Array
    b: Array

    @property
    def condition(self) -> tuple[float, float]:
        """Condition number of A, and of A with unit columns (its columns have different units)."""
        return float(np.linalg.cond(self.A)), float(
            np.linalg.cond(self.A / np.linalg.norm(self.A, axis=0))
        )

    def solve(self) -> Array:
        """(3 + k,) least-squares solution, columns scaled to unit norm first."""
        scale = np.linalg.norm(self.A, axis=0)
        return np.asarray(np.linalg.lstsq(self.A / scale, self.b, rcond=None)[0]) / scale

    def without_aam(self) -> LinearSystem:
        """The model of everybody else: the captured wheels at rest."""
        return LinearSystem(self.A[:, 3:], self.b)


def linear_system(
    robot: Robot, minimal: MinimalSet, motion: Kinematics, start: str = 'moving'
) -> LinearSystem:
    """Assemble the system from samples.

    Args:
        robot: Gives the tree and the servicer's own wheels.
        minimal: Minimal set.
        motion: Samples, the first at the start.
        start: One of `scenario.STARTS`; `spin_up` takes eqs. (31)-(32).
    """
    model = MomentumModel(robot, minimal)
    columns, _ = model.regressor(motion)
    R = motion.rotation.as_matrix()
    A = -R @ columns[..., 3:]
    h0 = robot.servicer_wheels.body_momentum
    if start == 'spin_up':
        A[..., :3] -= A[:1, :, :3].copy()
        b = -R @ h0
    else:
        A -= A[:1].copy()
        b = (R[0] - R) @ h0
    return LinearSystem(A.reshape(-1, A.shape[2]), b.ravel())


def true_solution(robot: Robot, minimal: MinimalSet) -> Array:
    """(3 + k,) [AAM; minimal parameters] of a robot."""
    return np.concatenate(
        [robot.target_momentum, minimal.regrouping @ BlockTree(robot).parameters()]
    )


def relative_errors(estimate: Array, truth: Array) -> Array:
    """(truth - estimate) / truth in %, as the paper's RE; NaN for parameters that are zero."""
    tiny = 1e-9 * np.max(np.abs(truth))
    return 100.0 * (truth - estimate) / np.where(np.abs(truth) > tiny, truth, np.nan)


def noise_free(
    axes: str, start: str, structures: Sequence[str] = ('symmetric',)
) -> list[dict[str, Any]]:
    """Identify from noise-free data of both kinds; the integration serves all structures.

    Args:
        axes: Joint axes.
        start: One of `scenario.STARTS`.
        structures: Minimal sets: `symmetric` or `generic`.

    Returns:
        Of each structure: size k and rank gap of the minimal set, condition of A, largest relative
        errors on momentum- and on forward-integrated data [%], the median error of the base
        parameters where the captured wheels are left out of the model [%]; beside them the
        reference and the paper's; `unknowns`: names and errors (3 + k,) of all unknowns.
    """
    case = scenario(axes)
    motions = (momentum_motion(axes, start), forward_motion(case, start))
    out = []
    for structure in structures:
        minimal = minimal_set(case.robot, structure)
        truth = true_solution(case.robot, minimal)
        exact, forward = (linear_system(case.robot, minimal, m, start) for m in motions)
        errors = [relative_errors(system.solve(), truth) for system in (exact, forward)]
        without = relative_errors(exact.without_aam().solve(), truth[3:])
        reference = paper.CONDITION_REFERENCE.get((axes, structure))
        out.append(
            {
                'axes': axes,
                'structure': structure,
                'start': start,
                'k': len(minimal),
                'rank_gap': minimal.rank_gap,
                'condition': _conditions(exact.condition),
                'reference': reference and {'k': reference['k'], **_conditions(reference[start])},
                'max_error_percent': {
                    name: float(np.nanmax(np.abs(error)))
                    for name, error in zip(_KINDS, errors, strict=True)
                },
                'paper_max_error_percent': paper.LARGEST_EXACT,
                'wrong_model_median_error_percent': float(np.nanmedian(np.abs(without))),
                'unknowns': {
                    'name': ('h_x', 'h_y', 'h_z', *minimal.names),
                    **dict(zip(_KINDS, errors, strict=True)),
                },
            }
        )
    return out


def _conditions(raw_and_unit: tuple[float, float]) -> dict[str, float]:
    return dict(zip(('raw', 'unit_columns'), raw_and_unit, strict=True))
