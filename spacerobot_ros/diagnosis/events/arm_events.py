"""All events of recordings of an arm on the ground: of joints that move, and at rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...effects.joint import direction
from ...effects.joints.joint_friction import LoadFriction
from ...estimation.balance.arm_priors import DRY, OF_LOAD, Machine
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance
from ...types import Array
from .event import Events, Spans
from .joint_templates import SPREAD
from .naming import MovingArm
from .rest import rest_events


@dataclass(frozen=True, slots=True, eq=False)
class ArmEvents:
    """Events, and the times of each recording that they take.

    What happens once says nothing of a machine, whether it is large enough for a name or not.
    """

    events: Events = field(default_factory=Events)
    left_out: tuple[Spans, ...] = ()


def arm_events(balances: Sequence[Balance], rows: ArmRows | None) -> ArmEvents:
    """Events of some recordings of one arm.

    Args:
        balances: The model along every recording.
        rows: The same as rows; None where no joint moves.
    """
    robot = balances[0].robot
    machine = Machine(robot, balances)
    friction = np.array([machine.friction(DRY, joint) for joint in robot.joints])
    of_load = np.array([machine.friction(OF_LOAD, joint) for joint in robot.joints])
    found, moving = Events(recordings=len(balances)), None
    if rows is not None:
        moving = MovingArm(with_directed_gains(rows))
        found = found.with_more(moving.events())
        slides = np.array([moving.coulomb(j) for j in range(robot.n_joints)])
        friction = np.maximum(slides, break_away(balances))
        of_load = np.array([moving.of_load(j) for j in range(robot.n_joints)])
    friction = np.where(friction > 0.0, friction, np.nan)
    for run, balance in enumerate(balances):
        found = found.with_more(rest_events(balance, run, friction, of_load, moving))
    once = [(e.recording, e.start, e.end) for e in found.named]
    once += [(e.recording, e.start, e.end) for e in found.possible if e.reason == 'weak']
    spans = [
        tuple((start - SPREAD, end + SPREAD) for run, start, end in once if run == own)
        for own in range(len(balances))
    ]
    return ArmEvents(found, tuple(spans))


_BEFORE, _AFTER = 0.3, 0.25  # s of a start: where torque is largest, and the way has its sign
_FEWEST = 2  # starts: one may be a push


def break_away(balances: Sequence[Balance]) -> Array:
    """(n,) torques at which joints start, the median of all starts; 0 where few are seen [N m].

    Dry friction holds more than it leaves of a motion, of a light joint nearly twice as much: what
    a joint bears by itself before it starts is no push.
    """
    joints = range(balances[0].robot.n_joints)
    every = [np.array([x for b in balances for x in _starts(b, j)]) for j in joints]
    return np.array([float(np.median(x)) if len(x) >= _FEWEST else 0.0 for x in every])


def _starts(balance: Balance, j: int) -> Iterator[float]:
    """Torque along the coming way that a joint bears before each start, the model's taken off."""
    arm = balance.arm
    stands = arm.rests[:, j] & arm.is_known & arm.powered[:, j]
    before, after = round(_BEFORE / arm.step), round(_AFTER / arm.step)
    borne, q = -arm.in_band(balance.missed[:, j]), arm.kinematics.q[:, j]
    for at in np.flatnonzero(stands[:-1] & ~stands[1:]).tolist():
        was, goes = slice(max(at - before, 0), at + 1), slice(at + 1, at + 1 + after)
        if stands[was].all() and arm.is_moving[goes, j].any():
            way = np.sign(q[goes][-1] - q[at])
            yield float(np.max(way * borne[was]))


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
