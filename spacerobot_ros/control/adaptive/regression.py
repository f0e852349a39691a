"""Torques as a linear map of the parameters, T = F pi, from measured states."""

from __future__ import annotations

import numpy as np

from ...types import Array
from .law_kernel import rest_centre
from .learning_kernel import eliminate_translation, filter_step
from .regressor_kernel import fill_momentum, fill_slotine_li
from .regressors import Regressors


class FilteredMomentum:
    """Low-passed momentum balance: ten rows and more without any acceleration (learning_kernel).

    Args:
        regressors: Of the robot.
        rate: Corner of the low-pass [1/s].
    """

    def __init__(self, regressors: Regressors, rate: float) -> None:
        self._regressors, self._rate = regressors, rate
        shape = regressors.shape
        self.F, self.T = np.zeros(shape), np.zeros(shape[0])
        self._F1, self._T1 = np.zeros(shape), np.zeros(shape[0])
        self._Yp, self._Yc = np.zeros(shape), np.zeros(shape)
        self._reduced = np.zeros(shape), np.zeros(shape)
        self._before = np.zeros(shape), np.zeros(shape)
        self._is_fresh = True

    def restart(self) -> None:
        """Forget the samples so far."""
        for array in (self.F, self.T, self._F1, self._T1):
            array[:] = 0.0
        self._is_fresh = True

    def add(self, V: Array, u: Array, h: float, pi: Array, measured: bool) -> bool:
        """Take a sample; the regressors' placement is current.

        Args:
            V: (6 + n,) velocity at the sample.
            u: (6 + n,) torques applied since the sample before.
            h: Time since then [s].
            pi: (p,) parameters that a predicted base velocity was computed with.
            measured: Whether V's linear part is measured; if not, the translation is eliminated
                and the force rows are zero.

        Returns:
            Whether F and T hold a whole interval.
        """
        r = self._regressors
        tree, R, p = r.tree, r.rotations, r.positions
        fill_momentum(tree, R, p, V, r.motion, r.columns, self._Yp, self._Yc)
        Yp, Yc = self._Yp, self._Yc
        if not measured:
            Yp, Yc = self._reduced
            eliminate_translation(tree, R, p, V, pi, r.motion, self._Yp, self._Yc, Yp, Yc)
        if self._is_fresh:
            self._before[0][:], self._before[1][:] = Yp, Yc
            self._is_fresh = False
            return False
        stages = (self._F1, self._T1, self.F, self.T)
        filter_step(self._rate, h, u, Yp, Yc, *self._before, *stages)
        return True


class DifferencedRates:
    """The paper's rows: Y(q, V, V') pi = u with accelerations as differences of the rates.

    The force rows are left out, so the base's mass has no effect. Takes the same calls as
    `FilteredMomentum`; `pi` predicts the base's velocity in the middle of the interval.
    """

    def __init__(self, regressors: Regressors) -> None:
        self._regressors = regressors
        shape = regressors.shape
        self.F, self.T = np.zeros(shape), np.zeros(shape[0])
        self._before = np.zeros(shape[0])
        self._is_fresh = True

    def restart(self) -> None:
        """Forget the samples so far."""
        self._is_fresh = True

    def add(self, V: Array, u: Array, h: float, pi: Array, measured: bool) -> bool:
        """Take a sample, as `FilteredMomentum.add`."""
        r = self._regressors
        if self._is_fresh:
            self._before[:] = V
            self._is_fresh = False
            return False
        A = (V - self._before) / h
        middle = 0.5 * (V + self._before)
        if not measured:
            rest_centre(r.tree, r.rotations, r.positions, middle, pi, r.motion)
        args = (r.tree, r.rotations, r.positions, middle, middle, A, r.motion, r.columns)
        fill_slotine_li(*args, self.F)
        self.F[:3] = 0.0
        self.T[3:] = u[3:]
        self._before[:] = V
        return True
