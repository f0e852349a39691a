"""What recordings tell of laws: inputs that they lack, and whether a law holds on another one.

Nothing is fitted here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...effects.laws.learned_torque import LearnedTorque
from ...estimation.balance.balance import Balance, balance_of
from ...estimation.trajectory.observations import observed
from ...inference.decisive import PARTS
from ...inference.validation import passes
from ...model.robot import Robot
from ...recording.record import Record
from ...recording.robot_inputs import EXTRA
from ...types import Array
from ..answer.result import Leftover


def judged_on(
    other: Record, robot: Robot, effects: Sequence[Effect], leftover: Sequence[Leftover]
) -> tuple[Leftover, ...]:
    """What is said of every channel, with the laws' share of another recording.

    A law that does not predict its parts is none that belongs in a model.

    Args:
        other: The recording.
        robot: The robot file's robot.
        effects: All of the extended model but the laws.
        leftover: What was said.
    """
    laws = [entry.applied for entry in leftover if entry.applied is not None]
    if not laws:
        return tuple(leftover)
    balance = balance_of(observed(other, robot), robot, effects)
    torques = [_torques(balance, law) for law in laws]
    left = balance.torque - np.sum(torques, axis=0)
    out = []
    for entry in leftover:
        if entry.applied is None:
            out.append(entry)
            continue
        j = robot.joints.index(str(entry.applied.where))
        moving = balance.arm.is_moving[:: balance.arm.stride, j]
        own = torques[laws.index(entry.applied)][moving, j]
        out.append(_judged(entry, left[moving, j] + own, own))
    return tuple(out)


def _judged(entry: Leftover, left: Array, own: Array) -> Leftover:
    """With its share of a joint's rows, what is left and the law's torque (M,) given."""
    if not len(left):
        return entry
    gains = left**2 - (left - own) ** 2
    square = float(left @ left)
    parts = np.array([np.sum(part) for part in np.array_split(gains, PARTS)])
    holds = passes(0.5 * len(left) / square * parts)
    share = float(np.sum(gains)) / square
    return replace(entry, other_recording=share, applied=entry.applied if holds else None)


def _torques(balance: Balance, law: Effect) -> Array:
    """(M, n) rows of a law's torques."""
    motion = balance.motion
    torques = law.force(motion, law.driven(motion))[:, 6:]
    return balance.in_rows(torques, np.arange(torques.shape[1]))


def unmeasured_inputs(effects: Iterable[Effect], records: Sequence[Record]) -> tuple[str, ...]:
    """A note on every law that lacks an input.

    Args:
        effects: Of the robot file.
        records: What was measured.
    """
    laws = (e for e in effects if isinstance(e, LearnedTorque))
    return tuple(
        f'effects.{law.name}: the recording has no {name}, on which this law depends: it is taken '
        f'to be in the middle of its range all along (`extra` of a mapping names its column)'
        for law in laws
        for name in (EXTRA + extra for extra, _ in law.formula.extra)
        if not all(name in record.inputs for record in records)
    )


def unshared_extras(records: Sequence[Record]) -> tuple[str, ...]:
    """A note on every column of a mapping's `extra` that some of several recordings lack."""
    names = dict.fromkeys(n for r in records for n in r.inputs if n.startswith(EXTRA))
    return tuple(
        f'{name}: not in every recording, so that no law is asked of it'
        for name in names
        if not all(name in record.inputs for record in records)
    )
