"""What an identification from a motion will reach: what `identify` will say of it.

The Fisher information along the trajectory, with the sensors and rates of the robot file
(`identification.cramer_rao`), is combined with the identifier's prior as the identifier does it,
nuisances included. It averages over the factor of the bodies' prior by the evidence of the data:
where the file's bodies are right it finds a small factor and is accordingly surer. So two
precisions of the AAM are said: that of the bodies assumed, which is what `identify` will say if
they are so, and that of bodies which are as uncertain as `robot.uncertainty` states.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..control.joint_reference import check_reference
from ..dynamics.state import initial_state
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.inference.square_root import marginal
from ..estimation.trajectory.base_response import (
    BaseMotion,
    BaseResponse,
    BaseStart,
    noise_free_record,
)
from ..estimation.trajectory.motion_limits import Use
from ..estimation.unknowns.minimal import minimal_set
from ..estimation.unknowns.torque_hold import find_holds
from ..identification.cramer_rao import information_root
from ..identification.momentum_posterior import posterior_of, prior_of
from ..identification.summary import estimated_values
from ..json_values import json_as
from ..model.robot import Robot
from ..types import Array
from .motions import Chosen, MotionFamily
from .problem import Problem, condition_numbers

REST = 10.0  # s of rest, measured before a spin-up
_LEAST_OFTEN = 50.0  # Hz; of the motion along which the base's own is found
_SAMPLING = 0.04  # s; of the motion in the paper's A
_NONZERO = 1e-3  # of the largest parameter; smaller ones have no meaningful relative error
_RANK_TOLERANCE = 1e-8  # differences are good to 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prediction:
    """Expected result of an identification.

    Args:
        bits: Told of the whole estimate [AAM; y], against the prior as the file states it.
        aam_bits: The same of the AAM alone, whatever the bodies.
        told: Number of directions of [AAM; y] better known by the data than by that prior.
        tellable: Number of those that any motion could tell.
        condition: Of the paper's A, raw. unit_condition: With columns of unit norm.
        names: Of [AAM; x], x the minimal parameters. units: Of them.
        values: Of the robot assumed. covariance: Predicted, its bodies as assumed.
        n_aam: Number of wheel-momentum entries.
        stated_std: (n_aam,) of the AAM where the bodies are as uncertain as the file states.
        aam_limit: Largest std of the AAM at which the identifier calls it valid [N m s].
        prior_factor: That the identifier will find.
        uses: How the motion uses every limit.
    """

    json_too = (
        *('scale_std', 'aam_std', 'aam_std_as_stated', 'worst_aam', 'median_parameter'),
        *('worst_parameter', 'std', 'relative_std'),
    )
    bits: float
    aam_bits: float
    told: int
    tellable: int
    condition: float
    unit_condition: float
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array = json_as()
    n_aam: int = json_as()
    stated_std: Array = json_as()
    aam_limit: float
    prior_factor: float
    uses: tuple[Use, ...] = json_as()

    @property
    def std(self) -> Array:
        """Predicted standard deviations of [AAM; x]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def aam_std(self) -> float:
        """Largest predicted standard deviation of the AAM [N m s]; NaN where there is none."""
        return _of_finite(np.max, self.std[: self.n_aam])

    @property
    def aam_std_as_stated(self) -> float:
        """The same where the bodies are as uncertain as the file states."""
        return _of_finite(np.max, self.stated_std)

    @property
    def relative_std(self) -> Array:
        """Predicted std over what it is compared with: |h| of the link, or |x|; NaN for zeros."""
        momenta = self.values[: self.n_aam].reshape(-1, 3)
        sizes = np.repeat(np.linalg.norm(momenta, axis=1), 3)
        scale = np.concatenate([sizes, np.where(self._is_large, np.abs(self._parameters), 0.0)])
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
    def scale_std(self) -> float:
        """Std of the mean relative error of everything that is not zero."""
        momenta = self.values[: self.n_aam]
        known = np.concatenate([np.abs(momenta) > _NONZERO * _largest(momenta), self._is_large])
        share = np.where(known, 1.0, 0.0) / np.where(known, self.values, 1.0)
        share /= max(int(np.sum(known)), 1)
        return float(np.sqrt(share @ self.covariance @ share))

    @property
    def hardest_use(self) -> Use:
        """The limit that the motion comes nearest to, or breaks most."""
        return max(self.uses, key=lambda use: use.fraction)

    @property
    def _parameters(self) -> Array:
        return self.values[self.n_aam :]

    @property
    def _is_large(self) -> Array:
        """(k,) which parameters have a relative error, each unit by itself."""
        units = np.array(self.units[self.n_aam :])
        out = np.zeros(len(units), dtype=bool)
        for unit in set(self.units[self.n_aam :]):
            own = units == unit
            size = np.abs(self._parameters[own])
            out[own] = size > _NONZERO * _largest(size)
        return out


