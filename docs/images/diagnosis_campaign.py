"""Draw the pictures of docs/diagnosis_campaign.md from `OUT/results.json`.

python docs/images/diagnosis_campaign.py out/diagnosis-campaign/results.json [FOLDER]
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from spacerobot_ros.display import Matrix, Panel
from validation.hidden.diagnosis_campaign_tables import drawings

HERE = Path(__file__).parent


def main(results: Path, folder: Path = HERE) -> None:
    """Draw false alarms against detection, and who is taken for whom."""
    plt.style.use(HERE / 'figures.mplstyle')
    (section,) = drawings((), json.loads(results.read_text(encoding='utf-8')))
    alarms, *confusion = section.items
    curves(alarms.picture[0], alarms.abscissa, folder / 'diagnosis_roc.svg')
    for plot in confusion:
        matrix(plot.picture, folder / 'diagnosis_confusion.svg')


def curves(panel: Panel, abscissa: str, path: Path) -> None:
    """The curves of a panel."""
    figure, ax = plt.subplots(figsize=(8.0, 2.75), layout='constrained')
    for curve in panel.curves:
        ax.plot(curve.t, curve.y, label=curve.label)
    ax.set(title=panel.title, ylabel=f'[{panel.unit}]', xlabel=abscissa)
    ax.legend(loc='lower right', ncols=2)
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
