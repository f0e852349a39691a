"""True rotors: bearing drag and imbalance, seen where the rotors turn freely."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..errors import ConfigurationError
from ..model.body import Body
from ..model.robot import Robot
from ..types import Array, Vector3
from .effect import Effect, Parameter, Values
from .motion import Motion

_STICTION_RATE = 0.1
"""Rate over which dry friction of a bearing changes its sign [rad/s]; wheels turn at hundreds."""


class RotorEffect(Effect):
    """An effect of one true rotor.

    A model whose wheels are locked into gyrostats does not show it.
    """

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Joints of all true rotors."""
        return tuple(rotor.joint for rotor in robot.rotors)


class BearingDrag(RotorEffect):
    """tau = -c Omega - T tanh(Omega / 0.1 rad/s)."""

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Torque against the rotor's relative rate."""
        joint = str(where)
        if joint not in motion.robot.joints:
            return motion.zeros()
        rate = motion.qd[:, motion.robot.joints.index(joint)]
        dry = values['coulomb'] * np.tanh(rate / _STICTION_RATE)
        return motion.joint_force(joint, -values['viscous'] * rate - dry)

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """Decay of the rate where the torque is steepest."""
        rotor = next(r for r in robot.rotors if r.joint == where)
        slope = values['viscous'] + values['coulomb'] / _STICTION_RATE
        return slope / rotor.axial_inertia


@dataclass(frozen=True, kw_only=True)
class RotorImbalance(RotorEffect):
    """Static: centre of mass U / m off the axis. Dynamic: product of inertia P against the axis.

    Both stand on the same side of the rotor, along the direction that `transverse` gives at zero
    angle. Nothing is linearised: the rotor is another body.
    """

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """Refuse a rotor that no body could be."""
        body = next(r.body for r in robot.rotors if r.joint == where)
        if np.linalg.eigvalsh(_unbalanced(body, values).inertia)[0] <= 0.0:
            raise ConfigurationError(
                f'{place}.dynamic',
                f'{values["dynamic"]:g} kg m^2 is more than a rotor of these moments can have',
            )

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """Another rotor body, where rotors are bodies of their own."""
        if not robot.rotor_count:
            return robot
        index = 1 + robot.joints.index(str(where))
        bodies = list(robot.bodies)
        bodies[index] = _unbalanced(bodies[index], values)
        return replace(robot, bodies=tuple(bodies))

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """The rotor's rate."""
        return abs(next(r.rate for r in robot.rotors if r.joint == where))


def transverse(axis: Vector3) -> Vector3:
    """The unit vector across a rotor's axis along which it is heavier, in the rotor's frame."""
    across = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = across - (axis @ across) * axis
    return np.asarray(across / np.linalg.norm(across))


def _unbalanced(body: Body, values: Values) -> Body:
    u = transverse(body.axis)
    product = values['dynamic'] * (np.outer(body.axis, u) + np.outer(u, body.axis))
    return replace(
        body, com=body.com + values['static'] / body.mass * u, inertia=body.inertia - product
    )


EFFECTS = (
    BearingDrag(
        id='rotor_bearing_drag',
        title='viscous and dry drag of a true rotor',
        group='wheels',
        is_fitted=False,
        parameters=(
            Parameter(
                name='viscous',
                unit='N m s/rad',
                doc='Torque against the relative rate, per rate.',
                default=0.0,
                minimum=0.0,
                size=1e-4,
                relevant=1e-6,
            ),
            Parameter(
                name='coulomb',
                unit='N m',
                doc='Torque of constant size against the relative rate.',
                default=0.0,
                minimum=0.0,
                size=1e-2,
                relevant=1e-4,
            ),
        ),
        magnitude='1e-6 to 1e-4 N m s/rad and 0.1 to 10 mN m',
        signature='a rotor that runs down, first exponentially, then evenly',
        source='Bialke, American Astronautical Society paper 98-063',
    ),
    RotorImbalance(
        id='rotor_imbalance',
        title='static and dynamic imbalance of a true rotor',
        group='wheels',
        is_fitted=False,
        parameters=(
            Parameter(
                name='static',
                unit='kg m',
                doc='Mass times distance of the centre of mass from the axis.',
                default=0.0,
                minimum=0.0,
                size=1e-4,
                relevant=1e-6,
            ),
            Parameter(
                name='dynamic',
                unit='kg m^2',
                doc='Product of inertia of axis and heavy side.',
                default=0.0,
                minimum=0.0,
                size=1e-4,
                relevant=1e-6,
            ),
        ),
        magnitude='1e-6 to 1e-4 kg m and kg m^2 (1 g cm^2 = 1e-7 kg m^2)',
        signature='force and torque that turn with the rotor, growing with the square of its rate',
        source='Masterson, Miller and Grogan, J. Sound and Vibration 249 (2002)',
    ),
)
