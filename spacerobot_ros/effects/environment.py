"""Forces from outside: external torques, thrusters, gravity. They change the system's momentum."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..dynamics.rotation import cross_rows
from ..errors import ConfigurationError
from ..model.robot import Robot
from ..types import Array
from .effect import Effect, Parameter, Values, unit_axis
from .motion import Motion
from .sensors import vector, xyz

FORCE = ('force_x', 'force_y', 'force_z')
AT = ('at_x', 'at_y', 'at_z')
_RISE = 5e-3
"""Time in which a thruster's valve opens or closes [s]."""


def on_base(motion: Motion, force: Array | None, torque: Array | None) -> Array:
    """(N, 6 + n) of force and torque, (N, 3) or (3,), at the base origin in base coordinates."""
    out = motion.zeros()
    if motion.robot.is_free:
        out[:, :3] = 0.0 if force is None else force
        out[:, 3:6] = 0.0 if torque is None else torque
    return out


def into_base(motion: Motion, inertial: Array) -> Array:
    """(N, 3) base coordinates of inertial ones, (3,) or (N, 3)."""
    stacked = np.broadcast_to(inertial, (len(motion), 3))
    return np.asarray(np.einsum('nji,nj->ni', motion.rotation, stacked))


class ExternalTorqueBody(Effect):
    """A torque that is constant in the base."""

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """The torque on the base."""
        return on_base(motion, None, vector(values))


class ExternalTorqueInertial(Effect):
    """A torque that is constant in the inertial frame."""

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """R_WB^T torque on the base."""
        return on_base(motion, None, into_base(motion, vector(values)))


class ThrusterLeak(Effect):
    """A force f constant in the base, at a point r from its origin: torque r x f."""

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Force and its torque."""
        force = vector(values, FORCE)
        return on_base(motion, force, cross_rows(vector(values, AT), force))


class ThrusterPulses(Effect):
    """The force of a leak, on for `width` in every `period` from `start` on.

    The valve opens and closes along half a cosine; a pulse's impulse is exactly f * width.
    """

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """Refuse pulses that run into each other."""
        if values['width'] + _RISE > values['period']:
            raise ConfigurationError(
                f'{place}.width',
                f'{values["width"]:g} s and {_RISE:g} s to open and close do not fit into '
                f'a period of {values["period"]:g} s',
            )

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Force and its torque while the valve is open."""
        force = vector(values, FORCE)
        steady = np.concatenate([force, cross_rows(vector(values, AT), force)])
        out = on_base(motion, None, None)
        if motion.robot.is_free:
            out[:, :6] = self._opening(motion.time, values)[:, None] * steady
        return out

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """The valve's."""
        return math.pi / _RISE

    def _opening(self, time: Array, values: Values) -> Array:
        since = time - values['start']
        phase = np.where(since >= 0.0, np.mod(since, values['period']), math.inf)
        opened = np.clip(phase / _RISE, 0.0, 1.0)
        closed = np.clip((phase - values['width']) / _RISE, 0.0, 1.0)
        return np.asarray(0.5 * (np.cos(np.pi * closed) - np.cos(np.pi * opened)))


class GravityGradient(Effect):
    """The tide of a circular orbit, on every body.

    With n the orbital rate, d the unit vector along the vertical and rho a place from the system's
    centre of mass, in free fall with it,

        a = n^2 (3 d d^T - 1) rho,

    so a body of mass m, centre of mass rho and inertia J takes the force m a and the torque
    3 n^2 d x J d. The vertical stands still in the inertial frame: it turns by n per second.
    """

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """Refuse a direction without length."""
        if not vector(values).any():
            raise ConfigurationError(
                place, 'x, y, z are all zero: give the direction of the vertical'
            )

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Forces and torques on all bodies."""
        robot = motion.robot
        out = motion.zeros()
        length = float(np.linalg.norm(vector(values)))
        if not robot.is_free or length == 0.0:
            return out
        square = values['orbital_rate'] ** 2
        vertical = into_base(motion, vector(values) / length)
        centres = [
            motion.link_position(b.name)
            + np.einsum('nij,j->ni', motion.base_rotation(b.name), b.com)
            for b in robot.bodies
        ]
        masses = [b.mass for b in robot.bodies]
        middle = sum(m * c for m, c in zip(masses, centres, strict=True)) / sum(masses)
        for body, centre in zip(robot.bodies, centres, strict=True):
            rho = centre - middle
            along = np.sum(vertical * rho, axis=1, keepdims=True)
            pull = square * body.mass * (3.0 * along * vertical - rho)
            rotation = motion.base_rotation(body.name)
            force = np.einsum('nji,nj->ni', rotation, pull)
            d = np.einsum('nji,nj->ni', rotation, vertical)
            torque = 3.0 * square * cross_rows(d, d @ body.inertia)
            out += motion.wrench(body.name, force, torque, body.com)
        return out

    def canonical(self, values: Values) -> Values:
        """The vertical of unit length; the opposite one is the same."""
        return unit_axis(values)

    def variants(self, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Verticals along the axes and between them; the opposite one is the same."""
        directions = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
        directions += [(1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)]
        return tuple(
            {axis: x / math.hypot(*d) for axis, x in zip('xyz', d, strict=True)}
            for d in directions
        )


