"""The page of a comparison for a review: what changed, where that shows, what would have."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from .. import __version__
from ..diagnosis.change_conclusion import Comparison
from ..display import Item, Plot, Report, Section, Table
from . import diagnosis_plots as curves
from .comparison_tables import change_table, detectable_table, rival_lines
from .formats import number

_METHOD = (
    'Torques of both groups are balanced along the motion; every effect of the catalogue has '
    'coefficients that both share, with the size of a machine that nobody knows, and what was '
    'added before the second group, within the tolerance of a machine that nobody touched. A '
    'change is named where its evidence exceeds the price of looking at all of them and every '
    'part of the second group is predicted with it from the others. '
)
_REPEATS = (
    'The recordings repeat one motion: the mean of the runs before is taken off each, sample by '
    'sample, and what is left is judged by the scatter between those runs. '
)


def comparison_page(comparison: Comparison, command: str) -> Report:
    """The report of a comparison.

    Args:
        comparison: What it says.
        command: The command line that asked for it.
    """
    changed = [Section('What changed', list(_changes(comparison)))]
    seen = 'The smallest change of each parameter, alone, that would have been named.'
    return Report(
        title=f'Comparison: {comparison.verdict}',
        subtitle=', '.join(comparison.left),
        sections=[
            Section('Verdict', [comparison.sentence]),
            *(changed if comparison.changes else []),
            Section('Torques that are missed afterwards', list(_torques(comparison))),
            Section('What would have been seen', [detectable_table(comparison, seen)]),
            Section('How it was done', list(_how(comparison, command))),
        ],
    )


def _changes(comparison: Comparison) -> Iterator[Item]:
    yield change_table(comparison.changes)
    yield from rival_lines(comparison.changes)


def _torques(comparison: Comparison) -> Iterator[Item]:
    rows = [(joint, number(rms, 3)) for joint, rms in comparison.left.items()]
    yield Table(('joint', 'left unexplained, rms [N m]'), rows)
    yield Plot(
        partial(curves.error_panels, comparison.series, ()),
        'First recording afterwards, each joint where it moves: torque that is missed with what '
        'both groups share (before), and with what changed as well (after).',
        height=1.5,
    )


def _how(comparison: Comparison, command: str) -> Iterator[Item]:
    yield f'{command}   (spacerobot {__version__})'
    yield f'{_REPEATS if comparison.is_repeated else _METHOD}See docs/diagnosis.md.'
