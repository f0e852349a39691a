"""Motions that a controller follows: each gives joint position, rate and acceleration at any time.

Every reference holds its first point before t = 0 and its last one, at rest, after its end.
"""

from __future__ import annotations

import numpy as np

from ..errors import ConfigurationError
from ..model.settings import ReferenceSettings
from ..types import Array
from .point import Point, Reference, evaluate_quintic, quintic_coefficients, rest
from .sampled import Sampled


class Hold:
    """Stay where one is.

    Args:
        q: (n,) joint positions [rad].
    """

    duration = 0.0

    def __init__(self, q: Array) -> None:
        self._point = rest(q)

    def at(self, t: float) -> Point:
        """The held point, whatever the time."""
        return self._point


class SetPoint:
    """A quintic move at rest to rest, then a hold.

    Args:
        start: (n,) joint positions at the start [rad].
        goal: (n,) joint positions at the end [rad].
        duration: Duration of the move [s].
    """

    def __init__(self, start: Array, goal: Array, duration: float) -> None:
        self.duration = duration
        self._ends = (rest(start), rest(goal))
        self._coefficients = quintic_coefficients(duration, *self._ends)

    def at(self, t: float) -> Point:
        """The point at time t [s]."""
        if t <= 0.0:
            return self._ends[0]
        if t >= self.duration:
            return self._ends[1]
        return evaluate_quintic(self._coefficients, self.duration, t)


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
        self._a = np.array(sine, dtype=float)
        self._b = np.array(cosine, dtype=float)
        self._w = 2.0 * np.pi / duration * np.arange(1, self._a.shape[1] + 1)
        self._repeat = repeat
        self._start = rest(start)
        series = self._series(0.0)
        end = Point(self._start.q - series.q, -series.qd, -series.qdd)
        self._quintic = quintic_coefficients(duration, end, end)

    def at(self, t: float) -> Point:
        """The point at time t [s]."""
        if self._repeat and t > 0.0:
            t %= self._period
        if t <= 0.0 or t >= self._period:
            return self._start
        series = self._series(t)
        quintic = evaluate_quintic(self._quintic, self._period, t)
        return Point(series.q + quintic.q, series.qd + quintic.qd, series.qdd + quintic.qdd)

    def _series(self, t: float) -> Point:
        w, s, c = self._w, np.sin(self._w * t), np.cos(self._w * t)
        q = self._a @ (s / w) - self._b @ (c / w)
        return Point(q, self._a @ c + self._b @ s, self._b @ (w * c) - self._a @ (w * s))


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

    def at(self, t: float) -> Point:
        """The point at time t [s]."""
        if t < 0.0:
            return self._start
        w, s, c = self._w, np.sin(self._w * t), np.cos(self._w * t)
        a = self._amplitude
        return Point(self._start.q + a * s, a * (w * c), a * (-(w**2) * s))


class Blend:
    """A reference joined smoothly from elsewhere: the offset dies away along a quintic.

    Args:
        reference: The motion to join.
        t_start: Time of the motion at which it is joined [s].
        start: Where the joints are at that time; its acceleration counts too.
        duration: Time over which the offset dies away [s].
    """

    def __init__(
        self, reference: Reference, t_start: float, start: Point, duration: float
    ) -> None:
        wanted = reference.at(t_start)
        offset = Point(start.q - wanted.q, start.qd - wanted.qd, start.qdd - wanted.qdd)
        self._reference, self._t_start, self._blend = reference, t_start, duration
        self._offset = quintic_coefficients(duration, offset, rest(np.zeros(len(start.q))))
        self.duration = max(reference.duration, t_start + duration)

    def at(self, t: float) -> Point:
        """The point at time t [s]."""
        point = self._reference.at(t)
        since = t - self._t_start
        if since >= self._blend:
            return point
        offset = evaluate_quintic(self._offset, self._blend, max(since, 0.0))
        return Point(point.q + offset.q, point.qd + offset.qd, point.qdd + offset.qdd)


def check_reference(settings: ReferenceSettings, n_joints: int) -> None:
    """Refuse reference settings that do not fit the robot.

    Args:
        settings: Section `reference` of the robot file.
        n_joints: Number n of manipulator joints.

    Raises:
        ConfigurationError: wrong numbers of coefficients or of goals.
    """
    size = n_joints * settings.harmonics
    fourier = f'{n_joints} joints x {settings.harmonics} harmonics'
    needed = {
        'set_point': (('set_point', n_joints, 'one a joint'),),
        'step': (('set_point', n_joints, 'one a joint'),),
        'harmonic': (('amplitude', n_joints, 'one a joint'),),
        'fourier': (('sine', size, fourier), ('cosine', size, fourier)),
    }
    for name, count, what in needed.get(settings.kind, ()):
        got = len(getattr(settings, name))
        if got != count:
            raise ConfigurationError(
                f'reference.{name}', f'expected {count} numbers ({what}), got {got}'
            )


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
        return SetPoint(start, np.array(settings.set_point), settings.duration)
    if settings.kind == 'step':
        return Hold(np.array(settings.set_point))
    if settings.kind == 'harmonic':
        return Harmonic(start, np.array(settings.amplitude), settings.duration)
    if settings.kind == 'fourier':
        sine = np.reshape(settings.sine, (n, settings.harmonics))
        cosine = np.reshape(settings.cosine, (n, settings.harmonics))
        return Fourier(sine, cosine, settings.duration, start, repeat=settings.repeat)
    return Hold(start)


__all__ = [
    'Blend',
    'Fourier',
    'Harmonic',
    'Hold',
    'Point',
    'Reference',
    'Sampled',
    'SetPoint',
    'build_reference',
    'check_reference',
    'quintic_coefficients',
    'rest',
]
