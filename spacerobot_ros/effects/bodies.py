"""Bodies that differ from the file's: a payload, missing fuel, a wrong inertia."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from ..errors import ConfigurationError
from ..model.robot import Robot
from ..types import Array
from .effect import Effect, Parameter, Values

NAMES = ('mass', 'mx', 'my', 'mz', 'ixx', 'ixy', 'iyy', 'ixz', 'iyz', 'izz')
"""In Pinocchio's order: mass, first moment, inertia about the origin of the body's frame."""
_ROUNDING = 1e-9  # of a body's own inertia, by which it may seem to be below zero
_RELEVANT = 5e-4  # of a body's own parameters: a change worth a name
_LEAST_SHARE = 1e-3  # of the robot's mass
_LEAST_RADIUS = 1e-2  # m


class BodyEffect(Effect):
    """An effect at a body of the arm or at the base; wheels' rotors are none."""

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Every body."""
        return tuple(b.name for b in robot.bodies[: len(robot.bodies) - robot.rotor_count])


class MovingBodyEffect(BodyEffect):
    """An effect of a body's motion; a fixed base has none."""

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Every body that moves."""
        return super().places(robot)[0 if robot.is_free else 1 :]


class InertialParameters(MovingBodyEffect):
    """Additions to a body's inertial parameters."""

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """The robot with the body's parameters increased."""
        return with_addition(robot, where, np.array([values[name] for name in NAMES]), self.id)

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """What is left is a body."""
        with_addition(robot, where, np.array([values[name] for name in NAMES]), place)

    def parameters_at(self, robot: Robot, where: str | None) -> tuple[Parameter, ...]:
        """As uncertain as the robot file says, in proportion to the body itself."""
        scales = _scales(robot, where)
        return tuple(
            replace(p, size=robot.inertia_uncertainty * scale, relevant=_RELEVANT * scale)
            for p, scale in zip(self.parameters, scales, strict=True)
        )


def body_index(robot: Robot, where: str | None) -> int:
    """Number of a body."""
    return [body.name for body in robot.bodies].index(str(where))


def with_addition(robot: Robot, where: str | None, addition: Array, place: str) -> Robot:
    """The robot with inertial parameters added to one body.

    Args:
        robot: The robot.
        where: Name of the body.
        addition: (10,) in the order of `NAMES`.
        place: For the message.

    Raises:
        ConfigurationError: the mass or the inertia would not be positive.
    """
    parameters = robot.inertial_parameters.copy()
    row = parameters[body_index(robot, where)]
    before = _central_inertia(row)
    row += addition
    mass = float(row[0])
    if mass < 0.0 or (mass == 0.0 and row.any()):
        raise ConfigurationError(place, f'leaves {where} with a mass of {mass:g} kg')
    least, largest = float(np.linalg.eigvalsh(_central_inertia(row))[0]), float(np.trace(before))
    if least < -_ROUNDING * largest:
        raise ConfigurationError(
            place, f'leaves {where} with a moment of inertia of {least:.4g} kg m^2'
        )
    return robot.with_inertial_parameters(parameters)


def _scales(robot: Robot, where: str | None) -> Array:
    """(10,) magnitudes of a body's parameters; a light one is taken for a part of the whole."""
    whole = float(np.sum(robot.inertial_parameters[:, 0]))
    row = robot.inertial_parameters[body_index(robot, where)]
    mass = max(float(row[0]), _LEAST_SHARE * whole)
    second = float(row[4] + row[6] + row[9])
    radius = max(float(np.sqrt(second / mass)), _LEAST_RADIUS)
    return np.array([mass, *[mass * radius] * 3, *[mass * radius**2] * 6])


def _central_inertia(row: Array) -> Array:
    """(3, 3) about the centre of mass."""
    if row[0] <= 0.0:
        return np.zeros((3, 3))
    return np.asarray(pin.Inertia.FromDynamicParameters(row).inertia)


def _parameters() -> tuple[Parameter, ...]:
    mass = Parameter(
        name='mass', unit='kg', doc='Added mass.', default=0.0, size=20.0, relevant=0.05
    )
    first = tuple(
        Parameter(
            name=name,
            unit='kg m',
            doc=f"Added mass times its position along {name[1]} of the body's frame.",
            default=0.0,
            size=20.0,
            relevant=0.02,
        )
        for name in NAMES[1:4]
    )
    second = tuple(
        Parameter(
            name=name,
            unit='kg m^2',
            doc=f"Added inertia {name[1:]} about the origin of the body's frame.",
            default=0.0,
            size=20.0,
            relevant=0.05,
        )
        for name in NAMES[4:]
    )
    return (mass, *first, *second)


EFFECTS = (
    InertialParameters(
        id='inertial_parameters',
        title='a body of other mass, centre of mass or inertia than the file says',
        group='bodies',
        parameters=_parameters(),
        magnitude='1 to 10 % of the body; a payload or used fuel: any',
        signature="torque residuals that follow the body's acceleration and, on ground, its angle",
        source='Atkeson, An and Hollerbach, Int. J. Robotics Research 5 (1986)',
    ),
)
