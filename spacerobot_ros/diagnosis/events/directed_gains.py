"""Gains of motors that differ by the direction of rotation, and from recording to recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...effects.joint import direction
from ...effects.joints.joint_friction import LoadFriction
from ...estimation.balance.arm_priors import OF_LOAD
from ...estimation.balance.arm_rows import ArmRows
from ...types import Array


class DirectedGain(LoadFriction):
    """tau = c tau_m sign(q'): a motor that gives more torque one way than the other.

    With a commutation angle d off, and late by T, a torque is cos(d + T q') of what it would be;
    d is found anew where a motor is switched on.
    """

    id = 'directed_gain'

    def torque(self, q: Array, qd: Array, effort: Array) -> Array:
        """Along the motor torque one way, against it the other."""
        return np.asarray(self['coefficient'] * effort * direction(qd))


def with_directed_gains(rows: ArmRows) -> ArmRows:
    """Rows with such gains, of each recording its own, too; as large as friction by the load.

    A sensor of the torque on the link knows of no motor.
    """
    count = len(rows.balances)
    runs = [None, *((run,) for run in range(count))] if count > 1 else [None]
    motors = [
        replace(c, kind=DirectedGain)
        for c in rows.candidates
        if c.kind.id == OF_LOAD and rows.robot.effort_kind(str(c.where)) != 'link'
    ]
    return rows.with_more([replace(c, recordings=run) for run in runs for c in motors])
