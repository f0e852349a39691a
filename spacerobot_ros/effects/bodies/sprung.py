r"""Parts that a spring holds to a body: fuel in its tank; a soft grasp is in `grasp.py`.

The part is a share of what the file says of its host, so that the file's robot is the limit of a
stiff spring: `change` takes it out, `force` brings back what it does.

Fuel that moves in its tank is a point mass on springs in three directions. With P = p + s its
place in the host's frame, a the acceleration of that frame's origin and g gravity there,

    s'' = g - a - alpha x P - w x (w x P) - 2 w x s' - 2 zeta omega s' - omega^2 s
    F   = m (omega^2 s + 2 zeta omega s')       on the host, at P

(Dodge, The New Dynamic Behavior of Liquids in Moving Containers (2000), 3). The mass is part of
what the file says of its host. Only accelerations and turning rates of the host enter, so that
all of it is the same in every frame that moves on evenly.
"""

from __future__ import annotations

import numpy as np

from ...dynamics.rotation import cross_rows, skew
from ...model.robot import Robot
from ...types import Array
from ..motion import Motion, body_index, inverse_mass
from ..own_states import driven_states
from ..parameter import Parameter, amount, searched
from .bodies import MovingBodyEffect

FREQUENCIES = tuple(0.5 * 1.8**k for k in range(8))
"""First guesses of a frequency [rad/s]: 0.5 to 31, as sampled motions of arms can show."""
FIRST_DAMPING = 0.05
"""First guess of a damping ratio: a broad resonance, seen from the next guess of a frequency."""


def spring_parameters(
    damping: float, guesses: tuple[float, ...] = FREQUENCIES
) -> tuple[Parameter, Parameter]:
    """Frequency and damping of a part on its spring."""
    zeta = {'nominal': damping, 'default': damping, 'minimum': 0.0, 'maximum': 10.0}
    return (
        searched('frequency', 'rad/s', 10.0, nominal=1.0, above=0.0, maximum=1e4, guesses=guesses),
        searched('damping', '', 0.1, guesses=(FIRST_DAMPING,), **zeta),
    )


