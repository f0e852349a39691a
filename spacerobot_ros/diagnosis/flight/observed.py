"""Samples of a flight as records that can be judged: whole, screened, sensor effects undone."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...estimation.noise_levels import noise_levels
from ...estimation.trajectory.reference import NoiseLevels
from ...identification.outliers import without_outliers
from ...model.robot import Robot
from ...recording.buffer import SampleBuffer, sensors_of
from ...recording.faults.joint_limits import with_stops
from ...recording.record import Record
from ...sensing.sensor_faults import corrected_record
from ...types import Array

CONTEXT_NS = 300_000_000
"""On either side of what is judged, for the reference [ns]."""
_FEWEST_JOINTS, _FEWEST_RATES, _FEWEST_ATTITUDES = 12, 8, 4
"""Samples of a stretch below which it is not judged, or a sensor says nothing of it."""
_LONGEST_GAP, _LOST_IN_A_ROW = 0.1, 4.0
"""Time [s], and usual intervals, without joints or gyro that the reference bridges: its knots are
0.05 s apart or more, and over two of them nothing holds it. Nonsense there is no fault."""


class Observations:
    """Samples in the order of their stamps, in nearly any order of arrival.

    Args:
        robot: The robot.
        believed: The robot file's own effects.

    Attributes:
        samples: The newest.
        left_out: Samples that contradict their neighbours, by sensor.
        has_gyro: Whether the gyro was there when the flight was learned.
        gap_end: End of the last gap of the last record that no reference can bridge [s]; None:
            there is none. Joints and gyro say how the robot moves; the tracker alone is too slow.
    """

    def __init__(self, robot: Robot, believed: Sequence[Effect]) -> None:
        self._robot, self._believed = robot, tuple(believed)
        self.left_out: Counter[str] = Counter()
        self.has_gyro = False
        self.gap_end: float | None = None
        self.begin_segment()

    def begin_segment(self) -> None:
        """Take what comes now as of another time."""
        self.samples = SampleBuffer(self._robot.joints, sensors=sensors_of(self._robot))
        self._counted_ns: int | None = None  # up to which outliers are counted

    def record(
        self, first_ns: int, last_ns: int, robot: Robot, noise: NoiseLevels | None
    ) -> Record | None:
        """The samples between two stamps without what believed sensor effects do.

        Args:
            first_ns: From [ns].
            last_ns: To [ns].
            robot: As it is thought to be.
            noise: Noise levels; None: those of the record itself.

        Returns:
            None where they do not suffice.
        """
        seen = with_stops(self.samples.record(first_ns, last_ns), robot)
        if not robot.is_free:
            seen = replace(seen, rates=None, attitudes=None)
        if len(seen.rate_time) < _FEWEST_RATES:
            seen = replace(seen, rates=None)
        if len(seen.attitude_time) < _FEWEST_ATTITUDES:
            seen = replace(seen, attitudes=None)
        blind = robot.is_free and not len(seen.rate_time) and seen.attitude is None
        if blind or len(seen.joint_time) < _FEWEST_JOINTS:
            return None
        kept = self._screened(corrected_record(seen, robot, self._believed), noise)
        self.gap_end = self._gap_end(kept, _ends(seen))
        return None if len(kept.joint_time) < _FEWEST_JOINTS else kept

    def _gap_end(self, record: Record, span: tuple[float, float]) -> float | None:
        times = [record.joint_time] if self._robot.joints else []
        if len(record.rate_time) or (self._robot.is_free and self.has_gyro):
            times.append(record.rate_time)
        ends = [end for end in (_gap_end(time, span) for time in times) if end is not None]
        return max(ends, default=None)

    def _screened(self, record: Record, noise: NoiseLevels | None) -> Record:
        """A record without samples that contradict their neighbours, which are counted once."""
        if noise is None:
            with np.errstate(over='ignore', invalid='ignore'):  # numbers near the largest
                noise, _ = noise_levels(self._robot.sensors, record, is_checked=False)
        kept, found = without_outliers(record, noise)
        start = -np.inf if self._counted_ns is None else self.samples.seconds(self._counted_ns)
        end = float(record.joint_time[-1]) - 1e-9 * CONTEXT_NS
        self.left_out.update(found.counted(record, start, end))
        self._counted_ns = (self.samples.origin_ns or 0) + round(end * 1e9)
        return kept


def _ends(record: Record) -> tuple[float, float]:
    """First and last time of any sensor [s]; wheels, an input, reach back farther."""
    first, last = replace(record, wheels=None).span_ns
    return (first - record.origin_ns) * 1e-9, (last - record.origin_ns) * 1e-9


def _gap_end(time: Array, span: tuple[float, float]) -> float | None:
    """End of a sensor's last gap that is too long, those at the ends of the span included."""
    stamps = np.concatenate([span[:1], time, span[1:]])
    gaps = np.diff(stamps)
    usual = float(np.median(np.diff(time))) if len(time) > 1 else 0.0
    long = np.flatnonzero(gaps > max(_LONGEST_GAP, _LOST_IN_A_ROW * usual))
    return float(stamps[long[-1] + 1]) if len(long) else None
