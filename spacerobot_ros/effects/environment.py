r"""Forces from outside, which change the system's momentum: torques, thrusters, gravity, an orbit.

Magnetic dipole, drag and solar pressure act on a simple circular orbit. The inertial frame is that
of the orbit's equator: z is the axis of the Earth, x the ascending node. With n the orbital rate,
i the inclination and u = u0 + n t the argument of latitude, the place is r = (mu / n^2)^(1/3) with
the direction

    r^ = (cos u, cos i sin u, sin i sin u),    v^ = dr^/du.

A record of some minutes can hardly tell any of these torques from one that is constant in the
inertial frame, so the diagnosis names that one.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ..dynamics.rotation import cross_rows
from ..model.robot import Robot
from ..types import Array
from .effect import Effect
from .motion import Motion
from .parameter import Parameter, amount, searched, xyz

FORCE = ('force_x', 'force_y', 'force_z')
AT = ('at_x', 'at_y', 'at_z')
_RISE = 5e-3
"""Time in which a thruster's valve opens or closes [s]."""
GRAVITY_OF_EARTH = 3.986004418e14
"""[m^3/s^2]"""
DIPOLE_OF_EARTH = 7.77e15
"""Magnetic field times cube of the distance on the magnetic equator [T m^3]."""
SOLAR_PRESSURE = 4.56e-6
"""On a black surface at the Earth's distance from the sun [N/m^2]."""


class External(Effect):
    """A force or torque from outside on a free base."""

    group = 'environment'
    needs_free_base = True
    is_external = True

    def on_base(self, motion: Motion, torque: Array, force: Array | None = None) -> Array:
        """(N, 6 + n) of force and torque, (N, 3) or (3,), at the base origin in base frame."""
        out = motion.zeros()
        if motion.robot.is_free:
            out[:, :3] = 0.0 if force is None else force
            out[:, 3:6] = torque
        return out

    def force_at(self, motion: Motion, force: Array) -> Array:
        """(N, 6 + n) of a force, (N, 3) or (3,), that acts at the place of the effect's values."""
        return self.on_base(motion, cross_rows(self.vector(*AT), force), force)

    def check_direction(self, of: str) -> None:
        """Refuse x, y, z without length."""
        if not self.vector().any():
            raise self.refusal(f'x, y, z are all zero: give the direction of {of}')


def into_base(motion: Motion, inertial: Array) -> Array:
    """(N, 3) base coordinates of inertial ones, (3,) or (N, 3)."""
    stacked = np.broadcast_to(inertial, (len(motion), 3))
    return np.asarray(np.einsum('nji,nj->ni', motion.rotation, stacked))


class ExternalTorqueBody(External):
    """A torque that is constant in the base.

    Typical: 1e-5 N m (pressure, magnetic) to 1 N m (venting).
    Signature: momentum that grows in a direction fixed in the base.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.

    Args:
        x, y, z: Torque about the base's axes.
    """

    id = 'external_torque_body'
    title = 'external torque that is constant in the base'
    parameters = xyz('N m', 1.0, 1e-3)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on the base."""
        return self.on_base(motion, self.vector())


class ExternalTorqueInertial(External):
    """A torque that is constant in the inertial frame.

    Typical: 1e-5 to 0.1 N m.
    Signature: momentum that grows evenly in a direction fixed in space.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.

    Args:
        x, y, z: Torque about the inertial axes.
    """

    id = 'external_torque_inertial'
    title = 'external torque that is constant in the inertial frame'
    parameters = xyz('N m', 1.0, 1e-3)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """R_WB^T torque on the base."""
        return self.on_base(motion, into_base(motion, self.vector()))


class RotationalDrag(External):
    """A torque on the base against its rate: m = -c w.

    Typical: 1e-3 to 0.1 N m s/rad on air bearings and in water; far less in orbit.
    Signature: momentum that decays with the rate, about every axis alike.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.

    Args:
        coefficient: Torque per rate.
    """

    id = 'rotational_drag'
    title = 'drag against the rate of the base'
    parameters = (amount('coefficient', 'N m s/rad', 1.0, 1e-3),)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on the base."""
        return self.on_base(motion, -self['coefficient'] * motion.omega)


