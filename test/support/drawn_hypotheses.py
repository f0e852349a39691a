"""Hypotheses and rows that are drawn from them, so that every prior is right."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from spacerobot_ros.inference.gram_blocks import GramBlocks
from spacerobot_ros.inference.hypotheses import Hypotheses
from spacerobot_ros.inference.hypothesis import Hypothesis, covariance_of


@dataclass(frozen=True)
class Drawn:
    """Rows (R, K), data (R,), the hypotheses, what is true, and in how many blocks."""

    columns: np.ndarray
    data: np.ndarray
    every: tuple[Hypothesis, ...]
    coefficients: np.ndarray
    causes: frozenset[int]
    blocks: int = 36
    recordings: int = 1

    @property
    def sums(self) -> GramBlocks:
        out = GramBlocks(self.columns.shape[1])
        for k, own in enumerate(np.array_split(np.arange(len(self.data)), self.blocks)):
            recording = k * self.recordings // self.blocks
            out.add(self.columns[own], self.data[own], recording)
        return out

    @property
    def hypotheses(self) -> Hypotheses:
        return Hypotheses(self.sums, self.every)


def drawn(
    seed: int | Sequence[int],
    *,
    count: int = 9,
    rows: int = 240,
    odds: float = 3.0,
    is_cause: float = 0.3,
    collinear: float = 0.7,
    bounded: float = 0.0,
    size: float = 1.0,
    **more: int,
) -> Drawn:
    """Groups of one to three columns, with priors of every form.

    Args:
        odds: Log odds of each beyond the usual.
        is_cause: Share that are causes.
        collinear: Standard deviation of the coefficients by which columns are mixed.
        bounded: Share that may not be negative.
        size: Of all slabs.
    """
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 4, count)
    places = np.split(np.arange(sizes.sum()), np.cumsum(sizes)[:-1])
    total = int(sizes.sum())
    columns = rng.standard_normal((rows, total))
    columns = columns @ (np.eye(total) + collinear * rng.standard_normal((total, total)))
    coefficients, every, causes = np.zeros(total), [], set()
    for i, at in enumerate(places):
        slab, spike = size * _prior(rng, len(at)), size * 0.03 * _prior(rng, len(at))
        if slab.ndim > 1:
            slab = size * slab
        if spike.ndim > 1:
            spike = size * 0.03 * spike
        if rng.random() < 0.4:
            spike = np.zeros(len(at))
        lower = np.zeros(len(at)) if rng.random() < bounded else None
        if rng.random() < is_cause:
            causes.add(i)
        value = rng.multivariate_normal(
            np.zeros(len(at)), covariance_of(slab if i in causes else spike)
        )
        coefficients[at] = np.abs(value) if i in causes and lower is not None else value
        every.append(
            Hypothesis(
                key=f'effect {i}',
                columns=at,
                slab=slab,
                spike=spike,
                lower=lower,
                log_odds=odds,
            )
        )
    data = columns @ coefficients + rng.standard_normal(rows)
    return Drawn(columns, data, tuple(every), coefficients, frozenset(causes), **more)


def _prior(rng: np.random.Generator, k: int) -> np.ndarray:
    """(k,) deviations or (k, k) a covariance, of the order of one."""
    if rng.random() < 0.5:
        return rng.uniform(0.3, 2.0, k)
    root = rng.standard_normal((k, k))
    return root @ root.T + 0.1 * np.eye(k)


def dense_log_density(problem: Drawn, hypotheses: Hypotheses, chosen, rows=slice(None)) -> float:
    """ln N(y; 0, 1 + X P X') of some rows, densely; P as unit information has it."""
    X, y = problem.columns[rows], problem.data[rows]
    covariance = np.eye(len(y))
    for i, (h, basis) in enumerate(zip(hypotheses.every, hypotheses.bases, strict=True)):
        spike = basis @ np.diag(hypotheses.spikes[h.columns]) @ basis.T
        own = basis @ basis.T if i in chosen else spike
        covariance += X[:, h.columns] @ own @ X[:, h.columns].T
    _, logarithm = np.linalg.slogdet(covariance)
    square = y @ np.linalg.solve(covariance, y)
    return float(-0.5 * (square + logarithm + len(y) * np.log(2.0 * np.pi)))
