"""What a control loop answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..types import Array, Vector3
from .reference import Point

Mode = Literal['tracking', 'hold', 'damping']


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """A torque command with what it rests on.

    Args:
        stamp_ns: Stamp of the joint states that it answers [ns].
        tau: (n,) torque [N m].
        saturated: (n,) bool, where a limit cut it.
        point: Reference at that stamp.
        error: (n,) reference minus measured position [rad].
        error_rate: (n,) reference minus measured rate [rad/s].
        mode: What the loop is doing.
        reason: Why it is damping; empty otherwise.
        uses_estimate: Whether the law runs on, or started from, a received estimate.
        base: (3,) torque on the base, in base coordinates [N m]; None where it is left free.
        base_saturated: Whether a limit cut that.
        attitude_error: (3,) rotation vector from the base to where it should point, in base
            coordinates [rad]; None where the base is left free or its attitude is not known.
    """

    stamp_ns: int
    tau: Array
    saturated: np.ndarray
    point: Point
    error: Array
    error_rate: Array
    mode: Mode
    reason: str
    uses_estimate: bool
    base: Vector3 | None = None
    base_saturated: bool = False
    attitude_error: Vector3 | None = None
