"""What a control loop answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..types import Array, Vector3
from .joint_reference import Setpoint

Mode = Literal['tracking', 'hold', 'damping']


@dataclass(frozen=True, slots=True, eq=False)
class Torque:
    """Torques that a law asks for.

    Args:
        tau: (n,) torque within the limits [N m].
        saturated: (n,) bool, where a limit cut it.
        base: (3,) torque on the base within the limits, in base coordinates [N m]; None where the
            law leaves the base free.
        base_saturated: Whether a limit cut that.
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
