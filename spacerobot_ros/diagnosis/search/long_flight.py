"""A record by prediction that is too long for memory: columns made stretch by stretch, summed.

The search finds its linearization on one stretch. About that model the columns of all stretches
are summed, each with a first state of its own; where the rows of what the sums want are not as
promised, they are summed once more about that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial, reduce
from typing import TypeVar, cast

import numpy as np

from ...effects.effect import Effect
from ...estimation.columns import Candidate
from ...estimation.fit import Fit
from ...estimation.rows import ChannelError, ChannelFit, Rows
from ...estimation.runs import Run
from ...estimation.stretches import SHOWN, LongRecord, joined, thinned
from ...identification.outliers import screened
from ...inference.decisive import CLUSTERS, CONFOUNDED
from ...inference.gram import Gram, sum_of
from ...inference.gram_blocks import NEVER_HELD_OUT, GramBlocks, merged
from ...inference.hypothesis import Hypothesis
from ...inference.inferred import infer
from ...recording.record import Record
from ...types import Array
from ..events.event import Events, Spans
from ..events.impulses import MomentumSteps, spans_of
from .found import Found, rivals_of
from .linear_rows import CandidateColumns, LinearRows, Variant, variant_of
from .search import MOST_CAUSES, RelinearizedSearch
from .timing import log_odds_of, timings

T = TypeVar('T')
_BLOCKS = 2 * CLUSTERS  # of all stretches: more say the same


@dataclass(frozen=True, eq=False)
class Flight:
    """Stretches of a record, as what is the same for every model of them.

    Args:
        runs: Of each, in which nothing was computed.
    """

    runs: tuple[Run, ...]

    @classmethod
    def of(cls, records: Sequence[Record], like: Run) -> Flight:
        """Of the stretches of a record, as one of them is taken."""
        every = (screened(record, like.noise)[0] for record in records)
        same = like.robot, like.believed, like.noise, like.timing
        return cls(tuple(Run(record, *same) for record in every))

    def each(self) -> Iterator[Run]:
        """One after another; what is computed of one goes with it."""
        for run in self.runs:
            yield run.without(run.left_out)

    def timing(self, fit: Fit) -> str:
        """How efforts act, most probably, beside the causes of a fit."""

        def log_odds(timing: str) -> float:
            fits = (Fit(run.timed(timing), fit.causes) for run in self.each())
            return log_odds_of(timing) - 0.5 * sum(own.misfit for own in fits)

        return max(timings(fit), key=log_odds)

    def with_events(self, causes: Sequence[Effect]) -> tuple[Flight, Events]:
        """Without the times of steps of a free base's momentum beside some causes, and these."""
        if not self.runs[0].robot.is_free:
            return self, Events()
        found = [MomentumSteps(Fit(run, causes)).events for run in self.each()]
        events = reduce(Events.with_more, found)
        spans: list[Spans] = [spans_of(own) if own.named else () for own in found]
        runs = (run.without(own) for run, own in zip(self.runs, spans, strict=True))
        return Flight(tuple(runs)), replace(events, notes=tuple(dict.fromkeys(events.notes)))

    def summed(
        self, causes: Sequence[Effect], pool: tuple[Candidate, ...]
    ) -> tuple[LinearRows, GramBlocks]:
        """The last stretch about a model with causes beside candidates, and the sums of all."""
        sums, whole = dict[int, Gram](), list[Gram]()
        parts = math.ceil(CLUSTERS / len(self.runs))  # of each stretch
        labels, share = np.arange(CLUSTERS) * parts // CLUSTERS, _BLOCKS / len(self.runs) / parts
        for i, run in enumerate(self.each()):
            fit = Fit(run, causes)
            rows = LinearRows(fit, CandidateColumns.along(fit, pool))
            own = rows.blocks(rows.data)
            whole = [sum_of([*whole, own.whole])]
            grams = merged(own.grams(np.arange(own.count)), labels)
            for k, gram in enumerate(grams, i * parts):
                at = int(k * min(share, 1.0))
                sums[at] = sums[at] + gram if at in sums else gram
        out = GramBlocks(own.count)
        for gram in sums.values():
            out.add_sums(gram)
        rounding = whole[0] - out.whole
        out.add_sums(replace(rounding, rows=0), NEVER_HELD_OUT)
        bare = replace(rows.columns, rows=rows.columns.rows[:0].copy())
        return LinearRows(rows.fit, bare), out


