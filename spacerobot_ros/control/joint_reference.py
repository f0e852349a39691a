"""Motions that a controller follows: each gives joint position, rate and acceleration at any time.

Every reference holds its first setpoint before t = 0 and its last one, at rest, after its end.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ..errors import ConfigurationError
from ..formats import counted
from ..model.motion_settings import ReferenceSettings
from ..types import Array

_POWERS = 6  # of the polynomials that begin and end motions
_EXPONENTS = np.arange(_POWERS)


class Setpoint(NamedTuple):
    """Where a motion is at one time.

    Args:
        q: (n,) joint positions [rad].
        qd: (n,) joint rates [rad/s].
        qdd: (n,) joint accelerations [rad/s^2].
    """

    q: Array
    qd: Array
    qdd: Array


class Reference(Protocol):
    """A motion of n joints."""

    @property
    def duration(self) -> float:
        """Time from which on the motion rests [s]: 0 for a hold, infinite for one that repeats."""

    def at(self, t: float) -> Setpoint:
        """The setpoint at time t [s] since the start of the motion."""


def quintic(duration: float, start: Setpoint, end: Setpoint) -> Array:
    """Fifth-order polynomial between two setpoints.

    Args:
        duration: Time between them [s].
        start: At t = 0.
        end: At t = duration.

    Returns:
        (6, 3 n) coefficients of 1, s, ..., s^5 with s = t / duration, of positions, rates and
        accelerations.
    """
    T = duration
    c0, c1, c2 = start.q, start.qd * T, 0.5 * start.qdd * T**2
    p, v, a = end.q - c0 - c1 - c2, end.qd * T - c1 - 2.0 * c2, end.qdd * T**2 - 2.0 * c2
    c3 = 10.0 * p - 4.0 * v + 0.5 * a
    c4 = -15.0 * p + 7.0 * v - a
    c5 = 6.0 * p - 3.0 * v + 0.5 * a
    c, k = np.array([c0, c1, c2, c3, c4, c5]), _EXPONENTS[:, None]
    rate, bend = np.roll(k * c, -1, axis=0), np.roll(k * (k - 1) * c, -2, axis=0)
    return np.concatenate([c, rate / T, bend / T**2], axis=1)


def rest(q: Array) -> Setpoint:
    """The position q at rest."""
    return Setpoint(np.array(q, dtype=float), np.zeros(len(q)), np.zeros(len(q)))


class Hold:
    """Stay where one is.

    Args:
        q: (n,) joint positions [rad].
    """

    duration = 0.0

    def __init__(self, q: Array) -> None:
        self._setpoint = rest(q)

    def at(self, t: float) -> Setpoint:
        """The held setpoint, whatever the time."""
        return self._setpoint


class Fourier:
    r"""A truncated Fourier series plus a quintic that brings it to rest at both ends.

        q_i(t) = sum_l a_il/(w l) sin(w l t) - b_il/(w l) cos(w l t) + sum_j c_ij t^j

    with w = 2 pi / duration: eq. (33) of the identification paper (docs/references.md). The c_ij
    make q = `start` and q' = q'' = 0 at both ends.

    Args:
        sine: (n, harmonics) a [rad/s].
        cosine: (n, harmonics) b [rad/s].
        duration: Duration of one pass [s].
        start: (n,) joint positions at both ends [rad].
        repeat: Start again at the end instead of holding.
    """

    def __init__(
        self, sine: Array, cosine: Array, duration: float, start: Array, *, repeat: bool = False
    ) -> None:
        self.duration = np.inf if repeat else duration
        self._period = duration
        self._w = 2.0 * np.pi / duration * np.arange(1, np.shape(sine)[1] + 1)
        self._repeat = repeat
        self._start = rest(start)
        n = len(start)
        series = _series(np.array(sine, dtype=float), np.array(cosine, dtype=float), self._w)
        self._curves = np.concatenate([series, np.zeros((_POWERS, 3 * n))])
        first = Setpoint(*self._sums(np.zeros(())))
        end = Setpoint(self._start.q - first.q, -first.qd, -first.qdd)
        self._curves[-_POWERS:] = quintic(duration, end, end)
        self._known: dict[float, Setpoint] = {}  # a law, its log and its limits ask for the same

    def at(self, t: float) -> Setpoint:
        """The setpoint at time t [s]."""
        if self._repeat and t > 0.0:
            t %= self._period
        if t <= 0.0 or t >= self._period:
            return self._start
        if t not in self._known:
            if len(self._known) > 1:
                del self._known[next(iter(self._known))]
            self._known[t] = Setpoint(*self._sums(np.asarray(t)))
        return self._known[t]

    def along(self, times: Array) -> Setpoint:
        """The setpoints at times (T,) [s], each field (T, n)."""
        t = np.where(times > 0.0, times % self._period, times) if self._repeat else times
        moves = ((t > 0.0) & (t < self._period))[:, None]
        each = zip(np.moveaxis(self._sums(t), -2, 0), self._start, strict=True)
        return Setpoint(*(np.where(moves, curve, rest) for curve, rest in each))

    def _sums(self, t: Array) -> Array:
        """(..., 3, n) of position, rate and acceleration at times t (...)."""
        angle, share = t[..., None] * self._w, t[..., None] / self._period
        shapes = np.empty((*t.shape, len(self._curves)))
        np.sin(angle, out=shapes[..., : len(self._w)])
        np.cos(angle, out=shapes[..., len(self._w) : -_POWERS])
        shapes[..., -_POWERS:] = share**_EXPONENTS
        return (shapes @ self._curves).reshape(*t.shape, 3, -1)


def _series(a: Array, b: Array, w: Array) -> Array:
    """(2 H, 3 n) position, rate and acceleration by sin(w t), then by cos(w t)."""
    sine, cosine = np.concatenate([a / w, b, -a * w]), np.concatenate([-b / w, a, b * w])
    return np.concatenate([sine, cosine], axis=1).T


class Harmonic:
    """Sines around the start, q = start + amplitude sin(2 pi t / period), for ever.

    The rate at t = 0 is not zero: a robot at rest has to catch up.

    Args:
        start: (n,) joint positions at the start [rad].
        amplitude: (n,) [rad].
        period: [s].
    """

    duration = float('inf')

    def __init__(self, start: Array, amplitude: Array, period: float) -> None:
        self._start = rest(start)
        self._amplitude = np.array(amplitude, dtype=float)
        self._w = 2.0 * np.pi / period

    def at(self, t: float) -> Setpoint:
        """The setpoint at time t [s]."""
        if t < 0.0:
            return self._start
        w, s, c = self._w, np.sin(self._w * t), np.cos(self._w * t)
        a = self._amplitude
        return Setpoint(self._start.q + a * s, a * (w * c), a * (-(w**2) * s))


class Blend:
    """A reference joined smoothly from elsewhere: the offset dies away along a quintic.

    Args:
        reference: The motion to join.
        t_start: Time of the motion at which it is joined [s].
        start: Where the joints are at that time; its acceleration counts too.
        duration: Time over which the offset dies away [s].

    Attributes:
        begins: Time of the motion at which it is joined [s]. joining: `duration`.
    """

    def __init__(
        self, reference: Reference, t_start: float, start: Setpoint, duration: float
    ) -> None:
        wanted = reference.at(t_start)
        offset = Setpoint(start.q - wanted.q, start.qd - wanted.qd, start.qdd - wanted.qdd)
        self._reference, self.begins, self.joining = reference, t_start, duration
        self._offset = quintic(duration, offset, rest(np.zeros(len(start.q))))
        self.duration = max(reference.duration, t_start + duration)

    def at(self, t: float) -> Setpoint:
        """The setpoint at time t [s]."""
        point = self._reference.at(t)
        since = t - self.begins
        if since >= self.joining:
            return point
        share = max(since, 0.0) / self.joining
        offset = (share**_EXPONENTS @ self._offset).reshape(3, -1)
        return Setpoint(*(np.array(point) + offset))


class PointToPoint(Blend):
    """A quintic move at rest to rest, then a hold.

    Args:
        start: (n,) joint positions at the start [rad].
        goal: (n,) joint positions at the end [rad].
        duration: Duration of the move [s].
    """

    def __init__(self, start: Array, goal: Array, duration: float) -> None:
        super().__init__(Hold(goal), 0.0, rest(start), duration)
        self._first = rest(start)

    def at(self, t: float) -> Setpoint:
        """The setpoint at time t [s]."""
        return super().at(t) if t > 0.0 else self._first


def check_reference(settings: ReferenceSettings, n_joints: int) -> None:
    """Refuse reference settings that do not fit the robot.

    Args:
        settings: Section `reference` of the robot file.
        n_joints: Number n of manipulator joints.

    Raises:
        ConfigurationError: wrong numbers of coefficients or of goals.
    """
    size = n_joints * settings.harmonics
    fourier = f'{counted(n_joints, "joint")} x {counted(settings.harmonics, "harmonic")}'
    needed = {
        'set_point': (('set_point', n_joints, 'one a joint'),),
        'step': (('set_point', n_joints, 'one a joint'),),
        'harmonic': (('amplitude', n_joints, 'one a joint'),),
        'fourier': (('sine', size, fourier), ('cosine', size, fourier)),
    }
    for name, count, what in needed.get(settings.kind, ()):
        got = len(getattr(settings, name))
        if got != count:
            why = f'expected {counted(count, "number")} ({what}), got {got}'
            raise ConfigurationError(f'reference.{name}', why)


def build_reference(settings: ReferenceSettings, start: Array) -> Reference:
    """The reference that the settings ask for; kind `topic` holds until a trajectory arrives.

    Args:
        settings: Section `reference` of the robot file.
        start: (n,) joint positions at the start of the motion [rad].

    Raises:
        ConfigurationError: settings that do not fit n joints.
    """
    n = len(start)
    check_reference(settings, n)
    if settings.kind == 'set_point':
        return PointToPoint(start, np.array(settings.set_point), settings.duration)
    if settings.kind == 'step':
        return Hold(np.array(settings.set_point))
    if settings.kind == 'harmonic':
        return Harmonic(start, np.array(settings.amplitude), settings.duration)
    if settings.kind == 'fourier':
        sine = np.reshape(settings.sine, (n, settings.harmonics))
        cosine = np.reshape(settings.cosine, (n, settings.harmonics))
        return Fourier(sine, cosine, settings.duration, start, repeat=settings.repeat)
    return Hold(start)
