"""What changed between two groups of recordings of one machine, what both share cancelled.

It is the diagnosis of an arm with other hypotheses: a cause may have changed before the second
group, and what a machine that nobody touched changes by is tolerated. The level of what is left is
each group's own, beside coefficients of its own: beside shared ones the change itself would pass
for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...effects.catalogue import kinds_beside
from ...effects.effect import Effect
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import balance_of
from ...estimation.balance.motor_constants import as_recorded, first_constants
from ...estimation.trajectory.observations import observed, refuse_unbalanced
from ...model.robot import Robot
from ...recording.faults.data_faults import check_data
from ...recording.record import Record
from ..arms.arm_found import refuse_rest
from .change_conclusion import Comparison, conclude_changes
from .changes import Changes
from .repeats import FEWEST, aligned, less_reference
from .two_groups import TwoGroups, split


def compare(
    before: Sequence[Record],
    after: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect] = (),
    report: Callable[[str, float], None] = lambda what, share: None,
) -> Comparison:
    """Say what changed between two groups of recordings of one machine.

    Args:
        before: Of a machine with a fixed base and measured efforts.
        after: Of the same machine, later.
        robot: The robot file's robot.
        believed: The robot file's own effects.
        report: Called with what is being done and the share done, from 0 to 1.

    Raises:
        RecordingError: faulty data, a free base or no efforts, or no joint that moves.
    """
    return conclude_changes(changes_between(before, after, robot, believed, report))


def changes_between(
    before: Sequence[Record],
    after: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect] = (),
    report: Callable[[str, float], None] = lambda what, share: None,
) -> Changes:
    """The changes that `compare` is about, with all that they were chosen by."""
    groups = groups_of(before, after, robot, believed, report)
    report('choosing changes', 0.7)
    return Changes.of(groups)


def groups_of(
    before: Sequence[Record],
    after: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    report: Callable[[str, float], None],
) -> TwoGroups:
    """Rows of both groups, and the level of what no cause explains in each."""
    every = list[Record]()
    for records in (before, after):
        for record in records:
            check_data(record, robot)
        measured = [observed(record, robot) for record in records]
        refuse_unbalanced(measured, robot)
        every += measured
    robot, count = as_recorded(robot, every), len(before)
    believed = (*believed, *first_constants(every, robot, believed))
    runs = aligned(every) if count >= FEWEST else None
    report('balancing torques along the motion', 0.1)
    balances = [balance_of(record, robot, believed) for record in runs or every]
    for part in (slice(None, count), slice(count, None)):
        refuse_rest(balances[part], every[part])
    rows = ArmRows.of(balances, kinds_beside(believed))
    report('finding the level of what no cause explains', 0.3)
    if runs:
        return less_reference(rows, count)
    levels = [leftover_levels(g, g.sizes, g.friction) for g in split(rows, count)]
    return TwoGroups(rows, count, (levels[0], levels[1]))