class Sprung(MovingBodyEffect):
    """A part of a body on springs of one frequency in k directions, which are its 2 k states.

    Args:
        frequency: Natural frequency in every direction, the host held.
        damping: Damping as a share of the critical one.
    """

    def spring(self, hidden: Array) -> Array:
        """(N, k) 2 zeta omega eta' + omega^2 eta."""
        size = hidden.shape[1] // 2
        omega, damping = self['frequency'], self['damping']
        return omega**2 * hidden[:, :size] + 2.0 * damping * omega * hidden[:, size:]

    def gravity(self, motion: Motion) -> Array:
        """(N, 3) gravity in the body's frame [m/s^2]."""
        gravity = motion.robot.gravity
        if not np.any(gravity):
            return np.zeros((len(motion), 3))
        return np.einsum('nji,j->ni', motion.link_rotation(self.where), gravity)

    def to_base(self, motion: Motion, momentum: Array) -> Array:
        """(N, 6) momentum about the base origin, in its axes, of one in the body's frame."""
        R, r = motion.base_rotation(self.where), motion.link_position(self.where)
        linear = np.einsum('nij,nj->ni', R, momentum[:, :3])
        angular = np.einsum('nij,nj->ni', R, momentum[:, 3:]) + cross_rows(r, linear)
        return np.concatenate([linear, angular], axis=1)

    def swing(self, drive: Array, time: Array) -> Array:
        """(N, 2) one direction and its rate, from rest, under an acceleration (N,) of its own."""
        return driven_states(
            lambda own: np.column_stack([own[:, 1], drive - self.spring(own)[:, 0]]), time, 2
        )

    def directions(self, robot: Robot) -> Array:
        """(6, k) wrenches [force; torque] of unit springs, in the host's frame."""
        raise NotImplementedError

    def moved(self, robot: Robot) -> Array:
        """(k, k) inertia along the directions, of the robot without the part."""
        raise NotImplementedError

    def pull(self, motion: Motion, hidden: Array) -> Array:
        """(N, 3) force on the host, in its frame [N]."""
        raise NotImplementedError

    def fastest(self, robot: Robot) -> float:
        """Of the part on its spring against the recoiling robot."""
        still, unit, S = np.zeros((6, robot.n_joints)), np.eye(6), self.directions(robot)
        motion = Motion(robot, np.zeros(6), still, still, still)
        J = S.T @ motion.wrench(self.where, unit[:, :3], unit[:, 3:])
        ratio = np.linalg.eigvals(self.moved(robot) @ J @ inverse_mass(robot) @ J.T).real.max()
        return float(max(1.0, self['damping']) * self['frequency'] * np.sqrt(1.0 + ratio))

    def felt(self, motion: Motion, place: Array, rate: Array) -> Array:
        """(N, 3) acceleration, less gravity, of what moves evenly in the host's frame.

        Args:
            motion: N states; `motion.acceleration` is known.
            place: (N, 3) in the host's frame [m].
            rate: (N, 3) of it [m/s].
        """
        V, A = motion.twist(self.where), motion.link_acceleration(self.where)
        w = V[:, 3:]
        origin = A[:, :3] + cross_rows(w, V[:, :3]) - self.gravity(motion)
        turning = cross_rows(w, cross_rows(w, place) + 2.0 * rate)
        return np.asarray(origin + cross_rows(A[:, 3:], place) + turning)

    def rate_along(self, motion: Motion, hidden: Array) -> Array:
        """(N, 2 k) `hidden_rate` with the recoil that a motion that coasts does not hold."""
        out = self.hidden_rate(motion, hidden)
        if motion.coasts:
            mass = np.sum(motion.robot.inertial_parameters[:, 0])
            recoil = self.pull(motion, hidden) / mass @ self.directions(motion.robot)[:3]
            out[:, self.hidden // 2 :] -= recoil
        return out

    def driven(self, motion: Motion) -> Array:
        """Along a given motion, the whole recoiling."""
        return driven_states(lambda own: self.rate_along(motion, own), motion.time, self.hidden)


class Slosh(Sprung):
    """A sprung point mass.

    Typical: 10 to 200 kg, 0.3 to 5 rad/s, damping 0.005 to 0.1, for tanks with diaphragms.
    Signature: a slow oscillation after every change of the body's velocity or rotation.
    Source: Dodge, The New Dynamic Behavior of Liquids in Moving Containers (2000), 3.

    Args:
        mass: What of the body's mass takes part.
        x, y, z: Place at rest in the body's frame.
    """

    id = 'fuel_slosh'
    title = 'fuel that sloshes in a tank of a body'
    hidden = 6
    parameters = (
        amount('mass', 'kg', 100.0, 0.1),
        *spring_parameters(0.02),
        *(searched(axis, 'm', 1.0, default=0.0) for axis in 'xyz'),
    )

    def change(self, robot: Robot) -> Robot:
        """The host without the mass."""
        m, (x, y, z) = self['mass'], self.vector()
        second = y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y
        return self.with_addition(robot, -m * np.array([1.0, x, y, z, *second]))

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The springs on the host."""
        place = self.vector() + hidden[:, :3]
        return motion.wrench(self.where, self.pull(motion, hidden), None, place)

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """[s', s'']."""
        place, rate = self.vector() + hidden[:, :3], hidden[:, 3:]
        bent = -self.felt(motion, place, rate) - self.spring(hidden)
        return np.concatenate([rate, bent], axis=1)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """Of the mass."""
        V, place = motion.twist(self.where), self.vector() + hidden[:, :3]
        linear = self['mass'] * (V[:, :3] + cross_rows(V[:, 3:], place) + hidden[:, 3:])
        return self.to_base(motion, np.concatenate([linear, cross_rows(place, linear)], axis=1))

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Every frequency, at the host's centre of mass."""
        x, y, z = robot.bodies[body_index(robot, where)].com.tolist()
        return tuple(
            {'frequency': frequency, 'damping': FIRST_DAMPING, 'x': x, 'y': y, 'z': z}
            for frequency in FREQUENCIES
        )

    def directions(self, robot: Robot) -> Array:
        """Along the axes of the host's frame."""
        return np.vstack([np.eye(3), skew(self.vector())])

    def moved(self, robot: Robot) -> Array:
        """The mass."""
        return np.asarray(self['mass'] * np.eye(3))

    def pull(self, motion: Motion, hidden: Array) -> Array:
        """Of the springs."""
        return np.asarray(self['mass'] * self.spring(hidden))
