"""Identification from a whole record: `spacerobot identify`."""

from __future__ import annotations

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
from .noise import noise_levels
from .prior import weak_prior
from .smoothing import SensorData
from .summary import summarize

METHODS = ('ml', 'recursive', 'ls')
_SHORTEST = 2.0  # s


def identify(
    record: Record, robot: Robot, settings: IdentifierSettings, method: str = 'ml'
) -> Estimate:
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
    model = MomentumModel(robot, minimal_set(robot, settings.structure))
    levels, notes = noise_levels(robot.sensors, data)
    notes = (*record.notes, *notes)
    if method == 'ml':
        stretch = prepare(data, levels)
        prior = weak_prior(model, stretch.reference, settings)
        constants, engine, converged = estimate_constants(model, stretch, prior)
        information = engine.information
        if not converged:
            notes = (*notes, 'the iteration has not converged')
    else:
        reference = sampled_reference(data)
        prior = weak_prior(model, reference, settings)
        constants, information = solve_least_squares(
            model, reference, levels, recursive=method == 'recursive'
        )
    stamp_ns = origin_ns + round(float(data.joint_time[-1]) * 1e9)
    return summarize(
        method,
        model,
        settings,
        constants,
        information,
        prior,
        len(data.joint_time),
        stamp_ns,
        notes,
    )


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
