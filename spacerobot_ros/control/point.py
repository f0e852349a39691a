"""Points of joint motions, and polynomials between them."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ..types import Array


class Point(NamedTuple):
    """A point of a motion.

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

    def at(self, t: float) -> Point:
        """The point at time t [s] since the start of the motion."""


def quintic_coefficients(duration: float, start: Point, end: Point) -> Array:
    """Fifth-order polynomial between two points.

    Args:
        duration: Time between them [s].
        start: At t = 0.
        end: At t = duration.

    Returns:
        (6, n) coefficients of 1, s, ..., s^5 with s = t / duration.
    """
    T = duration
    c0, c1, c2 = start.q, start.qd * T, 0.5 * start.qdd * T**2
    p, v, a = end.q - c0 - c1 - c2, end.qd * T - c1 - 2.0 * c2, end.qdd * T**2 - 2.0 * c2
    c3 = 10.0 * p - 4.0 * v + 0.5 * a
    c4 = -15.0 * p + 7.0 * v - a
    c5 = 6.0 * p - 3.0 * v + 0.5 * a
    return np.array([c0, c1, c2, c3, c4, c5])


def evaluate_quintic(coefficients: Array, duration: float, t: float) -> Point:
    """The point at time t [s] of a polynomial from `quintic_coefficients`."""
    s = t / duration
    c = coefficients
    q = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
    qd = c[1] + s * (2.0 * c[2] + s * (3.0 * c[3] + s * (4.0 * c[4] + s * 5.0 * c[5])))
    qdd = 2.0 * c[2] + s * (6.0 * c[3] + s * (12.0 * c[4] + s * 20.0 * c[5]))
    return Point(q, qd / duration, qdd / duration**2)


def rest(q: Array) -> Point:
    """The point q at rest."""
    return Point(np.array(q, dtype=float), np.zeros(len(q)), np.zeros(len(q)))
