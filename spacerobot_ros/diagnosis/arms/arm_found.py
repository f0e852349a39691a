"""What a search for the causes of an arm's torques says, and the rms that a model misses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ...effects.effect import Effect
from ...errors import RecordingError
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import Balance, balance_of, rms
from ...inference.inferred import InferredCause
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..events.arm_events import ArmEvents
from ..events.event import Spans
from ..limits import ENOUGH_ROWS, FEWEST_ROWS
from .fitted_arm import FittedArm
from .long_arm import Stretches, Traces

WORSE = 1.02
"""Of a joint's rms in a recording as it is: the most that an extended model may leave of it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ArmFound:
    """What a search says.

    Args:
        records: The recordings.
        robot: The robot file's robot.
        believed: Its own effects.
        fit: The chosen causes with values.
        causes: What speaks for each of them, by number.
        levels: (2 n, 8) variances of every joint's leftover, see `ArmRows.joints` [N^2 m^2].
        constants: Motor constants of currents that nobody made torques, estimated beside all.
        clear: Numbers of the causes that are named. named: The same as they are applied.
        calibration: What is applied beside them without a name: causes that are not clear of
            their own spread, and corrections of the file within its tolerance.
        learned: Laws that nobody has named, see `discovery`.
        events: What came from outside; all else is found without those times.
        stretches: All of a record that is too long for memory, of which `records` are a sample.
    """

    records: tuple[Record, ...]
    robot: Robot
    believed: tuple[Effect, ...]
    fit: FittedArm
    causes: Mapping[int, InferredCause]
    levels: Array
    clear: tuple[int, ...] = ()
    named: tuple[Effect, ...] = ()
    calibration: tuple[Effect, ...] = ()
    constants: tuple[Effect, ...] = ()
    learned: tuple[Effect, ...] = ()
    events: ArmEvents = field(default_factory=ArmEvents)
    stretches: Stretches | None = None

    @property
    def is_one(self) -> bool:
        """Whether all is of one recording."""
        return len(self.records) == 1 or self.stretches is not None

    @property
    def effects(self) -> tuple[Effect, ...]:
        """Of the extended model."""
        found = (*self.named, *self.calibration, *self.learned)
        return (*self.believed, *self.constants, *found)

    @cached_property
    def extended(self) -> tuple[Balance, ...]:
        """The recordings under the extended model."""
        return tuple(balances_of(self.records, self.robot, self.effects, self.events.left_out))

    @cached_property
    def traces(self) -> tuple[Traces, Traces]:
        """What the model and the extended model leave."""
        if self.stretches is None:
            return Traces.of(self.fit.rows.balances), Traces.of(self.extended)
        known = (*self.believed, *self.constants)
        both = (Traces.along(self.stretches, effects) for effects in (known, self.effects))
        return next(both), next(both)

    @cached_property
    def ratios(self) -> Array:
        """(R, n) rms that the extended model leaves by that of the model; NaN at rest."""
        pairs = zip(self.fit.rows.balances, self.extended, strict=True)
        return np.array([rms([after]) / rms([before]) for before, after in pairs])


def without_harm(found: ArmFound) -> ArmFound:
    """The same, or without what has no name where that leaves the worst joint better.

    Tolerances far outside of what they are help one joint and harm another.
    """
    if not np.any(found.ratios > WORSE):
        return found
    bare = replace(found, calibration=())
    return min(found, bare, key=lambda some: float(np.nanmax(some.ratios)))


def balances_of(
    records: Sequence[Record],
    robot: Robot,
    effects: Sequence[Effect],
    left_out: Sequence[Spans],
) -> list[Balance]:
    """Every recording under a robot with effects, without some times."""
    return [
        balance_of(record, robot, [e for e in effects if e.is_of(run)], spans)
        for run, (record, spans) in enumerate(zip(records, left_out, strict=True))
    ]


def refuse_rest(balances: Sequence[Balance], records: Sequence[Record]) -> None:
    """Refuse recordings that say nothing.

    Raises:
        RecordingError: no joint moves in any of them.
    """
    if not any(balance.arm.is_moving.any() for balance in balances):
        source = records[0].source or 'recording'
        raise RecordingError(source, f'{still_words(balances)}; record a motion')


def refuse_short(rows: ArmRows, records: Sequence[Record]) -> None:
    """Refuse recordings that say less than may be wrong.

    Raises:
        RecordingError: too few torques for the numbers that are asked of them.
    """
    arms = [balance.arm for balance in rows.balances]
    count = sum(int(np.sum(arm.is_moving[:: arm.stride])) for arm in arms)
    asked = sum(len(at) for at in rows.places)
    if count < FEWEST_ROWS * asked:
        enough = ENOUGH_ROWS * asked / rows.robot.n_joints * arms[0].stride * arms[0].step
        raise RecordingError(
            records[0].source or 'recording',
            f'is too short: {count} torques of moving joints in the band of their motion do not '
            f'tell apart {asked} numbers that may be wrong (friction, offsets, inertias, ...); '
            f'record {math.ceil(enough)} s or more in which every joint moves and turns both '
            'ways, as `spacerobot excite` designs it',
        )


def still_words(balances: Sequence[Balance]) -> str:
    """Why nothing is told where no joint moves."""
    touched = touched_joints(balances)
    but = f' but in jerks ({", ".join(touched)})' if touched else ''
    return f'no joint moves{but}: at rest friction holds any torque'


def touched_joints(balances: Sequence[Balance]) -> list[str]:
    """Joints that go somewhere, but nowhere for long enough to be judged."""
    moves = np.any([b.arm.is_moving.any(axis=0) for b in balances], axis=0)
    touched = np.any([b.arm.is_touched for b in balances], axis=0) & ~moves
    return [balances[0].robot.joints[j] for j in np.flatnonzero(touched)]


def touched_notes(balances: Sequence[Balance]) -> tuple[str, ...]:
    """What to say of them."""
    names = touched_joints(balances)
    words = 'moves, in jerks or once, are too short to be judged'
    return (f'{", ".join(names)}: {words}',) if names else ()
