r"""Parts that a spring holds to a body: a captured body in a soft grasp, fuel in its tank.

The part is a share of what the file says of its host, so that the file's robot is the limit of a
stiff spring: `change` takes it out, `force` brings back what it does. With V = [v; w] and A the
velocity and acceleration of the host's frame, in that frame, eta (6,) by how much a body has given
way, and G its spatial inertia,

    eta'' = -A - 2 zeta omega eta' - omega^2 eta
    h     = G (V + eta')                                        momentum of the part
    f     = G (2 zeta omega eta' + omega^2 eta) - V x* h        on the host

These are Lagrange's equations of T = 1/2 (V + eta')^T G (V + eta') for small eta, and the
momentum of host and part together is kept exactly. Gravity is an acceleration -g of the frame.

Fuel that moves in its tank is a point mass on springs in three directions. With P = p + s its
place in the host's frame, a the acceleration of that frame's origin and g gravity there,

    s'' = g - a - alpha x P - w x (w x P) - 2 w x s' - 2 zeta omega s' - omega^2 s
    F   = m (omega^2 s + 2 zeta omega s')       on the host, at P

(Dodge, The New Dynamic Behavior of Liquids in Moving Containers (2000), 3). The mass is part of
what the file says of its host.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..dynamics.equations import spatial_inertias
from ..dynamics.rotation import cross_rows, skew
from ..model.robot import Robot
from ..types import Array
from .bodies import MovingBodyEffect
from .hidden import driven_states
from .motion import Motion, body_index, inverse_mass
from .parameter import Parameter, amount, searched

FREQUENCIES = tuple(0.5 * 1.8**k for k in range(8))
"""First guesses of a frequency [rad/s]: 0.5 to 31, as sampled motions of arms can show."""
FIRST_DAMPING = 0.05
"""First guess of a damping ratio: a broad resonance, seen from the next guess of a frequency."""
_LIGHT = 1e-3  # of the whole's mass: what a part may have whose recoil does not matter


def spring_parameters(damping: float) -> tuple[Parameter, Parameter]:
    """Frequency and damping of a part on its spring."""
    zeta = {'nominal': damping, 'default': damping, 'minimum': 0.0, 'maximum': 10.0}
    return (
        searched(
            'frequency', 'rad/s', 10.0, nominal=1.0, above=0.0, maximum=1e4, guesses=FREQUENCIES
        ),
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

    @cached_property
    def directions(self) -> Array:
        """(6, k) directions S of the springs, [linear; angular] in the host's frame."""
        raise NotImplementedError

    def moved(self, robot: Robot) -> Array:
        """(k, k) inertia along the directions, of the robot without the part."""
        raise NotImplementedError

    def pull(self, motion: Motion, hidden: Array) -> Array:
        """(N, 3) force on the host, in its frame [N]."""
        raise NotImplementedError

    def fastest(self, robot: Robot) -> float:
        """Of the part on its spring against the recoiling robot."""
        still, unit, S = np.zeros((6, robot.n_joints)), np.eye(6), self.directions
        motion = Motion(robot, np.zeros(6), still, still, still)
        J = S.T @ motion.wrench(self.where, unit[:, :3], unit[:, 3:])
        ratio = np.linalg.eigvals(self.moved(robot) @ J @ inverse_mass(robot) @ J.T).real.max()
        return float(max(1.0, self['damping']) * self['frequency'] * np.sqrt(1.0 + ratio))

    def driven(self, motion: Motion) -> Array:
        """Along a given motion, with the recoil that such a motion does not hold."""
        size = self.hidden // 2

        def rate(own: Array) -> Array:
            out = self.hidden_rate(motion, own)
            if motion.coasts:
                mass = np.sum(motion.robot.inertial_parameters[:, 0])
                out[:, size:] -= self.pull(motion, own) / mass @ self.directions[:3]
            return out

        return driven_states(rate, motion.time, self.hidden)


