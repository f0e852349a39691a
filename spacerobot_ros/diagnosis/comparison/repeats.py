"""Repeats of one motion: what a model misses of it is the same in every run, and cancels.

The mean of the reference runs is taken off each run, sample by sample, and the level of what is
left is that of each reference run against the others: what a machine that nobody touched does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_motion import RATE, ArmMotion
from ...estimation.balance.arm_rows import ArmRows
from ...inference.gram import sum_of
from ...inference.marginal import Marginal
from ...recording.record import Record
from ...types import Array
from .two_groups import TwoGroups, bare_rows, split

FEWEST = 3
"""Reference runs from which the scatter between them is worth more than a usual tolerance."""
_ALIKE = 0.98  # correlation of the joint rates of a repeat


def aligned(records: Sequence[Record]) -> list[Record] | None:
    """The part of each record in which all do the same; None where they do not."""
    rates = [_rates(record) for record in records]
    lags = [_lag(rates[0], other) for other in rates]
    if any(lag is None for lag in lags):
        return None
    starts = [-min(int(lag) for lag in lags if lag is not None) + int(lag or 0) for lag in lags]
    length = min(len(rate) - start for rate, start in zip(rates, starts, strict=True))
    return [
        record.between(
            record.span[0] + start / RATE - 0.5 / RATE,
            record.span[0] + (start + length) / RATE + 0.5 / RATE,
        )
        for record, start in zip(records, starts, strict=True)
    ]


def less_reference(rows: ArmRows, count: int) -> TwoGroups:
    """Runs of one motion, each less the mean of the reference runs, or of the others of these.

    Args:
        rows: Of all runs, `aligned`.
        count: Number of reference runs.
    """
    first = split(rows, count)[0]
    levels = leftover_levels(first, first.sizes, first.friction)
    every, variances = np.arange(len(rows.sizes)), rows.sizes**2
    machine = Marginal.of(sum_of([*first.parts(levels), rows.held]), every, variances)
    explained = [columns @ machine.mean(every, variances) for columns in rows.columns]
    length = min(map(len, explained))
    left = [(t - e)[:length] for t, e in zip(rows.torques, explained, strict=True)]
    usual = np.mean(left[:count], axis=0)
    others = [(count * usual - own) / (count - 1) for own in left[:count]]
    reference = [*others, *[usual] * (len(left) - count)]
    torques = [
        t - e - _of_length(r, len(e))
        for t, e, r in zip(rows.torques, explained, reference, strict=True)
    ]
    bare, _ = bare_rows(rows, torques, count)
    level = leftover_levels(bare, bare.tolerances, bare.friction)
    rows = rows.about_others(rows.columns, torques)
    return TwoGroups(rows, count, (level, level), is_repeated=True)


def _rates(record: Record) -> Array:
    """(N, n) smooth joint rates at `RATE` from the first sample on [rad/s]."""
    motion = ArmMotion(record)
    times = np.arange(motion.times[0], motion.times[-1], 1.0 / RATE)
    qd = motion.kinematics.qd.T
    return np.column_stack([np.interp(times, motion.times, rate) for rate in qd])


def _lag(reference: Array, other: Array) -> int | None:
    """Samples by which another run of the same motion is late; None where it is another."""
    size = 1 << (len(reference) + len(other) - 1).bit_length()
    spectra = [np.fft.rfft(rates, size, axis=0) for rates in (other, reference)]
    product = np.sum(np.fft.irfft(spectra[0] * spectra[1].conj(), size, axis=0), axis=1)
    lag = int(np.argmax(product))
    lag = lag - size if lag > size // 2 else lag
    a, b = reference[max(-lag, 0) :], other[max(lag, 0) :]
    length = min(len(a), len(b))
    a, b = a[:length], b[:length]
    alike = float(np.sum(a * b)) / max(float(np.sqrt(np.sum(a**2) * np.sum(b**2))), 1e-300)
    return lag if alike > _ALIKE else None


def _of_length(values: Array, length: int) -> Array:
    """(length, n) values; what lacks at the end, where filters are unsure anyway, is repeated."""
    lacking = max(0, length - len(values))
    return np.pad(values, ((0, lacking), (0, 0)), mode='edge')[:length]
