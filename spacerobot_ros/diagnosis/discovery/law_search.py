"""Laws beside an arm's causes: the grammar proposes, and the search for causes decides.

Causes stay, but those that are a form of the grammar: a law may take their place. What is no law,
sines of the time and inertial errors, competes with laws as they do with each other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Hashable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import cast

import numpy as np

from ...effects.laws.grammar import quantity
from ...estimation.balance.arm_priors import COUPLED
from ...estimation.balance.arm_rows import ArmRows
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.inferred import Inferred, InferredCause, infer
from ...inference.model_search import ChosenSet, best_set
from ...inference.validation import HeldOut
from ..arms.arm_found import ArmFound
from ..arms.arm_hypotheses import arm_hypotheses
from ..arms.spectral_level import SpectralRows
from ..limits import WRONG_ANSWERS
from .arm_motions import ArmMotions
from .law_candidate import LawCandidate, candidate_of, left_of
from .possible_laws import REFINED, Law
from .screen import JointScreen

REPLACEABLE = ('joint_stiffness', 'joint_torque_ripple', COUPLED)
"""Causes that are a form of the grammar, so that a law may stand in their place. No other
friction: on a UR10e laws would take the place of a shape that has a name, and say no more."""
_SAME = 1e-6  # of a law's square: rounding leaves 1e-30 of what a cause is
_LOUD = (0.0, 0.5, 0.9)
"""Of noise that grows with the rate. Likelihood tells them apart: of noise that does it is 50 to
180 nats more at 0.9 than at 0, of noise that does not 50 to 170 less (30 machines of all noises,
with laws and without)."""


@dataclass(frozen=True, eq=False)
class FoundLaw:
    """A law, or what is none, that the search chose.

    Args:
        candidate: It.
        inferred: What speaks for it.
        chance: Probability of such a law by chance.
        share: Of the squares that its joints are left with it explains.
        held_out: The same of parts that it was not fitted to.
    """

    candidate: LawCandidate
    inferred: InferredCause
    chance: float
    share: float
    held_out: float


class LawSearch:
    """A second pass of the search for causes, with laws among the hypotheses.

    Args:
        found: The causes.
    """

    def __init__(self, found: ArmFound) -> None:
        self._found, rows, self.robot = found, found.fit.rows, found.robot
        self.motions = ArmMotions(rows, found.extended)
        driven = ~np.isin(rows.robot.joints, rows.robot.passive_joints)
        self.moving = [j for j in np.flatnonzero(driven).tolist() if len(rows.joints[j].torque)]
        kinds = [c.kind.id for c in rows.candidates]
        self._may_go = frozenset(i for i in found.fit.chosen if kinds[i] in REPLACEABLE)
        self._first, self.candidates = len(kinds), list[LawCandidate]()
        self._screens = dict[int, JointScreen]()
        self._asked = dict[int, tuple[int, ...]]()
        self._chances = dict[tuple[int, tuple[int, ...]], float]()
        self.replaced = frozenset[int]()
        self.refused: dict[int, float] = {}
        """Of laws that chance makes as well: its probability by their numbers."""
        self._excluded = frozenset[Hashable]()

    @cached_property
    def _in_noise(self) -> dict[int, list[JointScreen]]:
        """Of each joint, in noise that grows with the rate more or less."""
        causes = self._found.fit.chosen
        return {j: [JointScreen(self.motions, j, causes, s) for s in _LOUD] for j in self.moving}

    def _settle(self, chosen: Collection[int]) -> None:
        """Choose the likeliest noise of each joint beside a set.

        A law leaves more where it is larger, as noise that grows with the rate does.
        """
        for j, screens in self._in_noise.items():
            beside = self._causes_and_laws(j, self._beside(j, chosen))
            self._screens[j] = max(screens, key=lambda s: s.likelihood(*beside))

    def run(self) -> list[FoundLaw]:
        """What is chosen beside the causes; causes that give way are `replaced`."""
        chosen = frozenset(self._found.fit.chosen)
        self._settle(chosen)
        while more := self._proposed(chosen):
            first = self._first + len(self.candidates)
            self.candidates += more
            # beside all that may be, as what is chosen is no part of the noise that judges it
            hypotheses, _ = self._rows([*chosen, *range(first, first + len(more))])
            before, chosen = chosen, best_set(hypotheses, chosen).chosen
            if chosen <= before:
                break
            self._settle(chosen)
        if not self.candidates:
            return []
        hypotheses, left = self._rows(chosen)
        inferred = infer(hypotheses.blocks, hypotheses.every, refused=self._by_chance)
        return self._said(inferred, hypotheses, left)

    def _rows(self, chosen: Collection[int]) -> tuple[Hypotheses, Callable[..., float]]:
        """All hypotheses at the level that a set leaves, and what coefficients leave there."""
        rows = self._found.fit.rows.with_more(self.candidates, self.motions.balances)
        levels = list(self._found.levels)
        for j, screen in self._screens.items():
            levels[j] = screen.variances
        every = self._hypotheses(rows)
        sizes = {j: screen.sizes for j, screen in self._screens.items()}
        spectral = SpectralRows(rows.over(sizes), levels, every)
        scale = spectral.scale(chosen)
        return Hypotheses(spectral.blocks(scale), every), partial(spectral.left, scale)

    def _hypotheses(self, rows: ArmRows) -> list[Hypothesis]:
        """Laws, and causes whose place they may take; other causes always are."""
        stay = set(self._found.fit.chosen) - self._may_go
        return [
            h
            if i >= self._first or i in self._may_go
            else replace(h, log_odds=math.inf if i in stay else -math.inf)
            for i, h in enumerate(arm_hypotheses(rows))
        ]

    def _proposed(self, chosen: Collection[int]) -> list[LawCandidate]:
        """Laws that were not proposed before: beside all causes, and beside those that stay."""
        rows, known = self._found.fit.rows, {_words(c) for c in self.candidates}
        out = []
        for j in self.moving:
            beside = self._beside(j, chosen)
            if self._asked.get(j) == beside:
                continue
            self._asked[j], (causes, given) = beside, self._causes_and_laws(j, beside)
            may_go = [i for i in causes if i in self._may_go and rows.acts_on(i, j)]
            laws = [(law, True) for law in self._screens[j].proposals(causes, given)]
            if may_go:
                rest = [i for i in causes if i not in may_go]
                laws += [
                    (law, not self._is_of(law, j, may_go))
                    for law in self._screens[j].proposals(rest, given)
                ]
            is_shared = any(rows.acts_on(i, k) for i in may_go for k in self.moving if k != j)
            stay = [i for i in causes if i not in self._may_go]
            for law, is_other in laws:
                # what causes are by another name takes no place of them, but at one joint of two
                places = [''] if is_other or is_shared else []
                places += [quantity(law.inputs[1])[1]] if law.form.ratio and is_other else []
                for react in places:
                    candidate = candidate_of(law, j, self.motions, stay, react)
                    if _words(candidate) not in known:
                        known |= {_words(candidate)}
                        out.append(candidate)
        return out

    def _is_of(self, law: Law, j: int, causes: Collection[int]) -> bool:
        """Whether a law is what causes are, by another name."""
        terms = self.motions.torques([law], j)
        return bool(np.all(left_of(terms, self._found.fit.rows, j, causes, offset=1.0) < _SAME))

    def _beside(self, j: int, chosen: Collection[int]) -> tuple[int, ...]:
        """Of a set its causes, and its laws that act on joint j."""
        laws = self.candidates
        return tuple(
            i
            for i in sorted(chosen)
            if i < self._first or j in self._places(laws[i - self._first])
        )

    def _causes_and_laws(self, j: int, numbers: Iterable[int]) -> tuple[list[int], list[Law]]:
        causes, laws = [], []
        for i in numbers:
            if i < self._first:
                causes.append(i)
            else:
                c = self.candidates[i - self._first]
                is_own = c.where == self.robot.joints[j]
                laws.append(c.of if is_own else replace(c.of, inputs=c.of.inputs[::-1]))
        return causes, laws

    def _by_chance(self, hypotheses: Hypotheses, found: ChosenSet) -> list[int]:
        """The law of a set that chance explains most easily, if it does."""
        chances = {i: self._chance(i, found.chosen) for i in found.chosen if i >= self._first}
        worst = max(chances, key=chances.__getitem__, default=None)
        if worst is None or chances[worst] <= WRONG_ANSWERS / len(self.moving):
            return []
        self.refused[worst] = chances[worst]
        return [worst]

    def _chance(self, i: int, chosen: frozenset[int]) -> float:
        candidate = self.candidates[i - self._first]
        j = self._places(candidate)[0]
        key = i, self._beside(j, chosen - {i})
        if key not in self._chances:
            beside = self._causes_and_laws(j, key[1])
            self._chances[key] = self._screens[j].chance(candidate.of, *beside)
        return self._chances[key]

    def _said(
        self, inferred: Inferred, hypotheses: Hypotheses, left_of: Callable[..., float]
    ) -> list[FoundLaw]:
        causes = {cast(int, c.key): c for c in inferred.causes}
        chosen = frozenset(causes) | hypotheses.always
        out = []
        for i in (i for i in causes if i >= self._first):
            candidate = self.candidates[i - self._first]
            sets, at = (chosen, chosen - {i}), self._places(candidate)
            means = [hypotheses.mean(hypotheses.marginal(s), s) for s in sets]
            after, before = (left_of(mean, at) for mean in means)
            left = [float(np.sum(HeldOut(hypotheses, s).squares()[1])) for s in sets]
            out.append(
                FoundLaw(
                    candidate=candidate,
                    inferred=causes[i],
                    chance=self._chance(i, chosen),
                    share=1.0 - after / before,
                    held_out=(left[1] - left[0]) / before,
                )
            )
        self.replaced = self._may_go - chosen
        self._excluded = inferred.excluded
        return out

    def given_way(self, laws: Iterable[LawCandidate]) -> frozenset[int]:
        """Numbers of causes in whose place some laws stand."""
        at, rows = [j for law in laws for j in self._places(law)], self._found.fit.rows
        return frozenset(i for i in self.replaced if any(rows.acts_on(i, j) for j in at))

    def _places(self, law: LawCandidate) -> list[int]:
        """Numbers of the joints that it acts on."""
        joints = filter(None, (str(law.where), law.effect.react))
        return [self.robot.joints.index(joint) for joint in joints]

    def laws_of(self, keys: Iterable[Hashable]) -> tuple[Law, ...]:
        """Those of some hypotheses that are laws, or what is none."""
        numbers = (cast(int, key) - self._first for key in keys)
        return tuple(self.candidates[n].of for n in numbers if n >= 0)

    def not_repeated(self, joint: str) -> str:
        """A law of a joint that parts of the data do not repeat, in words; empty: none."""
        for key in self._excluded - set(self.refused):
            n = cast(int, key) - self._first
            if n >= 0 and self.candidates[n].where == joint:
                return self.candidates[n].of.resembles
        return ''


def _words(candidate: LawCandidate) -> tuple[object, ...]:
    """What a law says, with the options that are not refined."""
    law = candidate.of
    options = tuple((k, v) for k, v in sorted(law.options.items()) if k not in REFINED)
    places = {str(candidate.where), candidate.effect.react}
    inputs = frozenset(law.inputs) if candidate.effect.react else law.inputs
    return law.form.name, inputs, options, frozenset(places)
