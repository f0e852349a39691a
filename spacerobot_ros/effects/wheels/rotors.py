"""True rotors: bearing drag and imbalance, seen where the rotors turn freely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...model.body import Body, Rotor
from ...model.robot import Robot
from ...types import Array, Vector3
from ..effect import Effect
from ..motion import Motion
from ..parameter import amount

_STICTION_RATE = 0.1
"""Rate over which dry friction of a bearing changes its sign [rad/s]; wheels turn at hundreds."""


class RotorEffect(Effect):
    """An effect of one true rotor.

    A model whose wheels are locked into gyrostats does not show it.
    """

    group = 'wheels'
    is_fitted = False

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Joints of all true rotors."""
        return tuple(rotor.joint for rotor in robot.rotors)

    def rotor(self, robot: Robot) -> Rotor:
        """The rotor."""
        return next(r for r in robot.rotors if r.joint == self.where)


class BearingDrag(RotorEffect):
    """tau = -c Omega - T tanh(Omega / 0.1 rad/s).

    Typical: 1e-6 to 1e-4 N m s/rad and 0.1 to 10 mN m.
    Signature: a rotor that runs down, first exponentially, then evenly.
    Source: Bialke, American Astronautical Society paper 98-063.

    Args:
        viscous: Torque against the relative rate, per rate.
        coulomb: Torque of constant size against the relative rate.
    """

    id = 'rotor_bearing_drag'
    title = 'viscous and dry drag of a true rotor'
    parameters = (
        amount('viscous', 'N m s/rad', 1e-4, 1e-6, default=0.0),
        amount('coulomb', 'N m', 1e-2, 1e-4, default=0.0),
    )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Torque against the rotor's relative rate."""
        if self.where not in motion.robot.joints:
            return motion.zeros()
        rate = motion.qd[:, motion.column(self.where)]
        dry = self['coulomb'] * np.tanh(rate / _STICTION_RATE)
        return motion.joint_force(self.where, -self['viscous'] * rate - dry)

    def fastest(self, robot: Robot) -> float:
        """Decay of the rate where the torque is steepest."""
        slope = self['viscous'] + self['coulomb'] / _STICTION_RATE
        return slope / self.rotor(robot).axial_inertia


class RotorImbalance(RotorEffect):
    """Static: centre of mass U / m off the axis. Dynamic: product of inertia P against the axis.

    Both stand on the same side of the rotor, along the direction that `transverse` gives at zero
    angle. Nothing is linearized: the rotor is another body.

    Typical: 1e-6 to 1e-4 kg m and kg m^2 (1 g cm^2 = 1e-7 kg m^2).
    Signature: force and torque that turn with the rotor, growing with the square of its rate.
    Source: Masterson, Miller and Grogan, J. Sound and Vibration 249 (2002).

    Args:
        static: Mass times distance of the centre of mass from the axis.
        dynamic: Product of inertia of axis and heavy side.
    """

    id = 'rotor_imbalance'
    title = 'static and dynamic imbalance of a true rotor'
    parameters = (
        amount('static', 'kg m', 1e-4, 1e-6, default=0.0),
        amount('dynamic', 'kg m^2', 1e-4, 1e-6, default=0.0),
    )

    def check(self, robot: Robot) -> None:
        """Refuse a rotor that no body could be."""
        if np.linalg.eigvalsh(self._unbalanced(self.rotor(robot).body).inertia)[0] <= 0.0:
            why = f'{self["dynamic"]:g} kg m^2 is more than a rotor of these moments can have'
            raise self.refusal(why, 'dynamic')

    def change(self, robot: Robot) -> Robot:
        """Another rotor body, where rotors are bodies of their own."""
        if not robot.rotor_count:
            return robot
        index = 1 + robot.joints.index(str(self.where))
        return robot.with_body(index, self._unbalanced(robot.bodies[index]))

    def fastest(self, robot: Robot) -> float:
        """The rotor's rate."""
        return abs(self.rotor(robot).rate)

    def _unbalanced(self, body: Body) -> Body:
        u = transverse(body.axis)
        product = self['dynamic'] * (np.outer(body.axis, u) + np.outer(u, body.axis))
        com = body.com + self['static'] / body.mass * u
        return replace(body, com=com, inertia=body.inertia - product)


def transverse(axis: Vector3) -> Vector3:
    """The unit vector across a rotor's axis along which it is heavier, in the rotor's frame."""
    across = np.eye(3)[int(np.argmin(np.abs(axis)))]
    across = across - (axis @ across) * axis
    return np.asarray(across / np.linalg.norm(across))
