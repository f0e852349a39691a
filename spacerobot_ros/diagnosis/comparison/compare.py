"""What changed between two groups of recordings of one machine, what both share cancelled.

Every cause has its coefficients twice: those that both groups share, with the sizes of a machine
that nobody knows, and what was added before the second group, within the tolerance of a machine
that did not change. The level of what is left is each group's own, beside coefficients of its
own: beside shared ones the change itself would pass for it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...effects.catalogue import kinds_beside
from ...effects.effect import Effect
from ...estimation.balance.arm_fit import Posterior
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import balance_of
from ...estimation.balance.motor_constants import as_recorded, first_constants
from ...estimation.inference.evidence import Gram, sum_of
from ...estimation.trajectory.observations import observed, refuse_unbalanced
from ...model.robot import Robot
from ...recording.faults.data_faults import check_data
from ...recording.record import Record
from ...types import Array, IntArray
from ..arms.arm_found import refuse_rest
from ..arms.held_out_checks import check_held_out, predicted_better
from ..arms.selection import Selection
from ..limits import HELD_OUT
from .change_conclusion import Comparison, conclude_changes
from .changes import ChangeRows, Changes, clear_fit
from .moments import Moments
from .repeats import FEWEST, aligned, find_changes_of_repeats
from .usual_changes import usual_changes


@dataclass(frozen=True, eq=False)
class ChangedRows(ChangeRows):
    """Columns of two groups: K that they share, then what changed in the second.

    Args:
        common: (K,) standard deviations of the shared coefficients.
    """

    common: Array

    @cached_property
    def sizes(self) -> Array:
        """(2 K,) plausible sizes."""
        own = np.concatenate([c.sizes for c in self.candidates])
        return np.concatenate([self.common, own])

    @cached_property
    def places(self) -> list[IntArray]:
        """Columns of every candidate's change."""
        ends = len(self.common) + np.cumsum([len(c.sizes) for c in self.candidates])
        starts = [end - len(c.sizes) for c, end in zip(self.candidates, ends, strict=True)]
        return [np.arange(a, b) for a, b in zip(starts, ends, strict=True)]

    @property
    def lower(self) -> Array:
        """(2 K,) what is shared is not bounded, and a change goes both ways."""
        return np.full(len(self.sizes), -np.inf)

    @property
    def upper(self) -> Array:
        """(2 K,) see `lower`."""
        return np.full(len(self.sizes), np.inf)


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
    groups = []
    for records in (before, after):
        for record in records:
            check_data(record, robot)
        measured = [observed(record, robot) for record in records]
        refuse_unbalanced(measured, robot)
        groups.append(measured)
    every = [*groups[0], *groups[1]]
    robot = as_recorded(robot, every)
    believed = (*believed, *first_constants(every, robot, believed))
    kinds = kinds_beside(believed)
    count = len(before)
    if count >= FEWEST and (runs := aligned(every)):
        report('balancing torques of repeats of one motion', 0.2)
        return find_changes_of_repeats(runs[:count], runs[count:], robot, believed, kinds)
    return find_changes(groups[0], groups[1], robot, believed, kinds, report)


