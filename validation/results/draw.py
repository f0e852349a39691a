"""Draw the pictures of `diagnosis_campaign.md` from a campaign's results.

python -m validation.results.draw OUT/results.json [FOLDER]
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from spacerobot_ros.display import Matrix, Panel

from ..hidden.diagnosis_score import drawings

HERE = Path(__file__).parent
plt.style.use(HERE.parents[1] / 'docs' / 'images' / 'figures.mplstyle')


def main(results: Path, folder: Path = HERE / 'images') -> None:
    """Draw false alarms against detection, and who is taken for whom."""
    (section,) = drawings((), json.loads(results.read_text(encoding='utf-8')))
    alarms, *confusion = section.items
    curves(alarms.picture, alarms.abscissa, folder / 'diagnosis_roc.svg')
    for plot in confusion:
        matrix(plot.picture, folder / 'diagnosis_confusion.svg')


def curves(panels: Sequence[Panel], abscissa: str, path: Path) -> None:
    """Panels over one abscissa."""
    size = 8.0, 0.5 + 2.25 * len(panels)
    figure, axes = plt.subplots(
        len(panels), 1, sharex=True, squeeze=False, figsize=size, layout='constrained'
    )
    for ax, panel in zip(axes[:, 0], panels, strict=True):
        for curve in panel.curves:
            ax.plot(curve.t, curve.y, label=curve.label)
        ax.set(title=panel.title, ylabel=f'[{panel.unit}]')
        ax.legend(loc='lower right', ncols=2)
    axes[-1, 0].set_xlabel(abscissa)
    figure.savefig(path, metadata={'Date': None})


def matrix(content: Matrix, path: Path) -> None:
    """Counts, each row shaded by its own sum; empty cells stay blank."""
    rows, columns, counts = content.rows, content.columns, content.counts
    size = 2.5 + 0.24 * len(columns), 2.2 + 0.2 * len(rows)
    figure, ax = plt.subplots(figsize=size, layout='constrained')
    sums = np.maximum(counts.sum(axis=1, keepdims=True), 1)
    ax.imshow(counts / sums, cmap='Blues', vmin=0.0, vmax=1.6, aspect='auto')
    for i, j in zip(*np.nonzero(counts), strict=True):
        ax.text(j, i, f'{counts[i, j]:g}', ha='center', va='center', fontsize=7)
    ax.set_xticks(np.arange(len(columns)), columns, rotation=90, fontsize=8)
    ax.set_yticks(np.arange(len(rows)), rows, fontsize=8)
    ax.grid(visible=False)
    ax.set_xlabel(content.abscissa)
    figure.savefig(path, metadata={'Date': None})


if __name__ == '__main__':
    main(*map(Path, sys.argv[1:]))
