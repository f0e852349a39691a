"""The recent past of a simulated robot, for sensors that are late."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import replace

import numpy as np

from ..dynamics.rotation import cross, rotation_between, turned
from ..dynamics.state import State
from ..types import Array

_SAME = 1e-9  # s: a sum of floating-point periods and the time it stands for


class StateHistory:
    """States of past steps, and between them by cubic Hermite interpolation.

    Positions and their rates are matched at both ends of a step, under a torque that is held over
    it: rates are right to h^3 / 125 of their third derivative. Before the first step the robot
    coasts into it.
    """

    def __init__(self) -> None:
        self._times: list[float] = []
        self._moments: list[tuple[State, Array, Array]] = []  # with effort and hidden states

    def __len__(self) -> int:
        """Number of steps that are remembered."""
        return len(self._times)

    def add(self, time: float, state: State, effort: Array, hidden: Array, span: float) -> None:
        """Take the state at a time later than all before; forget what is older than `span`.

        Args:
            time: [s].
            state: True state.
            effort: (n,) torque over the step that ended there [N m].
            hidden: Own states of all effects.
            span: Time that may be asked for, back from now [s].
        """
        self._times.append(time)
        self._moments.append((state, effort, hidden))
        old = bisect_left(self._times, time - span) - 1  # the step that spans the oldest time
        if old > 0:
            del self._times[:old], self._moments[:old]

    def state(self, time: float) -> State:
        """State at a time not after the newest [s]."""
        k, share = self._place(time)
        after = self._moments[k][0]
        if share == 1.0:
            return after
        if k == 0:
            return _coasted(after, time - self._times[0])
        step = self._times[k] - self._times[k - 1]
        return _between(self._moments[k - 1][0], after, time - self._times[k - 1], step)

    def effort(self, time: float) -> Array:
        """(n,) torque over the step that ends at or after a time [N m]; zero before the first."""
        return self._moments[self._place(time)[0]][1]

    def hidden(self, time: float) -> Array:
        """Own states of all effects at a time, linear between steps; at rest before the first."""
        k, share = self._place(time)
        after = self._moments[k][2]
        if k == 0 or share == 1.0:
            return after
        before = self._moments[k - 1][2]
        return before + share * (after - before)

    def _place(self, time: float) -> tuple[int, float]:
        """The step that ends at or after a time, and the share of it that is over by then."""
        k = bisect_left(self._times, time - _SAME)
        if abs(self._times[k] - time) <= _SAME:
            return k, 1.0
        if k == 0:
            return 0, 0.0
        return k, (time - self._times[k - 1]) / (self._times[k] - self._times[k - 1])


def _coasted(state: State, dt: float) -> State:
    attitude = turned(state.q_WB_xyzw, state.omega_WB_B * dt)
    return replace(state, q_WB_xyzw=attitude, q=state.q + state.qd * dt)


def _between(a: State, b: State, t: float, h: float) -> State:
    q, qd = _hermite(a.q, b.q, a.qd, b.qd, t, h)
    step = rotation_between(a.q_WB_xyzw, b.q_WB_xyzw)
    # rate of the rotation vector from a: J^-1 omega, to third order of the small step
    end = b.omega_WB_B + 0.5 * cross(step, b.omega_WB_B)
    end = end + cross(step, cross(step, b.omega_WB_B)) / 12.0
    turn, rate = _hermite(np.zeros(3), step, a.omega_WB_B, end, t, h)
    omega = rate - 0.5 * cross(turn, rate) + cross(turn, cross(turn, rate)) / 6.0
    share, attitude = t / h, turned(a.q_WB_xyzw, turn)
    p, v = a.p_WB + share * (b.p_WB - a.p_WB), a.v_WB_B + share * (b.v_WB_B - a.v_WB_B)
    return State(p, attitude, q, v, omega, qd)


def _hermite(
    x0: Array, x1: Array, v0: Array, v1: Array, t: float, h: float
) -> tuple[Array, Array]:
    """Cubic through two points with given slopes, and its slope, at t of [0, h]."""
    u = t / h
    chord = (x1 - x0) / h
    bend, twist = chord - v0, v1 + v0 - 2.0 * chord
    value = x0 + t * (v0 + u * (bend + (u - 1.0) * twist))
    slope = v0 + 2.0 * u * bend + u * (3.0 * u - 2.0) * twist
    return value, slope