def find_changes(
    before: Sequence[Record],
    after: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> Changes:
    """Changes that parts of the second group want, none of them alone.

    Raises:
        RecordingError: recordings in which no joint moves.
    """
    report('balancing torques along the motion', 0.1)
    groups = [
        [balance_of(record, robot, believed) for record in records] for records in (before, after)
    ]
    for group, records in zip(groups, (before, after), strict=True):
        refuse_rest(group, records)
    both = ArmRows.of([*groups[0], *groups[1]], kinds)
    first, second = (replace(both, balances=tuple(group)).sharing(both) for group in groups)
    report('finding the level of what no cause explains', 0.3)
    own = (leftover_levels(group, both.sizes, both.friction) for group in (first, second))
    levels = [_level_of_both(*pair) for pair in zip(*own, strict=True)]
    report('choosing changes', 0.7)
    shared, later = len(both.sizes), second.parts(levels)
    earlier = sum_of(first.parts(levels))
    machine = Posterior.of(earlier + both.held, both.sizes)
    rows = _changed_rows(both, usual_changes(both, machine))
    selection = Selection(
        rows,
        [_doubled(part, shared, is_changed=True) for part in later],
        second.recording,
        _doubled(earlier, shared, is_changed=False) + _both_held(both.held),
    )
    selection.run()
    moments = Moments(
        selection,
        [
            _doubled(part, shared, is_changed=group is second)
            for group in (first, second)
            for part in group.by_moments.parts(levels)
        ],
    )
    moments.drop_chances()
    check_held_out(selection)
    drop_needless_bodies(selection)
    _drop_smaller_than_rest(selection)
    fit = clear_fit(selection, lambda i: moments.judge(i).wider)
    unexplained = _unexplained(selection)
    return Changes(robot, selection, fit, np.array(levels), len(before), moments, unexplained)


def _drop_smaller_than_rest(selection: Selection) -> None:
    """Drop changes that explain less than what no change that was chosen explains, weakest first.

    Two motions differ in what a file that is wrong leaves of them, too, which spreads over many
    changes, all of them small; a change of the machine has most of the difference.
    """
    while selection.chosen:
        gains = {i: float(np.sum(selection.held_out(i))) for i in selection.chosen}
        weakest = min(gains, key=gains.__getitem__)
        if 2.0 * gains[weakest] > _unexplained(selection):
            return
        selection.drop(weakest)


def _unexplained(selection: Selection) -> float:
    """Squares of whitened rows that all changes together would explain and the chosen ones do not.

    Beyond what noise gives the freedom of all of them: its mean, and two standard deviations.
    """
    whole, chosen = selection.whole, selection.posterior(selection.chosen)
    every = Posterior.of(whole, selection.rows.sizes)
    gained = float(whole.vector @ (every.mean - chosen.mean))
    tied = [float(np.diag(p.covariance) @ p.precision) for p in (chosen, every)]
    freedom = max(tied[0] - tied[1], 0.0)
    return gained - freedom - 2.0 * math.sqrt(2.0 * freedom)


def _level_of_both(before: Array, after: Array) -> Array:
    """(8,) mean variances; those of one group where a joint moves in that one alone."""
    before = np.where(np.isnan(before), after, before)
    return np.asarray(0.5 * (before + np.where(np.isnan(after), before, after)))


def _changed_rows(both: ArmRows, usual: Array) -> ChangedRows:
    candidates = tuple(
        replace(c, lower=np.full(len(c.sizes), -np.inf), upper=np.full(len(c.sizes), np.inf))
        for c in both.candidates
    )
    common = np.maximum(both.sizes, both.tolerances)
    rows = ChangedRows(both.balances, candidates, np.concatenate([common, usual]), common)
    return rows.sharing(both)


def _both_held(held: Gram) -> Gram:
    """Scales that nothing measured tells: they are the file's, and do not change."""
    none = np.zeros_like(held.matrix)
    matrix = np.block([[held.matrix, none], [none, held.matrix]])
    return Gram(matrix, np.concatenate([held.vector, held.vector]), 0.0, 0)


def _doubled(gram: Gram, shared: int, *, is_changed: bool) -> Gram:
    """Sums by shared and by changed coefficients."""
    g, b = gram.matrix, gram.vector
    none = np.zeros((shared, shared))
    matrix = np.block([[g, g], [g, g]]) if is_changed else np.block([[g, none], [none, none]])
    return Gram(matrix, np.concatenate([b, b if is_changed else 0.0 * b]), gram.square, gram.rows)


def drop_needless_bodies(selection: Selection) -> None:
    """Drop bodies without which parts are predicted as well, weakest first.

    A spring of -5 N m/rad at the second joint of a KUKA was the body beyond it, both with the same
    evidence, of which the spring predicts parts of the motion better by 7 nats; encoders of a
    double pendulum that are set to zero where it hangs, rubbing, were 0.17 kg at its end (by 2).
    What has to be beaten need not be worth a name. Loads that were put on in 150 simulated arms
    beat it by 57 and more.
    """
    rows = selection.rows
    bodies = {
        i
        for i, candidate in enumerate(rows.candidates)
        if candidate.kind.id == 'inertial_parameters'
    }
    for i in sorted(bodies & set(selection.chosen), key=selection.gain):
        if i not in selection.chosen:
            continue
        other = selection.instead_of(i, bodies)
        if predicted_better(selection, selection.chosen, other.chosen) <= HELD_OUT:
            check_held_out(other)
            selection.take(other)