class GraspCompliance(Sprung):
    """A share of a body that gives way to the grasp in all six directions, G = share G_host.

    Typical: 3 to 60 rad/s, damping 0.01 to 0.1, 50 to 99 % of the last body with its load.
    Signature: oscillation of the last joints and the base after every change of the motion.
    Source: Likins, AIAA J. 5 (1967).

    Args:
        share: What of the last body's inertia is beyond the grasp.
    """

    id = 'grasp_compliance'
    title = 'a captured body that gives way in the grasp'
    hidden = 12
    parameters = (amount('share', '', 0.5, 0.02, maximum=0.99), *spring_parameters(0.02))

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Bodies at the end of an arm."""
        inner = {0, *(body.parent for body in robot.bodies)}
        return tuple(p for p in super().places(robot) if body_index(robot, p) not in inner)

    @cached_property
    def directions(self) -> Array:
        """All."""
        return np.eye(6)

    def change(self, robot: Robot) -> Robot:
        """The host without the part."""
        return self.with_addition(robot, -self['share'] * self.row(robot))

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Spring, and the turning of the part's momentum with the host."""
        return motion.wrench(self.where, *self._wrench(motion, hidden))

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """[eta', eta'']."""
        drive = motion.link_acceleration(self.where) + self.spring(hidden)
        drive[:, :3] -= self.gravity(motion)
        return np.concatenate([hidden[:, 6:], -drive], axis=1)

    def driven(self, motion: Motion) -> Array:
        """Each direction is an oscillator of its own, unless the whole recoils from the part."""
        share = np.linalg.norm(self.moved(motion.robot)[:3])
        if motion.coasts and share > _LIGHT * np.sum(motion.robot.inertial_parameters[:, 0]):
            return super().driven(motion)
        drives = self.hidden_rate(motion, np.zeros((len(motion), self.hidden)))
        states = [self.swing(drive, motion.time) for drive in drives[:, 6:].T]
        return np.stack(states, axis=2).reshape(len(motion), self.hidden)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """The part's, its rigid share included."""
        return self.to_base(motion, self._part_momentum(motion, hidden))

    def moved(self, robot: Robot) -> Array:
        """(6, 6) spatial inertia G."""
        share = self['share'] / (1.0 - self['share'])
        return np.asarray(share * spatial_inertias(self.row(robot)[None])[0])

    def pull(self, motion: Motion, hidden: Array) -> Array:
        """Of the springs, and of the turning momentum."""
        return self._wrench(motion, hidden)[0]

    def _wrench(self, motion: Motion, hidden: Array) -> tuple[Array, Array]:
        """(N, 3) force and (N, 3) torque on the host, in its frame."""
        V, h = motion.twist(self.where), self._part_momentum(motion, hidden)
        pull = self.spring(hidden) @ self.moved(motion.robot)
        turning = cross_rows(V[:, 3:], h[:, 3:]) + cross_rows(V[:, :3], h[:, :3])
        return pull[:, :3] - cross_rows(V[:, 3:], h[:, :3]), pull[:, 3:] - turning

    def _part_momentum(self, motion: Motion, hidden: Array) -> Array:
        """(N, 6) in the host's frame."""
        return np.asarray((motion.twist(self.where) + hidden[:, 6:]) @ self.moved(motion.robot))


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
        V, A = motion.twist(self.where), motion.link_acceleration(self.where)
        w, rate = V[:, 3:], hidden[:, 3:]
        place = self.vector() + hidden[:, :3]
        frame = A[:, :3] + cross_rows(w, V[:, :3]) - self.gravity(motion)
        frame = (
            frame + cross_rows(A[:, 3:], place) + cross_rows(w, cross_rows(w, place) + 2.0 * rate)
        )
        return np.concatenate([rate, -frame - self.spring(hidden)], axis=1)

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

    @cached_property
    def directions(self) -> Array:
        """Along the axes of the host's frame."""
        return np.vstack([np.eye(3), skew(self.vector())])

    def moved(self, robot: Robot) -> Array:
        """The mass."""
        return np.asarray(self['mass'] * np.eye(3))

    def pull(self, motion: Motion, hidden: Array) -> Array:
        """Of the springs."""
        return np.asarray(self['mass'] * self.spring(hidden))
