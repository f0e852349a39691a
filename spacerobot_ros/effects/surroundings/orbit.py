r"""Torques and forces of what surrounds an orbit: magnetic field, air, sunlight.

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

import numpy as np

from ...dynamics.rotation import cross_rows
from ...model.robot import Robot
from ...types import Array
from ..motion import Motion
from ..parameter import Parameter, amount, searched, xyz
from .environment import AT, External, into_base

GRAVITY_OF_EARTH = 3.986004418e14
"""[m^3/s^2]"""
DIPOLE_OF_EARTH = 7.77e15
"""Magnetic field times cube of the distance on the magnetic equator [T m^3]."""
SOLAR_PRESSURE = 4.56e-6
"""On a black surface at the Earth's distance from the sun [N/m^2]."""


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
