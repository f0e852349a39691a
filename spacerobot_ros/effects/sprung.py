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
from functools import partial

import numpy as np

from ..dynamics.rotation import cross_rows, skew
from ..errors import ConfigurationError
from ..model.robot import Robot
from ..types import Array
from .bodies import MovingBodyEffect, body_index, with_addition
from .effect import Parameter, Values, unit_axis
from .hidden import driven_states
from .motion import Motion
from .mounting import (
    FIRST_DAMPING,
    FREQUENCIES,
    damping_parameter,
    fall,
    frequency_parameter,
    link_mobility,
    recoil,
    spring,
    to_base,
)

_LIGHT = 1e-3  # of the whole's mass: what a part may have whose recoil does not matter


class SprungPart(MovingBodyEffect):
    """A part of a body on springs of one frequency in all its directions."""

    def directions(self, values: Values) -> Array:
        """(6, k) orthonormal directions S, [linear; angular] in the host's frame."""
        raise NotImplementedError

    def inertia(self, host: Array, values: Values, is_left: bool) -> Array:
        """(6, 6) spatial inertia G.

        Args:
            host: (10,) inertial parameters of the host.
            values: Parameters.
            is_left: Whether the part has been taken out of them.
        """
        raise NotImplementedError

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """The host without the part."""
        part = self.inertia(_row(robot, where), values, False)
        return with_addition(robot, where, -_parameters_of(part), self.id)

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """The part is not more than its host."""
        part = self.inertia(_row(robot, where), values, False)
        with_addition(robot, where, -_parameters_of(part), place)

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Spring, and the turning of the part's momentum with the host."""
        return motion.wrench(str(where), *self._load(motion, where, values, hidden))

    def _load(
        self, motion: Motion, where: str | None, values: Values, hidden: Array
    ) -> tuple[Array, Array]:
        """(N, 3) force and (N, 3) torque on the host, in its frame."""
        S, V = self.directions(values), motion.twist(str(where))
        G = self.inertia(_row(motion.robot, where), values, True)
        pull = spring(values, hidden, S.shape[1]) @ (G @ S).T
        h = self._momentum(V, S, G, hidden)
        turning = cross_rows(V[:, 3:], h[:, 3:]) + cross_rows(V[:, :3], h[:, :3])
        return pull[:, :3] - cross_rows(V[:, 3:], h[:, :3]), pull[:, 3:] - turning

    def hidden_rate(
        self, motion: Motion, where: str | None, values: Values, hidden: Array
    ) -> Array:
        """[eta', eta'']."""
        S = self.directions(values)
        size = S.shape[1]
        drive = motion.link_acceleration(str(where))
        drive = np.concatenate([drive[:, :3] - fall(motion, where), drive[:, 3:]], axis=1)
        return np.concatenate(
            [hidden[:, size:], -drive @ S - spring(values, hidden, size)], axis=1
        )

    def driven(self, motion: Motion, where: str | None, values: Values) -> Array:
        """Each direction is an oscillator of its own, unless the whole recoils from the part."""
        size = self.hidden // 2
        if motion.coasts and self._share(motion.robot, where, values) > _LIGHT:
            return driven_states(
                partial(self._recoiling, motion, where, values), motion.time, self.hidden
            )
        drives = self.hidden_rate(motion, where, values, np.zeros((len(motion), self.hidden)))
        states = [
            driven_states(partial(_oscillator, values, drive), motion.time, 2)
            for drive in drives[:, size:].T
        ]
        return np.concatenate([s[:, i, None] for i in (0, 1) for s in states], axis=1)

    def _recoiling(
        self, motion: Motion, where: str | None, values: Values, hidden: Array
    ) -> Array:
        """`hidden_rate` with the recoil that the motion does not hold."""
        S = self.directions(values)
        out = self.hidden_rate(motion, where, values, hidden)
        force, _ = self._load(motion, where, values, hidden)
        out[:, S.shape[1] :] -= recoil(motion, force) @ S[:3]
        return out

    def _share(self, robot: Robot, where: str | None, values: Values) -> float:
        """Mass that moves against the host, by that of all else."""
        part = self.inertia(_row(robot, where), values, True)
        moved = np.linalg.norm(part[:3] @ self.directions(values))
        return float(moved / np.sum(robot.inertial_parameters[:, 0]))

    def momentum(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """The part's, its rigid share included."""
        S, V = self.directions(values), motion.twist(str(where))
        G = self.inertia(_row(motion.robot, where), values, True)
        return to_base(motion, where, self._momentum(V, S, G, hidden))

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Of the part on its spring against the recoiling robot."""
        S = self.directions(values)
        G = S.T @ self.inertia(_row(robot, where), values, True) @ S
        recoil = np.linalg.eigvals(G @ S.T @ link_mobility(robot, where) @ S).real.max()
        return float(max(1.0, values['damping']) * values['frequency'] * np.sqrt(1.0 + recoil))

    def _momentum(self, V: Array, S: Array, G: Array, hidden: Array) -> Array:
        return np.asarray((V + hidden[:, S.shape[1] :] @ S.T) @ G.T)


class Appendage(SprungPart):
    """A first bending mode: inertia about an axis of the host, G = I [0; a] [0; a]^T."""

    def directions(self, values: Values) -> Array:
        """Turning about the axis."""
        axis = np.array([values['x'], values['y'], values['z']])
        return np.concatenate([np.zeros(3), axis / np.linalg.norm(axis)])[:, None]

    def inertia(self, host: Array, values: Values, is_left: bool) -> Array:
        """About the axis alone."""
        S = self.directions(values)
        return np.asarray(values['inertia'] * S @ S.T)

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """The axis has a direction, and the host that much inertia."""
        if not any(values[name] for name in 'xyz'):
            raise ConfigurationError(f'{place}.x', 'the axis x, y, z has no direction: all zero')
        super().check(robot, where, values, place)

    def canonical(self, values: Values) -> Values:
        """The axis of unit length."""
        return unit_axis(values)

    def variants(self, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Every frequency about every axis of the host's frame."""
        return tuple(
            {'frequency': frequency, 'damping': FIRST_DAMPING, 'x': x, 'y': y, 'z': z}
            for frequency, (x, y, z) in itertools.product(FREQUENCIES, np.eye(3).tolist())
        )


class GraspCompliance(SprungPart):
    """A share of a body that gives way to the grasp in all six directions, G = share G_host."""

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Bodies at the end of an arm."""
        parents = {body.parent for body in robot.bodies}
        return tuple(p for p in super().places(robot) if body_index(robot, p) not in parents | {0})

    def directions(self, values: Values) -> Array:
        """All."""
        return np.eye(6)

    def inertia(self, host: Array, values: Values, is_left: bool) -> Array:
        """In proportion to the host's."""
        share = values['share'] / (1.0 - values['share'] if is_left else 1.0)
        return share * _spatial(host)


def _oscillator(values: Values, drive: Array, own: Array) -> Array:
    """(N, 2) [eta', eta''] of one direction under its drive (N,)."""
    return np.column_stack([own[:, 1], drive - spring(values, own, 1)[:, 0]])


def _row(robot: Robot, where: str | None) -> Array:
    return np.asarray(robot.inertial_parameters[body_index(robot, where)])


def _spatial(row: Array) -> Array:
    """(6, 6) spatial inertia [linear; angular] of inertial parameters."""
    m, h = row[0], skew(row[1:4])
    xx, xy, yy, xz, yz, zz = row[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return np.block([[m * np.eye(3), -h], [h, inertia]])


def _parameters_of(G: Array) -> Array:
    """(10,) inertial parameters of a spatial inertia."""
    lower = G[3:, 3:]
    moment = np.array([G[5, 1], G[3, 2], G[4, 0]])
    second = lower[0, 0], lower[0, 1], lower[1, 1], lower[0, 2], lower[1, 2], lower[2, 2]
    return np.concatenate([[G[0, 0]], moment, second])


def _axis(name: str) -> Parameter:
    return Parameter(
        name=name,
        unit='',
        doc=f"Axis along {name} of the body's frame; x, y, z of any length.",
        size=1.0,
        role='search',
    )


EFFECTS = (
    Appendage(
        id='flexible_appendage',
        title='a flexible panel or boom on a body',
        group='bodies',
        hidden=2,
        parameters=(
            Parameter(
                name='inertia',
                unit='kg m^2',
                doc="What of the body's inertia about the axis takes part.",
                minimum=0.0,
                size=50.0,
                relevant=0.05,
            ),
            frequency_parameter('Natural frequency, the body held.'),
            damping_parameter(0.005),
            *(_axis(name) for name in 'xyz'),
        ),
        magnitude='0.5 to 10 rad/s, damping 0.002 to 0.02, 10 to 100 kg m^2 for solar panels',
        signature='a decaying oscillation of the body after every change of its rotation',
        source='Likins, AIAA J. 5 (1967); Hughes, Spacecraft Attitude Dynamics (1986), 3.6',
    ),
    GraspCompliance(
        id='grasp_compliance',
        title='a captured body that gives way in the grasp',
        group='bodies',
        hidden=12,
        parameters=(
            Parameter(
                name='share',
                unit='',
                doc="What of the last body's inertia is beyond the grasp.",
                minimum=0.0,
                maximum=0.99,
                size=0.5,
                relevant=0.02,
            ),
            frequency_parameter('Natural frequency in every direction, the arm held.'),
            damping_parameter(0.02),
        ),
        magnitude='3 to 60 rad/s, damping 0.01 to 0.1, 50 to 99 % of the last body with its load',
        signature='oscillation of the last joints and the base after every change of the motion',
        source='Likins, AIAA J. 5 (1967)',
    ),
)
