r"""A captured body that gives way in the grasp: a rigid body on springs about where it should be.

The part is a share of what the file says of the last body: mass m at the centre of mass c, inertia
I about it, at rest in the host's frame. It moves by s there, and turns by Q with the Rodrigues
vector r = 2 tan(angle / 2) axis, at the rate Omega in the host's frame (Shuster, J. Astronautical
Sciences 41 (1993), eq. 338):

    r' = B Omega = Omega - r x Omega / 2 + r (r . Omega) / 4

The springs have the energy omega^2 / 2 (m s^2 + r . I r), which is 1/2 eta . G eta omega^2 of the
part's spatial inertia G for small displacements eta. With P = c + s, J = Q I Q^T, W = w + Omega,
the part obeys Newton's and Euler's equations,

    F = m (omega^2 s + 2 zeta omega s') = -m (a + alpha x P + w x (w x P) + 2 w x s' + s'' - g)
    T = B^T I (omega^2 r + 2 zeta omega r') = -J (alpha + Omega' + w x Omega) - W x J W

and F at P and T act on the host: a, alpha, w are acceleration of its frame's origin, angular
acceleration and rate. Nothing is small and no velocity enters but rates, so all frames that move
on evenly see the same, and momentum is kept exactly.
"""

from __future__ import annotations

import numpy as np

from ...dynamics.rotation import cross_rows, skew
from ...model.robot import Robot
from ...types import Array, Matrix3, Vector3
from ..motion import Motion, body_index
from ..own_states import driven_states
from ..parameter import amount
from .sprung import Sprung, spring_parameters

_FREQUENCIES = tuple(3.0 * 1.8**k for k in range(5))
"""First guesses [rad/s]: 3 to 31; a softer grasp is left behind by the motions of an arm."""
_NEAR = 1e-6  # of own states: where the rate is differentiated; rounding is then 1e-10
_PASSES = 3  # of Newton's method
_SETTLED = 1e-2  # rad and m; the square of the last change is left
_FARTHEST = 1.0  # rad and m; a grasp that gives way by more holds nothing


