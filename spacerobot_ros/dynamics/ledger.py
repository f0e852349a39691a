"""What a closed system must keep, and what one did."""

from __future__ import annotations

from dataclasses import dataclass

from ..types import Vector3

LEDGER_PERIOD = 0.1  # s between two looks at it


@dataclass(frozen=True, slots=True, eq=False)
class MomentumLedger:
    """What a closed system must keep, and what the simulated one did since its start.

    Args:
        linear: (3,) linear momentum in the inertial frame [N s].
        angular: (3,) angular momentum about the centre of mass, wheels and what effects hold
            included, inertial frame [N m s].
        kinetic: Kinetic energy without the gyrostats' own constant spin energy [J].
        potential: Energy in the gravity field [J].
        joint_work: Work of the joint torques since the start [J].
        base_work: Work of the base force and torque since the start [J].
        effect_work: Work of all physical effects since the start [J].
        linear_impulse: (3,) time integral of the external force, gravity included, inertial frame
            [N s].
        angular_impulse: (3,) time integral of the external torque about the centre of mass,
            inertial frame [N m s].
        momentum_drift: |h - h0 - angular_impulse| / |h0|; absolute [N m s] when h0 is zero. Zero
            for a fixed base, whose mount takes any torque, so that nothing is kept.
        energy_drift: Kinetic and potential energy, less those at the start, less all work [J].
    """

    linear: Vector3
    angular: Vector3
    kinetic: float
    potential: float
    joint_work: float
    base_work: float
    effect_work: float
    linear_impulse: Vector3
    angular_impulse: Vector3
    momentum_drift: float
    energy_drift: float
