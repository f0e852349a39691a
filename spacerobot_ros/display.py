"""Reports as plain data: sections of key figures, text, tables and plots.

Made where results are judged; rendered as a page (`report.html`), as `markdown`
and in the terminal (`cli.terminal`); what a page draws is made by `report.plots`.
"""

from __future__ import annotations

import math
import string
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from .formats import UNTESTED, number, percent, probability

if TYPE_CHECKING:
    from .types import Array

GoodOrBad = Literal['', 'good', 'bad']


class PageLink(str):
    """A cell that leads to another page, relative to its own."""

    target: str

    def __new__(cls, text: str, target: str) -> PageLink:
        """The text with where it leads."""
        link = super().__new__(cls, text)
        link.target = target
        return link


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
        color: Index into the palette; None takes the curve's place in the panel.
    """

    label: str
    t: Array
    y: Array
    half_band: Array | None = None
    color: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Panel:
    """One set of axes.

    Args:
        title: What is shown.
        unit: Unit of the ordinate; `1` for none.
        curves: Lines, drawn in order.
        log: Magnitudes on a logarithmic scale.
        levels: Horizontal reference lines: value and label.
        spans: Shaded parts of the abscissa: from, to and label.
    """

    title: str
    unit: str
    curves: Sequence[Curve]
    log: bool = False
    levels: Sequence[tuple[float, str]] = ()
    spans: Sequence[tuple[float, float, str]] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Matrix:
    """Counts of one thing against another.

    Args:
        rows: Labels from top to bottom. columns: From left to right.
        counts: (rows, columns).
        abscissa: What the columns are.
    """

    rows: Sequence[str]
    columns: Sequence[str]
    counts: Array
    abscissa: str


Picture = Sequence[Panel] | Matrix
"""Panels over one abscissa, or counts."""


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """A number that the reader came for.

    Args:
        label: What it is.
        value: The number as text.
        unit: Its unit; empty for none.
        remark: What to compare it with; empty for none.
        status: Whether it is as it should be; marked by a sign, not by color alone.
    """

    label: str
    value: str
    unit: str = ''
    remark: str = ''
    status: GoodOrBad = ''


@dataclass(frozen=True, slots=True)
class KeyFigures:
    """A row of key figures."""

    figures: Sequence[KeyFigure]


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot.

    Args:
        picture: What to draw, or what makes it: a picture that can not be drawn then costs that
            picture only.
        caption: What to see in it.
        abscissa: Of panels, with unit.
        height: Of a panel [px].
    """

    picture: Picture | Callable[[], Picture]
    caption: str = ''
    abscissa: str = 'time [s]'
    height: int = 240


@dataclass(frozen=True, slots=True)
class Replay:
    """A recording in 3D.

    Args:
        scene: A `simulation.replay.scene.Scene`, or what makes one: where none can be made that
            costs the replay only.
        caption: What to see in it.
    """

    scene: Any
    caption: str = ''


Figure = Plot | Replay
Item = str | KeyFigures | Table | Figure
"""A text is a paragraph."""


@dataclass(frozen=True, slots=True)
class Section:
    """A titled part of a report."""

    title: str
    items: Sequence[Item]


@dataclass(frozen=True, slots=True)
class Report:
    """A report.

    Args:
        title: Title of the page.
        subtitle: One line below it: robot, date of the data, seed.
        sections: Its parts.
    """

    title: str
    subtitle: str
    sections: Sequence[Section]


class _Cells(string.Formatter):
    """Format strings of a row's entries, which may be attributes.

    What is missing or not finite reads `-`. Besides Python's there are the formats `number 3` (of
    so many digits), `probability`, `percent .2g`, `tested` (a share that may not have been tested)
    and `or 1`: the text, or another where there is none.
    """

    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Any) -> Any:
        """An entry of a row."""
        return kwargs[key] if isinstance(kwargs, Mapping) else getattr(kwargs, str(key))

    def get_field(self, name: str, args: Sequence[Any], kwargs: Any) -> Any:
        """An entry of an entry that is None is None."""
        try:
            return super().get_field(name, args, kwargs)
        except TypeError:
            return None, name

    def format_field(self, value: Any, spec: str) -> str:
        """The value as text."""
        word, _, rest = spec.partition(' ')
        if word in _WORDS:
            return _WORDS[word](value, rest)
        is_missing = value is None or (isinstance(value, float) and not math.isfinite(value))
        return '-' if is_missing else str(super().format_field(value, spec))


_WORDS: dict[str, Callable[[Any, str], str]] = {
    'number': lambda value, digits: number(value, int(digits or 4)),
    'probability': lambda value, _: probability(value),
    'percent': lambda value, form: percent(value, form or '.1f'),
    'tested': lambda value, _: percent(value, nothing=UNTESTED),
    'or': lambda value, other: str(value) if value else other,
}


def table_of(
    rows: Iterable[Any], heads: str, cells: str, caption: str = '', title: str = ''
) -> Table:
    """A table written as a row of Markdown: columns are parted by ` | `.

    Args:
        rows: One dict or object a row.
        heads: Column titles.
        cells: Formats of a row's entries, such as `{name} | {error[raw]:.3g} | {p:probability}`.
        caption: One line above it.
        title: Its heading.
    """
    columns = cells.split(' | ')
    shown = [[_Cells().vformat(cell, (), row) for cell in columns] for row in rows]
    return Table(heads.split(' | '), shown, caption, title)
