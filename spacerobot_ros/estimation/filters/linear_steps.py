r"""Steps of a linear system x = [positions; velocities], exact to fourth order in their length.

Fast wheels on light links turn the rates by a radian or more in one step: neither is A dt small,
nor does it commute with itself a step later. So the exponent z of a step is Magnus' series to
fourth order (Blanes et al., Physics Reports 470 (2009)), and exp(z) Pade's (2, 2) approximant
D^-1 N with D = 1 - z/2 + z^2/12, which is stable for stiff friction. What drives along the step
goes through the same D: an acceleration s^(j-1) / (j-1)!, 0 <= s <= 1, leaves dt phi_j(z) with

    phi_1 = D^-1,   phi_2 = D^-1 (1/2 - z/12),   phi_3 = D^-1 (1/6 - z/24).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ...types import Array


class Steps:
    """All steps of a record.

    Args:
        durations: (N-1,) [s].
        matrices: (N, 2 m, 2 m) A at the ends of the steps.
    """

    def __init__(self, durations: Array, matrices: Array) -> None:
        self.durations = durations
        dt = durations[:, None, None]
        early, late = dt * matrices[:-1], dt * matrices[1:]
        self._z = 0.5 * (early + late) + (late @ early - early @ late) / 12.0
        self._m = matrices.shape[1] // 2

    @cached_property
    def _inverse(self) -> Array:
        """D^-1."""
        z = self._z
        return np.asarray(np.linalg.inv(np.eye(z.shape[1]) - 0.5 * z + (z @ z) / 12.0))

    @property
    def transitions(self) -> Array:
        """(N-1, 2 m, 2 m) exp(z)."""
        return np.asarray(np.eye(self._z.shape[1]) + self._inverse @ self._z)

    def driven(self, a0: Array, a1: Array | None = None, a2: Array | None = None) -> Array:
        """(N-1, 2 m, K) change of the state by accelerations a0 + a1 s + a2 s^2 along each step.

        Args:
            a0: (N-1, m, K).
            a1: The same, or None.
            a2: The same, or None; only with a1.
        """
        if a1 is None:
            return np.asarray(self._inverse[:, :, self._m :] @ (self._dt * a0))
        bend = np.zeros_like(a1) if a2 is None else a2
        drive = self._z[:, :, self._m :] @ (a1 + bend) / -12.0
        drive[:, self._m :] += a0 + 0.5 * a1 + bend / 3.0
        return np.asarray(self._inverse @ (self._dt * drive))

    @property
    def _dt(self) -> Array:
        return self.durations[:, None, None]
