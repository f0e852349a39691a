"""Identification from a whole record: `spacerobot identify`.

Joint columns that are swapped in positions and rates alike are found by what breaks: momentum.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np

from ..errors import IdentificationError
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.noise_levels import noise_levels
from ..estimation.trajectory.reference import Kinematics, NoiseLevels
from ..estimation.unknowns.minimal import minimal_set
from ..estimation.unknowns.torque_hold import find_holds
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.faults.motion_faults import contradictions
from ..recording.record import Record
from .estimate import Estimate
from .least_squares import sampled_motion, solve_least_squares
from .maximum_likelihood import MaximumLikelihood, prepare
from .outliers import screened
from .summary import Identification, Solution, Source, conclude
from .validity_limits import EXCHANGED_MISFIT, LARGEST_CHI2, SHORTEST

METHODS = ('ml', 'recursive', 'ls')


def identify(
    record: Record, robot: Robot, settings: IdentifierSettings, method: str = 'ml'
) -> Estimate:
    """The estimate of `identify_robot` alone."""
    return identify_robot(record, robot, settings, method).estimate


def identify_robot(
    record: Record, robot: Robot, settings: IdentifierSettings, method: str = 'ml'
) -> Identification:
    """Estimate wheel momentum and minimal parameters from a record.

    Args:
        record: Joint states, gyro and attitude.
        robot: What the robot file believes.
        settings: The identifier's settings.
        method: `ml` (maximum likelihood on the momentum filter), `ls` (the paper's least squares)
            or `recursive` (the same, row by row in square-root form).

    Raises:
        IdentificationError: unknown method, or a record without what is needed.
        ConfigurationError: fixed base or prismatic joints.
    """
    if method not in METHODS:
        raise IdentificationError(f'method {method!r} is not one of {", ".join(METHODS)}')
    refuse_incomplete(record)
    is_likelihood = method == 'ml'
    nuisances = settings.nuisances if is_likelihood else ()
    model = MomentumModel(robot, minimal_set(robot, settings.structure), nuisances)
    noise, notes = noise_levels(robot.sensors, record, is_checked=False)
    joints = robot.joints[: model.n]
    faults = contradictions(record)
    if is_likelihood:
        solution, kinematics = _likeliest(model, settings, record, noise)
        if solution.chi2_per_dof > LARGEST_CHI2:
            kept, left_out = screened(record, noise)
            again = _likeliest(model, settings, kept, noise)[0] if left_out else solution
            if again.chi2_per_dof <= LARGEST_CHI2:
                solution, record, notes = again, kept, (*notes, *left_out)
                faults = contradictions(kept)
            else:
                faults += swapped_joints(model, kinematics, joints)
    else:
        motion = sampled_motion(record)
        solution = solve_least_squares(model, settings, motion, noise, method)
    stamp_ns = record.origin_ns + round(record.span[1] * 1e9)
    source = Source(len(record.q), stamp_ns, (*record.notes, *notes), faults)
    return conclude(model, settings, solution, source)


def _likeliest(
    model: MomentumModel, settings: IdentifierSettings, record: Record, noise: NoiseLevels
) -> tuple[Solution, Kinematics]:
    """The solution of maximum likelihood, and the motion that it is of."""
    stretch = prepare(record, noise, find_holds(record, settings.torque_hold_period))
    likelihood = MaximumLikelihood(model, settings)
    likelihood.solve(stretch)
    solution = likelihood.solution('ml')
    if not likelihood.is_converged:
        solution = replace(solution, doubt='the iteration has not converged')
    return solution, stretch.kinematics


def refuse_incomplete(record: Record) -> None:
    """Refuse a record that is no run of a free-floating robot.

    Raises:
        IdentificationError: a sensor is missing, or the record is too short.
    """
    topics = {'joints': '/joint_states', 'rates': '/imu/data', 'attitudes': '/attitude'}
    missing = [topic for name, topic in topics.items() if getattr(record, name) is None]
    if missing:
        raise IdentificationError(f'{record.source}: has no {", no ".join(missing)}')
    start, end = record.span
    if end - start < SHORTEST:
        raise IdentificationError(
            f'{record.source}: {end - start:.2f} s is too short to identify from'
        )


_ROWS = 200  # times at which momentum is compared


def swapped_joints(
    model: MomentumModel, reference: Kinematics, joints: tuple[str, ...]
) -> tuple[str, ...]:
    """The pair of joints whose exchange makes momentum hold, in a line; empty where none does."""
    sparse = reference.part(slice(None, None, max(1, len(reference.time) // _ROWS)))
    as_given = _momentum_misfit(model, sparse)
    misfits = {}
    for a, b in combinations(range(model.n), 2):
        order = list(range(model.n))
        order[a], order[b] = b, a
        exchanged = replace(sparse, q=sparse.q[:, order], qd=sparse.qd[:, order])
        misfits[joints[a], joints[b]] = _momentum_misfit(model, exchanged)
    if not misfits:
        return ()
    pair = min(misfits, key=lambda names: misfits[names])
    if misfits[pair] < EXCHANGED_MISFIT * as_given:
        return (f'the columns of {pair[0]} and {pair[1]} seem to be swapped',)
    return ()


def _momentum_misfit(model: MomentumModel, reference: Kinematics) -> float:
    columns, h0 = model.regressor(reference)
    rows, right = columns.reshape(-1, model.size), h0.ravel()
    norms = np.linalg.norm(rows, axis=0)
    unit = rows / np.where(norms > 0.0, norms, 1.0)
    if not np.any(right):  # wheels at rest: the smallest singular value of the homogeneous system
        return float(np.linalg.svd(unit[:, norms > 0.0], compute_uv=False)[-1])
    solution = np.linalg.lstsq(unit, right, rcond=1e-12)[0]
    return float(np.linalg.norm(unit @ solution - right))
