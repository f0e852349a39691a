r"""Many closed loops at once under the computed torque in continuous time, sensors exact.

    tau = H(q) (q''_d + Kd e' + Kp e) + c(q, q', omega),    e = q_d - q                  (`laws`)

with H and c of one model, and a machine of its own for each run. This is what `ClosedLoop` comes
to as its period goes to zero; the torque is smooth but for its limits, so that steps of order 8
may be long. All runs take each step together, with compiled functions over all of them; a run's
numbers do not depend on which others there are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..control.joint_reference import Reference, Setpoint
from ..dynamics.aba import aba
from ..dynamics.compiling import compiled
from ..dynamics.equations import joint_torques
from ..dynamics.integrate import cubic_hermite, rk_step
from ..dynamics.tree import LINK, Records, tree_of
from ..model.robot import Robot
from ..types import Array

_WITHIN = np.array([0.25, 0.5, 0.75])
"""Parts of a step at which the error is looked at, too, by its cubic through both ends."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackingLaw:
    """What the controller knows.

    Args:
        model: The robot that it believes in, gyrostat view.
        reference: Motion of its n joints.
        bandwidth: Double pole of the error dynamics [rad/s].
        limits: (n,) torque limits [N m], infinite where there is none.
    """

    model: Robot
    reference: Reference
    bandwidth: float
    limits: Array


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Followed:
    """What came of R runs.

    Args:
        largest: (R, n) largest |e| [rad]. rms: (R, n) of e [rad]. last: (R, n) e at the end [rad].
        turned: (R,) largest rotation of the base from its start [rad].
        torque: (R, n) largest |tau| [N m].
        is_limited: (R,) whether a limit cut a torque.
        states: (R, 13 + 2 m) at the end.
    """

    largest: Array
    rms: Array
    last: Array
    turned: Array
    torque: Array
    is_limited: Array
    states: Array


def follow(
    machines: Sequence[Robot], x: Array, law: TrackingLaw, duration: float, steps: int
) -> Followed:
    """Let machines follow a motion; what diverges is NaN.

    Args:
        machines: R robots of one tree, their rotors free.
        x: (R, 13 + 2 m) states at the start.
        law: Their controller.
        duration: [s].
        steps: Integration steps.
    """
    trees = np.stack([tree_of(machine) for machine in machines])
    dt, loops = duration / steps, _Loops(trees, law, x.shape)
    start, x = x[:, 3:7].copy(), x.copy()
    largest, squares, torque = np.zeros((3, len(x), len(law.model.joints)))
    turned = np.zeros(len(x))
    before = loops.error(law.reference.at(0.0), x)
    with np.errstate(all='ignore'):  # what diverges does so alone
        for k in range(steps):
            t, loops.torques = k * dt, []
            x = rk_step(loops.rate, t, x, dt)
            torque = np.fmax(torque, np.abs(loops.torques[0]))
            x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
            after = loops.error(law.reference.at(t + dt), x)
            reached, added = _over_step(before, after, dt)
            largest, squares = np.fmax(largest, reached), squares + added
            turned = np.fmax(turned, rotated(start, x[:, 3:7]))
            before = after
    bad = ~np.isfinite(x).all(axis=1)
    for values in (largest, squares, turned, torque):
        values[bad] = np.nan
    return Followed(
        largest=largest,
        rms=np.sqrt(squares / duration),
        last=before[0],
        turned=turned,
        torque=torque,
        is_limited=loops.is_limited,
        states=x,
    )


class _Loops:
    """Rates of change of all runs."""

    def __init__(self, trees: Records, law: TrackingLaw, shape: tuple[int, ...]) -> None:
        self._trees, self._law = trees, law
        self._n, self._m = len(law.model.joints), (shape[1] - 13) // 2
        self._links = np.zeros(trees.shape[1], LINK)
        self._tau = np.zeros((shape[0], self._m))
        self.is_limited = np.zeros(shape[0], dtype=bool)
        self.torques: list[Array] = []

    def error(self, setpoint: Setpoint, x: Array) -> tuple[Array, Array]:
        """(R, n) joint errors and their rates."""
        n, m = self._n, self._m
        return setpoint.q - x[:, 7 : 7 + n], setpoint.qd - x[:, 13 + m : 13 + m + n]

    def rate(self, t: float, x: Array) -> Array:
        """Rates of all states; keeps the torques (R, n) that make them so."""
        law, n, m = self._law, self._n, self._m
        setpoint, out = law.reference.at(t), np.empty_like(x)
        e, ed = self.error(setpoint, x)
        v = setpoint.qdd + 2.0 * law.bandwidth * ed + law.bandwidth**2 * e
        q, qd, omega = x[:, 7 : 7 + n], x[:, 13 + m : 13 + m + n], x[:, 10 + m : 13 + m]
        tau = joint_torques(law.model, q, qd, v, omega)
        limited = np.clip(tau, -law.limits, law.limits)
        self.is_limited |= (limited != tau).any(axis=1)
        self._tau[:, :n] = limited
        self.torques.append(limited)
        _rates(self._trees, self._links, x, self._tau, out)
        return out


def _over_step(
    before: tuple[Array, Array], after: tuple[Array, Array], dt: float
) -> tuple[Array, Array]:
    """(R, n) largest |e| and integral of e^2 over a step, from e and e' at both ends."""
    (e0, d0), (e1, d1) = before, after
    inside = [cubic_hermite(e0, e1, d0, d1, part * dt, dt)[0] for part in _WITHIN]
    # Boole's rule, exact for the squares of what is cubic but for its last term
    a, b, c = (e**2 for e in inside)
    squares = dt / 90.0 * (7.0 * (e0**2 + e1**2) + 32.0 * (a + c) + 12.0 * b)
    return np.fmax.reduce(np.abs([e0, *inside, e1])), squares


def rotated(start: Array, now: Array) -> Array:
    """(R,) rotation between attitudes (R, 4) or (4,) [rad]."""
    return 2.0 * np.arccos(np.minimum(1.0, np.abs(np.sum(start * now, axis=1))))


def steps_for(law: TrackingLaw, duration: float) -> int:
    """Steps to begin with: an eighth of the error dynamics' time, none longer than a 40th."""
    return max(40, math.ceil(duration * law.bandwidth * 8.0))


@compiled
def _rates(trees: Records, links: Records, x: Array, tau: Array, out: Array) -> None:
    """Write (R, 13 + 2 m) rates of R machines: tree (m + 1,), state and torques (m,) of each."""
    wrench = np.zeros((1, 6))
    for r in range(len(x)):
        aba((trees[r], links, True), x[r : r + 1], tau[r : r + 1], wrench, out[r : r + 1])
