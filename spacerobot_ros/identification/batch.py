"""Identification from a whole record: `spacerobot identify`."""

from __future__ import annotations

from dataclasses import replace

from ..errors import IdentificationError
from ..estimation.minimal import minimal_set
from ..estimation.momentum_process import MomentumModel
from ..estimation.noise_levels import noise_levels
from ..estimation.torque_hold import find_holds
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.faults.kinematics import contradictions
from ..recording.record import Record
from .estimate import Estimate
from .least_squares import sampled_motion, solve_least_squares
from .maximum_likelihood import MaximumLikelihood, prepare
from .plausibility import swapped_joints
from .summary import Identification, Source, conclude
from .validity_limits import LARGEST_CHI2, SHORTEST

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
        holds = find_holds(record, settings.torque_hold_period)
        stretch = prepare(record, noise, holds)
        likelihood = MaximumLikelihood(model, settings)
        likelihood.solve(stretch)
        solution = likelihood.solution(method)
        if not likelihood.is_converged:
            solution = replace(solution, doubt='the iteration has not converged')
        if solution.chi2_per_dof > LARGEST_CHI2:
            faults += swapped_joints(model, stretch.kinematics, joints)
    else:
        motion = sampled_motion(record)
        solution = solve_least_squares(model, settings, motion, noise, method)
    stamp_ns = record.origin_ns + round(record.span[1] * 1e9)
    source = Source(len(record.q), stamp_ns, (*record.notes, *notes), faults)
    return conclude(model, settings, solution, source)


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
