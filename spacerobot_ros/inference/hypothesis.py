"""One thing that may be so: its columns, and what its coefficients are where it is, and anyway."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..types import Array, IntArray
from .decisive import MOST_RESOLVED
from .interior_point import MatrixInequality


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Hypothesis:
    """A group of k columns with two priors about zero; being a cause exchanges one for the other.

    Args:
        key: Its name, a different one each.
        columns: (k,) places of its columns.
        slab: Prior where it is a cause: (k,) standard deviations, or (k, k) a positive definite
            covariance.
        spike: Prior where it is none, its tolerance: the same; zeros where it is then not there.
        log_odds: Of its being a cause, beyond those of any hypothesis. inf: it always is one;
            -inf: it never is, and has its spike.
        lower: (k,) bounds of the coefficients of a cause, which zero is within. upper: (k,).
        body: What has to stay positive definite of its coefficients, in order.
        family: Its like: variants of one effect at one place, of which at most one is a cause.
            None: its key.
        needs: Keys one of which has to be a cause, too, such as the law that it refines.
        excludes: Keys none of which may be a cause beside it.
    """

    key: Hashable
    columns: IntArray
    slab: Array
    spike: Array
    log_odds: float = 0.0
    lower: Array | None = None
    upper: Array | None = None
    body: MatrixInequality | None = None
    family: Hashable = None
    needs: frozenset[Hashable] = field(default_factory=frozenset)
    excludes: frozenset[Hashable] = field(default_factory=frozenset)

    def __post_init__(self) -> None:
        """Refuse priors that are none.

        Raises:
            ValueError: shapes, a slab that is not positive definite, bounds without zero.
        """
        k = len(self.columns)
        for prior in (self.slab, self.spike):
            if prior.shape not in ((k,), (k, k)) or not np.all(np.isfinite(prior)):
                raise ValueError(f'{self.key}: a prior of shape {prior.shape} for {k} columns')
        if np.any(np.linalg.eigvalsh(covariance_of(self.slab)) <= 0.0):
            raise ValueError(f'{self.key}: its slab is not positive definite')
        if np.any(self.least > 0.0) or np.any(self.most < 0.0):
            raise ValueError(f'{self.key}: zero is not within its bounds')

    @property
    def least(self) -> Array:
        """(k,) lower bounds."""
        return np.full(len(self.columns), -np.inf) if self.lower is None else self.lower

    @property
    def most(self) -> Array:
        """(k,) upper bounds."""
        return np.full(len(self.columns), np.inf) if self.upper is None else self.upper

    @property
    def is_constrained(self) -> bool:
        """Whether anything keeps its coefficients from being any."""
        bounds = np.concatenate([self.least, self.most])
        return self.body is not None or bool(np.any(np.isfinite(bounds)))

    @property
    def deviations(self) -> Array:
        """(k,) standard deviations of its slab."""
        return np.asarray(np.sqrt(np.diag(covariance_of(self.slab))))


def covariance_of(prior: Array) -> Array:
    """(k, k) of standard deviations (k,) or a covariance."""
    return prior if prior.ndim > 1 else np.diag(prior**2)


class Standardized(NamedTuple):
    """Coordinates in which both priors of a hypothesis are independent, see `standardized`.

    Args:
        basis: (k, k) B. spikes: (k,) tau^2.
        odds: Log odds that make up for slabs that are wider than the data resolve.
    """

    basis: Array
    spikes: Array
    odds: float


def standardized(slab: Array, spike: Array, information: Array, rows: int) -> Standardized:
    r"""Coordinates z of coefficients x = B z in which both priors are independent.

        x ~ N(0, slab) is z ~ N(0, 1),    x ~ N(0, spike) is z ~ N(0, diag(tau2))

    What is plausible on a large machine may be a million times what the data of a small one
    resolve, which is no evidence against a small cause: a direction whose N rows are sharper than
    its slab costs ln(N) / 2 as if the slab were worth one datum (unit information: Kass and
    Wasserman, J. Am. Stat. Assoc. 90 (1995)), while values are judged by the slab itself. Not
    where a spike is wider than that: what is tolerated is plausible.

    Args:
        slab: (k, k) covariance.
        spike: (k, k) covariance.
        information: (k, k) of the coefficients, all else known.
        rows: N.
    """
    root = np.linalg.cholesky(slab)
    values, vectors = np.linalg.eigh(root.T @ information @ root)
    root = root @ vectors
    unit = rows / np.maximum(values, rows)
    unit[np.diag(_within(root, spike)) >= unit] = 1.0
    width = np.minimum(MOST_RESOLVED * unit, 1.0)
    root = root * np.sqrt(width)
    variances, vectors = np.linalg.eigh(_within(root, spike))
    spikes = np.where(variances > _ROUNDING, variances, 0.0)
    return Standardized(root @ vectors, spikes, 0.5 * float(np.sum(np.log(width / unit))))


_ROUNDING = 1e-14  # of a slab's variance


def _within(root: Array, covariance: Array) -> Array:
    """(k, k) covariance of z where x = root z has this one."""
    half = np.linalg.solve(root, covariance)
    out = np.linalg.solve(root, half.T)
    return np.asarray(0.5 * (out + out.T))
