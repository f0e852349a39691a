"""The paper's linear system, and estimators on noisy records against the Cramer-Rao bound.

The system is A x = b, as printed: every sample's momentum against the first's.

    A = [R0 RN - (R0 RN)_in, Y - Y_in]   b = (R0_in - R0) h0   # eqs. (27), (28)
    A = [R0 RN - (R0 RN)_in, Y]          b = -R0 h0            # eqs. (31), (32), after a spin-up

Methods on the same records: `paper` (least squares (26) with the momentum of the first sample, as
printed), `ls` (the total momentum estimated as well), `ml` (maximum likelihood over the bodies of
a whole record) and `recursive` (the same as the identifier node does it). The last two start from
inertial parameters that are up to 50 % wrong; the bound is of unbiased estimates of the bodies,
without a prior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.trajectory.reference import Kinematics
from spacerobot_ros.estimation.unknowns.minimal import MinimalSet, minimal_set
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.identification.cramer_rao import information_root
from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.identification.least_squares import momentum_columns, sampled_motion
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.recording.record import Record
from spacerobot_ros.types import Array

from . import paper
from .paper import (
    SCALES,
    Scenario,
    forward_motion,
    levels_of,
    momentum_motion,
    noise_of,
    noisy_record,
    scenario,
)
from .tracking import track_identified

_KNOWN = 1e-7  # of the largest singular value; the columns have unit norm
_OPEN = 1e-5  # share of a number's derivatives along what is not told; differences leave 1e-9

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
        scaled = self.A / np.linalg.norm(self.A, axis=0)
        return float(np.linalg.cond(self.A)), float(np.linalg.cond(scaled))

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
        start: One of `paper.STARTS`; `spin_up` takes eqs. (31)-(32).
    """
    columns = momentum_columns(robot, minimal, motion)
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
    return np.concatenate([robot.target_momentum, minimal.of_robot(robot)])


def relative_errors(estimate: Array, truth: Array) -> Array:
    """(truth - estimate) / truth in %, as the paper's RE; NaN for parameters that are nearly zero.

    Below 1e-4 of the largest parameter errors are shares of the large ones, not of their own size.
    """
    tiny = 1e-4 * np.max(np.abs(truth))
    return 100.0 * (truth - estimate) / np.where(np.abs(truth) > tiny, truth, np.nan)


