"""Least-squares B-splines through noisy samples of a signal and, if measured, of its derivative.

They give the reference trajectory about which the momentum filter is linear. SciPy evaluates and
differentiates; what it lacks is a fit to values and derivatives at once, and the choice of the
knots' spacing from the noise level.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ...errors import IdentificationError
from ...types import Array
from .spline_kernel import Coefficients, fitted, rows_of

DEGREE = 5
_ASIDE = 0.25
"""Share of a pause of samples by which knots keep clear of it: of 0, 0.25, 0.5 and 1 the smallest
whose error stays below 300 times the noise wherever the pause lies (0.5 s, knots of 0.05 s)"""
_SPACINGS = (2.0, 1.4, 1.0, 0.7, 0.5, 0.35, 0.25, 0.18, 0.12, 0.08, 0.05)


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples of m signals, or of their derivatives.

    Args:
        time: (N,) increasing [s].
        values: (N, m).
        std: Standard deviation of one sample.
        derivative: 0 for values, 1 for first derivatives.
    """

    time: Array
    values: Array
    std: float
    derivative: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class SplineFit:
    """A fitted spline of m signals.

    Args:
        curve: The spline of the times between its ends; `curve(t)` gives (N, m).
        spacing: Distance of its knots [s].
        chi2_per_dof: Weighted residual a degree of freedom.
    """

    curve: scipy.interpolate.BSpline
    spacing: float
    chi2_per_dof: float

    def __call__(self, time: Array, order: int = 0) -> Array:
        """(N, m) of the curve, or a derivative; beyond its ends it stays as it is there."""
        knots = self.curve.t
        inside = np.clip(time, knots[0], knots[-1])
        out = np.asarray(self.curve(inside, nu=order))
        if order > 0:
            out[inside != time] = 0.0
        return out


def fit_spline(samples: list[Samples], start: float, end: float) -> SplineFit:
    """Fit a quintic spline on [start, end], its knots as sparse as the noise allows.

    The spacing minimizes Akaike's criterion, chi2 + 2 (number of coefficients): a finer spline
    must pay for its coefficients with a better fit. Where samples pause there are no knots: what
    is free there would be as large as noise makes it. So it is before the first sample and behind
    the last, where the curve goes on for one usual interval only.

    Args:
        samples: One or more sets of samples of the same m signals.
        start: Start of the interval [s].
        end: End of the interval [s].

    Raises:
        IdentificationError: no usable samples.
    """
    start, end = _sampled(samples, start, end)
    rows = _Rows(samples, start, end)
    count = len(rows.time)
    intervals = [max(1, round((end - start) / spacing)) for spacing in _SPACINGS]
    affordable = [m for m in intervals if m + DEGREE <= count // 2] or intervals[:1]
    return rows.fit(min(affordable, key=rows.criterion))


def _sampled(samples: list[Samples], start: float, end: float) -> tuple[float, float]:
    """The part of an interval that has samples, and a usual interval between them on each side."""
    times = [s.time for s in samples if len(s.time) > 1]
    if not times:
        return start, end
    usual = max(float(np.median(np.diff(time))) for time in times)
    first, last = min(time[0] for time in times), max(time[-1] for time in times)
    return max(start, float(first) - usual), min(end, float(last) + usual)


class _Rows:
    """What the splines of all spacings are fitted to.

    Args:
        samples: Sets of samples of the same m signals.
        start: Start of the interval [s].
        end: End of the interval [s].
    """

    def __init__(self, samples: list[Samples], start: float, end: float) -> None:
        def each(values: Callable[[Samples], float]) -> Array:
            return np.concatenate([np.full(len(s.time), values(s)) for s in samples])

        self._ends = start, end
        self.time = np.clip(np.concatenate([s.time for s in samples]), start, end)
        in_order = np.sort(self.time)
        self._pauses = np.column_stack([in_order[:-1], in_order[1:]])
        self._is_derivative = each(lambda s: s.derivative) > 0
        self._weight = 1.0 / each(lambda s: s.std)
        self._values = np.concatenate([s.values for s in samples]) * self._weight[:, None]

    def criterion(self, intervals: int) -> float:
        """Akaike's of the spline of some intervals."""
        _, found = self._found(intervals)
        return found.chi2 + 2.0 * found.values.size

    def fit(self, intervals: int) -> SplineFit:
        """The spline of some intervals."""
        start, end = self._ends
        knots, found = self._found(intervals)
        dof = max(self._values.size - found.values.size, 1)
        curve = scipy.interpolate.BSpline(knots, found.values, DEGREE)
        return SplineFit(curve, (end - start) / intervals, found.chi2 / dof)

    def _found(self, intervals: int) -> tuple[Array, Coefficients]:
        """Knots of some intervals, and what the rows say of their spline."""
        start, end = self._ends
        inner = self._clear_of_pauses(np.linspace(start, end, intervals + 1))
        knots = np.concatenate([np.full(DEGREE, start), inner, np.full(DEGREE, end)])
        first, rows = rows_of(self.time, self._is_derivative, knots, DEGREE)
        rows *= self._weight[:, None]
        found = fitted(first, rows, self._values, len(inner) + DEGREE - 1)
        if not np.isfinite(found.values).all():
            raise IdentificationError(f'no usable samples between {start:.6g} s and {end:.6g} s')
        return knots, found

    def _clear_of_pauses(self, knots: Array) -> Array:
        """Those of evenly spaced knots that lie within samples, and the ends."""
        length = np.diff(self._pauses, axis=1)
        is_long = length[:, 0] > 2.0 * (knots[1] - knots[0])
        if not is_long.any():
            return knots
        wide = (self._pauses + _ASIDE * length * np.array([-1.0, 1.0]))[is_long]
        is_kept = np.all((knots[:, None] <= wide[:, 0]) | (knots[:, None] >= wide[:, 1]), axis=1)
        is_kept[[0, -1]] = True
        return knots[is_kept]
