"""Plots for reports: time series with bands, errors on a log scale; deterministic SVG text.

The same data give the same bytes: no date, fixed identifiers, text kept as text. Curves differ in
color (Okabe and Ito's palette, safe for the color-blind) and in line style (safe in print). Data
inside a page are base64 or JSON.
"""

from __future__ import annotations

import base64
import html
import io
import json
import re
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np

from ..display import Bars, Matrix, Panel, Plot
from ..types import Array


def packed(values: Array) -> str:
    """Numbers in order, as base64 of little-endian float32."""
    return base64.b64encode(np.ascontiguousarray(values, dtype='<f4').tobytes()).decode()


def inline_json(value: Any) -> str:
    """A `<script>` that holds data; nothing in it can end it."""
    text = json.dumps(value, allow_nan=False, separators=(',', ':')).replace('<', '\\u003c')
    return f'<script type="application/json">{text}</script>'


COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#000000')
STYLES: tuple[Any, ...] = ('-', '--', '-.', (0, (4, 1, 1, 1, 1, 1)), (0, (1, 1)))
MAX_POINTS = 1500  # a curve; more than a screen shows
LIVE_POINTS = 2400  # of all curves of a panel: 60 to 100 kB of a page

_RC = {
    'svg.fonttype': 'none',
    'svg.hashsalt': 'spacerobot_ros',
    'font.family': 'sans-serif',
    'font.size': 9.5,
    'axes.grid': True,
    'grid.color': '#dde1e6',
    'grid.linewidth': 0.6,
    'axes.edgecolor': '#8a919a',
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.axisbelow': True,
    'axes.titlelocation': 'left',
    'axes.titlesize': 10.5,
    'lines.linewidth': 1.5,
    'legend.frameon': False,
    'legend.fontsize': 9,
}


def svg_of(figure: Plot) -> str:
    """The `<svg>` element of any picture."""
    picture = figure.picture() if callable(figure.picture) else figure.picture
    if isinstance(picture, str):
        return picture
    if isinstance(picture, Matrix):
        return matrix(picture)
    if isinstance(picture, Bars):
        return bars(picture)
    return plot(picture, abscissa=figure.abscissa, height=figure.height)


def live_panels(figure: Plot) -> list[dict[str, Any]]:
    """What `assets/charts.js` draws of a picture; nothing of one that has no panels."""
    picture = figure.picture() if callable(figure.picture) else figure.picture
    if isinstance(picture, str | Matrix | Bars):
        return []
    return [_live(panel, figure.abscissa) for panel in picture if panel.curves]


