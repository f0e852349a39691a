"""Laws beside an arm's named causes: values of all of them together, as they will be applied."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ...effects.laws.dimensions import is_unit
from ...effects.laws.formula_entry import Formula
from ...effects.laws.grammar import LawUnits, formula_name
from ...effects.laws.learned_torque import Guard, LearnedTorque, law_at
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.arm_rows_about import about_model
from ...estimation.columns import Candidate
from ...model.machine import machine_of
from ...recording.robot_inputs import EXTRA
from ...types import Array, BoolArray
from ..arms.arm_found import ArmFound
from ..arms.arms import levels_of
from ..arms.fitted_arm import FittedArm
from ..limits import CHANCE
from .arm_channels import ArmMotions
from .discovery_limits import LARGEST_LAW
from .possible_laws import Law

_SIZE = 3.0  # times the torque that is missed: a law's plausible torque
_HELD = 1e-6  # of a size: what stays at nothing however sharp the data are
SAME = 1e-6
"""Of a term's square that causes leave where it is one of theirs: rounding leaves 1e-30 of a sign
beside dry friction, Dahl's friction 4e-3 beside one of another displacement, which is more."""


@dataclass(frozen=True, slots=True, eq=False)
class LawCandidate(Candidate):
    """A law among the candidates of an arm.

    Args:
        law: With any coefficients, neither limited nor guarded, so that it is linear in them.
    """

    law: LearnedTorque | None = None

    def values(self, coefficients: Array) -> dict[str, float]:
        """Coefficients by name."""
        return dict(zip(self.directions[0], map(float, coefficients), strict=True))

    def applied(self, values: Mapping[str, float]) -> Effect:
        """The law with given coefficients."""
        if self.law is None:
            raise ValueError('a candidate without a law')
        return replace(self.law, values=dict(values))


def candidate_of(law: Law, j: int, motions: ArmMotions, react: str = '') -> LawCandidate:
    """A law at joint j as a candidate, its sizes in proportion to what is missed there."""
    rows = motions.rows
    robot, joint = rows.robot, rows.robot.joints[j]
    names = [f'c{k}' for k in range(1, 1 + len(law.form.powers))]
    ranges = {formula_name(n, joint): ends for n, ends in motions.ranges(law, j).items()}
    guard = Guard(
        range=ranges,
        limit=math.inf,
        kind='external',
        react={react: law.form.ratio} if react else {},
        machine=machine_of(robot.urdf),
    )
    free = law_at(
        name=f'learned_torque_{joint}',
        where=joint,
        values=dict.fromkeys(names, 0.0),
        formula=Formula.read('learned_torque', joint, _entry(law, j, motions), 'law'),
        guard=guard,
    )
    missed = float(np.sqrt(np.mean(rows.joints[j].torque ** 2)))
    values = [law.form(motions.inputs(law, run), law.options) for run in range(len(rows.balances))]
    sizes = _SIZE * missed / np.sqrt(np.mean(np.concatenate(values) ** 2, axis=0))
    return LawCandidate(
        kind=LearnedTorque,
        where=joint,
        variant={},
        directions=tuple(
            {name: s * (name == own) for name in names}
            for own, s in zip(names, sizes.tolist(), strict=True)
        ),
        steps=sizes,
        sizes=sizes,
        lower=np.full(len(names), -np.inf),
        upper=np.full(len(names), np.inf),
        law=free,
    )


def _entry(law: Law, j: int, motions: ArmMotions) -> dict[str, Any]:
    """The formula of a law at joint j as in a robot file."""
    robot = motions.balances[0].motion.robot
    joint, bodies = robot.joints[j], zip(robot.joints, robot.bodies[1:], strict=True)
    measured = {} if robot.inputs is None else robot.inputs.extra
    known = {n: signal.unit if is_unit(signal.unit) else '' for n, signal in measured.items()}
    sliding = [name for name, body in bodies if body.is_prismatic]
    units = LawUnits(joint, robot.unit_of('N m', joint), sliding, known)
    extra = {
        own: {'unit': known[own], 'typical': 0.5 * sum(ends)}
        for name, ends in motions.ranges(law, j).items()
        if name.startswith(EXTRA) and (own := name.removeprefix(EXTRA))
    }
    return {**law.form.entry(law.inputs, law.options, units), 'extra': extra}


