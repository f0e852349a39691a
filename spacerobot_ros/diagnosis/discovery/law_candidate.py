"""Laws as candidates of an arm, and as they are applied."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import Effect, Key
from ...effects.laws.dimensions import is_unit
from ...effects.laws.formula_entry import Formula
from ...effects.laws.grammar import LawUnits, formula_name
from ...effects.laws.learned_torque import Guard, LearnedTorque, law_at
from ...effects.motion import Motion
from ...effects.prior import Prior
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.columns import Candidate
from ...model.machine import machine_of
from ...recording.robot_inputs import EXTRA
from ...types import Array
from ..limits import EXACT
from .arm_motions import ArmMotions
from .possible_laws import SHAPE, Law

_SIZE = 3.0  # times the torque that is missed: a law's plausible torque
_HELD = 1e-6  # of a size: what stays at nothing however sharp the data are
_FED_IN = 0.25
"""Largest share of the power of friction that may push, with the named friction beside it."""
_LARGEST = 1.49
"""Of its largest torque in the data, what a learned law may ever give: 1.5 is promised, and the
motion of the data is known to its noise (1.5002 times was seen at 1.5)."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LawCandidate(Candidate):
    """A law among the candidates of an arm.

    Args:
        of: The law.
        effect: The same with any coefficients, neither limited nor guarded: linear in them.
    """

    of: Law
    effect: LearnedTorque

    @property
    def key(self) -> Key:
        """What it says, and where: laws that say the same in other words are variants of one."""
        return f'{self.of.resembles} of {", ".join(sorted(self.of.inputs))}', self.where

    def values(self, coefficients: Array) -> dict[str, float]:
        """Coefficients by name."""
        return dict(zip(self.directions[0], map(float, coefficients), strict=True))

    def applied(self, values: Mapping[str, float]) -> Effect:
        """The law with given coefficients."""
        return replace(self.effect, values=dict(values))


def candidate_of(
    law: Law, j: int, motions: ArmMotions, causes: Collection[int] = (), react: str = ''
) -> LawCandidate:
    """A law at joint j as a candidate, its sizes in proportion to what is missed there.

    What it has in common with causes is theirs: shared out, a friction would lose half of its
    size to a law with the same term, and all of its certainty. Of one that is nothing else a
    cause is of a slightly other shape, which a law of other variables would follow, too: it
    competes with laws, and is none.

    Args:
        law: The law.
        j: Number of the joint.
        motions: Of the arm.
        causes: Numbers of those that stay whatever laws there are.
        react: The joint that acts alike; empty: none.
    """
    rows = motions.rows
    joint, count = rows.robot.joints[j], len(law.form.powers)
    names = [f'c{k}' for k in range(1, 1 + count)]
    is_theirs = left_of(motions.torques([law], j), rows, j, causes) < EXACT
    if np.all(is_theirs):
        law, is_theirs = replace(law, kind=SHAPE), np.zeros(count, dtype=bool)
    guard = Guard(
        range={formula_name(n, joint): ends for n, ends in motions.ranges(law, j).items()},
        limit=math.inf,
        kind='external',
        react={react: law.form.ratio} if react else {},
        machine=machine_of(rows.robot.urdf),
    )
    effect = law_at(
        name=f'learned_torque_{joint}',
        where=joint,
        values=dict.fromkeys(names, 0.0),
        formula=_formula_of(law, j, motions),
        guard=guard,
    )
    values = np.concatenate([motions.values(law, run) for run in range(len(rows.balances))])
    steps = sizes_of(rows.joints[j].torque, values)
    sizes = np.where(is_theirs, _HELD, 1.0) * steps
    return LawCandidate(
        kind=LearnedTorque,
        where=joint,
        variant={},
        directions=tuple(
            {name: step * (name == own) for name in names}
            for own, step in zip(names, steps.tolist(), strict=True)
        ),
        steps=steps,
        sizes=sizes,
        lower=np.full(count, -np.inf),
        upper=np.full(count, np.inf),
        prior=Prior(sizes, np.zeros(count), -law.price),
        of=law,
        effect=effect,
    )


