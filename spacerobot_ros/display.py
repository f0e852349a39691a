"""Tables and curves as plain data: made where results are judged, drawn by `report` and `cli`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .types import Array


@dataclass(frozen=True, slots=True)
class Table:
    """A table.

    Args:
        head: Column titles, with units.
        rows: Cells as text; those that read as numbers are aligned to the right.
        caption: One line above it.
        title: Its heading.
    """

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ''
    title: str = ''


@dataclass(frozen=True, slots=True, eq=False)
class Curve:
    """One line of a panel.

    Args:
        label: Name in the legend; empty for none.
        t: (N,) abscissa.
        y: (N,) ordinate; what is not finite leaves a gap.
        half_band: (N,) half width of a shaded band around it, such as 3 standard deviations.
        colour: Index into the palette; None takes the curve's place in the panel.
    """

    label: str
    t: Array
    y: Array
    half_band: Array | None = None
    colour: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One set of axes.

    Args:
        title: What is shown.
        unit: Unit of the ordinate; `1` for none.
        curves: Lines, drawn in order.
        log: Magnitudes on a logarithmic scale.
        levels: Horizontal reference lines: value and label.
    """

    title: str
    unit: str
    curves: Sequence[Curve]
    log: bool = False
    levels: Sequence[tuple[float, str]] = ()
