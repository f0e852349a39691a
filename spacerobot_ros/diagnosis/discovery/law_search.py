"""Laws beside an arm's causes: the grammar proposes, and the search for causes decides.

Causes stay, but those that are a form of the grammar: a law may take their place. What is no law,
sines of the time and inertial errors, competes with laws as they do with each other.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from ...effects.laws.grammar import quantity
from ...estimation.balance.arm_candidates import ZEROS
from ...estimation.balance.arm_priors import COUPLED
from ...inference.decisive import CLUSTERS
from ...inference.hypotheses import Hypotheses
from ...inference.inferred import InferredCause, infer
from ...inference.model_search import ChosenSet, best_set
from ...inference.validation import HeldOut
from ...types import Array
from ..arms.arm_found import ArmFound
from ..arms.arm_hypotheses import arm_hypotheses
from ..arms.spectral_level import SpectralRows
from ..limits import WRONG_ANSWERS
from .arm_motions import ArmMotions
from .law_candidate import LawCandidate, candidate_of, left_of, sizes_of
from .possible_laws import REFINED, SHAPE, Law
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

    Attributes:
        replaced: Numbers of causes that have given way to laws.
        unrepeated: Laws that other parts of the data do not repeat, in words, by joint.
    """

    def __init__(self, found: ArmFound) -> None:
        self._found, self._rows, self.robot = found, found.fit.rows, found.robot
        self.motions = ArmMotions(self._rows, found.extended)
        driven = ~np.isin(self.robot.joints, self.robot.passive_joints)
        moves = [len(own.torque) > 0 for own in self._rows.joints[: len(driven)]]
        self.moving = np.flatnonzero(driven & moves).tolist()
        kinds = [c.kind.id for c in self._rows.candidates]
        self._causes = frozenset(found.fit.chosen)
        self._may_go = frozenset(i for i in self._causes if kinds[i] in REPLACEABLE)
        # an offset is free: a spring, whose rest angle it is, is no more of a law for it
        self._offsets = frozenset(i for i, kind in enumerate(kinds) if kind in ZEROS)
        self._first, self._laws = len(kinds), list[LawCandidate]()
        self._screens = dict[int, JointScreen]()
        self._asked = dict[int, tuple[list[int], list[Law]]]()
        self._chances, self._refused = dict[tuple[int, ...], float](), set[int]()
        self.replaced, self.unrepeated = frozenset[int](), dict[str, str]()

    @cached_property
    def _in_noise(self) -> dict[int, list[JointScreen]]:
        """Of each joint, in noise that grows with the rate more or less."""
        causes = self._causes
        return {j: [JointScreen(self.motions, j, causes, s) for s in _LOUD] for j in self.moving}

    def run(self) -> list[FoundLaw]:
        """What is chosen beside the causes."""
        chosen, before = self._causes | self._offsets, None
        while chosen != before and (more := self._proposed(chosen)):
            self._laws += more
            # beside all that may be, as what is chosen is no part of the noise that judges it
            first = self._first + len(self._laws) - len(more)
            hypotheses = self._hypotheses([*chosen, *range(first, first + len(more))])
            before, chosen = chosen, best_set(hypotheses, chosen).chosen
        if not self._laws:
            return []
        hypotheses = self._hypotheses(chosen)
        blocks = hypotheses.blocks.grams(np.zeros(0, dtype=int))
        if sum(gram.rows > 0 for gram in blocks) < CLUSTERS:
            return []  # too few to say how sure a law is
        inferred = infer(hypotheses.blocks, hypotheses.every, refused=self._by_chance)
        causes = {cast(int, c.key): c for c in inferred.causes}
        chosen = hypotheses.always.union(causes)
        self.replaced = self._may_go - chosen
        failing = (cast(int, key) for key in inferred.excluded - self._refused)
        laws = (self._laws[i - self._first] for i in failing if i >= self._first)
        self.unrepeated = {str(law.where): law.of.resembles for law in laws}
        return [
            FoundLaw(self._laws[i - self._first], c, self._chance(i, chosen), *shares)
            for i, c in causes.items()
            if i >= self._first and not self._is_shape(i)
            for shares in [self._shares(i, hypotheses, chosen)]
        ]

    def _hypotheses(self, chosen: Collection[int]) -> Hypotheses:
        """Laws, and causes whose place they may take, at the level that a set leaves.

        Other causes always are, of any size: bounds of what stays tell laws apart no better.
        """
        rows = self._rows.with_more(self._laws, self.motions.balances)
        levels = list(self._found.levels)
        for j, screen in self._screens.items():
            levels[j] = screen.variances
        stay = (self._causes | self._offsets) - self._may_go
        every = arm_hypotheses(rows)
        for i, h in enumerate(every[: self._first]):
            odds = math.inf if i in stay else -math.inf
            every[i] = replace(h, log_odds=odds, lower=None, upper=None, body=None)
            if i in self._may_go:
                every[i] = replace(h, slab=self._as_of_law(i))
        sizes = {j: screen.sizes for j, screen in self._screens.items()}
        loud, spectral = rows.over(sizes), SpectralRows(rows, every)
        spectral.add(loud, levels)
        return Hypotheses(spectral.blocks(loud, chosen), every)

    def _as_of_law(self, i: int) -> Array:
        """(k,) sizes of a cause as of a law: by its own it would be another hypothesis."""
        at, rows = self._rows.places[i], self._rows.joints
        each = [sizes_of(rows[j].torque, rows[j].columns[:, at]) for j in self.moving]
        return np.min(each, axis=0)  # of the joint that shows it most

    def _proposed(self, chosen: Collection[int]) -> list[LawCandidate]:
        """Laws that were not proposed before: beside all causes, and beside those that stay."""
        out = {_words(law): law for law in self._laws}
        for j in self.moving:
            causes, given = self._beside(j, chosen)
            if self._asked.get(j) == (causes, given):
                continue
            self._asked[j] = causes, given
            # a law leaves more where it is larger, as noise that grows with the rate does
            screen = max(self._in_noise[j], key=lambda s: s.likelihood(causes, given))
            self._screens[j] = screen
            stay = [i for i in causes if i not in self._may_go]
            may_go = [i for i in causes if i in self._may_go and self._rows.acts_on(i, j)]
            rest = [i for i in causes if i not in may_go]
            laws = screen.proposals(causes, given)
            laws += screen.proposals(rest, given) if may_go else []
            for law in laws:
                for react in self._reactions(law, j, may_go):
                    law_here = candidate_of(law, j, self.motions, stay, react)
                    out.setdefault(_words(law_here), law_here)
        return [*out.values()][len(self._laws) :]

    def _reactions(self, law: Law, j: int, may_go: Sequence[int]) -> list[str]:
        """Joints that may act alike; empty: none.

        What causes are by another name takes no place of them, but at one of their joints.
        """
        both = [quantity(law.inputs[1])[1]] if law.form.ratio else []
        left = left_of(self.motions.torques([law], j), self._rows, j, may_go, offset=1.0)
        if not may_go or np.any(left > _SAME):
            return ['', *both]
        others = (k for k in self.moving if k != j)
        return [''] if any(self._rows.acts_on(i, k) for k in others for i in may_go) else []

    def _beside(self, j: int, chosen: Collection[int]) -> tuple[list[int], list[Law]]:
        """Causes of a set, and its laws that act on joint j."""
        numbers = sorted(chosen)
        laws = (self._laws[i - self._first] for i in numbers if i >= self._first)
        here = [law.of for law in laws if j in self._places(law)]
        return [i for i in numbers if i in self._causes], here

    def _by_chance(self, hypotheses: Hypotheses, found: ChosenSet) -> list[int]:
        """The law of a set that chance explains most easily, if it does."""
        laws = [i for i in found.chosen if i >= self._first and not self._is_shape(i)]
        chances = {i: self._chance(i, found.chosen) for i in laws}
        worst = max(chances, key=chances.__getitem__, default=None)
        if worst is None or chances[worst] <= WRONG_ANSWERS / len(self.moving):
            return []
        self._refused.add(worst)
        return [worst]

    def _is_shape(self, i: int) -> bool:
        return self._laws[i - self._first].of.kind == SHAPE

    def _chance(self, i: int, chosen: frozenset[int]) -> float:
        law = self._laws[i - self._first]
        j, *_ = self._places(law)
        causes, given = self._beside(j, chosen - {i})
        key = i, *causes, *map(id, given)
        if key not in self._chances:
            self._chances[key] = self._screens[j].chance(law.of, causes, given)
        return self._chances[key]

    def _shares(
        self, i: int, hypotheses: Hypotheses, chosen: frozenset[int]
    ) -> tuple[float, float]:
        """Of the squares of its joints' rows what a law explains, and of parts it was not told."""
        sets = chosen, chosen - {i}
        count = sum(
            len(self._rows.joints[j].torque) for j in self._places(self._laws[i - self._first])
        )
        means = [hypotheses.mean(hypotheses.marginal(s), s) for s in sets]
        inside = [hypotheses.blocks.whole.misfit(mean) for mean in means]
        held_out = [float(np.sum(HeldOut(hypotheses, s).squares()[1])) for s in sets]
        gains = (without - with_it for with_it, without in (inside, held_out))
        share, held = (gain / (count + max(gain, 0.0)) for gain in gains)
        return share, held

    def given_way(self, laws: Iterable[LawCandidate]) -> frozenset[int]:
        """Numbers of causes in whose place some laws stand."""
        at = [j for law in laws for j in self._places(law)]
        return frozenset(i for i in self.replaced if any(self._rows.acts_on(i, j) for j in at))

    def _places(self, law: LawCandidate) -> list[int]:
        """Numbers of the joints that it acts on."""
        joints = (str(law.where), *law.effect.guard.react)
        return [self.robot.joints.index(joint) for joint in joints]

    def laws_of(self, keys: Iterable[Hashable]) -> tuple[Law, ...]:
        """Those of some hypotheses that are laws, or what is none."""
        numbers = (cast(int, key) - self._first for key in keys)
        return tuple(self._laws[n].of for n in numbers if n >= 0)


def _words(candidate: LawCandidate) -> tuple[object, ...]:
    """What a law says, with the options that are not refined."""
    law = candidate.of
    options = tuple((k, v) for k, v in sorted(law.options.items()) if k not in REFINED)
    react = candidate.effect.guard.react
    places = {str(candidate.where), *react}
    inputs = frozenset(law.inputs) if react else law.inputs
    return law.form.name, inputs, options, frozenset(places)
