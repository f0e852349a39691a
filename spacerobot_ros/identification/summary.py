"""From constants and information to an `Estimate`: rank, open directions, validity, bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy

from ..estimation.filters.momentum_filter import SquareRootInformation
from ..estimation.filters.momentum_process import MomentumModel
from ..model.robot import Robot
from ..model.settings import IdentifierSettings
from ..types import Array
from .estimate import Estimate, estimated_values
from .physical import project
from .validity_limits import BETTER_THAN_PLACEBO, BETTER_THAN_PRIOR, LARGEST_CHI2
from .weak_prior import Prior


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """What a method found.

    Args:
        method: Its name.
        constants: (p,) [h_W; AAM; x; nuisances].
        information: Square-root information of the errors of what it is solved about, the prior
            included.
        prior: That prior.
        placebo: Information that the reference's own error makes up, where it is known.
        doubt: Why it is not valid, whatever the data say; empty where nothing is.
    """

    method: str
    constants: Array
    information: SquareRootInformation
    prior: Prior
    placebo: SquareRootInformation | None = None
    doubt: str = ''

    @property
    def chi2_per_dof(self) -> float:
        """Residual chi-square per degree of freedom."""
        return self.information.residual / max(self.information.rows - len(self.constants), 1)


@dataclass(frozen=True, slots=True, eq=False)
class Source:
    """What a solution came from.

    Args:
        samples: Number of joint samples.
        stamp_ns: Time of the last one.
        notes: Remarks for the user.
        faults: What is wrong with the sensors.
    """

    samples: int
    stamp_ns: int
    notes: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """An estimate with the bodies behind it.

    Args:
        estimate: Wheel momentum and minimal parameters.
        robot: The robot with the bodies and the wheel momentum found; None where no bodies
            were sought (`ls`, `recursive`, a linear manifold) or found.
        coordinates: Of the bodies, to start the next search from.
    """

    estimate: Estimate
    robot: Robot | None = None
    coordinates: Array | None = None


def conclude(
    model: MomentumModel,
    settings: IdentifierSettings,
    solution: Solution,
    source: Source,
    start: Array | None = None,
) -> Identification:
    """The estimate, over physical bodies where the method is likelihood and no fault is seen.

    Below full rank bodies are not sought: they would turn what the prior says into what the data
    seem to say. Where none fit, the linear estimate stands and a note says which body is at fault.

    Args:
        model: Robot and minimal set.
        settings: Limits of validity, manifold.
        solution: What was found.
        source: From what.
        start: Coordinates of bodies found earlier.
    """
    linear = summarize(model, settings, solution, source)
    is_linear = settings.manifold == 'linear' or solution.placebo is None
    if is_linear or source.faults or linear.unexcited:
        return Identification(linear)
    factor = solution.information.factor[:, :-1]
    found = project(model, settings, solution.constants, factor, start)
    if found.contradiction:
        notes = (*linear.notes, f'{found.contradiction}; the linear estimate stands')
        return Identification(replace(linear, notes=notes))
    dimension = found.dimension - 3 - model.nuisances.size
    note = (
        f'estimated over physical bodies: {dimension} dimensions for {linear.unknowns} numbers; '
        f'misfit {found.misfit:.3g} for {found.dof} degrees of freedom'
    )
    values = estimated_values(model, found.constants, found.covariance)
    estimate = replace(linear, notes=(*linear.notes, note), **values)
    robot = found.robot.with_target_momentum(estimate.aam)
    return Identification(estimate, robot, found.coordinates)


def summarize(
    model: MomentumModel, settings: IdentifierSettings, solution: Solution, source: Source
) -> Estimate:
    """The estimate over the linear minimal set."""
    constants, prior = solution.constants, solution.prior
    _, covariance = solution.information.solve()
    wanted = slice(3, model.x.stop)
    factor, _ = marginal(solution.information.factor, wanted)
    made_up = np.zeros_like(factor)
    if solution.placebo is not None:
        made_up = solution.placebo.factor[:, wanted]
    scale = prior.std[wanted]
    singular = np.linalg.svd(factor / np.linalg.norm(factor, axis=0), compute_uv=False)
    weak = _weak_directions(factor * scale, made_up * scale)
    if weak:
        # The unexcited directions are not straight (everything may scale together), so no linear
        # covariance tells how far along them the truth may lie: only the prior does.
        covariance = covariance + np.diag(prior.std**2)
    unexcited = tuple(_describe(direction, model.names) for direction in weak)
    notes = source.notes
    if not np.any(model.robot.servicer_wheels.body_momentum):
        notes = (*notes, _ratios(model.names, constants[wanted]))
    estimate = Estimate(
        method=solution.method,
        valid=True,
        reason='',
        rank=len(model.names) - len(weak),
        condition=float(singular[0] / singular[-1]),
        unexcited=unexcited,
        chi2_per_dof=solution.chi2_per_dof,
        samples=source.samples,
        stamp_ns=source.stamp_ns,
        notes=notes,
        weak=np.array(weak).reshape(len(weak), len(model.names)),
        **estimated_values(model, constants, covariance),
    )
    reason = '; '.join(source.faults) or _doubt(estimate, settings.valid_std) or solution.doubt
    return replace(estimate, valid=not reason, reason=reason)


def marginal(factor: Array, wanted: slice) -> tuple[Array, Array]:
    """Square-root information of some constants, the others eliminated.

    Args:
        factor: (p, p + 1) of all, with its right-hand side.
        wanted: The m that are kept.

    Returns:
        (m, m) upper triangular, and (m,) right-hand side.
    """
    others = np.ones(len(factor), dtype=bool)
    others[wanted] = False
    ordered = np.column_stack([factor[:, :-1][:, others], factor[:, wanted], factor[:, -1]])
    (triangle,) = scipy.linalg.qr(ordered, mode='r')
    rest = triangle[int(np.sum(others)) : len(factor)]
    size = rest.shape[0]
    return np.asarray(rest[:, -size - 1 : -1]), np.asarray(rest[:, -1])


def _weak_directions(factor: Array, made_up: Array) -> list[Array]:
    """Unit vectors that the data hardly tell better than the prior or than a placebo.

    Args:
        factor: Square-root information, unknowns in units of the prior's std.
        made_up: The placebo's, likewise.
    """
    least = np.hypot(1.0, BETTER_THAN_PRIOR) * np.eye(factor.shape[1])
    bar = np.linalg.qr(np.vstack([least, np.sqrt(BETTER_THAN_PLACEBO) * made_up]), mode='r')
    relative = scipy.linalg.solve_triangular(bar, factor.T, trans='T').T
    _, singular, right = np.linalg.svd(relative)
    weak = [np.linalg.solve(bar, right[i]) for i in np.flatnonzero(singular < 1.0)]
    return [direction / np.linalg.norm(direction) for direction in weak]


def _describe(direction: Array, names: tuple[str, ...]) -> str:
    """The direction's largest components, such as `0.71 J0xx + 0.70 J0yy`."""
    order = np.argsort(-np.abs(direction))
    chosen = [i for i in order[:4] if abs(direction[i]) > 0.2] or [order[0]]
    sign = np.sign(direction[chosen[0]])
    terms = [f'{sign * direction[i]:+.2f} {names[i]}' for i in chosen]
    return ' '.join(terms).removeprefix('+')


