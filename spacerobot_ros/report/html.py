"""Reports as one self-contained HTML page: sections of key figures, text, tables and plots.

A report is plain data; `render` turns it into a page that needs no network, reads well on a phone
and in print, and is the same to the last byte for the same content.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Literal

from ..display import Table
from ..errors import SpaceRobotError

Status = Literal['', 'good', 'bad']


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """A number that the reader came for.

    Args:
        label: What it is.
        value: The number as text.
        unit: Its unit; empty for none.
        remark: What to compare it with; empty for none.
        status: Whether it is as it should be; marked by a sign, not by colour alone.
    """

    label: str
    value: str
    unit: str = ''
    remark: str = ''
    status: Status = ''


@dataclass(frozen=True, slots=True)
class KeyFigures:
    """A row of key figures."""

    figures: Sequence[KeyFigure]


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph of plain text."""

    text: str


@dataclass(frozen=True, slots=True)
class Plot:
    """A plot.

    Args:
        svg: An `<svg>` element from `plots.plot`, used as it is.
        caption: What to see in it.
    """

    svg: str
    caption: str = ''


Item = KeyFigures | Text | Table | Plot


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


class ReportError(SpaceRobotError, OSError):
    """A report that can't be written."""


def write_report(report: Report, path: str | Path) -> Path:
    """Render a report into a file, making its folder.

    Raises:
        ReportError: the file can't be written.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(render(report), encoding='utf-8')
    except OSError as error:
        raise ReportError(f'{path}: can not be written: {error.strerror}') from error
    return path


def render(report: Report) -> str:
    """The page as text."""
    sections = '\n'.join(_section(section) for section in report.sections)
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<title>{escape(report.title)}</title>\n<style>{_CSS}</style>\n</head>\n<body>\n<main>\n'
        f'<header><h1>{escape(report.title)}</h1><p>{escape(report.subtitle)}</p></header>\n'
        f'{sections}\n</main>\n</body>\n</html>\n'
    )


def _section(section: Section) -> str:
    items = '\n'.join(_item(item) for item in section.items)
    return f'<section>\n<h2>{escape(section.title)}</h2>\n{items}\n</section>'


def _item(item: Item) -> str:
    if isinstance(item, KeyFigures):
        return f'<div class="key">{"".join(_key_figure(figure) for figure in item.figures)}</div>'
    if isinstance(item, Text):
        return f'<p>{escape(item.text)}</p>'
    if isinstance(item, Table):
        return _table(item)
    caption = f'<figcaption>{escape(item.caption)}</figcaption>' if item.caption else ''
    return f'<figure>{item.svg}{caption}</figure>'


def _key_figure(figure: KeyFigure) -> str:
    mark = {'': '', 'good': '<i class="good">&#10003;</i>', 'bad': '<i class="bad">&#10007;</i>'}
    unit = f' <span>{escape(figure.unit)}</span>' if figure.unit else ''
    remark = f'<small>{escape(figure.remark)}</small>' if figure.remark else ''
    value = f'<dd>{escape(figure.value)}{unit} {mark[figure.status]}</dd>'
    return f'<dl><dt>{escape(figure.label)}</dt>{value}{remark}</dl>'


def _table(table: Table) -> str:
    head = ''.join(f'<th scope="col">{escape(title)}</th>' for title in table.head)
    rows = '\n'.join(f'<tr>{"".join(_cell(cell) for cell in row)}</tr>' for row in table.rows)
    caption = f'<caption>{escape(table.caption)}</caption>' if table.caption else ''
    return (
        f'<div class="wide"><table>{caption}<thead><tr>{head}</tr></thead>\n'
        f'<tbody>\n{rows}\n</tbody></table></div>'
    )


def _cell(text: str) -> str:
    number = text.replace('±', '').strip().split(' ')[0].rstrip('%')
    try:
        float(number)
    except ValueError:
        return f'<td>{escape(text)}</td>'
    return f'<td class="number">{escape(text)}</td>'


_CSS = """
:root { color-scheme: light; --ink: #1c2128; --soft: #59636e; --line: #d9dee4; --accent: #0072b2; }
* { box-sizing: border-box; }
body { margin: 0; background: #f4f6f8; color: var(--ink);
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Noto Sans", sans-serif; }
main { max-width: 60rem; margin: 0 auto; padding: 1.5rem 1rem 3rem; }
header { border-left: 4px solid var(--accent); padding-left: 1rem; margin-bottom: 1.5rem; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: 0; }
header p { margin: .25rem 0 0; color: var(--soft); }
section { background: #fff; border: 1px solid var(--line); border-radius: 10px;
  padding: 1rem 1.25rem; margin: 0 0 1.25rem; }
h2 { font-size: 1.15rem; margin: 0 0 .5rem; }
p { max-width: 46rem; }
.key { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: .75rem; }
dl { margin: 0; padding: .6rem .8rem; border: 1px solid var(--line); border-radius: 8px; }
dt { color: var(--soft); font-size: .85rem; }
dd { margin: 0; font-size: 1.4rem; font-weight: 600; font-variant-numeric: tabular-nums; }
dd span { font-size: .85rem; font-weight: 400; }
dd i { font-style: normal; font-size: 1rem; }
.good { color: #00734f; } .bad { color: #b34a00; }
small { color: var(--soft); }
.wide { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: .92rem; }
caption { text-align: left; color: var(--soft); padding: .25rem 0; }
th, td { text-align: left; padding: .3rem .7rem; border-bottom: 1px solid var(--line); }
th { font-weight: 600; border-bottom-color: #9aa3ad; }
.number { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
figure { margin: .75rem 0; overflow-x: auto; }
svg { display: block; width: 100%; min-width: 32rem; height: auto; }
figcaption { color: var(--soft); font-size: .9rem; }
@media print {
  body { background: #fff; font-size: 11pt; } main { max-width: none; padding: 0; }
  section { border: 0; padding: 0; } figure, table, dl { break-inside: avoid; }
  svg { min-width: 0; }
}
"""