def predict(problem: Problem, chosen: Chosen, *, with_rest: bool = False) -> Prediction:
    """Prediction for a motion of the robot assumed.

    Args:
        problem: Its robot, unknowns and limits.
        chosen: The motion.
        with_rest: Count `REST` seconds of rest, own wheels still, measured before a spin-up.
    """
    return _predict(problem, problem.robot, problem.model, chosen, with_rest=with_rest)


def own_motion(problem: Problem) -> Chosen | None:
    """The robot file's own Fourier motion and first base rate, as they are; None without one."""
    reference = problem.settings.reference
    if reference.kind != 'fourier':
        return None
    check_reference(reference, problem.robot.n_joints)
    initial = initial_state(problem.robot, problem.settings.initial)
    times = np.array([0.0, reference.duration])
    family = MotionFamily(reference.duration, reference.harmonics, problem.family.start, times)
    start = BaseStart(initial.q_WB_xyzw, initial.omega_WB_B)
    return Chosen(family, family.amplitudes(reference), start)


def predict_with_wheels(problem: Problem, chosen: Chosen, momentum: Array) -> Prediction:
    """Prediction for a motion with other momentum (3,) of the own wheels [N m s]."""
    robot, options = problem.robot.with_servicer_momentum(momentum), problem.settings.identifier
    if problem.start_kind == 'spin_up':
        omega = BaseResponse(robot).spun_up(chosen.family.start, momentum)
        chosen = chosen._replace(start=BaseStart(chosen.start.attitude_xyzw, omega))
    believed = problem.believed.with_servicer_momentum(momentum)
    model = MomentumModel(believed, options.structure, options.nuisances)
    return _predict(problem, robot, model, chosen)


def _predict(
    problem: Problem,
    robot: Robot,
    model: MomentumModel,
    chosen: Chosen,
    *,
    with_rest: bool = False,
) -> Prediction:
    """Prediction for a motion of a robot, which may differ from the problem's in its wheels."""
    options, constants = problem.settings.identifier, problem.constants
    motion = _finely(problem, robot, chosen)
    exact = noise_free_record(robot, motion, problem.settings.simulator)
    holds = find_holds(exact, options.torque_hold_period)
    factor = information_root(model, exact, problem.noise, constants, holds)
    if with_rest:
        factor = np.concatenate([factor, _rest_rows(problem, model, motion)])
    _, std = prior_of(model, options.momentum_prior_std, motion.h_W[0], holds)
    # first what is known besides [AAM; y], then the AAM's prior; that of y is for its factor
    data = _with_prior(factor, std, [*range(3), *range(model.y.stop, model.size)])
    factor = _with_prior(data[:, :-1], std, list(range(3, model.y.start)))
    found = posterior_of(model, factor, constants, std, is_expected=True)
    values = estimated_values(model, replace(found, mean=constants))
    told = _strengths(model, data, std)
    some = slice(None, None, max(1, round(_SAMPLING / float(motion.time[1]))))
    raw, unit = condition_numbers(model, _sparse(motion, some))
    share = model.joint_share(motion.kinematics, constants)
    aam = constants[model.aam]
    n = model.n_aam
    axes = tuple(f'h_{link}_{axis}' for link in values['aam_links'] for axis in 'xyz')
    stated = _as_stated(model, factor)
    of_prior = stated / np.outer(std[model.aam], std[model.aam])
    return Prediction(
        bits=float(np.sum(np.log2(np.hypot(1.0, told)))),
        aam_bits=-0.5 * float(np.linalg.slogdet(of_prior)[1]) / np.log(2.0),
        told=int(np.sum(told > 1.0)),
        tellable=_tellable(model),
        condition=float(raw[0]),
        unit_condition=float(unit[0]),
        names=(*axes, *values['parameter_names']),
        units=(*(n * ('N m s',)), *values['units']),
        values=np.concatenate([aam, values['parameters']]),
        covariance=values['covariance'],
        n_aam=n,
        stated_std=np.sqrt(np.diag(stated)),
        aam_limit=options.valid_std * max(float(np.linalg.norm(aam)), share),
        prior_factor=found.factor,
        uses=problem.limits.uses(motion),
    )