class LongFit(Fit):
    """One model of all stretches: sums in place of rows.

    Args:
        flight: The stretches.
        causes: Effects beyond the robot file's.
        grams: Of its tangents, by time; none of a model that is only shown.
    """

    def __init__(
        self, flight: Flight, causes: Sequence[Effect], grams: Sequence[Gram] = ()
    ) -> None:
        self.run, self.causes = flight.runs[0], tuple(causes)
        self.left = _Left(flight, self.causes)
        self.rows = cast(Rows, self.left)
        self._grams = grams

    @cached_property
    def gram(self) -> Gram:
        """See `Fit.gram`."""
        return sum_of(self._grams)

    def drifting(self, count: int) -> Gram:
        """See `Fit.drifting`; one phase for each part."""
        middles = np.pi * (np.arange(len(self._grams)) + 0.5) / len(self._grams)
        parts = []
        for phase, gram in zip(middles, self._grams, strict=True):
            shares = np.cos(np.arange(count) * phase)
            matrix = np.asarray(np.kron(np.outer(shares, shares), gram.matrix), dtype=float)
            vector = np.asarray(np.kron(shares, gram.vector))
            parts.append(Gram(matrix, vector, gram.square, gram.rows))
        return sum_of(parts)


class _Left:
    """What a model leaves of all stretches, as `Rows` say it of a record.

    Args:
        flight: The stretches. causes: The model's.
    """

    def __init__(self, flight: Flight, causes: tuple[Effect, ...]) -> None:
        self._flight, self._causes = flight, causes

    @cached_property
    def _of_each(self) -> list[tuple[float, tuple[ChannelFit, ...], list[ChannelError]]]:
        out, most = [], SHOWN // len(self._flight.runs)
        for run in self._flight.each():
            rows = run.rows(self._causes)
            shown = [thinned(channel, most) for channel in rows.channels()]
            out.append((float(rows.data @ rows.data), rows.whiteness()[1], shown))
        return out

    @property
    def square(self) -> float:
        """Of all whitened residuals."""
        return sum(square for square, _, _ in self._of_each)

    def whiteness(self) -> tuple[float | None, tuple[ChannelFit, ...]]:
        """See `Rows.whiteness`: of every channel its worst stretch, for their number."""
        out = list[ChannelFit]()
        for same in _by_name((f.channel, f.axis, f) for _, fits, _ in self._of_each for f in fits):
            worst = min(same, key=lambda fit: fit.p_value)
            out.append(replace(worst, p_value=min(1.0, len(same) * worst.p_value)))
        return min(1.0, len(out) * min((f.p_value for f in out), default=1.0)), tuple(out)

    def channels(self) -> tuple[ChannelError, ...]:
        """See `Rows.channels`; every few samples."""
        names = ((c.channel, 0, c) for _, _, shown in self._of_each for c in shown)
        return tuple(map(joined, _by_name(names)))


def _by_name(every: Iterable[tuple[str, int, T]]) -> list[list[T]]:
    """Those of one name and number together."""
    out = dict[tuple[str, int], list[T]]()
    for name, number, one in every:
        out.setdefault((name, number), []).append(one)
    return list(out.values())


