"""What a law gets and what a control loop answers: newest samples, feedback, torques, command."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..dynamics.rotation import turned
from ..recording.buffer import Stream
from ..types import Array, Quaternion, Vector3
from .joint_reference import Setpoint

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


class History(Stream):
    """Recent samples of one sensor, for who can't wait: one that comes late is refused.

    Args:
        span: Time over which samples are kept [s].
    """

    def __init__(self, span: float = 2.0) -> None:
        super().__init__(lateness_ns=0)
        self._span_ns = round(span * 1e9)

    def add(self, stamp_ns: int, value: Array) -> None:
        """Take a sample; raise MessageRejectedError if it is not newer than all before."""
        super().add(stamp_ns, value)
        self.forget(stamp_ns - self._span_ns)

    def last(self, stamp_ns: int) -> int:
        """Place of the newest sample not after a stamp, else of the first; there must be one."""
        return max(bisect_right(self.stamps, stamp_ns) - 1, 0)


class RateHistory(History):
    """Recent gyro samples, for the rate and its slope at a time."""

    def at(self, stamp_ns: int, base_ns: int) -> tuple[Vector3, Vector3]:
        """Rate and slope at a stamp.

        From the newest sample not after it and one at least `base_ns` older; the slope is zero
        where there are no two such samples. The rate is extrapolated to the stamp with the slope.
        """
        new = self.last(stamp_ns)
        newest_ns, omega = self.stamps[new], self.values[new]
        old = bisect_right(self.stamps, newest_ns - max(base_ns, 1)) - 1
        if old < 0:
            return omega, np.zeros(3)
        slope = (omega - self.values[old]) / ((newest_ns - self.stamps[old]) * NS)
        return omega + slope * ((stamp_ns - newest_ns) * NS), slope

    def propagate(self, q_WB_xyzw: Quaternion, start_ns: int, stop_ns: int) -> Quaternion:
        """An attitude at `start_ns` propagated to `stop_ns` along the measured rates.

        Between samples the rate is taken as linear, before the first and after the last as theirs.
        """
        if start_ns == stop_ns or not self.stamps:
            return q_WB_xyzw
        stamps = (np.array(self.stamps) - start_ns) * NS
        end = (stop_ns - start_ns) * NS
        low, high = min(0.0, end), max(0.0, end)
        knots = np.array([low, *stamps[(stamps > low) & (stamps < high)], high])
        rates = np.array(self.values)
        at_knots = np.column_stack([np.interp(knots, stamps, column) for column in rates.T])
        steps = 0.5 * (at_knots[1:] + at_knots[:-1]) * np.diff(knots)[:, None]
        for step in steps if end > 0.0 else -steps[::-1]:
            q_WB_xyzw = turned(q_WB_xyzw, step)
        return q_WB_xyzw


class AttitudeHistory(History):
    """Recent attitudes, for the attitude at a time."""

    def add(self, stamp_ns: int, value: Quaternion) -> None:
        """Take q_WB (4,), as `History.add`; it is normalized."""
        super().add(stamp_ns, turned(value, np.zeros(3)))

    def at(self, stamp_ns: int, rates: RateHistory) -> Quaternion | None:
        """Attitude at a stamp: the newest one not after it, propagated with the gyro."""
        if not self.stamps:
            return None
        k = self.last(stamp_ns)
        return rates.propagate(self.values[k], self.stamps[k], stamp_ns)


Mode = Literal['tracking', 'hold', 'damping']


@dataclass(frozen=True, slots=True, eq=False)
class Torque:
    """Torques that a law asks for.

    Args:
        tau: (n,) torque within the limits [N m].
        saturated: (n,) bool, where a limit of torque or of the motion changed it.
        base: (3,) torque on the base within the limits, in base coordinates [N m]; None where the
            law leaves the base free.
        base_saturated: Whether a limit changed that.
        attitude_error: (3,) rotation vector from the base to where it should point, in base
            coordinates [rad]; None where the law leaves the base free or its attitude is unknown.
    """

    tau: Array
    saturated: np.ndarray
    base: Vector3 | None = None
    base_saturated: bool = False
    attitude_error: Vector3 | None = None


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Command(Torque):
    """A torque command with what it rests on.

    Args:
        stamp_ns: Stamp of the joint states that it answers [ns].
        setpoint: Reference at that stamp.
        error: (n,) reference minus measured position [rad].
        error_rate: (n,) reference minus measured rate [rad/s].
        mode: What the loop is doing.
        reason: Why it is damping, or holds for an event; empty otherwise.
        uses_estimate: Whether the law runs on, or started from, a received estimate.
    """

    stamp_ns: int
    setpoint: Setpoint
    error: Array
    error_rate: Array
    mode: Mode
    reason: str
    uses_estimate: bool
