"""Whitened rows in blocks, kept as sums: what is held out, and what errs for itself."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..types import Array, IntArray
from .decisive import CLUSTERS, PARTS, TELLING
from .gram import Gram

NEVER_HELD_OUT = -1
"""In place of a recording's number: of rows that hold what no data tell, in every part."""


class _KeptBlock(Protocol):
    def of(self, columns: IntArray) -> Gram:
        """Sums for some columns."""


@dataclass(frozen=True, slots=True, eq=False)
class _KeptRows:
    columns: NDArray[np.floating]
    data: Array

    def of(self, columns: IntArray) -> Gram:
        return Gram.of(self.columns[:, columns].astype(float), self.data)


@dataclass(frozen=True, slots=True, eq=False)
class _KeptSums:
    gram: Gram
    places: IntArray | None = None

    def of(self, columns: IntArray) -> Gram:
        if self.places is None:
            return self.gram.part(columns)
        return self.gram.placed(self.places[columns])


class GramBlocks:
    """Rows y = X c + noise of unit variance, block by block.

    A block keeps its rows where these are fewer than the columns, else its sums: B blocks of R
    rows together need min(R K, B K^2) numbers, beside K^2 of all.

    Args:
        count: Number K of columns.

    Attributes:
        whole: Sums over all rows.
        recording: Number of the recording of each block, in order.
        log_scale: Sum over all rows of the logarithm of the noise's standard deviation by which
            the data were divided; it makes densities of one set of data under several models of
            the noise comparable.
    """

    def __init__(self, count: int) -> None:
        self.count = count
        self.whole = Gram(np.zeros((count, count)), np.zeros(count), 0.0, 0)
        self.recording: list[int] = []
        self.log_scale = 0.0
        self._blocks: list[_KeptBlock] = []
        self._information: list[Array] = []

    @classmethod
    def of_rows(cls, columns: NDArray[np.floating], data: Array, matrix: Array) -> GramBlocks:
        """Rows in `CLUSTERS` runs of equal length, kept as they are, of single precision too.

        Their rounding is noise of every column, which counts in the sums over all rows: directions
        that are only it tell nothing, and no sums of them are negative.

        Args:
            columns: (R, K).
            data: (R,).
            matrix: (K, K) columns' columns.
        """
        out = cls(columns.shape[1])
        vector = np.zeros(out.count)
        edges = np.linspace(0, len(data), CLUSTERS + 1).astype(int).tolist()
        for start, end in pairwise(edges):
            rows, values = columns[start:end], data[start:end]
            out._append(None, rows, values, 0)
            vector += rows.astype(float).T @ values
            out._information.append(np.einsum('rk,rk->k', rows, rows, dtype=float))
        rounding = float(np.finfo(columns.dtype).eps) ** 2 * np.diag(np.diag(matrix))
        out.whole = Gram(matrix + rounding, vector, float(data @ data), len(data))
        return out

    def add(self, columns: Array, data: Array, recording: int = 0, log_scale: float = 0.0) -> None:
        """Add a block of rows (r, K) and data (r,); see `log_scale`."""
        gram = Gram.of(columns, data)
        self._append(gram if len(data) >= self.count else None, columns, data, recording)
        self._count_in(gram, log_scale)

    def add_sums(
        self,
        gram: Gram,
        recording: int = 0,
        log_scale: float = 0.0,
        places: IntArray | None = None,
    ) -> None:
        """Add a block of which only sums are known.

        Args:
            gram: The sums.
            recording: Number of its recording.
            log_scale: See `log_scale`.
            places: (K,) which of the sums' columns each column is there, several of them the same
                one; -1: none. None: the sums are of all columns.
        """
        self._blocks.append(_KeptSums(gram, places))
        self.recording.append(recording)
        self._count_in(gram if places is None else gram.placed(places), log_scale)

    def _append(
        self, gram: Gram | None, columns: NDArray[np.floating], data: Array, recording: int
    ) -> None:
        self._blocks.append(_KeptRows(columns, data) if gram is None else _KeptSums(gram))
        self.recording.append(recording)

    def _count_in(self, gram: Gram, log_scale: float) -> None:
        if gram.matrix.shape != (self.count, self.count):
            raise ValueError(f'a block of {len(gram.vector)} columns, not {self.count}')
        self.whole = self.whole + gram
        self.log_scale += log_scale
        self._information.append(np.diag(gram.matrix).copy())

    def grams(self, columns: IntArray) -> list[Gram]:
        """Sums over each block for some columns."""
        return [block.of(columns) for block in self._blocks]

    def parts(self, columns: IntArray, variances: Array) -> IntArray:
        """(B,) the part of the data that each block belongs to when a cause is judged.

        Parts are the recordings where two or more say something of the cause, else runs of blocks
        of the one that does; -1: never held out.

        Args:
            columns: The cause's.
            variances: (k,) of its prior.
        """
        recording = np.array(self.recording)
        information = np.array(self._information).reshape(len(recording), self.count)
        told = information[:, columns] @ variances
        told[recording == NEVER_HELD_OUT] = 0.0
        numbers = np.unique(recording[recording != NEVER_HELD_OUT])
        whole = np.array([float(np.sum(told[recording == k])) for k in numbers])
        judges = numbers[whole > TELLING * np.sum(whole)]
        out = np.full(len(recording), NEVER_HELD_OUT)
        if len(judges) > 1:
            for part, k in enumerate(judges.tolist()):
                out[recording == k] = part
        elif len(judges):
            seen = np.flatnonzero((recording == judges[0]) & (told > 0.0))
            for part, own in enumerate(np.array_split(seen, min(PARTS, len(seen)))):
                out[own] = part
        return out


def merged(grams: Sequence[Gram], labels: IntArray) -> list[Gram]:
    """Sums over each part, by the part (B,) of every block."""
    out = []
    for part in range(int(np.max(labels, initial=-1)) + 1):
        first, *others = (g for g, label in zip(grams, labels, strict=True) if label == part)
        for gram in others:
            first = first + gram
        out.append(first)
    return out