class Thruster(External):
    """A force f in base coordinates at a point r from the base origin: torque r x f.

    Source: Wertz, Spacecraft Attitude Determination and Control, 17.4.

    Args:
        force_x, force_y, force_z: Force along the base's axes.
        at_x, at_y, at_z: Where it acts, along the base's axes from the base origin.
    """

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Force and its torque."""
        return self.force_at(motion, self.vector(*FORCE))


_AT = tuple(searched(name, 'm', 1.0, default=0.0, guesses=(-1.0, 1.0)) for name in AT)


class ThrusterLeak(Thruster):
    """A force that is constant in the base.

    Typical: 1 mN to 1 N.
    Signature: a torque on the base that follows the centre of mass as the arm moves.
    """

    id = 'thruster_leak'
    title = 'thruster that leaks'
    parameters = (*xyz('N', 1.0, 1e-3, 'force_'), *_AT)


class ThrusterPulses(Thruster):
    """The force of a leak, on for `width` in every `period` from `start` on.

    The valve opens and closes along half a cosine; a pulse's impulse is exactly f * width.

    Typical: 1 to 20 N for 5 to 100 ms.
    Signature: steps of the momentum, all alike.

    Args:
        period: Time from one pulse to the next.
        width: Time for which a pulse is on.
        start: When the first pulse comes.
    """

    id = 'thruster_pulses'
    title = 'thruster that fires in pulses'
    is_timed = True
    is_fitted = False
    parameters = (
        *xyz('N', 10.0, 0.01, 'force_'),
        *_AT,
        searched('period', 's', above=0.0, nominal=1.0, guesses=(0.1, 1.0, 10.0)),
        searched('width', 's', minimum=_RISE, nominal=0.02, guesses=(0.02, 0.1)),
        searched('start', 's', default=0.0, minimum=0.0, guesses=(0.0,)),
    )

    def check(self, robot: Robot) -> None:
        """Refuse pulses that run into each other."""
        if self['width'] + _RISE > self['period']:
            raise self.refusal(
                f'{self["width"]:g} s and {_RISE:g} s to open and close do not fit into '
                f'a period of {self["period"]:g} s',
                'width',
            )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Force and its torque while the valve is open."""
        return self._opening(motion.time)[:, None] * super().force(motion, hidden)

    def fastest(self, robot: Robot) -> float:
        """The valve's."""
        return math.pi / _RISE

    def _opening(self, time: Array) -> Array:
        since = time - self['start']
        phase = np.where(since >= 0.0, np.mod(since, self['period']), math.inf)
        opened = np.clip(phase / _RISE, 0.0, 1.0)
        closed = np.clip((phase - self['width']) / _RISE, 0.0, 1.0)
        return np.asarray(0.5 * (np.cos(np.pi * closed) - np.cos(np.pi * opened)))


