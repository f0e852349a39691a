"""What an identification from a motion will reach: the trajectory-aware Cramer-Rao bound.

The bound uses the sensors and rates of the robot file, and is over what the identifier estimates
(`information.Unknowns`): on the physical manifold it is smaller than over the linear set. The
identifier's prior stands in for directions that the motion does not tell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..control.joint_reference import check_reference
from ..dynamics.state import initial_state
from ..estimation.filters.momentum_process import MomentumModel
from ..identification.cramer_rao import information_root
from ..model.robot import Robot
from ..types import Array
from .base_response import BaseMotion, BaseResponse, BaseStart, noise_free_record
from .motion_limits import Use
from .motions import MotionFamily
from .problem import Problem, condition_numbers

REST = 10.0  # s of rest, measured before a spin-up
_LEAST_OFTEN = 50.0  # Hz; of the motion along which the base's own is found
_SAMPLING = 0.04  # s; of the motion in the paper's A
_NONZERO = 1e-3  # of the largest parameter; smaller ones have no meaningful relative error
_BETTER = 3.0  # times better known than before: a direction that the motion tells
_JSON = (
    *('bits', 'told', 'tellable', 'condition', 'unit_condition', 'scale_std', 'worst_aam'),
    *('median_parameter', 'worst_parameter', 'names', 'values', 'std', 'relative_std'),
)


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Expected result of an identification.

    Args:
        bits: Told of the whole estimate, against the identifier's prior.
        told: Number of directions that get at least three times better known.
        tellable: Number of those that any motion could tell.
        condition: Of the paper's A, raw. unit_condition: With columns of unit norm.
        names: Of [AAM; x]. values: Of the robot assumed. covariance: Predicted.
        n_aam: Number of wheel-momentum entries.
        scale_std: Relative standard deviation of the common scale of all [AAM; x].
        uses: How the motion uses every limit.
    """

    bits: float
    told: int
    tellable: int
    condition: float
    unit_condition: float
    names: tuple[str, ...]
    values: Array
    covariance: Array
    n_aam: int
    scale_std: float
    uses: tuple[Use, ...]

    @property
    def std(self) -> Array:
        """Predicted standard deviations of [AAM; x], in N m s and kg m^2."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def relative_std(self) -> Array:
        """Predicted std over what it is compared with: |h| of the link, or |x|; NaN for zeros."""
        momenta = self.values[: self.n_aam].reshape(-1, 3)
        sizes = np.repeat(np.linalg.norm(momenta, axis=1), 3)
        x = np.abs(self.values[self.n_aam :])
        x = np.where(x > _NONZERO * x.max(), x, 0.0)
        scale = np.concatenate([sizes, x])
        return self.std / np.where(scale > 0.0, scale, np.nan)

    @property
    def worst_aam(self) -> float:
        """Largest relative std of a wheel-momentum component; NaN where there is none."""
        return _of_finite(np.max, self.relative_std[: self.n_aam])

    @property
    def worst_parameter(self) -> float:
        """Largest relative std of a minimal parameter."""
        return _of_finite(np.max, self.relative_std[self.n_aam :])

    @property
    def median_parameter(self) -> float:
        """Median relative std of the minimal parameters."""
        return _of_finite(np.median, self.relative_std[self.n_aam :])

    @property
    def hardest_use(self) -> Use:
        """The limit that the motion comes nearest to, or breaks most."""
        return max(self.uses, key=lambda use: use.fraction)

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        return {name: getattr(self, name) for name in _JSON}


def predict_design(problem: Problem, x: Array, *, with_rest: bool = False) -> Prediction:
    """Prediction for amplitudes x of the problem's family.

    Args:
        problem: Its robot, limits and start.
        x: (size,) [rad].
        with_rest: Count `REST` seconds of rest, own wheels still, measured before a spin-up.
    """
    return _predict(problem, problem.robot, problem.family, x, problem.start, with_rest=with_rest)


def predict_reference(problem: Problem) -> Prediction | None:
    """Prediction for the robot file's own Fourier motion and first rate; None without one."""
    reference = problem.settings.reference
    if reference.kind != 'fourier':
        return None
    check_reference(reference, problem.robot.n_joints)
    initial = initial_state(problem.robot, problem.settings.initial)
    times = np.array([0.0, reference.duration])
    family = MotionFamily(reference.duration, reference.harmonics, problem.family.start, times)
    start = BaseStart(initial.q_WB_xyzw, initial.omega_WB_B)
    x = family.amplitudes(reference)
    return _predict(problem, problem.robot, family, x, start)


