r"""Magnetic dipole, drag and solar pressure on a simple circular orbit.

The inertial frame is that of the orbit's equator: z is the axis of the Earth, x the ascending
node. With n the orbital rate, i the inclination and u = u0 + n t the argument of latitude, the
place is r = (mu / n^2)^(1/3) with the direction

    r^ = (cos u, cos i sin u, sin i sin u),    v^ = dr^/du.

A record of some minutes can hardly tell any of these torques from one that is constant in the
inertial frame, so the diagnosis names that one.
"""

from __future__ import annotations

import math

import numpy as np

from ..dynamics.rotation import cross_rows
from ..errors import ConfigurationError
from ..model.robot import Robot
from ..types import Array
from .effect import Effect, Parameter, Values
from .environment import AT, into_base, on_base
from .motion import Motion
from .sensors import vector, xyz

GRAVITY_OF_EARTH = 3.986004418e14
"""[m^3/s^2]"""
DIPOLE_OF_EARTH = 7.77e15
"""Magnetic field times cube of the distance on the magnetic equator [T m^3]."""
SOLAR_PRESSURE = 4.56e-6
"""On a black surface at the Earth's distance from the sun [N/m^2]."""


def _place(time: Array, values: Values) -> tuple[Array, Array, float]:
    """Directions (N, 3) of place and velocity, and distance from the Earth's centre [m]."""
    rate, tilt = values['orbital_rate'], values['inclination']
    u = values['latitude_argument'] + rate * time
    lift = np.array([math.cos(tilt), math.sin(tilt)])
    out = np.stack([np.cos(u), np.sin(u) * lift[0], np.sin(u) * lift[1]], axis=1)
    ahead = np.stack([-np.sin(u), np.cos(u) * lift[0], np.cos(u) * lift[1]], axis=1)
    return out, ahead, (GRAVITY_OF_EARTH / rate**2) ** (1.0 / 3.0)


class MagneticDipole(Effect):
    """Torque m x B of a residual dipole m in the field of a dipole along the Earth's axis.

    B = (k / r^3) (z - 3 (z . r^) r^), which points north on the equator.
    """

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """The torque on the base."""
        place, _, distance = _place(motion.time, values)
        north = np.array([0.0, 0.0, 1.0])
        field = DIPOLE_OF_EARTH / distance**3 * (north - 3.0 * place[:, 2:] * place)
        return on_base(motion, None, cross_rows(vector(values), into_base(motion, field)))


class AtmosphericDrag(Effect):
    """Force -rho/2 (C A) v^2 v^ at the centre of pressure."""

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Force and its torque on the base."""
        _, ahead, distance = _place(motion.time, values)
        speed = values['orbital_rate'] * distance
        size = 0.5 * values['density'] * values['area'] * speed**2
        force = into_base(motion, -size * ahead)
        return on_base(motion, force, cross_rows(vector(values, AT), force))


class SolarPressure(Effect):
    """Force -P (C A) s away from the sun at the centre of pressure."""

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """Refuse a direction without length."""
        if not vector(values).any():
            raise ConfigurationError(place, 'x, y, z are all zero: give the direction of the sun')

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Force and its torque on the base."""
        sun = vector(values)
        length = float(np.linalg.norm(sun)) or 1.0
        force = into_base(motion, -SOLAR_PRESSURE * values['area'] * sun / length)
        return on_base(motion, force, cross_rows(vector(values, AT), force))


def _number(name: str, unit: str, doc: str, nominal: float, **bounds: float) -> Parameter:
    return Parameter(
        name=name,
        unit=unit,
        doc=doc,
        nominal=nominal,
        default=nominal,
        role='search',
        grid=(nominal,),
        **bounds,
    )


_ORBIT = (
    _number('orbital_rate', 'rad/s', 'Rate of the circular orbit.', 1.1e-3, above=0.0),
    _number('inclination', 'rad', 'Inclination of the orbit.', 0.9),
    _number('latitude_argument', 'rad', 'Argument of latitude at the start.', 0.0),
)
_AREA = Parameter(
    name='area',
    unit='m^2',
    doc='Area that is exposed times its coefficient.',
    minimum=0.0,
    size=20.0,
    relevant=1.0,
)
_PRESSURE_POINT = tuple(
    _number(name, 'm', f"Centre of pressure along the base's {name[-1]}.", 0.0) for name in AT
)

EFFECTS = (
    MagneticDipole(
        id='magnetic_dipole',
        title="residual magnetic dipole in the Earth's field",
        group='environment',
        needs_free_base=True,
        is_external=True,
        is_timed=True,
        is_fitted=False,
        parameters=(
            *xyz('A m^2', "Dipole along the base's", size=10.0, relevant=1.0),
            *_ORBIT,
        ),
        magnitude='0.1 to 10 A m^2 in 3e-5 T: below 3e-4 N m',
        signature='a torque across the field, twice an orbit',
        source='Wertz, Spacecraft Attitude Determination and Control, 17.2.4 and appendix H',
    ),
    AtmosphericDrag(
        id='atmospheric_drag',
        title='drag of the atmosphere',
        group='environment',
        needs_free_base=True,
        is_external=True,
        is_timed=True,
        is_fitted=False,
        parameters=(
            _AREA,
            _number('density', 'kg/m^3', 'Density of the air.', 3e-12, minimum=0.0),
            *_PRESSURE_POINT,
            *_ORBIT,
        ),
        magnitude='3e-12 kg/m^3 at 400 km: 1e-3 N on 10 m^2',
        signature='a force against the flight, and its torque',
        source='Wertz, Spacecraft Attitude Determination and Control, 17.2.3',
    ),
    SolarPressure(
        id='solar_pressure',
        title='pressure of sunlight',
        group='environment',
        needs_free_base=True,
        is_external=True,
        is_fitted=False,
        parameters=(
            _AREA,
            *_PRESSURE_POINT,
            *(
                _number(axis, '', f'Direction to the sun in the inertial frame, {axis}.', nominal)
                for axis, nominal in zip('xyz', (1.0, 0.0, 0.0), strict=True)
            ),
        ),
        magnitude='1e-4 N on 20 m^2',
        signature='a force away from the sun, and its torque',
        source='Wertz, Spacecraft Attitude Determination and Control, 17.2.2',
    ),
)
