"""Repeats of one motion: what is usual from run to run is learned, the rest of the misfit cancels.

What a model misses of a motion is the same whenever it is repeated, known or not. So the mean of
the reference runs is taken off each run, sample by sample, and the level of what is left is that
of each reference run against the others: what a machine that nobody touched does. A change is
then judged against it with the sizes of its cause and no further tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import Effect
from ...effects.prior import NOTHING
from ...estimation.balance.arm_fit import Posterior
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_motion import RATE, ArmMotion
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import balance_of
from ...estimation.balance.leftover import VARIANCES
from ...estimation.balance.reml import level_of
from ...estimation.inference.evidence import sum_of
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..old.held_out_checks import check_held_out
from ..old.selection import Selection
from .changes import ChangeRows, Changes, clear_fit

FEWEST = 3
"""Reference runs from which the scatter between them is worth more than a usual tolerance."""
_ALIKE = 0.98  # correlation of the joint rates of a repeat
_DRIFT = 0.2  # of a torque's rms: friction and gains of a machine that warms up


@dataclass(frozen=True, eq=False)
class RepeatedRows(ChangeRows):
    """Runs of one motion less a reference.

    Args:
        reference: (M, n) of every run: the mean of other runs' torques [N m].
        count: Number of reference runs.
    """

    reference: tuple[Array, ...]
    count: int

    def torque(self, run: int) -> Array:
        """(M, n) torques that differ from the reference [N m]."""
        return super().torque(run) - self.reference[run]

    def freedom(self, i: int) -> float:
        """One less than the reference runs for each joint that a change is seen at.

        What differs from run to run is slower than a run, so a run says it once.
        """
        at = self.places[i]
        seen = np.any([np.any(c[:, :, at] != 0.0, axis=(0, 2)) for c in self.columns], axis=0)
        return float((self.count - 1) * max(1, np.sum(seen & (self.scale > 0.0))))


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


def find_changes_of_repeats(
    before: Sequence[Record],
    after: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
) -> Changes:
    """Changes of runs of one motion, `aligned`."""
    balances = [balance_of(r, robot, believed) for r in (*before, *after)]
    count = len(before)
    first = ArmRows.of(balances[:count], kinds)
    whole = sum_of(first.parts(leftover_levels(first, first.sizes, first.friction)))
    mean = Posterior.of(whole, first.sizes).mean
    every = replace(first, balances=tuple(balances)).sharing(first)
    explained = [columns @ mean for columns in every.columns]
    length = min(map(len, explained))
    left = [(b.torque - e)[:length] for b, e in zip(balances, explained, strict=True)]
    usual = np.mean(left[:count], axis=0)
    others = [(count * usual - own) / (count - 1) for own in left[:count]]
    reference = [
        e + _of_length(other, len(e))
        for e, other in zip(explained, [*others, *[usual] * len(after)], strict=True)
    ]
    levels = _levels(every, reference[:count], count)
    rows = RepeatedRows(
        tuple(balances[count:]),
        first.candidates,
        NOTHING * first.sizes,
        tuple(reference[count:]),
        count,
    ).sharing(every)
    selection = Selection.of(rows, levels)
    selection.run()
    check_held_out(selection)
    return Changes(robot, selection, clear_fit(selection), np.array(levels), 0, is_repeated=True)


def _levels(every: ArmRows, reference: Sequence[Array], count: int) -> list[Array]:
    """(8,) variances of every joint from run to run."""
    runs = RepeatedRows(
        every.balances[:count], every.candidates, every.tolerances, tuple(reference), count
    ).sharing(every)
    out = []
    for rows, scale in zip(runs.joints, np.tile(runs.scale, 2).tolist(), strict=True):
        bare = replace(rows, columns=np.zeros((len(rows.torque), 0)))
        drift = np.array([*[_DRIFT * scale] * 2, scale, scale])
        level = (
            level_of(bare, np.zeros(0), scale, drift) if len(rows.torque) else [np.nan] * VARIANCES
        )
        out.append(np.array(level))
    return out


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