def _finely(problem: Problem, robot: Robot, chosen: Chosen) -> BaseMotion:
    """A motion at the samples of the fastest sensor, or more often."""
    rates, duration = problem.settings.simulator, chosen.family.duration
    fastest = max(rates.joint_rate, rates.imu_rate)
    often = fastest * np.ceil(_LEAST_OFTEN / fastest)
    steps = int(np.ceil(often * duration - 1e-9))
    family = chosen.family.at(np.linspace(0.0, duration, steps + 1))
    joints = family.motion(chosen.x[None])
    return BaseResponse(robot).move(family.times, *joints, chosen.start)


def _sparse(motion: BaseMotion, some: slice) -> BaseMotion:
    names = ('q', 'qd', 'qdd', 'omega', 'R_WB', 'torque', 'inverse', 'coupling')
    fewer = {name: getattr(motion, name)[:, some] for name in names}
    return replace(motion, time=motion.time[some], **fewer)


def _with_prior(rows: Array, std: Array, part: list[int]) -> Array:
    """(p, p + 1) square-root information of rows (r, p) and the prior (p,) of some constants."""
    size = len(std)
    prior = np.diag(1.0 / std)[part]
    triangle = np.linalg.qr(np.concatenate([rows, prior, np.zeros((size, size))]), mode='r')
    return np.column_stack([triangle, np.zeros(size)])


def _strengths(model: MomentumModel, data: Array, std: Array) -> Array:
    """(m,) deviations of the prior over those of the data, of the directions of [AAM; y]."""
    wanted = np.arange(3, model.y.stop)
    root = marginal(data, wanted)[:, :-1]
    return np.asarray(np.linalg.svd(root * std[wanted], compute_uv=False))


def _as_stated(model: MomentumModel, factor: Array) -> Array:
    """(n_aam, n_aam) covariance of the AAM where the bodies' prior is as the file states it."""
    prior = np.zeros((model.bodies.size, model.size))
    prior[:, model.y] = np.diag(1.0 / model.bodies.std)
    triangle = np.linalg.qr(np.concatenate([factor[:, :-1], prior]), mode='r')
    inverse = np.linalg.inv(triangle)[model.aam]
    return np.asarray(inverse @ inverse.T)


def _tellable(model: MomentumModel) -> int:
    """Number of directions of [AAM; y] that change the momentum at all."""
    minimal, y = minimal_set(model.robot, model.structure), model.prior()[model.y]
    slopes = model.bodies.derivatives(minimal.of_bodies, y)
    scaled = slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-300)
    return model.n_aam + int(np.linalg.matrix_rank(scaled, tol=_RANK_TOLERANCE * len(y)))


def _rest_rows(problem: Problem, model: MomentumModel, motion: BaseMotion) -> Array:
    """(3, p) whitened rows of a rest before the spin-up: R^T h_W - sum_b R_b h_b = 0, eq. (31)."""
    first = motion.kinematics.part(slice(1))
    still = replace(first, qd=np.zeros_like(first.qd), omega=np.zeros((1, 3)))
    row = model.balance(still, problem.constants)[1][0]
    rates = problem.settings.simulator
    gyro = problem.noise.gyro / np.sqrt(REST * rates.imu_rate)
    attitude = problem.noise.attitude / np.sqrt(REST * rates.attitude_rate)
    D = np.linalg.inv(motion.inverse[0, 0])
    h_B = motion.R_WB[0, 0].T @ motion.h_W[0]
    across = attitude**2 * (h_B @ h_B * np.eye(3) - np.outer(h_B, h_B))
    return np.asarray(np.linalg.solve(np.linalg.cholesky(gyro**2 * D @ D.T + across), row))


def _largest(values: Array) -> float:
    return float(np.max(np.abs(values), initial=0.0))


def _of_finite(function: Callable[[Array], Any], values: Array) -> float:
    finite = values[np.isfinite(values)]
    return float(function(finite)) if len(finite) else float('nan')
