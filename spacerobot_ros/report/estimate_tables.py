"""An estimate of wheel momentum and inertia in tables and sentences."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from ..display import Section, Table
from ..formats import decimals
from ..identification.advice import Advice
from ..identification.estimate import Estimate

_MOST_ROWS = 60  # of a table; more than five joints have more minimal parameters


def estimate_sections(
    estimate: Estimate, groups: Sequence[str], advice: Sequence[Advice]
) -> Iterator[Section]:
    """What is printed of an estimate.

    Args:
        estimate: The estimate.
        groups: Of each parameter the numbers of bodies that it groups.
        advice: Motions that would tell more, best first.
    """
    n, std = len(estimate.aam), estimate.std
    sources, unit = estimate.sources or ('data',) * len(std), ['N m s']
    if momenta := [f'h_{link}_{axis}' for link in estimate.aam_links for axis in 'xyz']:
        title = 'wheel momentum of the captured body'
        yield _estimates(title, momenta, estimate.aam, std[:n], unit * n, sources[:n])
    if any(estimate.units):
        title = 'total angular momentum, inertial frame'
        total_std = estimate.total_momentum_covariance.diagonal() ** 0.5
        yield _estimates(title, 'xyz', estimate.total_momentum, total_std, unit * 3)
    names, values = estimate.parameter_names, estimate.parameters
    if len(names) <= _MOST_ROWS:
        title = 'minimal inertial parameters, each with the numbers of the bodies that it groups'
        yield _estimates(title, names, values, std[n:], estimate.units, sources[n:], groups)
    else:
        yield Section('', [f'{len(names)} minimal inertial parameters: --json has them'])
    head = (
        f'method {estimate.method}, {estimate.samples} samples, rank {estimate.rank} of '
        f'{estimate.unknowns}, condition {estimate.condition:.4g}, '
        f'chi-square per degree of freedom {estimate.chi2_per_dof:.3g}'
    )
    only = [f'from the file alone: {line}' for line in estimate.unexcited]
    reason = [] if estimate.valid else [f'not valid: {estimate.reason}']
    notes = [f'note: {note}' for note in estimate.notes]
    yield Section('', [head, *only, *notes, *reason])
    if advice:
        rows = [(one.motion or 'none of those tried', '\n'.join(one.tells)) for one in advice]
        title = 'what more motion would tell of the wheel momentum, in the order of its worth'
        yield Section(title, [Table(('extra motion', 'tells'), rows)])


def _estimates(title: str, *columns: Iterable[Any]) -> Section:
    """Names, values as far as they are known, their standard deviations, units and sources."""
    head = ('name', 'value', '+- std', 'unit', 'from', 'groups')[: len(columns)]
    cells = [
        (name, f'{value:.{decimals(std)}f}', f'{std:.{decimals(std)}f}', *others)
        for name, value, std, *others in zip(*columns, strict=True)
    ]
    return Section(title, [Table(head, cells)])
