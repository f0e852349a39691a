"""Reports as one self-contained HTML page.

A page needs no network, reads well on a phone, in the dark and in print, and is the same to the
last byte for the same content. Curves are drawn, zoomed and read by uPlot, recordings played in 3D
by three.js; both libraries are part of the page, and of the package under `assets/`.
"""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from importlib import resources
from pathlib import Path
from urllib.parse import quote

from ..display import (
    Figure,
    Item,
    KeyFigure,
    KeyFigures,
    PageLink,
    Replay,
    Report,
    Section,
    Table,
)
from ..formats import is_number
from ..model.files import write_text
from .plots import COLORS, inline_json, picture_of


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
        f'<title>{escape(report.title)}</title>\n{"".join(_head(sections))}</head>\n<body>\n<main>\n'
        f'<header><h1>{escape(report.title)}</h1><p>{escape(report.subtitle)}</p></header>\n'
        f'{sections}\n</main>\n</body>\n</html>\n'
    )


def _section(section: Section) -> str:
    items = '\n'.join(_item(item) for item in section.items)
    title = f'<h2>{escape(section.title)}</h2>\n' * bool(section.title)
    return f'<section>\n{title}{items}\n</section>'


def _head(sections: str) -> Iterator[str]:
    """Styles, and the scripts that something on the page needs."""
    colors = ''.join(f'--curve-{k}: {color}; ' for k, color in enumerate(COLORS[:-1]))
    has_replay = '<figure class="replay"' in sections
    has_charts = has_replay or '<div class="live"' in sections
    library = _asset('uplot.min.css') * has_charts  # first: ours changes what it says
    yield f'<style>{library}:root {{ {colors}}}\n{_asset("report.css")}</style>\n'
    names = [
        *['uplot.min.js', 'charts.js'] * has_charts,
        *['three.min.js', 'replay.js'] * has_replay,
    ]
    yield from (f'<script>{_asset(name)}</script>\n' for name in names)


def _asset(name: str) -> str:
    return (resources.files(__package__) / 'assets' / name).read_text(encoding='utf-8')


def _item(item: Item) -> str:
    if isinstance(item, KeyFigures):
        return f'<div class="key">{"".join(_key_figure(figure) for figure in item.figures)}</div>'
    if isinstance(item, str):
        return f'<p>{escape(item)}</p>'
    if isinstance(item, Table):
        return _table(item)
    return _figure(item)


def _figure(item: Figure) -> str:
    caption = f'<figcaption>{escape(item.caption)}</figcaption>' if item.caption else ''
    try:
        if isinstance(item, Replay):
            return _replay(item, caption)
        return f'<figure class="plot">{picture_of(item)}{caption}</figure>'
    except Exception as error:  # noqa: BLE001  whatever fails in a picture costs that picture only
        why = f'This picture could not be drawn: {type(error).__name__}: {error}'
        return f'<figure><p>{escape(why)}</p>{caption}</figure>'


def _replay(item: Replay, caption: str) -> str:
    from .replay_view import scene_values  # late: it knows dynamics

    scene = item.scene() if callable(item.scene) else item.scene
    notes = ''.join(f'<p class="note">{escape(note)}</p>' for note in scene.notes)
    content = inline_json(scene_values(scene))
    return f'<figure class="replay">{content}<div class="view"></div>{caption}{notes}</figure>'


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
