r"""The published method: linear least squares on the momentum equation, sample by sample.

    R_k^T h_W - sum_b R_b h_b - Y(q, q', w) x = h0        # eqs. (22)-(28) of the identification
    paper

Rows are taken to the inertial frame, where the total momentum h_W is a constant unknown (never the
first sample's). There is no prior, so it needs motion that excites every direction of the minimal
set; noise in the regressor biases the result towards zero. `method='ml'` is the remedy of both,
this is the comparison.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Slerp

from ..dynamics.rotation import skew
from ..errors import ConfigurationError, IdentificationError
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.inference.square_root import SquareRootInformation, marginal
from ..estimation.trajectory.reference import Kinematics, NoiseLevels
from ..estimation.unknowns.minimal import MinimalSet, minimal_regressor, minimal_set
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate
from .summary import Source, too_weak, unexplained
from .validity_limits import LARGEST_CHI2, WEAKLY_KNOWN

_STEP = 1e-5  # rad, rad/s; for derivatives by what is measured


def sampled_motion(record: Record) -> Kinematics:
    """Raw samples at the joints' stamps: gyro and attitude interpolated, nothing smoothed.

    Raises:
        IdentificationError: fewer than two gyro or attitude samples, or no stretch that all
            sensors cover.
    """
    rate_time, attitude_time, attitude = record.rate_time, record.attitude_time, record.attitude
    if attitude is None or min(len(rate_time), len(attitude_time)) < 2:
        raise IdentificationError('least squares needs at least two gyro and two attitude samples')
    start = max(rate_time[0], attitude_time[0])
    end = min(rate_time[-1], attitude_time[-1])
    inside = (record.joint_time >= start) & (record.joint_time <= end)
    if record.qd is None or not np.any(inside):
        raise IdentificationError(
            'least squares needs joint positions and rates while gyro and attitude are measured'
        )
    time = record.joint_time[inside]
    omega = np.column_stack([np.interp(time, rate_time, column) for column in record.omega.T])
    rotation = Slerp(attitude_time, attitude)(time)
    return Kinematics(time, record.q[inside], record.qd[inside], omega, rotation)


def momentum_columns(robot: Robot, minimal: MinimalSet, motion: Kinematics) -> Array:
    """(N, 3, p) columns of [h_W; AAM; x] of the momentum equation, in the base frame."""
    by_momenta = MomentumModel(robot, minimal.structure)
    columns = by_momenta.balance(motion, by_momenta.prior())[1][..., : by_momenta.y.start]
    return np.concatenate([columns, -minimal_regressor(minimal, motion)], axis=2)


def solve_least_squares(
    record: Record, robot: Robot, settings: IdentifierSettings, noise: NoiseLevels, source: Source
) -> Estimate:
    """Least squares for [h_W; AAM; x].

    The information is scaled by the residual's own spread; the residual is judged against the
    sensors' noise.

    Args:
        record: Joint states, gyro and attitude.
        robot: What the robot file believes.
        settings: Structure of the minimal set, limit of validity.
        noise: Noise levels, to judge the residual.
        source: Of the estimate.

    Raises:
        ConfigurationError: sliding joints.
    """
    for joint, body in zip(robot.joints, robot.bodies[1:], strict=True):
        if body.is_prismatic:
            why = "slides; the paper's least squares is for joints that turn: use method `ml`"
            raise ConfigurationError(f'joint {joint!r}', why)
    minimal, motion = minimal_set(robot, settings.structure), sampled_motion(record)
    columns, h0 = momentum_columns(robot, minimal, motion), robot.servicer_wheels.body_momentum
    rows, values = (motion.matrices @ columns).reshape(-1, columns.shape[2]), motion.matrices @ h0
    information = SquareRootInformation(rows.shape[1])
    information.add(rows, values.ravel())
    dof = max(values.size - information.size, 1)
    information.factor /= max((information.residual / dof) ** 0.5, 1e-300)
    constants, covariance = information.solve()
    n = 3 * len(robot.target_wheels)
    names = (*(f'h_{g.link}_{a}' for g in robot.target_wheels for a in 'xyz'), *minimal.names)
    root = marginal(information.factor, np.arange(3, len(constants)))[:, :-1]
    singular = np.linalg.svd(root / np.linalg.norm(root, axis=0), compute_uv=False)
    sizes = [np.max(np.abs(x), initial=1e-300) for x in np.split(constants[3:], [n])]
    _, spread, directions = np.linalg.svd(root * np.repeat(sizes, [n, len(minimal)]))
    weak = list(directions[spread < WEAKLY_KNOWN])  # unit vectors that the data hardly tell
    chi2 = _chi2(robot, minimal, motion, constants, noise) / dof
    aam, std = constants[3 : 3 + n], np.sqrt(np.diag(covariance)[3 : 3 + n])
    limit = settings.valid_std * max(float(np.linalg.norm(aam)), 1e-9)
    reason = '; '.join(source.faults)
    if not reason and weak:
        reason = f'{len(weak)} of {len(names)} directions are not excited yet'
    if not reason and np.any(std > limit):
        reason = too_weak(float(np.max(std)), limit)
    if not reason and chi2 > LARGEST_CHI2:
        reason = unexplained(chi2)
    return Estimate(
        method='ls',
        valid=not reason,
        reason=reason,
        aam_links=tuple(g.link for g in robot.target_wheels),
        aam=aam,
        parameter_names=minimal.names,
        parameters=constants[3 + n :],
        units=minimal.units,
        covariance=covariance[3:, 3:],
        rank=len(names) - len(weak),
        unknowns=len(names),
        condition=float(singular[0] / max(singular[-1], np.finfo(float).tiny)),
        unexcited=tuple(_describe(direction, names) for direction in weak),
        total_momentum=constants[:3],
        total_momentum_covariance=covariance[:3, :3],
        chi2_per_dof=chi2,
        samples=source.samples,
        stamp_ns=source.stamp_ns,
        notes=source.notes,
        sources=('data',) * len(names),
    )


def _describe(direction: Array, names: tuple[str, ...]) -> str:
    """The direction's largest components, such as `0.71 J0xx + 0.70 J0yy`."""
    order = np.argsort(-np.abs(direction))
    chosen = [i for i in order[:4] if abs(direction[i]) > 0.2] or [order[0]]
    sign = np.sign(direction[chosen[0]])
    terms = [f'{sign * direction[i]:+.2f} {names[i]}' for i in chosen]
    return ' '.join(terms).removeprefix('+')


def _chi2(
    robot: Robot, minimal: MinimalSet, motion: Kinematics, constants: Array, noise: NoiseLevels
) -> float:
    """Sum of squares of the missing momentum, weighted by what noise makes of it."""

    def missing(**changed: Array) -> Array:
        columns = momentum_columns(robot, minimal, replace(motion, **changed))
        return np.asarray(columns @ constants - robot.servicer_wheels.body_momentum)

    levels = {'omega': noise.gyro, 'qd': noise.joint_velocity, 'q': noise.joint_position}
    parts = [noise.attitude * skew(motion.rotation.inv().apply(constants[:3]))]
    for name, std in levels.items():
        values = getattr(motion, name)
        steps = _STEP * np.eye(values.shape[1])
        changes = [missing(**{name: values + s}) - missing(**{name: values - s}) for s in steps]
        parts.append(std / (2.0 * _STEP) * np.stack(changes, axis=2))
    covariance = sum(part @ np.swapaxes(part, 1, 2) for part in parts)
    left = missing()
    return float(np.sum(left * np.linalg.solve(covariance, left[..., None])[..., 0]))
