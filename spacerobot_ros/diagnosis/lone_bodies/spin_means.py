r"""Mean rates of a gyro, window by window, beside the spin that a magnetometer sees.

With the gyro's mean g and the spin w n (`estimation.spin`), every fault of the gyro is a column:

    g - w n = b + s w n + r x w n + ...
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.catalogue import CATALOGUE
from ...effects.motion import Motion
from ...estimation.spin import SpinWindow
from ...model.robot import Robot
from ...types import Array, IntArray

KINDS = ('gyro_bias', 'gyro_scale', 'gyro_misalignment')
"""Ids of the faults of a gyro."""
_OBSERVABLE = 0.5  # of a plausible size that a number's deviation may be, to be fitted at all
_WIDE = 20.0  # plausible sizes that a chip's faults may reach: those listed are of space practice
_SAME_AXIS = math.cos(math.radians(5.0))  # a magnetometer tells a window's axis to some degrees
_STEP = 1e-6
_QUIET = 1e-5  # rad/s; below the means of any such gyro


@dataclass(frozen=True, slots=True, eq=False)
class MeanFit:
    """Effects fitted to the means.

    Args:
        kinds: Ids.
        names: (P,) effect and parameter of every number.
        values: (P,). covariance: (P, P).
        left: (M, 3) of the means [rad/s].
        misfit: Sum of their squares over the noise.
        extent: Sum of the squares of the values in plausible sizes.
    """

    kinds: tuple[str, ...]
    names: tuple[tuple[str, str], ...]
    values: Array
    covariance: Array
    left: Array
    misfit: float
    extent: float

    def bic(self, rows: int) -> float:
        """Bayesian information criterion."""
        return self.misfit + len(self.values) * math.log(rows)


class SpinMeans:
    """The windows' means, and columns of effects in them.

    Args:
        windows: In which the body spins.
        robot: Without joints.

    Attributes:
        seen: (M, 3) spin of every window by the magnetometer [rad/s].
        spin: (M, 3) the same about the mean axis.
        error: (M, 3) means of the gyro less that.
        noise: (3,) by which they scatter.
    """

    def __init__(self, windows: Sequence[SpinWindow], robot: Robot) -> None:
        self.windows, self.robot = windows, robot
        self.seen = np.array([w.spin for w in windows])
        self.spin = self._steady()
        self.error = np.array([w.mean for w in windows]) - self.spin
        self.time = np.array([np.mean(w.time) for w in windows])
        self.noise = np.full(3, _QUIET)
        for _ in range(2):  # what is observable depends on the noise itself
            full = self.fit(KINDS)
            free = max(len(windows) - len(full.values) / 3.0, 1.0)
            self.noise = np.sqrt(np.sum(full.left**2, axis=0) / free)

    def _steady(self) -> Array:
        """(M, 3) every window's rate about the mean axis, its recording's where that is another.

        A window's own axis is far noisier than a mean of the gyro, and noise in columns would be
        taken for scales.
        """
        out = np.zeros_like(self.seen)
        number = np.array([w.recording for w in self.windows])
        common = _mean_axis(self.seen)
        for recording in np.unique(number):
            own = self.seen[number == recording]
            axis = _mean_axis(own)
            if abs(axis @ common) > _SAME_AXIS:
                axis = common
            rates = np.sign(own @ axis) * np.linalg.norm(own, axis=1)
            out[number == recording] = np.outer(rates, axis)
        return out

    def fit(
        self,
        kinds: Sequence[str],
        rows: IntArray | None = None,
        among: Sequence[tuple[str, str]] | None = None,
    ) -> MeanFit:
        """Least squares over some windows (all), what the data do not tell left at nothing.

        Args:
            kinds: Ids of effects.
            rows: Windows.
            among: Effect and parameter of the numbers that may be fitted; None: all.
        """
        names = [(k, p.name) for k in kinds for p in CATALOGUE[k].parameters]
        names = [name for name in names if among is None or name in among]
        columns = np.stack([self._column(*name) for name in names], axis=2) if names else None
        used = np.arange(len(self.windows)) if rows is None else rows
        target = (self.error / self.noise)[used].ravel()
        values, covariance, extent = np.zeros(0), np.zeros((0, 0)), 0.0
        left = self.error.copy()
        if columns is not None:
            design = (columns / self.noise[:, None])[used].reshape(len(target), -1)
            sizes = _WIDE * np.array([self._size(*name) for name in names])
            spread = np.linalg.inv(design.T @ design + np.diag(sizes**-2.0))
            seen = np.flatnonzero(np.sqrt(np.diag(spread)) < _OBSERVABLE * sizes)
            names, columns, design = [names[i] for i in seen], columns[..., seen], design[:, seen]
            values = np.linalg.lstsq(design, target, rcond=None)[0]
            covariance = np.linalg.pinv(design.T @ design)
            extent = float(np.sum((values / sizes[seen]) ** 2))
            left -= columns @ values
        misfit = float(np.sum((left / self.noise) ** 2))
        return MeanFit(tuple(kinds), tuple(names), values, covariance, left, misfit, extent)

    def _column(self, kind: str, name: str) -> Array:
        """(M, 3) change of the means by one parameter of an effect."""
        values = CATALOGUE[kind].nominal()
        values[name] += _STEP
        effect = CATALOGUE[kind](name=kind, where=None, values=values)
        none = np.zeros((len(self.time), 0))
        motion = Motion(self.robot, self.time, none, none, none, omega=self.spin)
        return np.asarray((effect.sense('gyro', self.spin, motion) - self.spin) / _STEP)

    def _size(self, kind: str, name: str) -> float:
        return next(p.size for p in CATALOGUE[kind].parameters if p.name == name)

    def held_out(self, kinds: Sequence[str]) -> float:
        """Misfit of every second window by what the others give."""
        groups, total = np.arange(len(self.windows)) % 2, 0.0
        for g in (0, 1):
            left = self.fit(kinds, np.flatnonzero(groups != g)).left / self.noise
            total += float(np.sum(left[groups == g] ** 2))
        return total


def _mean_axis(spins: Array) -> Array:
    """(3,) unit axis of spins of either sense."""
    axis = np.sum(np.sign(spins @ spins[0])[:, None] * spins, axis=0)
    return np.asarray(axis / np.linalg.norm(axis))
