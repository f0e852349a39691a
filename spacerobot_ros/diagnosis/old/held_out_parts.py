"""Which parts of the data judge a cause of an arm that was fitted to the others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.balance.arm_rows import ArmRows
from ...estimation.inference.evidence import Fold, Gram, sum_of
from ...types import IntArray
from ..limits import TELLING


class HeldOutParts:
    """Recordings, or blocks of them.

    Args:
        rows: The recordings.
        blocks: Gram matrices of the blocks of rows.
        recording: (B,) number of the recording of each block.
        whole: Sums over all rows, those that are never held out among them.
    """

    def __init__(
        self, rows: ArmRows, blocks: Sequence[Gram], recording: IntArray, whole: Gram
    ) -> None:
        self._rows, self._blocks, self._whole = rows, tuple(blocks), whole
        numbers, self._which = np.unique(recording, return_inverse=True)
        self._recordings = [
            sum_of([b for b, r in zip(blocks, self._which, strict=True) if r == k])
            for k in range(len(numbers))
        ]
        self._folds: dict[bytes, list[Fold]] = {}

    def labels(self, i: int | None = None) -> IntArray:
        """(B,) the part that each block belongs to; -1: to none that judges.

        Parts are recordings where two or more say something of a cause, else the blocks of the
        one that does. Where a load is declared they are the first, second, ... block of each: a
        loaded recording alone does not tell the load from the links.

        Args:
            i: The cause; None: all that is chosen.
        """
        own = slice(None) if i is None else self._rows.places[i]
        sizes, which = self._rows.sizes[own], self._which
        information = np.array([np.diag(r.matrix)[own] @ sizes**2 for r in self._recordings])
        judges = np.flatnonzero(information > TELLING * information.sum())
        if len(judges) < 2:
            judges = np.array([np.argmax(information)])
        elif not self._rows.has_load:
            return which
        place = np.arange(len(which)) - np.searchsorted(which, which)
        return np.where(np.isin(which, judges), place, -1)

    def are_recordings(self, i: int) -> bool:
        """Whether each of two recordings or more judges a cause."""
        several = len(self._recordings) > 1 and bool(np.all(self.labels(i) >= 0))
        return several and not self._rows.has_load

    def folds(self, i: int | None = None) -> list[Fold]:
        """Each part of the data beside all others, see `labels`."""
        labels = self.labels(i)
        key = labels.tobytes()
        if key not in self._folds:
            parts = [
                sum_of([b for b, label in zip(self._blocks, labels, strict=True) if label == part])
                for part in range(labels.max() + 1)
            ]
            self._folds[key] = [Fold(self._whole - part, part) for part in parts]
        return self._folds[key]
