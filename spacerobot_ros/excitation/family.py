"""The family of motions to choose from: Fourier series plus quintic, linear in its coefficients.

    q(t) = q_start + sum_m x_m f_m(t)

with the x_m [rad] the amplitudes of sine and cosine of each harmonic, and each f_m brought to rest
at both ends by its own quintic (`control.joint_reference.Fourier`). Scaling all amplitudes scales
rates and accelerations alike, which makes any motion gentle enough.

Symbols: B candidates, T times, n joints, H harmonics.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..control.joint_reference import Fourier
from ..model.motion_settings import ReferenceSettings
from ..types import Array


class MotionFamily:
    """Joint motions at fixed times.

    Args:
        duration: [s].
        harmonics: Number H.
        start: (n,) joint positions at both ends [rad].
        times: (T,) from 0 to the duration [s].
    """

    def __init__(self, duration: float, harmonics: int, start: Array, times: Array) -> None:
        self.duration, self.harmonics, self.start, self.times = duration, harmonics, start, times
        self._rates = 2.0 * np.pi / duration * np.arange(1, harmonics + 1)
        zero = np.zeros((harmonics, harmonics))
        basis = Fourier(
            np.concatenate([np.diag(self._rates), zero]),
            np.concatenate([zero, np.diag(self._rates)]),
            duration,
            np.zeros(2 * harmonics),
        )
        points = [basis.at(float(t)) for t in times]
        self._curves = [np.array([getattr(p, k) for p in points]) for k in ('q', 'qd', 'qdd')]

    @property
    def size(self) -> int:
        """Number of amplitudes, 2 H n."""
        return 2 * self.harmonics * len(self.start)

    def at(self, times: Array) -> MotionFamily:
        """The same family at other times."""
        return MotionFamily(self.duration, self.harmonics, self.start, times)

    def motion(self, x: Array) -> tuple[Array, Array, Array]:
        """Positions, rates and accelerations (B, T, n) of candidates x (B, 2 H n)."""
        amplitudes = x.reshape(len(x), len(self.start), -1)
        q, qd, qdd = (np.einsum('tm,bnm->btn', curve, amplitudes) for curve in self._curves)
        return q + self.start, qd, qdd

    def amplitudes(self, reference: ReferenceSettings) -> Array:
        """(2 H n,) amplitudes of a Fourier motion: harmonics that it lacks are zero, higher cut.

        A motion of another duration keeps its amplitudes and changes its rates.
        """
        rates = 2.0 * np.pi / reference.duration * np.arange(1, reference.harmonics + 1)
        x = np.zeros((len(self.start), 2, self.harmonics))
        shared = min(self.harmonics, reference.harmonics)
        for part, values in enumerate((reference.sine, reference.cosine)):
            table = np.reshape(values, (len(self.start), -1)) / rates
            x[:, part, :shared] = table[:, :shared]
        return x.ravel()

    def reference(self, x: Array) -> ReferenceSettings:
        """Section `reference` of a robot file for one candidate x (2 H n,)."""
        table = x.reshape(len(self.start), 2, self.harmonics) * self._rates
        return replace(
            ReferenceSettings(),
            kind='fourier',
            duration=self.duration,
            harmonics=self.harmonics,
            sine=tuple(table[:, 0].ravel().tolist()),
            cosine=tuple(table[:, 1].ravel().tolist()),
        )
