"""The newest samples of the sensors, and the feedback that a law gets of them at a time."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from ..sensing.sensors import turned
from ..types import Array, Quaternion, Vector3

NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Feedback:
    """What a law knows of the robot at one time.

    Args:
        q: (n,) joint positions [rad].
        qd: (n,) joint rates [rad/s].
        omega_WB_B: (3,) angular velocity of the base [rad/s].
        omega_slope: (3,) its time derivative [rad/s^2]; only used to look half a period ahead.
        q_WB_xyzw: (4,) attitude of the base; None where it is not known.
    """

    q: Array
    qd: Array
    omega_WB_B: Vector3
    omega_slope: Vector3
    q_WB_xyzw: Quaternion | None = None


class RateHistory:
    """Recent gyro samples, for the rate and its slope at a time.

    Args:
        span: Time over which samples are kept [s].
    """

    def __init__(self, span: float) -> None:
        self._span_ns = round(span * 1e9)
        self._samples: deque[tuple[int, Vector3]] = deque(maxlen=4096)

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest sample, None before the first."""
        return self._samples[-1][0] if self._samples else None

    def add(self, stamp_ns: int, omega: Vector3) -> None:
        """Take a sample newer than all before."""
        self._samples.append((stamp_ns, omega))
        while stamp_ns - self._samples[0][0] > self._span_ns:
            self._samples.popleft()

    def at(self, stamp_ns: int, base_ns: int) -> tuple[Vector3, Vector3]:
        """Rate and slope at a stamp.

        From the newest sample not after it and one at least `base_ns` older; the slope is zero
        where there are no two such samples. The rate is extrapolated to the stamp with the slope.
        """
        past = [s for s in self._samples if s[0] <= stamp_ns] or list(self._samples)[:1]
        newest_ns, omega = past[-1]
        older = next((s for s in reversed(past) if newest_ns - s[0] >= max(base_ns, 1)), None)
        if older is None:
            return omega, np.zeros(3)
        slope = (omega - older[1]) / ((newest_ns - older[0]) * NS)
        return omega + slope * ((stamp_ns - newest_ns) * NS), slope

    def propagate(self, q_WB_xyzw: Quaternion, start_ns: int, stop_ns: int) -> Quaternion:
        """An attitude at `start_ns` propagated to `stop_ns` along the measured rates.

        Between samples the rate is taken as linear, before the first and after the last as theirs.
        """
        if start_ns == stop_ns or not self._samples:
            return q_WB_xyzw
        stamps = np.array([s[0] - start_ns for s in self._samples]) * NS
        rates = np.array([s[1] for s in self._samples])
        end = (stop_ns - start_ns) * NS
        low, high = min(0.0, end), max(0.0, end)
        inside = stamps[(stamps > low) & (stamps < high)]
        knots = np.array([low, *inside, high])
        at_knots = np.column_stack([np.interp(knots, stamps, column) for column in rates.T])
        steps = 0.5 * (at_knots[1:] + at_knots[:-1]) * np.diff(knots)[:, None]
        for step in steps if end > 0.0 else -steps[::-1]:
            q_WB_xyzw = turned(q_WB_xyzw, step)
        return q_WB_xyzw


class AttitudeHistory:
    """The newest attitudes, for the attitude at a time."""

    def __init__(self) -> None:
        self._samples: deque[tuple[int, Quaternion]] = deque(maxlen=16)

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest sample, None before the first."""
        return self._samples[-1][0] if self._samples else None

    def add(self, stamp_ns: int, q_WB_xyzw: Quaternion) -> None:
        """Take a sample newer than all before."""
        self._samples.append((stamp_ns, turned(q_WB_xyzw, np.zeros(3))))

    def at(self, stamp_ns: int, rates: RateHistory) -> Quaternion | None:
        """Attitude at a stamp: the newest one not after it, propagated with the gyro."""
        if not self._samples:
            return None
        past = [s for s in self._samples if s[0] <= stamp_ns] or list(self._samples)[:1]
        start_ns, q_WB_xyzw = past[-1]
        return rates.propagate(q_WB_xyzw, start_ns, stamp_ns)
