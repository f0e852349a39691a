"""What parts on springs share: their mounting on a body, frequency and damping."""

from __future__ import annotations

import numpy as np

from ..dynamics.rotation import cross_rows
from ..model.robot import Robot
from ..types import Array
from .bodies import MovingBodyEffect
from .motion import Motion, inverse_mass
from .parameter import Parameter, searched

FREQUENCIES = tuple(0.5 * 1.8**k for k in range(8))
"""First guesses of a frequency [rad/s]: 0.5 to 31, as sampled motions of arms can show."""
FIRST_DAMPING = 0.05
"""First guess of a damping ratio: a broad resonance, seen from the next guess of a frequency."""


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

    def fastest_against(self, robot: Robot, S: Array, G: Array) -> float:
        """Of a part on its spring against the recoiling robot.

        Args:
            robot: The robot without the part.
            S: (6, k) its directions.
            G: (k, k) its inertia along them.
        """
        still, unit = np.zeros((6, robot.n_joints)), np.eye(6)
        motion = Motion(robot, np.zeros(6), still, still, still)
        J = S.T @ motion.wrench(self.where, unit[:, :3], unit[:, 3:])
        ratio = np.linalg.eigvals(G @ J @ inverse_mass(robot) @ J.T).real.max()
        return float(max(1.0, self['damping']) * self['frequency'] * np.sqrt(1.0 + ratio))


def recoil(motion: Motion, force: Array) -> Array:
    """(N, 3) by which the whole accelerates under a force (N, 3) [N], in the force's frame.

    Zero where the motion's accelerations hold it already.
    """
    if not motion.coasts:
        return np.zeros_like(force)
    return np.asarray(force / np.sum(motion.robot.inertial_parameters[:, 0]))


def spring_parameters(damping: float) -> tuple[Parameter, Parameter]:
    """Frequency and damping of a part on its spring."""
    zeta = {'nominal': damping, 'default': damping, 'minimum': 0.0, 'maximum': 10.0}
    return (
        searched(
            'frequency', 'rad/s', 10.0, nominal=1.0, above=0.0, maximum=1e4, guesses=FREQUENCIES
        ),
        searched('damping', '', 0.1, guesses=(FIRST_DAMPING,), **zeta),
    )