class GraspCompliance(Sprung):
    """A share of the last body that gives way to the grasp in all six directions.

    Typical: 3 to 60 rad/s, damping 0.01 to 0.1, 50 to 99 % of the last body with its load.
    Signature: oscillation of the last joints and the base after every change of the motion.
    Source: Likins, AIAA J. 5 (1967).

    Args:
        share: What of the last body's inertia is beyond the grasp.
    """

    id = 'grasp_compliance'
    title = 'a captured body that gives way in the grasp'
    hidden = 12
    parameters = (
        amount('share', '', 0.5, 0.02, maximum=0.99),
        *spring_parameters(0.02, _FREQUENCIES),
    )

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Bodies at the end of an arm."""
        return tuple(p for p in super().places(robot) if p in robot.last_links)

    def change(self, robot: Robot) -> Robot:
        """The host without the part."""
        return self.with_addition(robot, -self['share'] * self.row(robot))

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The springs on the host."""
        place = self._centre(motion.robot) + hidden[:, :3]
        twist = self._twist(motion.robot, hidden)
        return motion.wrench(self.where, self.pull(motion, hidden), twist, place)

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """[s', r', s'', Omega']."""
        r, rate, Omega = hidden[:, 3:6], hidden[:, 6:9], hidden[:, 9:]
        place = self._centre(motion.robot) + hidden[:, :3]
        bent = -self.felt(motion, place, rate) - self.spring(hidden)[:, :3]
        inertia, w = self._inertia(motion.robot), motion.twist(self.where)[:, 3:]
        W = w + Omega
        torque = -self._twist(motion.robot, hidden) - cross_rows(W, _turned(inertia, r, W))
        # directions in which the body has no inertia have no torque, either
        turning = _turned(np.asarray(np.linalg.pinv(inertia), dtype=float), r, torque)
        turning -= motion.link_acceleration(self.where)[:, 3:] + cross_rows(w, Omega)
        return np.concatenate([rate, _rodrigues_rate(r, Omega), bent, turning], axis=1)

    def driven(self, motion: Motion) -> Array:
        """Along a given motion, the whole recoiling; Newton's method on the whole trajectory.

        What would give way by more than `_FARTHEST` is left behind: no spring holds it.
        """
        states = np.zeros((len(motion), self.hidden))
        for _ in range(_PASSES):
            before, states = states, self._nearby(motion, states)
            if not np.max(np.abs(states[:, :6]), initial=0.0) < _FARTHEST:
                return np.zeros_like(states)
            if np.max(np.abs(states - before)[:, :6], initial=0.0) < _SETTLED:
                break
        return states

    def _nearby(self, motion: Motion, states: Array) -> Array:
        """(N, 12) along a motion, by the equations linearized about some states."""
        along = self.rate_along(motion, states)

        def rate(own: Array) -> Array:
            moved = self.rate_along(motion, states + _NEAR * (own - states))
            return np.asarray(along + (moved - along) / _NEAR)

        return driven_states(rate, motion.time, self.hidden)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """The part's, its rigid share included."""
        V, place = motion.twist(self.where), self._centre(motion.robot) + hidden[:, :3]
        mass, W = self._mass(motion.robot), V[:, 3:] + hidden[:, 9:]
        linear = mass * (V[:, :3] + cross_rows(V[:, 3:], place) + hidden[:, 6:9])
        spin = _turned(self._inertia(motion.robot), hidden[:, 3:6], W)
        angular = cross_rows(place, linear) + spin
        return self.to_base(motion, np.concatenate([linear, angular], axis=1))

    def directions(self, robot: Robot) -> Array:
        """Forces at the centre of mass, and couples."""
        out = np.eye(6)
        out[3:, :3] = skew(self._centre(robot))
        return out

    def moved(self, robot: Robot) -> Array:
        """Mass and inertia about the centre of mass."""
        out = self._mass(robot) * np.eye(6)
        out[3:, 3:] = self._inertia(robot)
        return out

    def pull(self, motion: Motion, hidden: Array) -> Array:
        """Of the springs."""
        return np.asarray(self._mass(motion.robot) * self.spring(hidden)[:, :3])

    @property
    def _by_host(self) -> float:
        """Inertia of the part by that of the body without it."""
        return self['share'] / (1.0 - self['share'])

    def _mass(self, robot: Robot) -> float:
        return self._by_host * float(self.row(robot)[0])

    def _centre(self, robot: Robot) -> Vector3:
        return np.asarray(robot.bodies[body_index(robot, self.where)].com)

    def _inertia(self, robot: Robot) -> Matrix3:
        return self._by_host * robot.bodies[body_index(robot, self.where)].inertia

    def _twist(self, robot: Robot, hidden: Array) -> Array:
        """(N, 3) torque T of the springs on the host."""
        r, Omega = hidden[:, 3:6], hidden[:, 9:]
        omega, damping = self['frequency'], self['damping']
        by_rate = 2.0 * damping * omega * _rodrigues_rate(r, Omega)
        return _rodrigues_rate(-r, (omega**2 * r + by_rate) @ self._inertia(robot))


def _rodrigues_rate(r: Array, Omega: Array) -> Array:
    """(N, 3) B Omega of Rodrigues vectors r; B^T is that of -r."""
    along = np.einsum('ni,ni->n', r, Omega)[:, None]
    return np.asarray(Omega - 0.5 * cross_rows(r, Omega) + 0.25 * along * r)


def _turned(tensor: Matrix3, r: Array, v: Array) -> Array:
    """(N, 3) Q T Q^T v of a symmetric tensor T that is turned by Rodrigues vectors r."""
    return _rotated(r, _rotated(-r, v) @ tensor)


def _rotated(r: Array, v: Array) -> Array:
    """(N, 3) Q v: Cayley's formula."""
    once = cross_rows(r, v)
    scale = 1.0 + 0.25 * np.einsum('ni,ni->n', r, r)
    return np.asarray(v + (once + 0.5 * cross_rows(r, once)) / scale[:, None])