class GravityGradient(External):
    """The tide of a circular orbit, on every body.

    With n the orbital rate, d the unit vector along the vertical and rho a place from the system's
    centre of mass, in free fall with it,

        a = n^2 (3 d d^T - 1) rho,

    so a body of mass m, centre of mass rho and inertia J takes the force m a and the torque
    3 n^2 d x J d. The vertical stands still in the inertial frame: it turns by n per second.

    Typical: 1.1e-3 rad/s in low orbit: 1e-3 N m per 1000 kg m^2 of difference.
    Signature: a torque that depends on how the system stands against the vertical.
    Source: Hughes, Spacecraft Attitude Dynamics, 8.1.

    Args:
        orbital_rate: Rate of the circular orbit.
        x, y, z: Direction of the vertical in the inertial frame, of any length.
    """

    id = 'gravity_gradient'
    title = 'gravity gradient'
    parameters = (
        amount('orbital_rate', 'rad/s', 2e-6, 1e-7, maximum=0.1, role='square'),
        *(searched(axis, '', guesses=(-1.0, 1.0)) for axis in 'xyz'),
    )

    def check(self, robot: Robot) -> None:
        """Refuse a direction without length."""
        self.check_direction('the vertical')

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Forces and torques on all bodies."""
        robot, out = motion.robot, motion.zeros()
        length = float(np.linalg.norm(self.vector()))
        if not robot.is_free or length == 0.0:
            return out
        square = self['orbital_rate'] ** 2
        vertical = into_base(motion, self.vector() / length)
        coms = [
            motion.link_position(b.name)
            + np.einsum('nij,j->ni', motion.base_rotation(b.name), b.com)
            for b in robot.bodies
        ]
        masses = [b.mass for b in robot.bodies]
        middle = sum(m * c for m, c in zip(masses, coms, strict=True)) / sum(masses)
        for body, com in zip(robot.bodies, coms, strict=True):
            rho = com - middle
            along = np.sum(vertical * rho, axis=1, keepdims=True)
            pull = square * body.mass * (3.0 * along * vertical - rho)
            rotation = motion.base_rotation(body.name)
            d = np.einsum('nji,nj->ni', rotation, vertical)
            torque = 3.0 * square * cross_rows(d, d @ body.inertia)
            force = np.einsum('nji,nj->ni', rotation, pull)
            out += motion.wrench(body.name, force, torque, body.com)
        return out

    def canonical(self) -> Effect:
        """The vertical of unit length; the opposite one is the same."""
        return self.with_unit_axis()

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Verticals along the axes and between them; the opposite one is the same."""
        directions = [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
        directions += [(1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)]
        return tuple(
            {axis: x / math.hypot(*d) for axis, x in zip('xyz', d, strict=True)}
            for d in directions
        )


class GravityError(Effect):
    """g = g_believed + (x, y, z) in the inertial frame; a free base falls along, unaware.

    Typical: 0.01 to 0.3 m/s^2: a ground test whose base does not stand level.
    Signature: joint torques of a weight that acts in a wrong direction.
    Source: Swevers et al., IEEE Control Systems Magazine 27 (2007).

    Args:
        x, y, z: Gravity added along the inertial axes.
    """

    id = 'gravity_error'
    title = 'gravity that is not as believed'
    group = 'environment'
    parameters = xyz('m/s^2', 0.2, 0.01)

    def change(self, robot: Robot) -> Robot:
        """Another gravity."""
        return replace(robot, gravity=robot.gravity + self.vector())


def _known(name: str, unit: str, value: float, **bounds: float) -> Parameter:
    """A parameter that the fit leaves at its usual value."""
    return searched(name, unit, nominal=value, default=value, guesses=(value,), **bounds)


_ORBIT = (
    _known('orbital_rate', 'rad/s', 1.1e-3, above=0.0),
    _known('inclination', 'rad', 0.9),
    _known('latitude_argument', 'rad', 0.0),
)
_AREA = amount('area', 'm^2', 20.0, 1.0)
_PRESSURE_CENTRE = tuple(_known(name, 'm', 0.0) for name in AT)


class Orbital(External):
    """A force or torque of what surrounds the orbit.

    Args:
        orbital_rate: Rate of the circular orbit.
        inclination: Inclination of the orbit.
        latitude_argument: Argument of latitude at the start.
    """

    is_timed = True
    is_fitted = False

    def orbit(self, time: Array) -> tuple[Array, Array, float]:
        """Directions (N, 3) of place and velocity, and distance from the Earth's centre [m]."""
        u = self['latitude_argument'] + self['orbital_rate'] * time
        up = np.array([math.cos(self['inclination']), math.sin(self['inclination'])])
        out = np.stack([np.cos(u), np.sin(u) * up[0], np.sin(u) * up[1]], axis=1)
        ahead = np.stack([-np.sin(u), np.cos(u) * up[0], np.cos(u) * up[1]], axis=1)
        return out, ahead, (GRAVITY_OF_EARTH / self['orbital_rate'] ** 2) ** (1.0 / 3.0)


class MagneticDipole(Orbital):
    """Torque m x B of a residual dipole m in the field of a dipole along the Earth's axis.

    B = (k / r^3) (z - 3 (z . r^) r^), which points north on the equator.

    Typical: 0.1 to 10 A m^2 in 3e-5 T: below 3e-4 N m.
    Signature: a torque across the field, twice an orbit.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.4 and appendix H.

    Args:
        x, y, z: Dipole along the base's axes.
    """

    id = 'magnetic_dipole'
    title = "residual magnetic dipole in the Earth's field"
    parameters = (*xyz('A m^2', 10.0, 1.0), *_ORBIT)

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on the base."""
        place, _, distance = self.orbit(motion.time)
        north = np.array([0.0, 0.0, 1.0])
        field = DIPOLE_OF_EARTH / distance**3 * (north - 3.0 * place[:, 2:] * place)
        return self.on_base(motion, cross_rows(self.vector(), into_base(motion, field)))


class AtmosphericDrag(Orbital):
    """Force -rho/2 (C A) v^2 v^ at the centre of pressure.

    Typical: 3e-12 kg/m^3 at 400 km: 1e-3 N on 10 m^2.
    Signature: a force against the flight, and its torque.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.3.

    Args:
        area: Area that is exposed times its coefficient.
        density: Density of the air.
        at_x, at_y, at_z: Centre of pressure along the base's axes.
    """

    id = 'atmospheric_drag'
    title = 'drag of the atmosphere'
    parameters = (
        _AREA,
        _known('density', 'kg/m^3', 3e-12, minimum=0.0),
        *_PRESSURE_CENTRE,
        *_ORBIT,
    )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Force and its torque on the base."""
        _, ahead, distance = self.orbit(motion.time)
        speed = self['orbital_rate'] * distance
        size = 0.5 * self['density'] * self['area'] * speed**2
        return self.force_at(motion, into_base(motion, -size * ahead))


class SolarPressure(External):
    """Force -P (C A) s away from the sun at the centre of pressure.

    Typical: 1e-4 N on 20 m^2.
    Signature: a force away from the sun, and its torque.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.2.2.

    Args:
        area: Area that is exposed times its coefficient.
        at_x, at_y, at_z: Centre of pressure along the base's axes.
        x, y, z: Direction to the sun in the inertial frame, of any length.
    """

    id = 'solar_pressure'
    title = 'pressure of sunlight'
    is_fitted = False
    parameters = (
        _AREA,
        *_PRESSURE_CENTRE,
        *(_known(axis, '', nominal) for axis, nominal in {'x': 1.0, 'y': 0.0, 'z': 0.0}.items()),
    )

    def check(self, robot: Robot) -> None:
        """Refuse a direction without length."""
        self.check_direction('the sun')

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Force and its torque on the base."""
        sun = self.vector()
        sun /= float(np.linalg.norm(sun)) or 1.0
        return self.force_at(motion, into_base(motion, -SOLAR_PRESSURE * self['area'] * sun))