def find_in_stretches(
    long: LongRecord,
    first: Run,
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> tuple[Found, Events]:
    """Causes of all stretches, and steps of the momentum of a free base.

    Args:
        long: The stretches.
        first: One of them, on which the linearization is found.
        kinds: Effects that may be causes.
        report: Called with what is being done and the share done, from 0 to 1.
    """
    causes, pool, run = _begun(long, first, kinds, report)
    report('looking for events', 0.4)
    flight, events = Flight.of(long.every, run).with_events(causes)
    sample = Flight(tuple(flight.runs[i] for i in long.sample))
    found, rounds = None, 0
    while found is None:
        report('summing over all stretches', 0.5 + 0.2 * rounds)
        causes, found = _summed(flight, sample, causes, pool, is_last=rounds > 0)
        rounds += 1
    return found, events


def _summed(
    flight: Flight,
    sample: Flight,
    causes: Sequence[Effect],
    pool: tuple[Candidate, ...],
    *,
    is_last: bool,
) -> tuple[tuple[Effect, ...], Found | None]:
    """What sums about a model want; with all that they say where its rows are as promised.

    Args:
        flight: The stretches.
        sample: Some of them, in which new causes have to do what their columns promise.
        causes: Of the model.
        pool: Candidates.
        is_last: Whether no other causes may come, and this is all.
    """
    rows, blocks = flight.summed(causes, pool)
    every = [_barred(h) if is_last and _is_new(h) else h for h in rows.hypotheses]
    held = set[Variant]()
    while True:
        inferred = infer(blocks, every, MOST_CAUSES)
        keys = {variant_of(cause) for cause in inferred.causes}
        chosen = [h for h in every if h.key in keys]
        new = [h for h in chosen if _is_new(h) and h.key not in held]
        false = [h.key for h in new if not _is_as_promised(sample, rows, h, inferred.mean)]
        if not false:
            break
        held |= keys - set(false)
        every = [_barred(h) if h.key in false else h for h in every]
    moved = _moved(rows, chosen, inferred.mean)
    if any(map(_is_new, chosen)):
        return moved, None
    own = np.concatenate([np.zeros(0, dtype=int), *(h.columns for h in chosen)])
    values = inferred.mean[own]
    fit = LongFit(flight, moved, [g.left(values) for g in blocks.grams(own) if g.rows])
    promised = blocks.whole.part(own).misfit(values)
    if not is_last and fit.left.square - promised > 2.0 * CONFOUNDED:
        return moved, None
    rest = [_barred(h) for h in every if h.key not in keys]
    again, order = partial(LongFit, flight), [*chosen, *rest]
    return moved, Found(again(()), fit, blocks, order, inferred, rivals_of(inferred), again)


def _begun(
    long: LongRecord,
    first: Run,
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> tuple[tuple[Effect, ...], tuple[Candidate, ...], Run]:
    """Causes of one stretch, candidates beside them, and the run as efforts act in the sample."""
    search = RelinearizedSearch(first, kinds, report)
    fit = search.find().fit
    sample = Flight.of([long.every[i] for i in long.sample], fit.run)
    return fit.causes, search.candidates, fit.run.timed(sample.timing(fit))


def _is_as_promised(sample: Flight, rows: LinearRows, new: Hypothesis, mean: Array) -> bool:
    """Whether a cause lessens the misfit by what its columns promise, but for half of its size.

    Columns along noisy efforts are large where a link is light, and what they seem to take is
    that noise, of which a model with the cause has as much.
    """
    candidate, causes = rows.columns.candidates[variant_of(new).number], rows.fit.causes
    (guess,) = rows.guesses([new], mean)
    lacking = 0.0
    for run in sample.each():
        fit = Fit(run, causes)
        step = fit.signatures.whitened(candidate.small_steps) @ mean[new.columns]
        promised = float(step @ (2.0 * fit.data - step))
        lacking += promised - (fit.misfit - Fit(run, [*causes, guess]).misfit)
        lacking -= 0.5 * float(step @ step)
    return lacking < 0.0


def _is_new(h: Hypothesis) -> bool:
    """Whether the model about which columns were made has it not."""
    return variant_of(h).number >= 0


def _barred(h: Hypothesis) -> Hypothesis:
    return replace(h, log_odds=-math.inf)


def _moved(rows: LinearRows, chosen: Sequence[Hypothesis], mean: Array) -> tuple[Effect, ...]:
    """Causes with the values of coefficients (K,)."""
    ahead = rows.fit.moved(mean[: len(rows.fit.free)] - rows.offsets)
    held = {cause.key: cause for cause in ahead}
    guesses = zip(chosen, rows.guesses(chosen, mean), strict=True)
    return tuple(held.get(variant_of(h).key, guess).canonical() for h, guess in guesses)
