r"""The parameters in force and how data move them.

Least squares weigh the filtered momentum balance by its noise. The gradient of the Lyapunov
function 1/2 sigma^T M sigma + 1/2 (pi - pi_true)^T Gamma^-1 (pi - pi_true) is Gamma Y_SL^T sigma
with Gamma = G / E: a parameter wrong by its prior standard deviation weighs as much as the energy
E = I (Lambda `adaptation_error`)^2 of the error dynamics, so that the gain fits robots of any
size. The composite law adds both, with the covariance as gain.
"""

from __future__ import annotations

import numpy as np

from ...dynamics.pseudo_inertia import parameters_of, pseudo_inertia
from ...dynamics.random_body import body_scales, deformation_widths
from ...dynamics.tree import inertial_rows
from ...model.robot import Robot
from ...types import Array
from .law_signals import AdaptiveSettings
from .learning_kernel import descend, least_squares_step, sampled_step
from .parameter_prior import prior_covariance
from .physical_consistency import is_physical, natural_step, project
from .regressors import parameter_values

_LEAST_SQUARES = ('adaptive_rls', 'adaptive_composite', 'adaptive_rls_paper')
_GRADIENT = ('adaptive_lyapunov', 'adaptive_composite', 'adaptive_lyapunov_paper')


class Learner:
    """Parameters, their covariance, and the update laws.

    Args:
        robot: The prior.
        settings: Law, consistency, gains and the wheels' prior.

    Attributes:
        pi: (p,) parameters in force.
        G: (p, p) covariance.
        slope: (p,) gradient Y^T sigma, written by the law.
        has_slope: Whether it is that of the last sample.
    """

    def __init__(self, robot: Robot, settings: AdaptiveSettings) -> None:
        self.settings = settings
        self.pi = parameter_values(robot)
        self.G = prior_covariance(robot, settings.prior_shape, settings.wheel_momentum_std)
        self.scales = body_scales(inertial_rows(robot))
        own = [deformation_widths(robot.uncertainty_of(k)) for k in range(len(robot.bodies))]
        self._variances = np.mean(np.square(own), axis=(1, 2))  # of each body's deformation
        self.uses_regression = settings.law in _LEAST_SQUARES
        self.uses_gradient = settings.law in _GRADIENT
        self.excitation = 0.0
        self._bodies = 10 * len(robot.bodies)
        size = len(self.pi)
        self.slope, self.has_slope = np.zeros(size), False
        self._gain, self._whitener = 0.0, np.zeros((0, 0))
        self._width = size if self.uses_regression else 10  # of the blocks along G's diagonal
        self._is_bounded = not settings.law.endswith('_paper')
        rows = 5 + len(robot.bodies)
        self._scratch = (np.zeros((rows, size)), np.zeros((rows, rows)), np.zeros(rows))
        self.physical_pi = self.pi.copy()
        project(self.physical_pi, self.G, self.scales, self._fallback())
        if settings.physical_consistency != 'none':
            self.pi[:] = self.physical_pi

    @property
    def is_physical(self) -> bool:
        """Whether all bodies in force are physical."""
        return bool(is_physical(self.pi, self.scales))

    def take(self, mean: Array, covariance: Array) -> None:
        """Start from another mean (p,) and covariance (p, p)."""
        self.pi[:], self.G[:] = mean, covariance
        self.has_slope, self._width = False, len(mean)
        if self.settings.physical_consistency != 'none':
            project(self.pi, self.G, self.scales, self.physical_pi)
        if self.is_physical:
            self.physical_pi[:] = self.pi

    def regress(self, F: Array, T: Array, variances: Array) -> None:
        """One step of least squares on T = F pi, rows weighed by their variances (N,)."""
        excitation = least_squares_step(F, T, variances, self.G, self.pi, self._scratch)
        self.excitation = float(excitation) ** 0.5
        self._constrain()

    def weigh(self, energy: float, K_D: Array) -> None:
        """Set the gradient's gain and what bounds it.

        Args:
            energy: What a prior standard deviation weighs [J].
            K_D: (6 + n, 6 + n) gain of the rates.
        """
        self._gain = 1.0 / energy
        self._whole = np.linalg.inv(np.linalg.cholesky(K_D))
        self.weaken(1.0)

    def weaken(self, share: float) -> None:
        """Have a share of K_D, as `weigh` had it, bound the gradient's steps."""
        self._whitener = self._whole / share**0.5

    def descend(self, h: float, Y: Array) -> None:
        """Move along the gradient of the last sample, over a time h [s].

        Args:
            h: Time since that sample [s].
            Y: (N, p) regressor of that sample.
        """
        if not self.has_slope:
            return
        self.has_slope = False
        step = h * self._gain
        if self._is_bounded:
            step = sampled_step(step, self._whitener, Y, self.G, self._width)
        if self.settings.physical_consistency == 'natural':
            natural_step(self.pi, self.slope, step * self._variances, self.scales)
            wheels = slice(self._bodies, None)
            self.pi[wheels] += step * (self.G[wheels] @ self.slope)
            return
        descend(step, self.G, self._width, self.slope, self.pi)
        self._constrain()

    def _constrain(self) -> None:
        if self.settings.physical_consistency == 'none':
            return
        project(self.pi, self.G, self.scales, self.physical_pi)
        self.physical_pi[:] = self.pi

    def _fallback(self) -> Array:
        """Physical parameters near the prior: each body's indefinite part taken out."""
        out = self.pi.copy()
        rows = out[: self._bodies].reshape(-1, 10)
        for row, scale in zip(rows, self.scales, strict=True):
            if scale[3] > 0.0:
                size = np.outer(scale, scale)
                values, vectors = np.linalg.eigh(pseudo_inertia(row) * size)
                P = (vectors * np.maximum(values, 1e-4)) @ vectors.T / size
                row[:] = parameters_of(P)
        return out
