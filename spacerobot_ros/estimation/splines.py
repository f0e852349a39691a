"""Least-squares B-splines through noisy samples of a signal and, if measured, of its derivative.

They give the reference trajectory about which the momentum filter is linear. SciPy evaluates and
differentiates; what it lacks is a fit to values and derivatives at once, and the choice of the
knots' spacing from the noise level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.sparse.linalg import splu

from ..errors import IdentificationError
from ..types import Array

DEGREE = 5
_SEED = 5  # of the draw of the error; any seed serves
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
        curve: The spline; `curve(t)` gives (N, m).
        error: A draw of the spline's own error: the same fit to white noise of the samples' level.
        spacing: Distance of its knots [s].
        chi2_per_dof: Weighted residual a degree of freedom.
    """

    curve: BSpline
    error: BSpline
    spacing: float
    chi2_per_dof: float

    def __call__(self, time: Array, order: int = 0) -> Array:
        """(N, m) of the curve, or a derivative."""
        return np.asarray(self.curve(time, nu=order))

    def with_error(self) -> SplineFit:
        """With the draw of its error added."""
        curve, error = self.curve, self.error
        return replace(self, curve=BSpline(curve.t, curve.c + error.c, curve.k))


def fit_spline(samples: list[Samples], start: float, end: float) -> SplineFit:
    """Fit a quintic spline on [start, end], its knots as sparse as the noise allows.

    The spacing minimises Akaike's criterion, chi2 + 2 (number of coefficients): a finer spline
    must pay for its coefficients with a better fit.

    Args:
        samples: One or more sets of samples of the same m signals.
        start: Start of the interval [s].
        end: End of the interval [s].

    Raises:
        IdentificationError: no usable samples.
    """
    count = sum(len(s.time) for s in samples)
    intervals = [max(1, round((end - start) / spacing)) for spacing in _SPACINGS]
    affordable = [m for m in intervals if m + DEGREE <= count // 2] or intervals[:1]
    scored = []
    for m in affordable:
        curve, error, chi2, dof = _fit(samples, start, end, m)
        score = chi2 + 2.0 * (m + DEGREE) * samples[0].values.shape[1]
        scored.append((score, SplineFit(curve, error, (end - start) / m, chi2 / max(dof, 1))))
    return min(scored, key=lambda pair: pair[0])[1]


def _fit(
    samples: list[Samples], start: float, end: float, intervals: int
) -> tuple[BSpline, BSpline, float, int]:
    knots = np.concatenate(
        [np.full(DEGREE, start), np.linspace(start, end, intervals + 1), np.full(DEGREE, end)]
    )
    rows = [_design(knots, s) / s.std for s in samples]
    targets = [s.values / s.std for s in samples]
    design, target = sparse.vstack(rows).tocsc(), np.concatenate(targets)
    normal = (design.T @ design).tocsc()
    # A coefficient without data nearby is held near its neighbours by a ridge far below any
    # measurement's weight.
    ridge = 1e-12 * normal.diagonal().max()
    if not ridge > 0.0:
        raise IdentificationError(f'no usable samples between {start:.6g} s and {end:.6g} s')
    factor = splu(normal + ridge * sparse.identity(normal.shape[0], format='csc'))
    coefficients = factor.solve(design.T @ target)
    coefficients += factor.solve(design.T @ (target - design @ coefficients))
    chi2 = float(np.sum((target - design @ coefficients) ** 2))
    noise = np.random.default_rng(_SEED).normal(size=target.shape)
    error = BSpline(knots, factor.solve(design.T @ noise), DEGREE)
    return BSpline(knots, coefficients, DEGREE), error, chi2, target.size - coefficients.size


def _design(knots: Array, samples: Samples) -> sparse.csr_array:
    time = np.clip(samples.time, knots[0], knots[-1])
    if samples.derivative == 0:
        return BSpline.design_matrix(time, knots, DEGREE)
    count = len(knots) - DEGREE - 1
    steps = DEGREE / (knots[DEGREE + 1 : -1] - knots[1 : -DEGREE - 1])
    difference = sparse.diags_array([-steps, steps], offsets=[0, 1], shape=(count - 1, count))
    return BSpline.design_matrix(time, knots[1:-1], DEGREE - 1) @ difference
