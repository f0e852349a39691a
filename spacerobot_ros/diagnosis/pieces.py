"""A record too long for memory: diagnosed in pieces, whose answers `pieces_conclusion` joins."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..errors import RecordingError
from ..recording.record import Record
from .answer.result import Diagnosis, Series
from .pieces_conclusion import combined

_PER_SAMPLE = 2500.0
"""Bytes that a diagnosis needs a sample and joint squared: every joint adds rows and columns, each
held a few times. `bench/scaling.py` measures 2300 to 2950 from point to point."""
MOST_MEMORY = 4e9  # bytes; a record that needs more is taken in pieces
PIECE_MEMORY = 1e9  # of each, so that all of it stays below 2 GB
_SHORTEST = 20.0  # s, `limits.BUDGETED`: a shorter one tells too little
_SHOWN = 20_000  # samples of a channel that plots keep

Judge = Callable[[Record], Diagnosis]


def pieces_of(record: Record) -> list[Record]:
    """A record in parts of equal length; itself where that fits into memory."""
    if record.joints is None:
        return [record]
    need = _PER_SAMPLE * len(record.joint_time) * record.q.shape[1] ** 2
    if need <= MOST_MEMORY:
        return [record]
    start, end = record.span
    count = max(1, min(math.ceil(need / PIECE_MEMORY), math.floor((end - start) / _SHORTEST)))
    if count == 1:
        return [record]
    edges = np.linspace(start, end, count + 1)
    edges[0] = -np.inf  # the first sample, and others a little before it
    return [record.between(a, b) for a, b in pairwise(edges.tolist())]


def diagnose_pieces(
    pieces: Sequence[Record], judge: Judge, report: Callable[[str, float], None]
) -> Diagnosis:
    """One answer of all pieces.

    Args:
        pieces: Of one record.
        judge: Diagnoses one.
        report: Called with what is being done and the share done, from 0 to 1.

    Raises:
        RecordingError: no piece can be used; the reason of the first.
    """
    spans, answers, refused = [], [], list[str]()
    first: RecordingError | None = None
    for i, piece in enumerate(pieces):
        report(f'diagnosing piece {i + 1} of {len(pieces)}', i / len(pieces))
        span = piece.span if len(piece.joint_time) else (math.nan, math.nan)
        try:
            answers.append(_thin(judge(piece), math.ceil(_SHOWN / len(pieces))))
            spans.append(span)
        except RecordingError as error:
            first = first or error
            refused.append(f'{span[0]:.0f} to {span[1]:.0f} s: {error.reason}')
    if not answers:
        raise first or RecordingError('recording', 'is empty')
    notes = [f'diagnosed in {len(answers)} pieces of {np.ptp(spans[0]):.0f} s each']
    return combined(answers, spans, [*notes, *(f'left out: {why}' for why in refused[:3])])


def _thin(answer: Diagnosis, most: int) -> Diagnosis:
    """The answer with so many samples of its curves, which only plots need."""
    return replace(answer, series=tuple(_every(series, most) for series in answer.series))


def _every(series: Series, most: int) -> Series:
    step = max(1, math.ceil(len(series.time) / most))
    curves = ('time', 'measured', 'before', 'after')
    return replace(series, **{name: getattr(series, name)[::step].copy() for name in curves})
