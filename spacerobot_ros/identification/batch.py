"""Identification from a whole record: `spacerobot identify`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import IdentificationError
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate
from .least_squares import sampled_reference, solve_least_squares
from .linearize import MomentumModel
from .maximum_likelihood import estimate_constants, prepare
from .minimal import minimal_set
from .momentum_filter import SquareRootInformation
from .noise import noise_levels
from .physical import project
from .prior import weak_prior
from .smoothing import SensorData
from .summary import nuisance_values, summarize

METHODS = ('ml', 'recursive', 'ls')
_SHORTEST = 2.0  # s


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Result of `identify_robot`.

    Args:
        estimate: Wheel momentum and minimal parameters.
        robot: The robot with the bodies and the wheel momentum found; None where no bodies
            were sought (`ls`, `recursive`, a linear manifold) or found.
    """

    estimate: Estimate
    robot: Robot | None


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
    data, origin_ns = sensor_data(record)
    nuisances = settings.nuisances if method == 'ml' else ()
    model = MomentumModel(robot, minimal_set(robot, settings.structure), nuisances)
    levels, notes = noise_levels(robot.sensors, data)
    notes = (*record.notes, *notes)
    if method == 'ml':
        stretch = prepare(data, levels)
        prior = weak_prior(model, stretch.reference, settings)
        constants, engine, converged = estimate_constants(model, stretch, prior)
        information, placebo = engine.information, engine.placebo
    else:
        reference, placebo = sampled_reference(data), None
        prior = weak_prior(model, reference, settings)
        constants, information = solve_least_squares(
            model, reference, levels, recursive=method == 'recursive'
        )
        converged = True
    stamp_ns = origin_ns + round(float(data.joint_time[-1]) * 1e9)
    linear = summarize(
        method,
        model,
        settings,
        constants,
        information,
        prior,
        len(data.joint_time),
        stamp_ns,
        notes,
        placebo,
    )
    if linear.valid and not converged:
        linear = replace(linear, valid=False, reason='the iteration has not converged')
    # Below full rank, bodies would turn what the prior says into what the data seem to say.
    if method != 'ml' or settings.manifold == 'linear' or linear.unexcited:
        return Identification(linear, None)
    return _on_bodies(model, settings, linear, constants, information)


def _on_bodies(
    model: MomentumModel,
    settings: IdentifierSettings,
    linear: Estimate,
    constants: Array,
    information: SquareRootInformation,
) -> Identification:
    """The estimate over physical bodies, or the linear one with the reason where none fit."""
    change, _ = information.solve()
    physical = project(
        model,
        settings.structure,
        constants + change,
        information.factor[:, :-1],
        settings.prior_std,
    )
    if physical.contradiction:
        notes = (*linear.notes, f'{physical.contradiction}; the linear estimate stands')
        return Identification(replace(linear, notes=notes), None)
    aam = physical.constants[model.aam]
    dimension = physical.dimension - 3 - model.nuisances.size
    estimate = replace(
        linear,
        aam=aam,
        parameters=physical.constants[model.x],
        covariance=physical.covariance[3 : model.x.stop, 3 : model.x.stop],
        nuisances=nuisance_values(model, physical.constants, physical.covariance),
        total_momentum=physical.constants[:3],
        total_momentum_covariance=physical.covariance[:3, :3],
        notes=(
            *linear.notes,
            f'estimated over physical bodies: {dimension} dimensions for '
            f'{linear.unknowns} numbers; misfit {physical.misfit:.3g} for {physical.dof} '
            'degrees of freedom',
        ),
    )
    return Identification(estimate, physical.robot.with_target_momentum(aam))


def sensor_data(record: Record) -> tuple[SensorData, int]:
    """Samples of a record in seconds from its first stamp, and that stamp [ns].

    Raises:
        IdentificationError: a sensor is missing, or the record is too short.
    """
    if record.joints is None or record.rates is None or record.attitudes is None:
        missing = [
            name
            for name, series in (
                ('/joint_states', record.joints),
                ('/imu/data', record.rates),
                ('/attitude', record.attitudes),
            )
            if series is None
        ]
        raise IdentificationError(f'{record.source}: has no {", no ".join(missing)}')
    joints, rates, attitudes = record.joints, record.rates, record.attitudes
    origin = int(min(joints.stamp_ns[0], rates.stamp_ns[0], attitudes.stamp_ns[0]))
    times: list[Array] = [
        np.asarray((series.stamp_ns - origin) * 1e-9, dtype=float)
        for series in (joints, rates, attitudes)
    ]
    if times[0][-1] - times[0][0] < _SHORTEST:
        raise IdentificationError(
            f'{record.source}: {times[0][-1] - times[0][0]:.2f} s is too short to identify from'
        )
    qd = joints.velocity if joints.velocity is not None else np.full_like(joints.position, np.nan)
    return SensorData(
        times[0], joints.position, qd, times[1], rates.omega, times[2], attitudes.q_xyzw
    ), origin