def _ratios(names: tuple[str, ...], values: Array) -> str:
    """What is left where no momentum is known: everything over the largest number."""
    largest = int(np.argmax(np.abs(values)))
    ratios = ', '.join(
        f'{name} {value / values[largest]:.5g}' for name, value in zip(names, values, strict=True)
    )
    return (
        "the servicer's own wheels are at rest, so the common scale is not observable; "
        f'ratios to {names[largest]}: {ratios}'
    )


def _doubt(estimate: Estimate, valid_std: float) -> str:
    """Why the data do not suffice; empty where they do."""
    if estimate.unexcited:
        open_ones = f'{len(estimate.unexcited)} of {estimate.unknowns}'
        return f'{open_ones} directions are not excited yet'
    aam = estimate.aam
    limit = valid_std * max(float(np.linalg.norm(aam)), 1e-9)
    if len(aam) and (largest := np.max(estimate.std[: len(aam)])) > limit:
        return f'wheel momentum is known to {largest:.3g} N m s only, the limit is {limit:.3g}'
    if estimate.chi2_per_dof > LARGEST_CHI2:
        return unexplained(estimate.chi2_per_dof)
    return ''


def unexplained(chi2_per_dof: float) -> str:
    """What to say of a misfit."""
    chi2 = f'{chi2_per_dof:.3g}'
    return f'the model does not explain the data: chi2 per degree of freedom is {chi2}'


def nothing_known(
    model: MomentumModel, settings: IdentifierSettings, reason: str, stamp_ns: int
) -> Estimate:
    """The prior as an estimate that is not valid, for a reason, at a stamp [ns]."""
    prior = model.prior()
    std = np.full(model.size, settings.prior_std * np.max(np.abs(prior[model.x])))
    std[:3], std[model.aam] = 10.0 * settings.momentum_prior_std, settings.momentum_prior_std
    known = estimated_values(model, prior, np.diag(std**2))
    return Estimate(
        method='online',
        valid=False,
        reason=reason,
        rank=0,
        condition=float('inf'),
        unexcited=('every direction',),
        chi2_per_dof=0.0,
        samples=0,
        stamp_ns=stamp_ns,
        **{**known, 'nuisances': ()},
    )
