"""What recordings tell of laws: inputs that they lack, and whether a law holds on another one.

Nothing is fitted here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ...effects.effect import Effect
from ...effects.laws.learned_torque import LearnedTorque
from ...estimation.balance.balance import Balance, balance_of
from ...estimation.inference.placebo import held_out_gain
from ...estimation.rows import BLOCKS
from ...estimation.trajectory.observations import observed
from ...model.robot import Robot
from ...recording.record import Record
from ...recording.robot_inputs import EXTRA
from ...types import Array
from ..answer.result import Leftover
from .discovery_limits import BEYOND_PLACEBO

_WIDE = 1e3  # times a law that its placebos may be


def judged_on(
    other: Record, robot: Robot, effects: Sequence[Effect], leftover: Sequence[Leftover]
) -> tuple[Leftover, ...]:
    """What is said of every channel, with the laws' share of another recording.

    A law that explains no more of it than its own torque at other times, fitted, is none that
    belongs in a model.

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
        out.append(_judged(entry, left[moving, j] + own, own, balance.row_times[moving]))
    return tuple(out)


def _judged(entry: Leftover, left: Array, own: Array, times: Array) -> Leftover:
    if not len(left):
        return entry
    square = float(left @ left)
    share = 1.0 - float(np.sum((left - own) ** 2)) / square
    ends = np.linspace(0, len(left), BLOCKS + 1).astype(int).tolist()
    blocks = [slice(a, b) for a, b in pairwise(ends)]
    placebo = held_out_gain(own[:, None], left, np.array([_WIDE]), blocks, times) / square
    holds = share > placebo + BEYOND_PLACEBO
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
