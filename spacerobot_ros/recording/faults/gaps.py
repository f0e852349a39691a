"""Long pauses in a recording: said, or taken as the ends of recordings of their own."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np

from ...errors import RecordingError
from ...formats import counted
from ...types import Array, IntArray
from ..record import SENSORS, Record, shown
from .thresholds import is_short

ONE_LOST, SEVERAL_LOST = 1.5, 2.5
"""Usual intervals between samples from which one is missing between them, and more than one."""
GAP_PERIODS = 10.0  # a longer pause between two samples is worth a note
# A pause that ends a recording: longer than four periods, which lost samples may leave, and than
# half a period at 4 Hz. Samples T apart tell a motion up to 1/(2 T): across 0.125 s nothing is
# known of an arm's motion that the balance of torques, band-limited to about that, looks at.
SPLIT_PERIODS, SPLIT_PAUSE = 4.0, 0.125  # s


def with_gaps_noted(record: Record) -> Record:
    """The record with a note for each sensor on its longest pause, where that is long.

    A pause is long above `GAP_PERIODS` times the median period of the sensor.
    """
    notes = []
    for name in SENSORS:
        series = getattr(record, name)
        if series is not None and len(series.stamp_ns) > 2:
            notes += _gap(name, series.stamp_ns)
    return replace(record, notes=(*record.notes, *notes))


def split_at_gaps(record: Record) -> tuple[Record, ...]:
    """The stretches between long pauses of the joints, each a record that counts from its start.

    Args:
        record: With joints, perhaps of several runs one after another.

    Returns:
        Stretches long enough to be judged, in order; the notes say what was left out.

    Raises:
        RecordingError: no joints, or no stretch is long enough.
    """
    if record.joints is None:
        raise RecordingError(record.source, 'can not be split at gaps: it has no joints')
    time = record.joint_time
    cuts = 0.5 * (time[:-1] + time[1:])[np.diff(time) > longest_pause(time)]
    edges = [-np.inf, *cuts.tolist(), np.inf]
    stretches = [record.between(*ends) for ends in itertools.pairwise(edges)]
    kept = [(i, part) for i, part in enumerate(stretches, 1) if not is_short(part.joint_time)]
    if not kept:
        raise RecordingError(
            record.source, f'its {len(stretches)} stretches between gaps are all too short'
        )
    if len(stretches) == 1:
        return (record,)
    left_out = len(stretches) - len(kept)
    too_short = f'{counted(left_out, "stretch", "stretches")} between gaps left out: too short'
    also = (too_short,) if left_out else ()
    return tuple(_own(part, f'stretch {i} of {len(stretches)}', also) for i, part in kept)


def continued(seconds: Array) -> Array:
    """(N,) times of runs one after another, whose clock may begin anew, as those of one clock.

    Where the clock goes back another run begins, after a pause that `split_at_gaps` splits at.
    """
    back = np.diff(seconds, prepend=seconds[:1])
    return np.asarray(
        seconds + np.cumsum(np.where(back < 0.0, 2.0 * longest_pause(seconds) - back, 0))
    )


def longest_pause(time: Array) -> float:
    """The longest pause that samples at (N,) times have within a recording [s]."""
    period = float(np.median(np.abs(np.diff(time)))) if len(time) > 1 else 0.0
    return max(SPLIT_PERIODS * period, SPLIT_PAUSE)


def _own(part: Record, name: str, also: tuple[str, ...]) -> Record:
    """A stretch as a record of its own; a sensor that was silent in it is absent."""
    sensors: dict[str, Any] = {key: getattr(part, key) for key in SENSORS}
    sensors = {key: series or None for key, series in sensors.items()}  # not one without samples
    begins = f'{name}, {shown(float(part.joint_time[0]))} after the first sample'
    inputs = {key: series for key, series in part.inputs.items() if len(series)}
    own = replace(part, **sensors, inputs=inputs, zero_ns=None, source=f'{part.source} ({name})')
    return replace(own, notes=(begins, *part.notes, *also))


def _gap(name: str, stamps: IntArray) -> list[str]:
    steps = np.diff(stamps)
    long = steps > GAP_PERIODS * np.median(steps)
    if not long.any():
        return []
    worst = int(np.argmax(steps))
    return [
        f'{name}: {counted(int(long.sum()), "gap")}, the longest {steps[worst] / 1e9:.3g} s '
        f'after {shown((stamps[worst] - stamps[0]) / 1e9)}'
    ]
