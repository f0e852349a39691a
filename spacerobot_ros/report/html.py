"""Reports as one self-contained HTML page, by `assets/page.html`.

A page needs no network, reads well on a phone, in the dark and in print, and is the same to the
last byte for the same content. Curves are drawn, zoomed and read by uPlot, recordings played in 3D
by three.js; both libraries are part of the page, and of the package under `assets/`.
"""

from __future__ import annotations

from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined, Template

from ..display import Figure, Item, KeyFigures, Replay, Report, Table
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
    sections = [(part.title, [_item(item) for item in part.items]) for part in report.sections]
    kinds = {kind for _, items in sections for kind, *_ in items}
    return _page().render(report=report, sections=sections, kinds=kinds, colors=COLORS[:-1])


@cache
def _page() -> Template:
    known = {'asset': _asset, 'is_number': is_number, 'quote': quote}
    environment = Environment(
        autoescape=True, keep_trailing_newline=True, undefined=StrictUndefined
    )
    return environment.from_string(_asset('page.html'), known)


def _asset(name: str) -> str:
    return (resources.files(__package__) / 'assets' / name).read_text(encoding='utf-8')


def _item(item: Item) -> tuple[str, Any, str]:
    """What kind of thing it is, what the page says of it, and its caption."""
    if isinstance(item, str):
        return 'text', item, ''
    if isinstance(item, KeyFigures):
        return 'key', item, ''
    if isinstance(item, Table):
        return 'table', item, ''
    try:
        return *_drawn(item), item.caption
    except Exception as error:  # noqa: BLE001  whatever fails in a picture costs that picture only
        why = f'This picture could not be drawn: {type(error).__name__}: {error}'
        return 'failure', why, item.caption


def _drawn(item: Figure) -> tuple[str, Any]:
    if not isinstance(item, Replay):
        return picture_of(item)
    from .replay_view import scene_values  # late: it knows dynamics

    scene = item.scene() if callable(item.scene) else item.scene
    return 'replay', {'scene': inline_json(scene_values(scene)), 'notes': scene.notes}
