"""Torques as a linear map of the parameters, T = F pi, from measured states."""

from __future__ import annotations

import numpy as np

from ...dynamics.body_regressors import (
    fill_momentum,
    fill_resting_momentum,
    fill_slotine_li,
    momentum_map,
    rest_centre,
)
from ...types import Array
from .learning_kernel import filter_step
from .regressors import Regressors


class FilteredMomentum:
    """Low-passed momentum balance: ten rows and more without any acceleration (learning_kernel).

    Args:
        regressors: Of the robot.
        rate: Corner of the low-pass [1/s].
    """

    def __init__(self, regressors: Regressors, rate: float) -> None:
        self._machine, self._rate = regressors.machine, rate
        shape = regressors.shape
        self.F, self.T = np.zeros(shape), np.zeros(shape[0])
        self._stages = np.zeros(shape), np.zeros(shape[0]), self.F, self.T
        self._now, self._before = [(np.zeros(shape), np.zeros(shape)) for _ in range(2)]
        self._P = np.zeros((3, shape[0]))
        self._is_fresh = True

    def restart(self) -> None:
        """Forget the samples so far."""
        for array in self._stages:
            array[:] = 0.0
        self._is_fresh = True

    def add(self, q: Array, V: Array, u: Array, h: float, pi: Array, measured: bool) -> bool:
        """Take a sample.

        Args:
            q: (n,) joint positions.
            V: (6 + n,) velocity at the sample; its linear part is written unless it is measured.
            u: (6 + n,) torques applied since the sample before.
            h: Time since then [s].
            pi: (p,) parameters that a predicted base velocity was computed with.
            measured: Whether V's linear part is; if not, the translation is eliminated and the
                force rows are zero.

        Returns:
            Whether F and T hold a whole interval.
        """
        if measured:
            fill_momentum(self._machine, q, V, *self._now)
        else:
            fill_resting_momentum(self._machine, q, V, pi, self._P, self._now)
        if self._is_fresh:
            for kept, now in zip(self._before, self._now, strict=True):
                kept[:] = now
            self._is_fresh = False
            return False
        filter_step(self._rate, h, u, self._now, self._before, self._stages)
        return True


class DifferencedRates:
    """The paper's rows: Y(q, V, V') pi = u with accelerations as differences of the rates.

    The force rows are left out, so the base's mass has no effect. Takes the same calls as
    `FilteredMomentum`; `pi` predicts the base's velocity in the middle of the interval.
    """

    def __init__(self, regressors: Regressors) -> None:
        self._machine, shape = regressors.machine, regressors.shape
        self._P = np.zeros((3, shape[0]))
        self.F, self.T = np.zeros(shape), np.zeros(shape[0])
        self._before = np.zeros(shape[0])
        self._is_fresh = True

    def restart(self) -> None:
        """Forget the samples so far."""
        self._is_fresh = True

    def add(self, q: Array, V: Array, u: Array, h: float, pi: Array, measured: bool) -> bool:
        """Take a sample, as `FilteredMomentum.add`."""
        momentum_map(self._machine, q, V, pi, self._P)
        if not measured:
            rest_centre(self._P, V)
        if self._is_fresh:
            self._before[:] = V
            self._is_fresh = False
            return False
        A = (V - self._before) / h
        middle = 0.5 * (V + self._before)
        if not measured:
            rest_centre(self._P, middle)
        fill_slotine_li(self._machine, q, middle, middle, A, self.F)
        self.F[:3] = 0.0
        self.T[3:] = u[3:]
        self._before[:] = V
        return True
