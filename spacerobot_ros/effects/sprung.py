r"""Parts that a spring holds to a body: a solar panel, a captured body in a soft grasp.

The part is a share of what the file says of its host, so that the file's robot is the limit of a
stiff spring: `change` takes it out, `force` brings back what it does. With V = [v; w] and A the
velocity and acceleration of the host's frame, in that frame, S the directions in which the part
gives way, eta by how much, and G = G S S^T its spatial inertia,

    eta'' = -S^T A - 2 zeta omega eta' - omega^2 eta
    h     = G (V + S eta')                                      momentum of the part
    f     = G S (2 zeta omega eta' + omega^2 eta) - V x* h      on the host

These are Lagrange's equations of T = 1/2 (V + S eta')^T G (V + S eta') for small eta, and the
momentum of host and part together is kept exactly. Gravity is an acceleration -g of the frame.
"""

from __future__ import annotations

import itertools
from functools import cached_property

import numpy as np

from ..dynamics.rotation import cross_rows, skew
from ..model.robot import Robot
from ..types import Array
from .effect import Effect
from .hidden import driven_states
from .motion import Motion, body_index
from .mounting import FIRST_DAMPING, FREQUENCIES, Sprung, recoil, spring_parameters
from .parameter import amount, searched

_LIGHT = 1e-3  # of the whole's mass: what a part may have whose recoil does not matter


class SprungPart(Sprung):
    """A rigid part on springs."""

    @cached_property
    def directions(self) -> Array:
        """(6, k) orthonormal directions S, [linear; angular] in the host's frame."""
        raise NotImplementedError

    def inertia(self, host: Array, is_left: bool) -> Array:
        """(6, 6) spatial inertia G.

        Args:
            host: (10,) inertial parameters of the host.
            is_left: Whether the part has been taken out of them.
        """
        raise NotImplementedError

    def change(self, robot: Robot) -> Robot:
        """The host without the part."""
        part = self.inertia(self.row(robot), False)
        return self.with_addition(robot, -_parameters_of(part))

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Spring, and the turning of the part's momentum with the host."""
        return motion.wrench(self.where, *self._wrench(motion, hidden))

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """[eta', eta'']."""
        S = self.directions
        drive = motion.link_acceleration(self.where)
        drive = np.concatenate([drive[:, :3] - self.gravity(motion), drive[:, 3:]], axis=1)
        return np.concatenate([hidden[:, S.shape[1] :], -drive @ S - self.spring(hidden)], axis=1)

    def driven(self, motion: Motion) -> Array:
        """Each direction is an oscillator of its own, unless the whole recoils from the part."""
        size = self.hidden // 2
        if motion.coasts and self._share(motion.robot) > _LIGHT:
            return driven_states(
                lambda own: self._recoiling(motion, own), motion.time, self.hidden
            )
        drives = self.hidden_rate(motion, np.zeros((len(motion), self.hidden)))

        def states(drive: Array) -> Array:
            return driven_states(
                lambda own: np.column_stack([own[:, 1], drive - self.spring(own)[:, 0]]),
                motion.time,
                2,
            )

        return np.stack([states(drive) for drive in drives[:, size:].T], axis=2).reshape(
            len(motion), self.hidden
        )

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """The part's, its rigid share included."""
        return self.to_base(motion, self._part_momentum(motion, hidden))

    def fastest(self, robot: Robot) -> float:
        """Of the part on its spring against the recoiling robot."""
        S = self.directions
        return self.fastest_against(robot, S, S.T @ self.inertia(self.row(robot), True) @ S)

    def _wrench(self, motion: Motion, hidden: Array) -> tuple[Array, Array]:
        """(N, 3) force and (N, 3) torque on the host, in its frame."""
        S, V = self.directions, motion.twist(self.where)
        pull = self.spring(hidden) @ (self.inertia(self.row(motion.robot), True) @ S).T
        h = self._part_momentum(motion, hidden)
        turning = cross_rows(V[:, 3:], h[:, 3:]) + cross_rows(V[:, :3], h[:, :3])
        return pull[:, :3] - cross_rows(V[:, 3:], h[:, :3]), pull[:, 3:] - turning

    def _part_momentum(self, motion: Motion, hidden: Array) -> Array:
        """(N, 6) in the host's frame."""
        S, G = self.directions, self.inertia(self.row(motion.robot), True)
        return np.asarray((motion.twist(self.where) + hidden[:, S.shape[1] :] @ S.T) @ G.T)

    def _recoiling(self, motion: Motion, hidden: Array) -> Array:
        """`hidden_rate` with the recoil that the motion does not hold."""
        S, out = self.directions, self.hidden_rate(motion, hidden)
        force, _ = self._wrench(motion, hidden)
        out[:, S.shape[1] :] -= recoil(motion, force) @ S[:3]
        return out

    def _share(self, robot: Robot) -> float:
        """Mass that moves against the host, by that of all else."""
        moved = np.linalg.norm(self.inertia(self.row(robot), True)[:3] @ self.directions)
        return float(moved / np.sum(robot.inertial_parameters[:, 0]))


