"""Plots of reports: data that `assets/charts.js` draws as curves; counts as tables.

The same data give the same bytes. Curves differ in color (Okabe and Ito's palette, safe for the
color-blind) and in dashes (safe in print). Data inside a page are base64 or JSON.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from ..display import Matrix, Panel, Plot
from ..types import Array


def packed(values: Array) -> str:
    """Numbers in order, as base64 of little-endian float32."""
    return base64.b64encode(np.ascontiguousarray(values, dtype='<f4').tobytes()).decode()


def inline_json(value: Any) -> Markup:
    """A `<script>` that holds data; nothing in it can end it."""
    text = json.dumps(value, allow_nan=False, separators=(',', ':')).replace('<', '\\u003c')
    return Markup(f'<script type="application/json">{text}</script>')


COLORS = ('#0072b2', '#d55e00', '#009e73', '#cc79a7', '#e69f00', '#56b4e9', '#000000')
MOST_POINTS = 1800  # of all curves of a panel, which then takes 30 to 80 kB of a page
FEWEST_POINTS = 200  # of a curve


def picture_of(figure: Plot) -> tuple[str, Any]:
    """The kind of a plot's picture, and what the page shows of it."""
    picture = figure.picture() if callable(figure.picture) else figure.picture
    if isinstance(picture, Matrix):
        return 'matrix', picture
    content = {'abscissa': figure.abscissa, 'height': figure.height, 'panels': panels_of(picture)}
    return 'curves', inline_json(content)


def panels_of(panels: Sequence[Panel]) -> list[dict[str, Any]]:
    """Panels from top to bottom over one abscissa, as `assets/charts.js` reads them."""
    shown = [panel for panel in panels if panel.curves]
    ends = [c.t[k] for panel in shown for c in panel.curves if len(c.t) for k in (0, -1)]
    return [_panel(panel, [min(ends), max(ends)] if ends else []) for panel in shown]


def _panel(panel: Panel, ends: Sequence[float]) -> dict[str, Any]:
    """Curves on the times of all of them, so thinned that every peak is kept."""
    limit = max(MOST_POINTS // len(panel.curves), FEWEST_POINTS)
    sides = [(np.asarray(c.t, float), np.asarray(c.y, float)) for c in panel.curves]
    x = np.unique(np.concatenate([ends, *(thinned(t, y, limit)[0] for t, y in sides)]))
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
        'x': packed(x),
        'levels': panel.levels,
        'spans': panel.spans,
        'curves': curves,
    }


def thinned(t: Array, y: Array, limit: int) -> tuple[Array, Array]:
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