def sizes_of(missed: Array, terms: Array) -> Array:
    """(k,) plausible coefficients of terms (R, k) of a law, by the torque (M,) that is missed."""
    size = np.maximum(np.mean(terms**2, axis=0), 1e-300)
    return np.asarray(_SIZE * np.sqrt(np.mean(missed**2) / size))


def _formula_of(law: Law, j: int, motions: ArmMotions) -> Formula:
    """A law at joint j as a formula of a robot file."""
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
    entry = {**law.form.entry(law.inputs, law.options, units), 'extra': extra}
    return Formula.read('learned_torque', joint, entry, 'law', is_known_motion=True)


def left_of(
    law: Array, rows: ArmRows, j: int, causes: Collection[int], offset: float = 0.0
) -> Array:
    """(k,) of the square of each term (R, k) at joint j, what causes leave.

    And the simple laws that they refine: beside a dry friction with a history the term of one
    without is as good as its opposite.

    Args:
        law: The terms.
        rows: The recordings.
        j: The joint.
        causes: Numbers of causes.
        offset: What may be constant beside them; 0: nothing.
    """
    every = enumerate(rows.candidates)
    simple = [
        (s, rows.candidates[i].where) for i in causes for s in rows.candidates[i].kind.refines
    ]
    refined = [i for i, c in every if c.key in simple]
    own = [int(k) for i in (*causes, *refined) for k in rows.places[i]]
    theirs = np.column_stack([rows.joints[j].columns[:, own], np.full(len(law), offset)])
    theirs = theirs / np.maximum(np.linalg.norm(theirs, axis=0), 1e-300)
    left = law - theirs @ np.linalg.lstsq(theirs, law, rcond=1e-9)[0]
    return np.asarray(np.sum(left**2, axis=0) / np.maximum(np.sum(law**2, axis=0), 1e-300))


def applied_law(
    candidate: LawCandidate, free: LearnedTorque, motions: ArmMotions
) -> LearnedTorque:
    """The law as it is simulated: limited, and without what friction can not do."""
    largest = 0.0
    for balance in motions.balances:
        motion, j = balance.motion, motions.rows.robot.joints.index(str(free.where))
        torque = free.force(motion, np.zeros((len(motion), 0)))[:, 6 + j]
        moving = balance.arm.is_moving[:, j]  # in some recordings it may stand
        largest = max(largest, float(np.max(np.abs(torque[moving]), initial=0.0)))
    guard = replace(free.guard, kind=candidate.of.kind, limit=_LARGEST * largest)
    return replace(free, guard=guard)


def guarded(
    law: LearnedTorque, friction: Mapping[str, Sequence[Effect]], along: Sequence[Motion]
) -> LearnedTorque | None:
    """A law that takes energy; one that corrects friction of the model is no friction alone.

    None where with all friction of its joint it feeds energy in.
    """
    if not feeds_energy(law, along):
        return law
    beside = friction.get(str(law.where), ())
    return None if feeds_energy(law, along, beside) else _external(law)


def _external(law: LearnedTorque) -> LearnedTorque:
    return replace(law, guard=replace(law.guard, kind='external'))


def feeds_energy(
    law: LearnedTorque, motions: Iterable[Motion], beside: Sequence[Effect] = ()
) -> bool:
    """Whether friction, as it was fitted, feeds in more power than fits may.

    Args:
        law: The law.
        motions: Of the recordings.
        beside: Other friction of the same joint.
    """
    if law.guard.kind != 'dissipative':
        return False
    every = [_external(law), *beside]
    given, taken = 0.0, 0.0
    for motion in motions:
        force = np.sum([e.force(motion, e.driven(motion)) for e in every], axis=0)
        power = np.sum(force * motion.rates, axis=1)
        given += float(np.sum(np.maximum(power, 0.0)))
        taken += float(np.sum(np.maximum(-power, 0.0)))
    return given > _FED_IN * (given + taken)
