"""From constants and information to an `Estimate`: rank, unexcited directions, validity."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..estimation.momentum_filter import SquareRootInformation
from ..estimation.momentum_process import MomentumModel
from ..model.settings import IdentifierSettings
from ..types import Array
from .estimate import Estimate, NamedValue
from .prior import Prior

# A direction counts as excited once the data know it this many times better than the prior, and
# have this many times the information that the reference's own error makes up.
_BETTER_THAN_PRIOR = 3.0
_BETTER_THAN_PLACEBO = 100.0
# Beyond this the stated noise does not explain the residual, and no standard deviation holds.
LARGEST_CHI2 = 2.0


def summarize(
    method: str,
    model: MomentumModel,
    settings: IdentifierSettings,
    constants: Array,
    information: SquareRootInformation,
    prior: Prior,
    samples: int,
    stamp_ns: int,
    notes: tuple[str, ...] = (),
    placebo: SquareRootInformation | None = None,
) -> Estimate:
    """Build the estimate.

    Args:
        method: Name of the method.
        model: Robot and minimal set.
        settings: Limits of validity.
        constants: (p,) [h_W; AAM; x].
        information: Square-root information of their errors, the prior included.
        prior: That prior.
        samples: Number of samples used.
        stamp_ns: Time of the last one.
        notes: Remarks for the user.
        placebo: Information that the reference's own error makes up, where it is known.
    """
    _, covariance = information.solve()
    told = slice(3, model.x.stop)
    factor = _marginal(information.factor[:, :-1], told)
    made_up = np.zeros_like(factor) if placebo is None else placebo.factor[:, told]
    scale = prior.std[told]
    norms = np.linalg.norm(factor, axis=0)
    singular = np.linalg.svd(factor / norms, compute_uv=False)
    weak = _weak_directions(factor * scale, made_up * scale)
    if weak:
        # The unexcited directions are not straight (everything may scale together), so no linear
        # covariance tells how far along them the truth may lie: only the prior does.
        covariance = covariance + np.diag(prior.std**2)
    names = aam_names(model) + model.minimal.names
    unexcited = tuple(_describe(direction, names) for direction in weak)
    dof = max(information.rows - len(constants), 1)
    chi2 = information.residual / dof
    aam = constants[model.aam]
    aam_std = np.sqrt(np.diag(covariance)[model.aam])
    reason = _reason(settings, model, unexcited, aam, aam_std, chi2)
    if not np.any(model.robot.servicer_wheels.body_momentum):
        notes = (*notes, _ratios(names, constants[told]))
    return Estimate(
        method=method,
        valid=not reason,
        reason=reason,
        aam_links=tuple(g.link for g in model.robot.target_wheels),
        aam=aam,
        parameter_names=model.minimal.names,
        parameters=constants[model.x],
        covariance=covariance[told, told],
        rank=len(names) - len(weak),
        condition=float(singular[0] / singular[-1]),
        unexcited=unexcited,
        total_momentum=constants[:3],
        total_momentum_covariance=covariance[:3, :3],
        chi2_per_dof=chi2,
        samples=samples,
        stamp_ns=stamp_ns,
        notes=notes,
        nuisances=nuisance_values(model, constants, covariance),
        weak=np.array(weak).reshape(len(weak), len(names)),
    )


def nuisance_values(
    model: MomentumModel, constants: Array, covariance: Array
) -> tuple[NamedValue, ...]:
    """The nuisances with their standard deviations."""
    names, units = model.nuisances.names, model.nuisances.units
    std = np.sqrt(np.diag(covariance))[model.other]
    return tuple(
        NamedValue(name, float(value), float(sigma), unit)
        for name, value, sigma, unit in zip(names, constants[model.other], std, units, strict=True)
    )


def _marginal(factor: Array, told: slice) -> Array:
    """Square-root information of some constants, the others eliminated."""
    others = np.ones(factor.shape[1], dtype=bool)
    others[told] = False
    ordered = np.column_stack([factor[:, others], factor[:, told]])
    count = int(np.sum(others))
    (triangle,) = scipy.linalg.qr(ordered, mode='r')
    return np.asarray(triangle[count:, count:])


def aam_names(model: MomentumModel) -> tuple[str, ...]:
    """Readable names of the wheel-momentum unknowns."""
    return tuple(f'h_{g.link}_{axis}' for g in model.robot.target_wheels for axis in 'xyz')


def _weak_directions(factor: Array, made_up: Array) -> list[Array]:
    """Unit vectors that the data hardly tell better than the prior or than a placebo.

    Args:
        factor: Square-root information, unknowns in units of the prior's std.
        made_up: The placebo's, likewise.
    """
    least = np.hypot(1.0, _BETTER_THAN_PRIOR) * np.eye(factor.shape[1])
    bar = np.linalg.qr(np.vstack([least, np.sqrt(_BETTER_THAN_PLACEBO) * made_up]), mode='r')
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


def _reason(
    settings: IdentifierSettings,
    model: MomentumModel,
    unexcited: tuple[str, ...],
    aam: Array,
    aam_std: Array,
    chi2: float,
) -> str:
    if unexcited:
        total = model.n_aam + len(model.minimal)
        return f'{len(unexcited)} of {total} directions are not excited yet'
    limit = settings.valid_std * max(float(np.linalg.norm(aam)), 1e-9)
    if len(aam) and np.max(aam_std) > limit:
        known = f'{np.max(aam_std):.3g} N m s'
        return f'wheel momentum is known to {known} only, the limit is {limit:.3g}'
    if chi2 > LARGEST_CHI2:
        return f'the model does not explain the data: chi2 per degree of freedom is {chi2:.3g}'
    return ''
