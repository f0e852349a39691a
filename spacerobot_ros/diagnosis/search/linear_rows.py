"""Rows about a fit, linear in all that may be a cause: what it has, and what it has not."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from ...effects.bodies.bodies import NAMES as INERTIAL
from ...effects.bodies.bodies import InertialParameters
from ...effects.effect import Effect, Key
from ...effects.parameter import Parameter
from ...effects.prior import Scale
from ...estimation.balance.arm_priors import body_scale
from ...estimation.columns import Candidate, candidates
from ...estimation.fit import Fit
from ...estimation.inference.constrained import PhysicalBody
from ...estimation.inference.whiteness import spectral_lines
from ...estimation.possible import is_physical
from ...estimation.scaling import PROPORTIONAL, bounds_of, spread_of
from ...inference.gram_blocks import GramBlocks
from ...inference.hypotheses import Hypotheses
from ...inference.hypothesis import Hypothesis
from ...inference.inferred import InferredCause
from ...inference.model_search import ChosenSet
from ...types import Array, IntArray
from ..limits import SUSPICIOUS

_BATCH = 32  # candidates whose columns are made at once: as many as fit into a processor's cache
_HALVINGS = 12


class Variant(NamedTuple):
    """Name of a hypothesis: a variant of an effect at a place.

    Args:
        effect: Id.
        where: Place.
        number: Of the candidate; -1: as the fit has it.
    """

    effect: str
    where: str | None
    number: int

    @property
    def key(self) -> Key:
        """Effect and place."""
        return self.effect, self.where


def variant_of(named: Hypothesis | InferredCause) -> Variant:
    """The name of a hypothesis."""
    return cast(Variant, named.key)


@dataclass(frozen=True, slots=True, eq=False)
class CandidateColumns:
    """Candidates as columns about a model.

    Args:
        candidates: The candidates.
        places: CandidateColumns of each.
        rows: (R, K) columns, in single precision: no column is better than that.
        products: (K, K) of columns with columns.
    """

    candidates: tuple[Candidate, ...]
    places: tuple[IntArray, ...]
    rows: NDArray[np.float32]
    products: Array

    @classmethod
    def of(cls, fit: Fit, kinds: Iterable[type[Effect]]) -> CandidateColumns:
        """Of everything that may be a cause.

        Effects with states of their own (springs, sloshing) are dear, and leave slow errors or
        spectral lines that a test of whiteness sees: they are looked at where it sees any, and
        not where there is no such test, since what swings by itself then looks like anything.
        """
        p_value, channels = fit.rows.whiteness()
        asks = p_value is not None and p_value < SUSPICIOUS
        asked = [kind for kind in kinds if asks or not (kind.hidden or kind.is_rare)]
        return cls.along(fit, tuple(candidates(asked, fit.rows, spectral_lines(channels))))

    @classmethod
    def along(cls, fit: Fit, pool: tuple[Candidate, ...]) -> CandidateColumns:
        """Of some candidates."""
        ends = np.cumsum([len(c.steps) for c in pool])
        places = tuple(np.arange(e - len(c.steps), e) for c, e in zip(pool, ends, strict=True))
        count = sum(map(len, places))
        rows, products = np.empty((len(fit.data), count), np.float32), np.zeros((count, count))
        for k in range(0, len(pool), _BATCH):
            steps = [step for c in pool[k : k + _BATCH] for step in c.small_steps]
            at = np.concatenate(places[k : k + _BATCH])
            rows[:, at] = fit.signatures.whitened(steps)
        for part in _runs(rows):
            products += part.T @ part
        return cls(pool, places, rows, products)


@dataclass(frozen=True, eq=False)
class LinearRows:
    """A fit, and candidates beside its causes.

    Args:
        fit: The model; its own causes have their tangents.
        columns: Of the others, about this model or one whose rows differ little from it.
    """

    fit: Fit
    columns: CandidateColumns

    @cached_property
    def offsets(self) -> Array:
        """(P,) the fit's own values that count from no effect; of others the change counts."""
        counts = np.array([p.role in PROPORTIONAL for _, p in self.fit.free], dtype=bool)
        return np.where(counts, self.fit.offsets, 0.0)

    @property
    def data(self) -> Array:
        """(R,) whitened residuals of the model without causes, so far as it is linear."""
        return np.asarray(self.fit.data + self.fit.tangents @ self.offsets)

    @cached_property
    def _rows(self) -> NDArray[np.float32]:
        own = self.fit.tangents.astype(np.float32)
        return (
            np.concatenate([own, self.columns.rows], axis=1) if len(own.T) else self.columns.rows
        )

    @cached_property
    def _matrix(self) -> Array:
        """(P + K, P + K) products of all columns, the fit's own first."""
        own = len(self.fit.free)
        out = np.zeros((own + len(self.columns.products),) * 2)
        out[own:, own:] = self.columns.products
        for rows in _runs(self._rows) if own else ():
            out[:own] += rows[:, :own].T @ rows
        out[own:, :own] = out[:own, own:].T
        return out

    def blocks(self, data: Array) -> GramBlocks:
        """The rows with some data (R,)."""
        return GramBlocks.of_rows(self._rows, data, self._matrix)

    @cached_property
    def hypotheses(self) -> tuple[Hypothesis, ...]:
        """The fit's causes, then all candidates; of one that it has, none may come."""
        every = [self._held(i) for i in range(len(self.fit.causes))]
        kinds = [type(cause) for cause in self.fit.causes]
        held = {cause.key for cause in self.fit.causes}
        variants = Counter(c.key for c in self.columns.candidates)
        for k, c in enumerate(self.columns.candidates):
            log_odds = -math.log(max(1.0, c.trials / variants[c.key]))
            every.append(self._other(k, -math.inf if c.key in held else log_odds))
            kinds.append(c.kind)
        names = [variant_of(h) for h in every]
        excluded = (
            frozenset(n for n in names if n.where == name.where and n.effect in kind.excludes)
            for name, kind in zip(names, kinds, strict=True)
        )
        return tuple(replace(h, excludes=e) for h, e in zip(every, excluded, strict=True))

    def _held(self, i: int) -> Hypothesis:
        cause, own = self.fit.causes[i], self.fit.own(i)
        parameters = [self.fit.free[k][1] for k in own]
        bounds = [
            bounds_of(p) if p.role in PROPORTIONAL else (-math.inf, math.inf) for p in parameters
        ]
        lower, upper = np.array(bounds).T
        return Hypothesis(
            key=Variant(*cause.key, -1),
            columns=own,
            slab=self._slab(
                cause.id, cause.where, parameters, np.array([spread_of(p) for p in parameters])
            ),
            spike=np.zeros(len(own)),
            lower=np.minimum(lower, 0.0),
            upper=np.maximum(upper, 0.0),
            body=self._body(cause.id, cause.where, parameters),
            family=cause.key,
        )

    def _other(self, k: int, log_odds: float) -> Hypothesis:
        c = self.columns.candidates[k]
        return Hypothesis(
            key=Variant(*c.key, k),
            columns=len(self.fit.free) + self.columns.places[k],
            slab=self._slab(c.kind.id, c.where, c.parameters, c.sizes),
            spike=np.zeros(len(c.sizes)),
            log_odds=log_odds,
            lower=np.minimum(c.lower, 0.0),
            upper=np.maximum(c.upper, 0.0),
            body=self._body(c.kind.id, c.where, c.parameters),
            family=c.key,
        )

    def _body(
        self, effect: str, where: str | None, parameters: Sequence[Parameter]
    ) -> PhysicalBody | None:
        """What inertial parameters are added to: the file's body."""
        if effect != 'inertial_parameters':
            return None
        robot = self.fit.run.robot
        names = [body.name for body in robot.bodies]
        which = np.array([INERTIAL.index(p.name) for p in parameters])
        file = robot.inertial_parameters[names.index(str(where))]
        body = PhysicalBody(np.arange(len(which)), file, which)
        return body if body.is_body else None

    def _slab(
        self, effect: str, where: str | None, parameters: Sequence[Parameter], sizes: Array
    ) -> Array:
        """Plausible sizes; of inertial parameters those of a solid put there or lost."""
        if effect != 'inertial_parameters' or not self.fit.run.robot.joints:
            return sizes
        scale = Scale(sizes=sizes, interval=0.0, gravity=np.zeros(3))
        robot = self.fit.run.robot
        k = [body.name for body in robot.bodies].index(str(where))
        prior = InertialParameters.prior(replace(scale, body=body_scale(robot, k)))
        which = [INERTIAL.index(p.name) for p in parameters]
        return sizes if prior is None else prior.slab[np.ix_(which, which)]

    def alone(self) -> list[tuple[float, Effect]]:
        """Candidates that each by itself add to the fit: log evidence and values, most first."""
        every = self.hypotheses
        about = Hypotheses(self.blocks(self.fit.data), every)
        held, out = range(len(self.fit.causes)), list[tuple[float, Effect]]()
        start = ChosenSet.of(about, held)
        density = about.evidence(start.marginal, held)
        for i in range(len(held), len(every)):
            marginal = start.marginal.part(about.columns_of([*held, i]))
            marginal = marginal.changed(*about.exchange([i]))
            gain = about.evidence(marginal, [*held, i]) - density
            if gain > 0.0:
                with_it = ChosenSet.of(about, [*held, i])
                mean = about.mean(with_it.marginal, with_it.chosen)
                (guess,) = self.guesses([every[i]], mean)
                out.append((gain, guess))
        return sorted(out, key=lambda it: -it[0])

    def guesses(self, wanted: Iterable[Hypothesis], mean: Array) -> list[Effect]:
        """Causes with first values; the fit's own as they are.

        Args:
            wanted: Which.
            mean: (P + K,) coefficients of all hypotheses.
        """
        held = {cause.key: cause for cause in self.fit.causes}
        return [
            held.get(v.key) or self._guess(self.columns.candidates[v.number], mean[h.columns])
            for h, v in ((h, variant_of(h)) for h in wanted)
        ]

    def _guess(self, candidate: Candidate, coefficients: Array) -> Effect:
        """Estimated values, drawn towards no effect until a physical robot has them."""
        for k in range(_HALVINGS):
            applied = candidate.applied(candidate.values(0.5**k * coefficients))
            if is_physical([applied], self.fit.rows.robot):
                return applied
        return candidate.applied(candidate.directions[0])


_ROWS = 1000  # in double precision at once


def _runs(columns: NDArray[np.float32]) -> Iterator[Array]:
    for rows in np.array_split(columns, max(1, len(columns) // _ROWS)):
        yield rows.astype(float)