def noise_free(
    axes: str, start: str, structures: Sequence[str] = ('symmetric',)
) -> list[dict[str, Any]]:
    """Identify from noise-free data of both kinds; the integration serves all structures.

    Args:
        axes: Joint axes.
        start: One of `paper.STARTS`.
        structures: Minimal sets: `symmetric` or `generic`.

    Returns:
        Of each structure: size k of the minimal set, condition of A, largest relative
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
        largest = [float(np.nanmax(np.abs(error))) for error in errors]
        without = relative_errors(exact.without_aam().solve(), truth[3:])
        known = paper.CONDITION_REFERENCE.get(f'{axes} {structure}')
        out.append(
            {
                'axes': axes,
                'structure': structure,
                'start': start,
                'k': len(minimal),
                'condition': _conditions(exact.condition),
                'reference': known and {'k': known['k'], **_conditions(known.get(start))},
                'max_error_percent': dict(zip(_KINDS, largest, strict=True)),
                'paper_max_error_percent': paper.LARGEST_EXACT,
                'wrong_model_median_error_percent': float(np.nanmedian(np.abs(without))),
                'unknowns': {
                    'name': ('h_x', 'h_y', 'h_z', *minimal.names),
                    **dict(zip(_KINDS, errors, strict=True)),
                },
            }
        )
    return out


def _conditions(raw_and_unit: tuple[float, float] | None) -> dict[str, float | None]:
    return dict(zip(('raw', 'unit_columns'), raw_and_unit or (None, None), strict=True))


METHODS = ('paper', 'ls', 'recursive', 'ml')
TRACKED = ('ls', 'recursive', 'ml')
"""Methods whose estimate of the first record is tracked with."""
# factors on each body's inertial parameters before identification
_WRONG = np.array([1.25, 1.5, 0.5, 1.5])


def noisy_run(axes: str, scale: float, seed: int) -> dict[str, Any]:
    """Run every method on one noisy record; the first at full noise is tracked with, too.

    Returns:
        By method: (3 + k,) solutions [AAM; x] and chi2 per degree of freedom; the tracking runs.
    """
    case = scenario(axes)
    record = noisy_record(case.robot.joints, momentum_motion(axes), scale, seed)
    found = {
        method: estimate(record, case, scale, method) for method in METHODS if method != 'paper'
    }
    solutions = {name: np.concatenate([e.aam, e.parameters]) for name, e in found.items()}
    samples = sampled_motion(record)
    solutions['paper'] = linear_system(case.robot, case.minimal, samples).solve()
    is_tracked = (scale, seed) == (SCALES[0], 0)
    return {
        'axes': axes,
        'noise_scale': scale,
        'seed': seed,
        'solutions': solutions,
        'chi2_per_dof': {name: e.chi2_per_dof for name, e in found.items()},
        'tracking': {m: track_identified(axes, m, found[m]) for m in TRACKED if is_tracked},
    }


def estimate(record: Record, case: Scenario, scale: float, method: str) -> Estimate:
    """What one of `METHODS` finds, from what is believed before identification."""
    rows = case.believed.inertial_parameters * _WRONG[:, None]
    believed = replace(case.believed.with_inertial_parameters(rows), sensors=noise_of(scale))
    settings = replace(case.identifier, solve_period=2.0)
    return identify(record, believed, settings, method).estimate


def bound_of(axes: str, scale: float = 1.0, attitude_every: int = 1) -> Array:
    """(3 + k,) Cramer-Rao bound of [AAM; x] for records of `noisy_record`."""
    case = scenario(axes)
    exact = noisy_record(case.robot.joints, momentum_motion(axes), 0.0, 0, attitude_every)
    model = MomentumModel(case.robot, case.minimal.structure)
    return bound_std(information_root(model, exact, levels_of(scale)), model)


def true_values(axes: str) -> Array:
    """(3 + k,) true [AAM; x] with the symmetry of Table I."""
    case = scenario(axes)
    return true_solution(case.robot, case.minimal)


def error_figures(values: Array, truth: Array, bound: Array) -> tuple[Array, Array, Array]:
    """Errors of runs.

    Args:
        values: (runs, 3 + k).
        truth: (3 + k,).
        bound: (3 + k,) Cramer-Rao.

    Returns:
        (3 + k,) root mean squares, the same over the bound, and mean error over root mean square:
        about 1/sqrt(runs) for an unbiased method.
    """
    errors = values - truth
    rmse = np.sqrt(np.mean(errors**2, axis=0))
    return rmse, rmse / bound, np.mean(errors, axis=0) / rmse


def score(runs: Sequence[dict[str, Any]], bound: Array) -> list[dict[str, Any]]:
    """Every method over the `noisy_run`s of one robot and noise level, against the bound (3 + k,).

    Returns:
        Of each method: root mean squares over the AAM's components and the base parameters of RMSE
        over bound, over the AAM's of RMSE over the bound of the linear set (the reference's), and
        of |mean error| over RMSE; RMSE of the AAM and median of the base parameters' [%]; mean
        chi2 per degree of freedom, None for `paper`; the reference.
    """
    axes, scale = runs[0]['axes'], runs[0]['noise_scale']
    truth, out, linear = (
        true_values(axes),
        [],
        scale * np.array(paper.BOUND_REFERENCE[axes]['aam']),
    )
    for method in METHODS:
        values = np.array([run['solutions'][method] for run in runs])
        rmse, over, bias = error_figures(values, truth, bound)
        percent = np.abs(relative_errors(truth + rmse, truth))
        chi2 = [run['chi2_per_dof'][method] for run in runs if method != 'paper']
        reference = paper.estimator_reference(axes, scale, method)
        out.append(
            {
                'axes': axes,
                'noise_scale': scale,
                'method': method,
                'runs': len(runs),
                'aam_over_bound': rms(over[:3]),
                'base_over_bound': rms(over[3:]),
                **_compared((rms(percent[:3] / linear), rms(bias))),
                'aam_rmse_percent': percent[:3].tolist(),
                'base_rmse_percent': float(np.nanmedian(percent[3:])),
                'chi2_per_dof': float(np.mean(chi2)) if chi2 else None,
                'reference': reference and _compared(reference),
            }
        )
    return out


def _compared(figures: tuple[float, float]) -> dict[str, float]:
    return dict(zip(('aam_over_linear_bound', 'bias_over_rmse'), figures, strict=True))


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def bound_std(root: Array, model: MomentumModel) -> Array:
    """(3 n_links + k,) smallest standard deviations of an unbiased estimate of [AAM; x].

    Args:
        root: (p, p) square root of an information. What it tells nothing of is infinite.
        model: Its robot is the truth; x are its minimal parameters.
    """
    minimal = minimal_set(model.robot, model.structure)
    bodies, n = model.bodies, model.n_aam
    asked = np.zeros((n + len(minimal), model.size - 3))
    asked[:n, :n] = np.eye(n)
    y = slice(n, n + bodies.size)
    asked[n:, y] = bodies.derivatives(minimal.of_bodies, np.zeros(bodies.size))
    wanted = root[3:, 3:]
    scale = np.linalg.norm(wanted, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    _, singular, right = np.linalg.svd(wanted / scale)
    known = singular > _KNOWN * singular[0]
    along = asked / scale @ right.T
    std = np.linalg.norm(along[:, known] / singular[known], axis=1)
    is_open = np.linalg.norm(along[:, ~known], axis=1) > _OPEN * np.linalg.norm(along, axis=1)
    return np.where(is_open, np.inf, std)
