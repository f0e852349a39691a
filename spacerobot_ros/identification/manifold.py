"""The estimate over physical bodies, from that over the linear minimal set."""

from __future__ import annotations

from dataclasses import replace

from ..estimation.momentum_process import MomentumModel
from ..model.settings import IdentifierSettings
from ..types import Array
from .estimate import Estimate
from .physical import PhysicalEstimate, project
from .summary import nuisance_values


def on_bodies(
    model: MomentumModel,
    settings: IdentifierSettings,
    linear: Estimate,
    constants: Array,
    factor: Array,
    start: Array | None = None,
) -> tuple[Estimate, PhysicalEstimate | None]:
    """Project a linear estimate onto physical bodies where that is asked for and possible.

    Below full rank it is not: bodies would turn what the prior says into what the data seem to
    say. Where no bodies fit, the linear estimate stands and a note says which body is at fault.

    Args:
        model: Robot and minimal set.
        settings: Structure, manifold, prior.
        linear: The linear estimate.
        constants: (p,) what it is made of.
        factor: (p, p) square root of its information.
        start: Coordinates of an earlier projection.

    Returns:
        The estimate, and the bodies; None where there are none.
    """
    if settings.manifold == 'linear' or linear.unexcited:
        return linear, None
    found = project(model, settings.structure, constants, factor, settings.prior_std, start)
    if found.contradiction:
        notes = (*linear.notes, f'{found.contradiction}; the linear estimate stands')
        return replace(linear, notes=notes), None
    told = slice(3, model.x.stop)
    dimension = found.dimension - 3 - model.nuisances.size
    note = (
        f'estimated over physical bodies: {dimension} dimensions for {linear.unknowns} numbers; '
        f'misfit {found.misfit:.3g} for {found.dof} degrees of freedom'
    )
    estimate = replace(
        linear,
        aam=found.constants[model.aam],
        parameters=found.constants[model.x],
        covariance=found.covariance[told, told],
        nuisances=nuisance_values(model, found.constants, found.covariance),
        total_momentum=found.constants[:3],
        total_momentum_covariance=found.covariance[:3, :3],
        notes=(*linear.notes, note),
    )
    return estimate, found