def _live(panel: Panel, abscissa: str) -> dict[str, Any]:
    """Curves on the times of all of them, so thinned that every peak is kept."""
    limit = max(LIVE_POINTS // len(panel.curves), 200)
    sides = [(np.asarray(c.t, float), np.asarray(c.y, float)) for c in panel.curves]
    kept = [thinned(t, y, limit)[0] for t, y in sides]
    x = np.unique(np.concatenate(kept))
    curves = []
    for place, (curve, (t, y)) in enumerate(zip(panel.curves, sides, strict=True)):
        lines = {'y': y}
        if curve.half_band is not None:
            half = np.asarray(curve.half_band, float)
            lines |= {'low': y - half, 'high': y + half}
        if panel.log:
            lines['y'] = np.abs(y)
            lines = {key: np.where(line > 0.0, line, np.nan) for key, line in lines.items()}
        shown = {
            key: packed(
                np.interp(x, t, line, np.nan, np.nan) if len(t) else np.full_like(x, np.nan)
            )
            for key, line in lines.items()
        }
        color = place if curve.color is None else curve.color
        curves.append({'label': curve.label, 'color': color % len(COLORS), 'dash': place, **shown})
    return {
        'title': panel.title,
        'unit': panel.unit,
        'log': panel.log,
        'abscissa': abscissa,
        'x': packed(x),
        'levels': [value for value, _ in panel.levels],
        'curves': curves,
    }


def plot(panels: Sequence[Panel], *, abscissa: str = 'time [s]', height: float = 2.3) -> str:
    """Stacked panels over one abscissa.

    Args:
        panels: From top to bottom.
        abscissa: Label below the last panel, with unit.
        height: Height of a panel where the whole is 8 wide [in].

    Returns:
        An `<svg>` element that scales to the width of its container.
    """
    width, whole = 8.0, 0.45 + height * len(panels)
    room = {  # for texts [in], as shares; a layout that asks them takes longer than to draw
        'left': 0.85 / width,
        'right': 1.0 - 0.15 / width,
        'bottom': 0.5 / whole,
        'top': 1.0 - 0.45 / whole,
        'hspace': 0.5 / (height - 0.5),
    }

    def draw(figure: Any) -> None:
        axes = figure.subplots(len(panels), 1, sharex=True, squeeze=False, gridspec_kw=room)[:, 0]
        for panel, ax in zip(panels, axes, strict=True):
            _draw(panel, ax)
        axes[-1].set_xlabel(abscissa)

    label = ', '.join(panel.title for panel in panels)
    return _drawn((width, whole), label, draw, layout=None)


def bars(content: Bars) -> str:
    """Horizontal bars as an `<svg>` element that scales to the width of its container."""
    labels = content.labels

    def draw(figure: Any) -> None:
        ax = figure.subplots()
        places = np.arange(len(labels))
        heights = np.array([value if value > 0.0 else np.nan for value in content.values])
        colors = [COLORS[0] if mark else '#aab4bf' for mark in content.marked]
        ax.barh(places, heights, color=colors, height=0.7)
        ax.set_xscale('log')
        ax.set_yticks(places, labels)
        ax.invert_yaxis()
        ax.grid(visible=False, axis='y')
        ax.set_xlabel(content.abscissa)

    return _drawn((8.0, 0.8 + 0.26 * len(labels)), content.abscissa, draw)


def matrix(content: Matrix) -> str:
    """Counts as a shaded matrix, each row by its own sum; empty cells stay blank.

    Args:
        content: Labels and counts.

    Returns:
        An `<svg>` element that scales to the width of its container.
    """
    rows, columns, counts = content.rows, content.columns, content.counts

    def draw(figure: Any) -> None:
        ax = figure.subplots()
        sums = np.maximum(counts.sum(axis=1, keepdims=True), 1)
        ax.imshow(counts / sums, cmap='Blues', vmin=0.0, vmax=1.6, aspect='auto')
        for i, j in zip(*np.nonzero(counts), strict=True):
            ax.text(j, i, f'{counts[i, j]:g}', ha='center', va='center', fontsize=7)
        ax.set_xticks(np.arange(len(columns)), columns, rotation=90, fontsize=8)
        ax.set_yticks(np.arange(len(rows)), rows, fontsize=8)
        ax.grid(visible=False)
        ax.set_xlabel(content.abscissa)

    size = 2.5 + 0.24 * len(columns), 2.2 + 0.2 * len(rows)
    return _drawn(size, content.abscissa, draw)


def _drawn(
    size: tuple[float, float],
    label: str,
    draw: Callable[[Any], None],
    layout: Literal['constrained'] | None = 'constrained',
) -> str:
    """An element with a label: what is drawn into a figure of a size [in]."""
    import matplotlib as mpl  # late: what only describes plots need not wait for it
    from matplotlib.figure import Figure

    with mpl.rc_context(_RC):
        figure, buffer = Figure(figsize=size, layout=layout), io.StringIO()
        draw(figure)
        figure.savefig(buffer, format='svg', metadata={'Date': None, 'Creator': None})
    return _inline(buffer.getvalue(), label)


def _draw(panel: Panel, ax: Any) -> None:
    for place, curve in enumerate(panel.curves):
        choice = place if curve.color is None else curve.color
        color, style = COLORS[choice % len(COLORS)], STYLES[place % len(STYLES)]
        t, y = np.asarray(curve.t, dtype=float), np.asarray(curve.y, dtype=float)
        if panel.log:
            y = np.where(y == 0.0, np.nan, np.abs(y))
        if curve.half_band is not None:
            _band(ax, t, y, np.asarray(curve.half_band), color, panel.log)
        ax.plot(*thinned(t, y), color=color, linestyle=style, label=curve.label or None)
    for value, label in panel.levels:
        ax.axhline(
            value, color='#5b626b', linewidth=0.9, linestyle=(0, (5, 3)), label=label or None
        )
    for first, last, label in panel.spans:
        ax.axvspan(first, last, color='#d98200', alpha=0.2, linewidth=0, label=label or None)
    if panel.log:
        ax.set_yscale('log')
    ax.set_title(panel.title)
    ax.set_ylabel(f'[{panel.unit}]')
    ax.margins(x=0.01)
    handles, labels = ax.get_legend_handles_labels()
    if labels:
        corner: Any = {'loc': 'lower right', 'bbox_to_anchor': (1.0, 0.98), 'borderaxespad': 0.1}
        ax.legend(handles, labels, ncols=len(labels), **corner)  # beside the title, off the curves


def _band(ax: Any, t: Array, y: Array, half: Array, color: str, log: bool) -> None:
    step = max(1, len(t) // MAX_POINTS)
    keep = slice(None, None, step)
    low = y[keep] - half[keep]
    if log:
        low = np.where(low > 0.0, low, np.nan)
    ax.fill_between(t[keep], low, y[keep] + half[keep], color=color, alpha=0.18, linewidth=0)


def thinned(t: Array, y: Array, limit: int = MAX_POINTS) -> tuple[Array, Array]:
    """At most `limit` points that keep every peak: the smallest and largest of each stretch.

    Args:
        t: (N,) abscissa.
        y: (N,) ordinate.
        limit: Largest number of points.
    """
    if len(t) <= limit:
        return t, y
    width = -(-len(t) // (limit // 2 - 1))
    starts = np.arange(0, len(t), width)
    stretches = np.full((len(starts), width), np.nan)
    stretches.flat[: len(y)] = y
    absent = np.isnan(stretches)
    lowest = np.argmin(np.where(absent, np.inf, stretches), axis=1)
    highest = np.argmax(np.where(absent, -np.inf, stretches), axis=1)
    chosen = np.unique([0, *(starts + lowest), *(starts + highest), len(t) - 1])
    return t[chosen], y[chosen]


def _inline(svg: str, label: str) -> str:
    """The bare element: no prolog, width of its container, no identifier that nothing uses."""
    svg = svg[svg.index('<svg') :].strip()
    svg = re.sub(r'<metadata>.*?</metadata>\s*', '', svg, flags=re.DOTALL)
    svg = re.sub(r'<svg ', f'<svg role="img" aria-label="{html.escape(label)}" ', svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) width="[^"]*"', r'\1', svg, count=1)
    svg = re.sub(r'(<svg[^>]*?) height="[^"]*"', r'\1', svg, count=1)
    used = set(re.findall(r'(?:url\(|href=")#([^")]+)', svg))
    return re.sub(r' id="([^"]*)"', lambda m: m.group(0) if m.group(1) in used else '', svg)
