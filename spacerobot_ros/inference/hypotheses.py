"""All hypotheses about some rows: their marginal sums under any set of causes, and its objective.

    J(S) = ln Z(S) + sum over S of log odds

with Z the marginal likelihood of the rows, truncated by bounds as Laplace's approximation has it:
by the loss of the nearest point that is allowed.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Collection, Hashable, Iterable, Sequence, Set
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..types import Array, IntArray
from .bounded import nearest
from .decisive import FAMILYWISE
from .gram import Gram
from .gram_blocks import GramBlocks
from .hypothesis import Hypothesis, covariance_of, standardized
from .interior_point import ConstrainedProblem, MatrixInequality
from .marginal import Marginal, SingleBounds


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """A matrix inequality among more unknowns."""

    columns: IntArray
    offset: Array
    basis: Array


class FittedBlocks(NamedTuple):
    """Blocks of rows with the coefficients that a set of causes gives to all columns in use.

    Args:
        columns: (n,) these. mean: (n,) standardized coefficients. covariance: (n, n).
        grams: Sums over every block that has rows.
    """

    columns: IntArray
    mean: Array
    covariance: Array
    grams: list[Gram]


class Hypotheses:
    """Hypotheses, each column of the rows belonging to one.

    Args:
        blocks: The rows.
        every: The hypotheses; sets of causes are sets of their numbers.

    Attributes:
        bases: (k, k) of each, see `standardized`.
        spikes: (K,) prior variance of every standardized coefficient where it is no cause's; a
            cause's is one.
        usual: Prior log odds of any hypothesis, which its own are beyond.
        log_odds: (H,) prior log odds of each, with those of `Standardized`.
        families: Of each, all variants of what it is one of.
    """

    def __init__(self, blocks: GramBlocks, every: Sequence[Hypothesis]) -> None:
        self.blocks, self.every = blocks, tuple(every)
        owned = np.concatenate([np.zeros(0, dtype=int), *(h.columns for h in every)])
        if not np.array_equal(np.sort(owned), np.arange(blocks.count)):
            raise ValueError('each column has to belong to one hypothesis')
        if len({h.key for h in every}) < len(every):
            raise ValueError('two hypotheses have one key')
        whole, self.bases, self.spikes = blocks.whole, list[Array](), np.zeros(blocks.count)
        resolved = list[float]()
        for h in self.every:
            priors = covariance_of(h.slab), covariance_of(h.spike)
            information = whole.matrix[np.ix_(h.columns, h.columns)]
            own = standardized(*priors, information, whole.rows)
            self.spikes[h.columns] = own.spikes
            self.bases.append(own.basis)
            resolved.append(own.odds)
        seen = np.diag(whole.matrix) > 0.0
        self._is_seen = [bool(seen[h.columns].any()) for h in self.every]
        asked = [
            i for i, h in enumerate(self.every) if np.isfinite(h.log_odds) and self.is_seen(i)
        ]
        self.usual = -math.log(max(len(asked), 1)) - FAMILYWISE
        odds = zip(self.every, resolved, strict=True)
        self.log_odds = np.array([self.usual + h.log_odds + more for h, more in odds])
        self.always = frozenset(i for i, h in enumerate(self.every) if h.log_odds == math.inf)
        numbers = {h.key: i for i, h in enumerate(self.every)}
        members = defaultdict[Hashable, set[int]](set)
        likes = [(i,) if h.family is None else h.family for i, h in enumerate(self.every)]
        for i, like in enumerate(likes):
            members[like].add(i)
        self.families = [members[like] for like in likes]
        self._conflicts = [set(own) for own in self.families]
        for i, h in enumerate(self.every):
            for k in (numbers[key] for key in h.excludes if key in numbers):
                self._conflicts[i].add(k)
                self._conflicts[k].add(i)
        self._needs = [
            {numbers[k] for k in h.needs if k in numbers} if h.needs else None for h in self.every
        ]
        self.open = frozenset(asked)
        self._is_constrained = [h.is_constrained for h in self.every]

    def is_seen(self, i: int) -> bool:
        """Whether the rows say anything of a hypothesis."""
        return self._is_seen[i]

    def with_data(self, blocks: GramBlocks) -> Hypotheses:
        """The same about other data; blocks of the same columns."""
        out = copy(self)
        out.blocks = blocks
        out.__dict__.pop('whole', None)
        return out

    @cached_property
    def whole(self) -> Gram:
        """Sums over all rows, of standardized coefficients."""
        return self._standardized(self.blocks.whole, range(len(self.every)))

    def _standardized(self, gram: Gram, which: Iterable[int]) -> Gram:
        """Sums for the columns of some hypotheses, ascending, of standardized coefficients."""
        which = list(which)
        columns = self.columns_of(which)
        scale = np.ones(len(columns))
        wide = [i for i in which if len(self.bases[i]) > 1]
        for i in which:
            if len(self.bases[i]) == 1:
                scale[np.searchsorted(columns, self.every[i].columns)] = self.bases[i][0, 0]
        matrix, vector = scale[:, None] * gram.matrix * scale, scale * gram.vector
        for i in wide:
            at, basis = np.searchsorted(columns, self.every[i].columns), self.bases[i]
            matrix[:, at] = matrix[:, at] @ basis
            matrix[at] = basis.T @ matrix[at]
            vector[at] = basis.T @ vector[at]
        return Gram(matrix, vector, gram.square, gram.rows)

    def grams(self, which: Sequence[int]) -> list[Gram]:
        """Sums over each block for the columns of some hypotheses, standardized."""
        columns = self.columns_of(which)
        return [self._standardized(gram, which) for gram in self.blocks.grams(columns)]

    def columns_of(self, which: Iterable[int]) -> IntArray:
        """Columns of some hypotheses, ascending."""
        own = [self.every[i].columns for i in which]
        return np.sort(np.concatenate([np.zeros(0, dtype=int), *own]))

    def variances(self, chosen: Iterable[int]) -> Array:
        """(K,) prior variances of all standardized coefficients under a set of causes."""
        out = self.spikes.copy()
        out[self.columns_of(chosen)] = 1.0
        return out

    def active(self, chosen: Collection[int]) -> list[int]:
        """Hypotheses whose coefficients are not zero under a set of causes."""
        every = enumerate(self.every)
        return [i for i, h in every if i in chosen or np.any(self.spikes[h.columns] > 0.0)]

    def marginal(self, chosen: Collection[int]) -> Marginal:
        """Of all rows and columns."""
        columns = np.arange(self.blocks.count)
        out = Marginal.of(self.whole, columns, self.variances(chosen))
        return Marginal(columns, out.matrix, out.vector, out.log_density - self.blocks.log_scale)

    def fitted(self, marginal: Marginal, chosen: Collection[int]) -> FittedBlocks:
        """Every block under a set of causes, by its marginal sums for all columns."""
        active = self.active(chosen)
        columns, variances = self.columns_of(active), self.variances(chosen)
        mean, covariance = (
            of(columns, variances[columns]) for of in (marginal.mean, marginal.covariance)
        )
        grams = [gram for gram in self.grams(active) if gram.rows]
        return FittedBlocks(columns, mean, covariance, grams)

    @cached_property
    def single_bounds(self) -> SingleBounds:
        """Bounds of causes that are one coefficient, standardized."""
        lower, upper = np.full(self.blocks.count, -np.inf), np.full(self.blocks.count, np.inf)
        for h, basis in zip(self.every, self.bases, strict=True):
            if len(basis) == 1:
                lower[h.columns], upper[h.columns] = h.least / basis[0], h.most / basis[0]
        return SingleBounds(lower, upper)

    def exchange(self, came: Iterable[int], gone: Iterable[int] = ()) -> tuple[IntArray, Array]:
        """Columns whose priors change as causes come and go, and by how much; not ascending."""
        came, gone = list(came), list(gone)
        columns = np.concatenate([self.every[i].columns for i in (*came, *gone)])
        change = 1.0 - self.spikes[columns]
        change[sum(len(self.every[i].columns) for i in came) :] *= -1.0
        return columns, change

    def objective(
        self, marginal: Marginal, chosen: Collection[int], least: float = -math.inf
    ) -> float:
        """J of a set of causes.

        Args:
            marginal: Sums under it for at least the columns of its constrained causes.
            chosen: The set.
            least: J below which only that it is less matters.
        """
        odds = self.prior(chosen)
        return self.evidence(marginal, chosen, least - odds) + odds

    def prior(self, chosen: Iterable[int]) -> float:
        """Log odds of a set of causes against none."""
        return float(sum(self.log_odds[i] for i in chosen if i not in self.always))

    def evidence(
        self, marginal: Marginal, chosen: Iterable[int], least: float = -math.inf
    ) -> float:
        """Log evidence ln Z of a set of causes; see `objective`."""
        held = self.constrained(chosen)
        if not held:
            return marginal.log_density
        ones, density = np.ones(self.blocks.count), marginal.log_density
        mean, covariance, constraints = self._placed(marginal, held, ones, held)
        return density - nearest(mean, covariance, *constraints, enough=density - least)[1]

    def constrained(self, which: Iterable[int]) -> list[int]:
        """Those of some hypotheses whose coefficients can not be any."""
        return [i for i in which if self._is_constrained[i]]

    def mean(self, marginal: Marginal, chosen: Collection[int]) -> Array:
        """(K,) most probable coefficients, as they are given: causes within bounds, bodies bodies.

        What is only tolerated has no bounds, but has to stay a body.
        """
        active = self.active(chosen)
        tolerated = [i for i in active if i not in chosen and self._is_whole_body(i)]
        held = [*self.constrained(chosen), *tolerated]
        variances, at = self.variances(chosen), self.columns_of(held)
        z = variances * marginal.vector
        if held:
            own, covariance, constraints = self._placed(marginal, held, variances, chosen)
            x, loss = nearest(own, covariance, *constraints)
            if loss > 0.0:
                if constraints[1]:  # cuts leave a body's edge a little
                    x = _inside(own, covariance, *constraints)
                across = variances[:, None] * marginal.matrix[:, at] * variances[at]
                across[at] -= np.diag(variances[at])
                basis = self.basis(held)
                z -= across @ basis.T @ np.linalg.solve(covariance, x - own)
                z[at] = np.linalg.solve(basis, x)
        out = np.zeros(len(z))
        for h, basis in zip(self.every, self.bases, strict=True):
            out[h.columns] = basis @ z[h.columns]
        return out

    def _is_whole_body(self, i: int) -> bool:
        h = self.every[i]
        return h.body is not None and bool(np.all(self.spikes[h.columns] > 0.0))

    def _placed(
        self,
        marginal: Marginal,
        held: Sequence[int],
        variances: Array,
        bounded: Collection[int],
    ) -> tuple[Array, Array, tuple[tuple[Array, Array], list[MatrixInequality]]]:
        """Coefficients of constrained hypotheses, as they are given, and what constrains them.

        Args:
            marginal: At least for their columns.
            held: The hypotheses.
            variances: (K,) prior variances of all.
            bounded: Those that bounds hold for.

        Returns:
            Mean and covariance without, and bounds and inequalities.
        """
        columns, basis = self.columns_of(held), self.basis(held)
        lower, upper = np.full(len(columns), -np.inf), np.full(len(columns), np.inf)
        bodies: list[MatrixInequality] = []
        for i in held:
            h, at = self.every[i], np.searchsorted(columns, self.every[i].columns)
            if i in bounded:
                lower[at], upper[at] = h.least, h.most
            if h.body is not None:
                bodies.append(_Placed(at[h.body.columns], h.body.offset, h.body.basis))
        mean = basis @ marginal.mean(columns, variances[columns])
        covariance = _positive(basis @ marginal.covariance(columns, variances[columns]) @ basis.T)
        return mean, covariance, ((lower, upper), bodies)

    def basis(self, which: Iterable[int]) -> Array:
        """(k, k) coefficients of hypotheses as they are given, by standardized ones."""
        which = list(which)
        columns = self.columns_of(which)
        out = np.zeros((len(columns), len(columns)))
        for i in which:
            at = np.searchsorted(columns, self.every[i].columns)
            out[np.ix_(at, at)] = self.bases[i]
        return out

    def dependents(self, chosen: Set[int], gone: Iterable[int]) -> frozenset[int]:
        """What goes from a set of causes with some: these, and what needs them."""
        out = frozenset(gone)
        while True:
            rest = chosen - out
            needing = ((i, self._needs[i]) for i in rest)
            more = {i for i, needs in needing if needs is not None and rest.isdisjoint(needs)}
            if not more:
                return out
            out |= more

    def may_join(self, i: int, chosen: Set[int]) -> bool:
        """Whether a hypothesis may be a cause beside a set of causes."""
        needs = self._needs[i]
        return chosen.isdisjoint(self._conflicts[i]) and (
            needs is None or not chosen.isdisjoint(needs)
        )


def _positive(covariance: Array) -> Array:
    """(k, k) the same, directions that rounding left none as uncertain as it can tell."""
    try:
        np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        sizes = np.sqrt(np.maximum(np.diag(covariance), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(covariance / np.outer(sizes, sizes))
        root = sizes[:, None] * vectors * np.sqrt(np.maximum(values, _TOLD * values[-1]))
        return np.asarray(root @ root.T)
    return covariance


_TOLD = 1e-7  # of the largest eigenvalue: rounding of `MOST_RESOLVED` times a slab


def _inside(
    mean: Array,
    covariance: Array,
    bounds: tuple[Array, Array],
    inequalities: Sequence[MatrixInequality],
) -> Array:
    """(k,) the nearest point where all matrices are positive definite."""
    information = np.linalg.inv(covariance)
    information = 0.5 * (information + information.T)
    sizes = np.sqrt(np.diag(covariance))
    return ConstrainedProblem(
        information, information @ mean, sizes, *bounds, inequalities
    ).solve()