def predict_with_wheels(problem: Problem, x: Array, momentum: Array) -> Prediction:
    """Prediction for amplitudes x (size,) with other momentum (3,) of the own wheels [N m s]."""
    robot, start = problem.robot.with_servicer_momentum(momentum), problem.start
    if problem.start_kind == 'spin_up':
        omega = BaseResponse(robot).spun_up(problem.family.start, momentum)
        start = BaseStart(start.attitude_xyzw, omega)
    return _predict(problem, robot, problem.family, x, start)


def _predict(
    problem: Problem,
    robot: Robot,
    family: MotionFamily,
    x: Array,
    start: BaseStart,
    *,
    with_rest: bool = False,
) -> Prediction:
    """Prediction for a motion of a robot, which may differ from the problem's in its wheels."""
    rates = problem.settings.simulator
    fastest = max(rates.joint_rate, rates.imu_rate)
    often = fastest * np.ceil(_LEAST_OFTEN / fastest)
    steps = int(np.ceil(often * family.duration - 1e-9))
    family = family.at(np.linspace(0.0, family.duration, steps + 1))
    motion = BaseResponse(robot).move(family.times, *family.motion(x[None]), start)
    unknowns, model = problem.unknowns, MomentumModel(robot, problem.minimal)
    exact = noise_free_record(robot, motion, problem.settings.simulator)
    factor = information_root(model, exact, problem.noise)
    if with_rest:
        factor = np.concatenate([factor, _rest_rows(problem, model, motion)])
    columns, _ = model.regressor(motion.kinematics)
    some = slice(None, None, max(1, round(_SAMPLING / float(motion.time[1]))))
    raw, unit = condition_numbers(columns[None, some], motion.R_WB[:, some])
    triangle = np.asarray(np.linalg.qr(factor @ unknowns.to_constants, mode='r'))[3:, 3:]
    _, singular, right = np.linalg.svd(triangle * unknowns.prior_std)
    strength = np.zeros(len(unknowns))
    strength[: len(singular)] = singular
    shrink = 1.0 / np.hypot(1.0, strength)
    root = unknowns.to_constants[3:, 3:] * unknowns.prior_std @ (right.T * shrink)
    values = model.prior()[3:]
    return Prediction(
        bits=float(-np.sum(np.log2(shrink))),
        told=int(np.sum(strength > _BETTER)),
        tellable=unknowns.observable,
        condition=float(raw[0]),
        unit_condition=float(unit[0]),
        names=model.names,
        values=values,
        covariance=root @ root.T,
        n_aam=model.n_aam,
        scale_std=_scale_std(values, root),
        uses=problem.limits.uses(motion),
    )


def _scale_std(values: Array, root: Array) -> float:
    """Std of the mean relative error of everything that is not zero."""
    known = np.abs(values) > _NONZERO * np.max(np.abs(values))
    return float(np.linalg.norm(np.mean(root[known] / values[known, None], axis=0)))


def _rest_rows(problem: Problem, model: MomentumModel, motion: BaseMotion) -> Array:
    """(3, p) whitened rows of a rest before the spin-up: R^T h_W - sum_b R_b h_b = 0, eq. (31)."""
    first = motion.kinematics.part(slice(1))
    still = replace(first, qd=np.zeros_like(first.qd), omega=np.zeros((1, 3)))
    row = model.regressor(still)[0][0]
    rates = problem.settings.simulator
    gyro = problem.noise.gyro / np.sqrt(REST * rates.imu_rate)
    attitude = problem.noise.attitude / np.sqrt(REST * rates.attitude_rate)
    D = np.linalg.inv(motion.inverse[0, 0])
    h_B = motion.R_WB[0, 0].T @ motion.h_W[0]
    across = attitude**2 * (h_B @ h_B * np.eye(3) - np.outer(h_B, h_B))
    return np.asarray(np.linalg.solve(np.linalg.cholesky(gyro**2 * D @ D.T + across), row))


def _of_finite(function: Callable[[Array], Any], values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(function(finite)) if len(finite) else float('nan')