class GravityError(Effect):
    """g = g_believed + (x, y, z) in the inertial frame; a free base falls along, unaware."""

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """Another gravity."""
        return replace(robot, gravity=robot.gravity + vector(values))


def force_at(*, size: float, relevant: float) -> tuple[Parameter, ...]:
    """Six parameters: a force in base coordinates, and where it acts."""
    forces = (
        Parameter(
            name=name,
            unit='N',
            doc=f"Force along the base's {name[-1]}.",
            default=0.0,
            size=size,
            relevant=relevant,
        )
        for name in FORCE
    )
    points = (
        Parameter(
            name=name,
            unit='m',
            doc=f"Where it acts, along the base's {name[-1]} from the base origin.",
            default=0.0,
            size=1.0,
            role='search',
            grid=(-1.0, 1.0),
        )
        for name in AT
    )
    return (*forces, *points)


EFFECTS = (
    ExternalTorqueBody(
        id='external_torque_body',
        title='external torque that is constant in the base',
        group='environment',
        needs_free_base=True,
        is_external=True,
        parameters=xyz('N m', "Torque about the base's", size=1.0, relevant=1e-3),
        magnitude='1e-5 N m (pressure, magnetic) to 1 N m (venting)',
        signature='momentum that grows in a direction fixed in the base',
        source='Wertz, Spacecraft Attitude Determination and Control, 17.2',
    ),
    ExternalTorqueInertial(
        id='external_torque_inertial',
        title='external torque that is constant in the inertial frame',
        group='environment',
        needs_free_base=True,
        is_external=True,
        parameters=xyz('N m', 'Torque about the inertial', size=1.0, relevant=1e-3),
        magnitude='1e-5 to 0.1 N m',
        signature='momentum that grows evenly in a direction fixed in space',
        source='Wertz, Spacecraft Attitude Determination and Control, 17.2',
    ),
    ThrusterLeak(
        id='thruster_leak',
        title='thruster that leaks',
        group='environment',
        needs_free_base=True,
        is_external=True,
        parameters=force_at(size=1.0, relevant=1e-3),
        magnitude='1 mN to 1 N',
        signature='a torque on the base that follows the centre of mass as the arm moves',
        source='Wertz, Spacecraft Attitude Determination and Control, 17.4',
    ),
    ThrusterPulses(
        id='thruster_pulses',
        title='thruster that fires in pulses',
        group='environment',
        needs_free_base=True,
        is_external=True,
        is_timed=True,
        is_fitted=False,
        parameters=(
            *force_at(size=10.0, relevant=0.01),
            Parameter(
                name='period',
                unit='s',
                doc='Time from one pulse to the next.',
                above=0.0,
                nominal=1.0,
                role='search',
                grid=(0.1, 1.0, 10.0),
            ),
            Parameter(
                name='width',
                unit='s',
                doc='Time for which a pulse is on.',
                minimum=_RISE,
                nominal=0.02,
                role='search',
                grid=(0.02, 0.1),
            ),
            Parameter(
                name='start',
                unit='s',
                doc='When the first pulse comes.',
                default=0.0,
                minimum=0.0,
                role='search',
                grid=(0.0,),
            ),
        ),
        magnitude='1 to 20 N for 5 to 100 ms',
        signature='steps of the momentum, all alike',
        source='Wertz, Spacecraft Attitude Determination and Control, 17.4',
    ),
    GravityGradient(
        id='gravity_gradient',
        title='gravity gradient',
        group='environment',
        needs_free_base=True,
        is_external=True,
        parameters=(
            Parameter(
                name='orbital_rate',
                unit='rad/s',
                doc='Rate of the circular orbit.',
                minimum=0.0,
                maximum=0.1,
                size=2e-6,
                relevant=1e-7,
                role='square',
            ),
            *(
                Parameter(
                    name=axis,
                    unit='',
                    doc=f'Direction of the vertical in the inertial frame, {axis}.',
                    role='search',
                    grid=(-1.0, 1.0),
                )
                for axis in 'xyz'
            ),
        ),
        magnitude='1.1e-3 rad/s in low orbit: 1e-3 N m per 1000 kg m^2 of difference',
        signature='a torque that depends on how the system stands against the vertical',
        source='Hughes, Spacecraft Attitude Dynamics, 8.1',
    ),
    GravityError(
        id='gravity_error',
        title='gravity that is not as believed',
        group='environment',
        parameters=xyz('m/s^2', 'Gravity added along the inertial', size=0.2, relevant=0.01),
        magnitude='0.01 to 0.3 m/s^2: a ground test whose base does not stand level',
        signature='joint torques of a weight that acts in a wrong direction',
        source='Swevers et al., IEEE Control Systems Magazine 27 (2007)',
    ),
)