def applied_law(law: Law, free: LearnedTorque, motions: ArmMotions) -> LearnedTorque:
    """The law as it is simulated: limited, and without what friction can not do."""
    largest = 0.0
    for balance in motions.balances:
        motion, j = balance.motion, motions.rows.robot.joints.index(str(free.where))
        torque = free.force(motion, np.zeros((len(motion), 0)))[:, 6 + j]
        moving = balance.arm.is_moving[:, j]  # in some recordings it may stand
        largest = max(largest, float(np.max(np.abs(torque[moving]), initial=0.0)))
    return replace(free, guard=replace(free.guard, kind=law.kind, limit=LARGEST_LAW * largest))


def with_laws(
    found: ArmFound, laws: Sequence[LawCandidate], dropped: Collection[int] = ()
) -> tuple[ArmFound, list[int]]:
    """Causes and laws fitted together, and the laws' numbers among the candidates.

    What a law has in common with causes is theirs: shared out, a friction would lose half of its
    size to a law with the same term, and all of its certainty.

    Args:
        found: The causes.
        laws: The laws.
        dropped: Numbers of the causes in whose place they stand.
    """
    if not laws:
        return found, []
    causes = [i for i in found.fit.chosen if i not in dropped]
    first = len(found.fit.rows.candidates)
    numbers = list(range(first, first + len(laws)))

    def rows_with(some: Sequence[LawCandidate]) -> ArmRows:
        return about_model(
            found.fit.rows.with_more(some), dict(enumerate(found.extended)), numbers
        )

    rows = rows_with(laws)
    own = [
        replace(law, sizes=np.where(_is_of(rows, i, causes), _HELD, 1.0) * law.sizes)
        for i, law in zip(numbers, laws, strict=True)
    ]
    rows = rows_with(own)
    both = [*causes, *numbers]
    levels = levels_of(rows, FittedArm.of(rows, [*found.levels], both))
    fit = FittedArm.of(rows, levels, both)
    out = replace(found, fit=fit, levels=np.array(levels))
    clear = tuple(i for i in causes if i in found.clear and fit.chance(i) < CHANCE)
    unclear = [i for i in causes if i not in clear]
    out = replace(
        out,
        clear=clear,
        named=tuple(fit.effects(clear)),
        calibration=tuple(fit.effects([*unclear, *fit.calibration])),
    )
    return out, numbers


def _is_of(rows: ArmRows, i: int, causes: Sequence[int]) -> BoolArray:
    """(k,) whether a law's terms are those of causes, or of the simple laws that they refine.

    Beside a dry friction with a history the term of one without is as good as its opposite.
    """
    columns = rows.joints[rows.robot.joints.index(str(rows.candidates[i].where))].columns
    law = columns[:, rows.places[i]]
    every = [*causes, *_refined(rows, causes)]
    theirs = columns[:, [int(k) for c in every for k in rows.places[c]]]
    theirs = theirs / np.maximum(np.linalg.norm(theirs, axis=0), 1e-300)
    left = law - theirs @ np.linalg.lstsq(theirs, law, rcond=1e-9)[0]
    return np.asarray(np.sum(left**2, axis=0) < SAME * np.sum(law**2, axis=0))


def _refined(rows: ArmRows, causes: Sequence[int]) -> list[int]:
    """Numbers of the simple laws that causes refine, at their places."""
    kinds = [
        (law, rows.candidates[i].where) for i in causes for law in rows.candidates[i].kind.refines
    ]
    return [i for i, c in enumerate(rows.candidates) if c.key in kinds]
