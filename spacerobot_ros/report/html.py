"""Reports as one self-contained HTML page.

A page needs no network, reads well on a phone and in print, and is the same to the last byte for
the same content.
"""

from __future__ import annotations

from html import escape
from pathlib import Path
from urllib.parse import quote

from ..display import Item, KeyFigure, KeyFigures, PageLink, Plot, Report, Section, Table
from ..model.files import write_text
from .formats import is_number
from .plots import svg_of


def write_report(report: Report, path: str | Path) -> Path:
    """Render a report into a file, making its folder.

    Raises:
        ConfigurationError: the file can't be written.
    """
    return write_text(path, render(report))


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
    title = f'<h2>{escape(section.title)}</h2>\n' * bool(section.title)
    return f'<section>\n{title}{items}\n</section>'


def _item(item: Item) -> str:
    if isinstance(item, KeyFigures):
        return f'<div class="key">{"".join(_key_figure(figure) for figure in item.figures)}</div>'
    if isinstance(item, str):
        return f'<p>{escape(item)}</p>'
    if isinstance(item, Table):
        return _table(item)
    return _figure(item)


def _figure(figure: Plot) -> str:
    caption = f'<figcaption>{escape(figure.caption)}</figcaption>' if figure.caption else ''
    try:
        svg = svg_of(figure)
    except Exception as error:  # noqa: BLE001  whatever fails in a picture costs that picture only
        why = f'This picture could not be drawn: {type(error).__name__}: {error}'
        return f'<figure><p>{escape(why)}</p>{caption}</figure>'
    return f'<figure>{svg}{caption}</figure>'


def _key_figure(figure: KeyFigure) -> str:
    mark = {'': '', 'good': '<i class="good">&#10003;</i>', 'bad': '<i class="bad">&#10007;</i>'}
    unit = f' <span>{escape(figure.unit)}</span>' if figure.unit else ''
    remark = f'<small>{escape(figure.remark)}</small>' if figure.remark else ''
    value = f'<dd>{escape(figure.value)}{unit} {mark[figure.status]}</dd>'
    return f'<dl><dt>{escape(figure.label)}</dt>{value}{remark}</dl>'


def _table(table: Table) -> str:
    head = ''.join(f'<th scope="col">{escape(title)}</th>' for title in table.head)
    rows = '\n'.join(f'<tr>{"".join(_cell(cell) for cell in row)}</tr>' for row in table.rows)
    above = '. '.join(text for text in (table.title, table.caption) if text)
    caption = f'<caption>{escape(above)}</caption>' if above else ''
    return (
        f'<div class="wide"><table>{caption}<thead><tr>{head}</tr></thead>\n'
        f'<tbody>\n{rows}\n</tbody></table></div>'
    )


def _cell(text: str) -> str:
    kind = ' class="number"' if is_number(text) else ''
    shown = escape(text)
    if isinstance(text, PageLink):
        shown = f'<a href="{quote(text.target)}">{shown}</a>'
    return f'<td{kind}>{shown}</td>'


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
