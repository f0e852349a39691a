"""A record too long for memory: diagnosed in pieces, whose answers `pieces_conclusion` joins."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..effects.effect import Effect
from ..errors import RecordingError
from ..recording.record import Record
from .answer.result import Diagnosis, Series
from .limits import SUSPICIOUS
from .pieces_conclusion import combined

_PER_SAMPLE = 2500.0
"""Bytes that a diagnosis needs a sample and joint squared: every joint adds rows and columns, each
held a few times. `python -m validation bench.scaling` measures 2300 to 2950, 3200 at most."""
MOST_MEMORY = 4e9  # bytes; a record that needs more is taken in pieces
PIECE_MEMORY = 7e8
"""Of each, so that all of it stays below 2 GB: of two hours of seven joints the record alone, and
what is loaded, are 0.8 GB, and a piece may need 0.9."""
_LEAST = 20.0  # s that tell enough: no piece is shorter
_SHOWN = 20_000  # samples of a channel that plots keep


Judge = Callable[[Record, Sequence[type[Effect]]], Diagnosis]
"""Diagnoses a piece, with effects that may be causes."""


def pieces_of(record: Record) -> list[Record]:
    """A record in parts of equal length; itself where that fits into memory.

    None is shorter than `_LEAST`, which would tell too little.
    """
    if record.joints is None:
        return [record]
    need = _PER_SAMPLE * len(record.joint_time) * record.q.shape[1] ** 2
    if need <= MOST_MEMORY:
        return [record]
    start, end = record.span
    count = max(1, min(math.ceil(need / PIECE_MEMORY), math.floor((end - start) / _LEAST)))
    if count == 1:
        return [record]
    edges = np.linspace(start, end, count + 1)
    edges[0] = -np.inf  # the first sample, and others a little before it
    return [record.between(a, b) for a, b in pairwise(edges.tolist())]


def diagnose_pieces(
    pieces: Sequence[Record],
    kinds: Sequence[type[Effect]],
    judge: Judge,
    report: Callable[[str, float], None],
) -> Diagnosis:
    """One answer of all pieces.

    Args:
        pieces: Of one record.
        kinds: Effects that may be causes.
        judge: Diagnoses one.
        report: Called with what is being done and the share done, from 0 to 1.

    Raises:
        RecordingError: no piece can be used; the reason of the first.
    """
    spans, answers, refused = [], list[Diagnosis](), list[str]()
    first: RecordingError | None = None
    for i, piece in enumerate(pieces):
        report(f'diagnosing piece {i + 1} of {len(pieces)}', i / len(pieces))
        span = piece.span if len(piece.joint_time) else (math.nan, math.nan)
        try:
            answer = _judged(piece, kinds, judge, answers[-1:])
            answers.append(_thin(answer, math.ceil(_SHOWN / len(pieces))))
            spans.append(span)
        except RecordingError as error:
            first = first or error
            refused.append(f'{span[0]:.0f} to {span[1]:.0f} s: {error.reason}')
    if not answers:
        raise first or RecordingError('recording', 'is empty')
    notes = [f'diagnosed in {len(answers)} pieces of {np.ptp(spans[0]):.0f} s each']
    return combined(answers, spans, [*notes, *(f'left out: {why}' for why in refused[:3])])


def _judged(
    piece: Record, kinds: Sequence[type[Effect]], judge: Judge, before: Sequence[Diagnosis]
) -> Diagnosis:
    """The answer of a piece, with what swings only where there is a sign of it.

    Its columns take most of the time. They are left out where the piece before shows no such
    cause, nor a rival, and nothing beyond its causes, until this one shows something.
    """
    for last in filter(_is_clear, before):
        causes = (*last.causes, *last.minor)
        known = {c.applied.id for c in causes} | {r.effect for c in causes for r in c.rivals}
        some = [kind for kind in kinds if kind.id in known or not (kind.hidden or kind.is_rare)]
        if _is_clear(answer := judge(piece, some)):
            return answer
    return judge(piece, kinds)


def _is_clear(answer: Diagnosis) -> bool:
    """Whether nothing is left that a search would look for."""
    return answer.fit_p is not None and answer.fit_p >= SUSPICIOUS


def _thin(answer: Diagnosis, most: int) -> Diagnosis:
    """The answer with so many samples of its curves, which only plots need."""
    return replace(answer, series=tuple(_every(series, most) for series in answer.series))


def _every(series: Series, most: int) -> Series:
    step = max(1, math.ceil(len(series.time) / most))
    curves = ('time', 'measured', 'before', 'after')
    return replace(series, **{name: getattr(series, name)[::step].copy() for name in curves})
