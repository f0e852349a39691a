"""Whether a cause is one: it beats placebos, and its values stay the same along the record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...estimation.inference.evidence import Gram, chi_square_tail, score
from ...estimation.inference.placebo import held_out_gain
from ...estimation.refit import Fit
from ...estimation.rows import blocks
from ..limits import INCONSTANT


@dataclass(frozen=True, slots=True)
class Soundness:
    """What speaks for a cause of a fit beside all its others.

    Args:
        held_out_gain: Share of the held-out excess misfit that it removes, from 0 to 1.
        placebo_gain: Largest such share among placebos of the same size.
        constant_p: Probability that its parameters scatter so between the parts of the record.
    """

    held_out_gain: float
    placebo_gain: float
    constant_p: float

    @property
    def is_sound(self) -> bool:
        """Whether it beats placebos, and stays the same along the record."""
        return self.held_out_gain > self.placebo_gain and self.constant_p >= INCONSTANT


def soundness(fit: Fit, index: int) -> Soundness:
    """Of one cause; held-out gains are against the model with all other causes."""
    own = fit.own(index)
    without = fit.held_out(index)
    before, after = (float(np.sum(x**2)) for x in (without, fit.held_out()))
    excess = max(before - len(fit.data), 1.0)
    sizes = 1.0 / np.sqrt(np.maximum(fit.precision[own], 1e-12))
    times = fit.rows.row_times
    placebo = held_out_gain(fit.tangents[:, own], without, sizes, blocks(times), times)
    return Soundness((before - after) / excess, placebo / excess, _constant_p(fit, index))


def _constant_p(fit: Fit, index: int) -> float:
    own = fit.own(index)
    others = np.setdiff1d(np.arange(len(fit.free)), own)
    order = np.concatenate([others, own])
    unbounded = (np.full(len(own), -np.inf), np.full(len(own), np.inf))
    sizes = np.array([fit.free[k][1].size for k in own])
    sizes[~np.isfinite(sizes)] = 1.0
    total, dof = 0.0, 0.0
    for part in blocks(fit.rows.row_times):
        gram = Gram.of(fit.tangents[part][:, order], fit.data[part])
        alone = gram.without(len(others), fit.precision[others] + 1e-12)
        found = score(alone, sizes, unbounded, None)
        total, dof = total + found.gain, dof + found.dof
    return chi_square_tail(total, max(dof - len(own), 1.0))