class Appendage(SprungPart):
    """A first bending mode: inertia about an axis of the host, G = I [0; a] [0; a]^T.

    Args:
        inertia: What of the body's inertia about the axis takes part.
        x, y, z: Axis in the body's frame, of any length.
    """

    id = 'flexible_appendage'
    title = 'a flexible panel or boom on a body'
    hidden = 2
    parameters = (
        amount('inertia', 'kg m^2', 50.0, 0.05),
        *spring_parameters(0.005),
        *(searched(axis, '', 1.0) for axis in 'xyz'),
    )
    magnitude = '0.5 to 10 rad/s, damping 0.002 to 0.02, 10 to 100 kg m^2 for solar panels'
    signature = 'a decaying oscillation of the body after every change of its rotation'
    source = 'Likins, AIAA J. 5 (1967); Hughes, Spacecraft Attitude Dynamics (1986), 3.6'

    @cached_property
    def directions(self) -> Array:
        """Turning about the axis."""
        axis = self.vector()
        return np.concatenate([np.zeros(3), axis / np.linalg.norm(axis)])[:, None]

    def inertia(self, host: Array, is_left: bool) -> Array:
        """About the axis alone."""
        S = self.directions
        return np.asarray(self['inertia'] * S @ S.T)

    def check(self, robot: Robot) -> None:
        """The axis has a direction, and the host that much inertia."""
        if not self.vector().any():
            raise self.refusal('the axis x, y, z has no direction: all zero', 'x')
        super().check(robot)

    def canonical(self) -> Effect:
        """The axis of unit length."""
        return self.with_unit_axis()

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Every frequency about every axis of the host's frame."""
        return tuple(
            {'frequency': frequency, 'damping': FIRST_DAMPING, 'x': x, 'y': y, 'z': z}
            for frequency, (x, y, z) in itertools.product(FREQUENCIES, np.eye(3).tolist())
        )


class GraspCompliance(SprungPart):
    """A share of a body that gives way to the grasp in all six directions, G = share G_host.

    Args:
        share: What of the last body's inertia is beyond the grasp.
    """

    id = 'grasp_compliance'
    title = 'a captured body that gives way in the grasp'
    hidden = 12
    parameters = (amount('share', '', 0.5, 0.02, maximum=0.99), *spring_parameters(0.02))
    magnitude = '3 to 60 rad/s, damping 0.01 to 0.1, 50 to 99 % of the last body with its load'
    signature = 'oscillation of the last joints and the base after every change of the motion'
    source = 'Likins, AIAA J. 5 (1967)'

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Bodies at the end of an arm."""
        inner = {0, *(body.parent for body in robot.bodies)}
        return tuple(p for p in super().places(robot) if body_index(robot, p) not in inner)

    @cached_property
    def directions(self) -> Array:
        """All."""
        return np.eye(6)

    def inertia(self, host: Array, is_left: bool) -> Array:
        """In proportion to the host's."""
        share = self['share'] / (1.0 - self['share'] if is_left else 1.0)
        return share * _spatial(host)


def _spatial(row: Array) -> Array:
    """(6, 6) spatial inertia [linear; angular] of inertial parameters."""
    m, h = row[0], skew(row[1:4])
    xx, xy, yy, xz, yz, zz = row[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.block([[m * np.eye(3), -h], [h, inertia]])


def _parameters_of(G: Array) -> Array:
    """(10,) inertial parameters of a spatial inertia."""
    return G[[0, 5, 3, 4, 3, 3, 4, 3, 4, 5], [0, 1, 2, 0, 3, 4, 4, 5, 5, 5]]


EFFECTS = (Appendage, GraspCompliance)
