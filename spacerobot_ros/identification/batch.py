"""Identification from a whole record: `spacerobot identify`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import IdentificationError
from ..estimation.minimal import minimal_set
from ..estimation.momentum_process import MomentumModel
from ..estimation.smoothing import SensorData
from ..estimation.torque_hold import find_holds
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.faults.kinematics import contradictions
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate
from .least_squares import sampled_reference, solve_least_squares
from .manifold import on_bodies
from .maximum_likelihood import estimate_constants, prepare
from .noise import noise_levels
from .plausibility import swapped_joints
from .prior import weak_prior
from .summary import LARGEST_CHI2, summarize

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
    data, origin_ns = sensor_data(record, settings.torque_hold_period)
    nuisances = settings.nuisances if method == 'ml' else ()
    model = MomentumModel(robot, minimal_set(robot, settings.structure), nuisances)
    levels, notes = noise_levels(robot.sensors, data)
    notes = (*record.notes, *notes)
    if method == 'ml':
        stretch = prepare(data, levels)
        prior = weak_prior(model, stretch.reference, settings, data.holds)
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
    joints = robot.joints[: data.q.shape[1]]
    faults = contradictions(record)
    if method == 'ml' and linear.chi2_per_dof > LARGEST_CHI2:
        faults += swapped_joints(model, stretch.reference, joints)
    if faults:
        return Identification(replace(linear, valid=False, reason='; '.join(faults)), None)
    if method != 'ml':
        return Identification(linear, None)
    change, _ = information.solve()
    estimate, bodies = on_bodies(
        model, settings, linear, constants + change, information.factor[:, :-1]
    )
    return Identification(
        estimate, None if bodies is None else bodies.robot.with_target_momentum(estimate.aam)
    )


def sensor_data(record: Record, torque_hold_period: float = 0.0) -> tuple[SensorData, int]:
    """Samples of a record in seconds from its first stamp, and that stamp [ns].

    Args:
        record: Joint states, gyro and attitude.
        torque_hold_period: Period over which torques are held; zero where not stated [s].

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
    holds = find_holds(times[0], joints.effort, torque_hold_period, joints.effort_delay)
    return SensorData(
        times[0], joints.position, qd, times[1], rates.omega, times[2], attitudes.q_xyzw, holds
    ), origin
