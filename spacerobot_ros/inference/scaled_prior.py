r"""A Gaussian prior whose standard deviations share a factor that the data find.

What is stated of a prior's width is a guess, and a width that is too small makes an answer that is
sure and wrong. So all standard deviations w have one unknown factor s, and the answer is the
average over s by its evidence. With data |C y - c|^2, the singular values of C W = U S V^T (W the
diagonal of w) and b = U^T c,

    ln Z(s) = -1/2 sum_i b_i^2 / (1 + s^2 S_i^2) - 1/2 sum_i ln(1 + s^2 S_i^2)
    E[y | s] = W V a(s),  a_i = s^2 S_i b_i / (1 + s^2 S_i^2),  Cov[y | s] = W V diag(s^2 / (1 +
    s^2 S_i^2)) V^T W

so a grid over ln s costs one decomposition (MacKay, Neural Computation 4 (1992) 415). ln s is
normal about zero: what is stated counts where the data say little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..types import Array

LARGEST = 10.0
"""Range of the factor: a tenth to ten times what is stated."""
_SPREAD = 1.0
"""Standard deviation of ln s: stated widths are right to a factor of some three."""
_NODES = 121
"""Of ln s: 0.04 apart, where the evidence of a hundred well-told numbers is 0.07 wide."""


@dataclass(frozen=True, slots=True, eq=False)
class ScaledPosterior:
    """Posterior of unknowns y, averaged over the factor of their prior.

    Args:
        mean: (m,). covariance: (m, m).
        prior_variance: (m,) of the prior, by the same average.
        rank: Number of directions that the data tell better than the prior does.
        factor: Of the prior's standard deviations, geometric mean.
        above: Probability that the factor is above half of the largest.
    """

    mean: Array
    covariance: Array
    prior_variance: Array
    rank: int
    factor: float
    above: float


def scaled_posterior(
    root: Array,
    values: Array,
    std: Array,
    *,
    is_expected: bool = False,
) -> ScaledPosterior:
    """Combine data with a prior about zero.

    Args:
        root: (m, m) square-root information of y, any rank.
        values: (m,) its right-hand side.
        std: (m,) standard deviations of the prior at factor one, positive.
        is_expected: Whether the right-hand side is that of data without noise, for a covariance
            as data with noise have it in the mean: b_i^2 is then one larger.
    """
    left, singular, right = np.linalg.svd(root * std)
    told = left.T @ values
    if is_expected:
        told = np.copysign(np.hypot(told, 1.0), told)
    log_s = np.linspace(-np.log(LARGEST), np.log(LARGEST), _NODES)
    variance = np.exp(2.0 * log_s)[:, None]
    strength = 1.0 + variance * singular**2
    log_z = -0.5 * np.sum(told**2 / strength + np.log(strength), axis=1)
    log_z -= 0.5 * (log_s / _SPREAD) ** 2
    weight = np.exp(log_z - np.max(log_z))
    weight[[0, -1]] *= 0.5  # of the trapezoidal rule
    weight /= np.sum(weight)
    means = variance * singular * told / strength
    mean = weight @ means
    off = np.sqrt(weight)[:, None] * (means - mean)
    own = off.T @ off + np.diag(weight @ (variance / strength))
    basis = std[:, None] * right.T
    return ScaledPosterior(
        basis @ mean,
        basis @ own @ basis.T,
        float(weight @ variance[:, 0]) * std**2,
        int(np.sum(singular**2 * float(weight @ variance[:, 0]) > 1.0)),
        float(np.exp(weight @ log_s)),
        float(np.sum(weight[log_s > np.log(0.5 * LARGEST)])),
    )
