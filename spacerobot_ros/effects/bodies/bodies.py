"""Bodies that differ from the file's: a payload, missing fuel, a wrong inertia."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...dynamics.random_body import deformed, random_solid
from ...model.rigid_body import Solid
from ...model.robot import Robot
from ...types import Array
from ..effect import Effect
from ..motion import body_index
from ..parameter import Parameter
from ..prior import NOTHING, Prior, Scale

_MOMENTS = ('mx', 'my', 'mz')
_INERTIAS = ('ixx', 'ixy', 'iyy', 'ixz', 'iyz', 'izz')
NAMES = ('mass', *_MOMENTS, *_INERTIAS)
"""In Pinocchio's order: mass, first moment, inertia about the origin of the body's frame."""
_ROUNDING = 1e-9  # of a body's own inertia, by which it may seem to be below zero
_RELEVANT = 5e-4  # of a body's own parameters: a change worth a name
_LEAST_SHARE = 1e-3  # of the robot's mass
_LEAST_RADIUS = 1e-2  # m
_WRONG, _LOAD = 0.5, 0.1
"""Of a body's mass, what one that is wrong is off by; of the mass of all that moves, a load."""
_SHORT, _REACH = 0.2, 0.3
"""Of the longest distance between joints: a body is as large at least; where a load may be."""


class MovingBodyEffect(Effect):
    """An effect of the motion of a body of the arm or of a free base; wheels' rotors are none."""

    group = 'bodies'

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every body that moves."""
        names = tuple(b.name for b in robot.bodies[: len(robot.bodies) - robot.rotor_count])
        return names[0 if robot.is_free else 1 :]

    def row(self, robot: Robot) -> Array:
        """(10,) inertial parameters of the body."""
        return robot.bodies[body_index(robot, self.where)].solid.row

    def with_addition(self, robot: Robot, addition: Array) -> Robot:
        """The robot with inertial parameters (10,), in the order of `NAMES`, added to the body.

        Raises:
            ConfigurationError: the mass or the inertia would not be positive.
        """
        index = body_index(robot, self.where)
        largest = float(np.trace(robot.bodies[index].inertia))
        row = self.row(robot) + addition
        mass = float(row[0])
        if mass < 0.0 or (mass == 0.0 and row.any()):
            raise self.refusal(f'leaves {self.where} with a mass of {mass:g} kg')
        left = Solid.of_row(row)
        least = float(np.linalg.eigvalsh(left.inertia)[0])
        if least < -_ROUNDING * largest:
            why = f'leaves {self.where} with a moment of inertia of {least:.4g} kg m^2'
            raise self.refusal(why)
        return robot.with_body(index, robot.bodies[index].with_solid(left))


class InertialParameters(MovingBodyEffect):
    """Additions to a body's inertial parameters.

    Typical: 1 to 10 % of the body; a payload or used fuel: any.
    Signature: torque residuals that follow the body's acceleration and, on ground, its angle.
    Source: Atkeson, An and Hollerbach, Int. J. Robotics Research 5 (1986).

    Args:
        mass: Added mass.
        mx, my, mz: Added mass times its position in the body's frame.
        ixx, ixy, iyy, ixz, iyz, izz: Added inertia about the origin of the body's frame.
    """

    id = 'inertial_parameters'
    title = 'a body of other mass, centre of mass or inertia than the file says'
    parameters = (
        Parameter('mass', 'kg', 20.0, 0.05, default=0.0),
        *(Parameter(name, 'kg m', 20.0, 0.02, default=0.0) for name in _MOMENTS),
        *(Parameter(name, 'kg m^2', 20.0, 0.05, default=0.0) for name in _INERTIAS),
    )

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """A solid put there or lost, and another density; as the file is uncertain."""
        body = scale.body
        if body is None:
            return None
        mass = max(float(body.row[0]), _LEAST_SHARE * body.whole)
        centre = body.row[1:4] / mass
        gyration = math.sqrt(max(float(body.row[4] + body.row[6] + body.row[9]), 0.0) / mass)
        arm = max(float(np.linalg.norm(centre)), gyration, _SHORT * body.length)
        heavy, extent = _WRONG * mass, arm / math.sqrt(3.0)
        if body.is_last and not body.is_lone:
            heavy, extent = max(_LOAD * body.whole, heavy), max(_REACH * body.length, extent)
        spread = extent**2 * np.eye(3)
        if body.is_lone:  # elsewhere than along its centre is the zero of its encoder
            along = centre / max(float(np.linalg.norm(centre)), NOTHING * arm)
            spread = extent**2 * np.outer(along, along) + (NOTHING * arm) ** 2 * np.eye(3)
        slab = random_solid(heavy, centre, spread, extent)
        slab += _WRONG**2 * np.outer(body.row, body.row)
        own = body.uncertainty
        spike = np.zeros(10) if own is None else deformed(body.row, own)
        return Prior(slab, spike, -1.0)

    def change(self, robot: Robot) -> Robot:
        """The robot with the body's parameters increased."""
        return self.with_addition(robot, self.vector(*NAMES))

    @classmethod
    def parameters_at(cls, robot: Robot, where: str | None) -> tuple[Parameter, ...]:
        """As uncertain as the robot file says, in proportion to the body itself.

        A body without joints shows no mass, and where no momentum of its wheels is known, only the
        ratios of its inertia, which are given with ixx as the file has it. Known forces on it show
        all but the mass, and that where its position is measured.
        """
        scales = _scales(robot, where)
        inputs = robot.inputs
        is_spun = robot.servicer_momentum.any() or (inputs is not None and inputs.wheels)
        observable: tuple[str, ...] = _INERTIAS if is_spun else _INERTIAS[1:]
        if inputs is not None and (inputs.commands or inputs.wrench):
            observable = NAMES if inputs.is_located else NAMES[1:]
        return tuple(
            replace(p, size=robot.inertia_uncertainty * scale, relevant=_RELEVANT * scale)
            for p, scale in zip(cls.parameters, scales, strict=True)
            if robot.joints or p.name in observable
        )


def _scales(robot: Robot, where: str | None) -> Array:
    """(10,) magnitudes of a body's parameters; a light one is taken for a part of the whole."""
    whole = float(np.sum(robot.inertial_parameters[:, 0]))
    row = robot.inertial_parameters[body_index(robot, where)]
    mass = max(float(row[0]), _LEAST_SHARE * whole)
    second = float(row[4] + row[6] + row[9])
    radius = max(float(np.sqrt(second / mass)), _LEAST_RADIUS)
    return np.array([mass, *[mass * radius] * 3, *[mass * radius**2] * 6])
