"""Whether a cause is one: it beats placebos, and its values stay the same along the record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...estimation.fit import Fit
from ...estimation.inference.evidence import LEAST_PRECISION, Gram, Score, chi_square_tail, score
from ...estimation.inference.placebo import held_out_gain
from ...estimation.rows import blocks
from ...estimation.scaling import size_of
from ...types import Array
from ..limits import EXACT, IMITATED, INCONSTANT, LITTLE

_DRIFTS = 2  # cosines of the record's length: what changes faster is left to the test of fit


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


def drift_p(fit: Fit) -> float:
    """Probability that the values of all causes together drift so along the record.

    Each cause's columns times cosines of the record's length, beside the columns as they are: what
    stands for an effect that is in no catalogue acts in other proportions at other times. A drift
    of less than `EXACT` of what the causes do together is none: no model of them is that right.
    """
    if not fit.free:
        return 1.0
    times = fit.rows.row_times
    phase = np.pi * (times - times[0]) / (times[-1] - times[0])
    columns = [fit.tangents * np.cos(k * phase)[:, None] for k in range(_DRIFTS + 1)]
    gram = Gram.of(np.concatenate(columns, axis=1), fit.data)
    alone = gram.without(len(fit.free), fit.precision + LEAST_PRECISION)
    found = _score(alone, np.tile(_sizes(fit), _DRIFTS))
    together = np.sum([fit.changed(i) for i in range(len(fit.causes))], axis=0)
    return found.p_value if found.gain > EXACT**2 * float(together @ together) else 1.0


def least_needed(fit: Fit) -> int | None:
    """The cause that adds so little to all others that it may be what a wrong name leaves.

    What stands for an effect that is in no catalogue takes nearly all of what that does, and a
    further cause the little that is left, which few rows can tell from its own: its extra sum of
    squares beside the others' columns is small, in itself and by the mean share of what all do.
    What is next to nothing beside the others is no such leftover: no two effects are that alike.
    """
    causes = range(len(fit.causes))
    if len(causes) < 2:
        return None
    extra = [_extra_squares(fit, i) for i in causes]
    together = np.sum([fit.changed(i) for i in causes], axis=0)
    whole = float(together @ together)
    least = int(np.argmin(extra))
    little = min(LITTLE * whole / len(extra), IMITATED)
    return least if EXACT**2 * whole <= extra[least] < little else None


def _extra_squares(fit: Fit, index: int) -> float:
    """What a cause changes beyond what the values of all others could."""
    others = np.setdiff1d(np.arange(len(fit.free)), fit.own(index))
    gram = Gram.of(fit.tangents[:, others], fit.changed(index))
    return gram.without(len(others), fit.precision[others] + LEAST_PRECISION).square


def _constant_p(fit: Fit, index: int) -> float:
    own = fit.own(index)
    others = np.setdiff1d(np.arange(len(fit.free)), own)
    order = np.concatenate([others, own])
    total, dof = 0.0, 0.0
    for part in blocks(fit.rows.row_times):
        gram = Gram.of(fit.tangents[part][:, order], fit.data[part])
        alone = gram.without(len(others), fit.precision[others] + LEAST_PRECISION)
        found = _score(alone, _sizes(fit)[own])
        total, dof = total + found.gain, dof + found.dof
    return chi_square_tail(total, max(dof - len(own), 1.0))


def _sizes(fit: Fit) -> Array:
    """(P,) plausible sizes of all numbers; one where the catalogue knows none."""
    return np.array([size_of(p) for _, p in fit.free])


def _score(gram: Gram, sizes: Array) -> Score:
    """Of columns that nothing bounds."""
    return score(gram, sizes, (np.full(len(sizes), -np.inf), np.full(len(sizes), np.inf)), None)
