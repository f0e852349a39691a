"""Arms and free bases with a torque that no catalogue knows, and noise of several kinds.

Laws are written here in their own words, not by the grammar: those inside it, and those that it
only comes close to. Sizes are by the noise of the same joint. On free bases those fly that one or
two angles or rates tell, as tables in the plant, at a joint or on the base by its attitude.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, sosfiltfilt

from spacerobot_ros.types import Array

from .real_arm import COULOMB, JOINTS, POSE, RATE, RealArm, motion_of

NOISE = 0.1  # rms of what is left, of a joint's Coulomb torque
_SHARE = 0.3  # of what real arms have beside it: masses, friction of the run, ripple, gains
_BAND = 4.0  # Hz

LawFunction = Callable[[Array, Array, Array, Array, int, int], Array]
"""(N,) torque of any size by (N, n) angles, rates, motor torques; times; own and other joint."""


def _dahl(q: Array, length: float) -> Array:
    """By small steps of dz = dq (1 - z sign(dq)) / length."""
    z = np.zeros(len(q))
    for i, way in enumerate(np.diff(q)):
        z[i + 1] = z[i]
        for step in np.full(8, way / 8.0):
            z[i + 1] += step / length * (1.0 - z[i + 1] * np.sign(step))
    return z


def _play(q: Array, radius: float) -> Array:
    z = np.zeros(len(q))
    for i, way in enumerate(np.diff(q)):
        z[i + 1] = np.clip(z[i] + way / radius, -1.0, 1.0)
    return z


INSIDE: Mapping[str, tuple[LawFunction, str]] = {
    'drag': (lambda q, v, T, t, j, k: v[:, j] * np.abs(v[:, j]), 'v'),
    'square root': (lambda q, v, T, t, j, k: np.sign(v[:, j]) * np.abs(v[:, j]) ** 0.5, 'v'),
    'asymmetric': (lambda q, v, T, t, j, k: np.maximum(v[:, j], 0.0), 'v'),
    'coupled viscous': (lambda q, v, T, t, j, k: v[:, k], 'w'),
    'coupled Coulomb': (lambda q, v, T, t, j, k: np.sign(v[:, k]), 'w'),
    'sum of rates': (lambda q, v, T, t, j, k: np.sign(v[:, j] + v[:, k]), 'vw'),
    'cubic spring': (lambda q, v, T, t, j, k: (q[:, j] - POSE[j]) ** 3, 'q'),
    'end stop': (lambda q, v, T, t, j, k: np.maximum(q[:, j] - POSE[j] - 0.2, 0.0), 'q'),
    'warm-up': (lambda q, v, T, t, j, k: v[:, j] * np.exp(-t / 8.0), 'vt'),
    'by angle': (lambda q, v, T, t, j, k: np.sign(v[:, j]) * (1.0 + np.sin(2.0 * q[:, j])), 'vq'),
    'Dahl': (lambda q, v, T, t, j, k: _dahl(q[:, j], 0.05), 'q'),
    'play': (lambda q, v, T, t, j, k: _play(q[:, j], 0.05), 'q'),
    'two angles': (lambda q, v, T, t, j, k: np.sin(q[:, j] + q[:, k]), 'qp'),
    'load squared': (lambda q, v, T, t, j, k: T[:, j] ** 2 * np.sign(v[:, j]), 'vT'),
    "another's spring": (lambda q, v, T, t, j, k: q[:, k], 'p'),
    'two rates': (lambda q, v, T, t, j, k: v[:, j] * v[:, k], 'vw'),
    'clock': (lambda q, v, T, t, j, k: np.sin(2.0 * np.pi * (0.21 + 0.005 * t) * t), 't'),
}
"""Laws of the grammar, and their variables: rates v, w of the own and the other joint, angles q
and p, load T, time t."""

OUTSIDE: Mapping[str, tuple[LawFunction, str]] = {
    'exp of angle': (lambda q, v, T, t, j, k: np.exp(q[:, j]) * np.sign(v[:, j]), 'vq'),
    'load to 0.6': (lambda q, v, T, t, j, k: np.abs(T[:, j]) ** 0.6 * np.sign(v[:, j]), 'vT'),
    'falling': (lambda q, v, T, t, j, k: np.sign(v[:, j]) / (1.0 + (4.0 * v[:, j]) ** 2), 'v'),
    'rate to 2.5': (lambda q, v, T, t, j, k: np.sign(v[:, j]) * np.abs(v[:, j]) ** 2.5, 'v'),
    "another's tanh": (lambda q, v, T, t, j, k: np.tanh(v[:, k] / 0.3), 'w'),
    'product of sines': (lambda q, v, T, t, j, k: np.sin(q[:, j]) * np.sin(2.0 * q[:, k]), 'qp'),
}
"""Laws that the grammar has not."""

LAWS = {**INSIDE, **OUTSIDE}
_NAMES = {'v': 'rate', 'w': 'rate', 'q': 'angle', 'p': 'angle', 'T': 'load'}
COLOURS = ('white', 'slow', 'pink', 'line', 'speed')


def variables_of(law: str, own: str, other: str) -> list[str]:
    """Inputs of a law by their names."""
    return [
        'time' if a == 't' else f'{_NAMES[a]}/{other if a in "wp" else own}' for a in LAWS[law][1]
    ]


@dataclass(frozen=True, eq=False)
class LawArm(RealArm):
    """An arm with noise of one colour at all joints and a law at one.

    Args:
        colour: One of `COLOURS`.
        law: Name of the law; empty: none.
        place: Numbers of the law's joint and of the other.
        size: Of the law [N m].
    """

    leftover: float = _SHARE
    colour: str = 'slow'
    law: str = ''
    place: tuple[int, int] = (0, 1)
    size: float = 1.0

    def hidden_torque(self, q: Array, qd: Array, torque: Array) -> Array:
        """(N,) of the law [N m]: against the motion where it is friction."""
        law, _ = LAWS[self.law]
        return -self.size * law(q, qd, torque, np.arange(len(q)) / RATE, *self.place)

    def sized(self, ratio: float, moving: Sequence[str], duration: float) -> LawArm:
        """With a law of an rms by that of the noise in the band, on the motion of run 0.

        About its mean, as that of the noise: a torque that hardly changes is an offset, and no
        record tells of what it is a function.

        Args:
            ratio: Of the two.
            moving: Joints that move.
            duration: [s].
        """
        rng = np.random.default_rng([self.seed, 0, 5])
        time = np.arange(round(duration * RATE) + 1) / RATE
        q, qd, qdd = motion_of(rng, time, np.isin(JOINTS, moving))
        raw = self.hidden_torque(q, qd, super()._motor(rng, q, qd, qdd))
        wanted = ratio * NOISE * COULOMB[self.place[0]]
        return replace(self, size=self.size * wanted / float(np.std(raw)))

    def _motor(self, rng: np.random.Generator, q: Array, qd: Array, qdd: Array) -> Array:
        torque = super()._motor(rng, q, qd, qdd)
        torque += NOISE * COULOMB * np.column_stack([self._noise(rng, v) for v in qd.T])
        if self.law:
            torque[:, self.place[0]] -= self.hidden_torque(q, qd, torque)
        return torque

    def _noise(self, rng: np.random.Generator, rate: Array) -> Array:
        """(N,) of unit rms in the band."""
        white = rng.standard_normal(len(rate))
        if self.colour == 'line':
            # half a tenth of a hertz wide, somewhere where motions are, too
            middle = rng.uniform(0.1, 1.0)
            time = np.arange(len(rate)) / RATE
            phase = 2.0 * np.pi * (middle * time + rng.uniform())
            turn = np.cumsum(rng.standard_normal(len(rate))) * np.sqrt(2.0 * np.pi * 0.05 / RATE)
            white = np.sin(phase + turn) + 0.1 * white
        elif self.colour in ('slow', 'pink'):
            frequency = np.fft.rfftfreq(len(rate), 1.0 / RATE)
            bend = 1.0 / (1.0 + (frequency / 0.15) ** 2) if self.colour == 'slow' else 1.0
            fall = 1.0 if self.colour == 'slow' else 1.0 / np.sqrt(np.maximum(frequency, 0.02))
            spectrum = np.sqrt(bend) * fall * np.fft.rfft(white)
            white = np.fft.irfft(spectrum, len(rate))
        elif self.colour == 'speed':
            white *= np.abs(rate)
        low = sosfiltfilt(butter(3, _BAND, fs=RATE, output='sos'), white)
        return np.asarray(low / max(np.sqrt(np.mean(low**2)), 1e-9))
