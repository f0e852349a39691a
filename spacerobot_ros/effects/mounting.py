"""What parts on springs share: their mounting on a body, frequency and damping."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..dynamics.rotation import cross_rows
from ..model.robot import Robot
from ..types import Array
from .bodies import body_index
from .effect import Parameter, Values
from .motion import Motion

FREQUENCIES = tuple(0.5 * 1.8**k for k in range(8))
"""First guesses of a frequency [rad/s]: 0.5 to 31, as sampled motions of arms can show."""
FIRST_DAMPING = 0.05
"""First guess of a damping ratio: a broad resonance, seen from the next guess of a frequency."""


def fall(motion: Motion, where: str | None) -> Array:
    """(N, 3) gravity in a body's frame [m/s^2]."""
    gravity = motion.robot.gravity
    if not np.any(gravity):
        return np.zeros((len(motion), 3))
    return np.einsum('nji,j->ni', motion.link_rotation(str(where)), gravity)


def to_base(motion: Motion, where: str | None, momentum: Array) -> Array:
    """(N, 6) momentum in base coordinates about the base origin, of one in a body's frame."""
    R, r = motion.base_rotation(str(where)), motion.link_position(str(where))
    linear = np.einsum('nij,nj->ni', R, momentum[:, :3])
    angular = np.einsum('nij,nj->ni', R, momentum[:, 3:]) + cross_rows(r, linear)
    return np.concatenate([linear, angular], axis=1)


def link_mobility(robot: Robot, where: str | None) -> Array:
    """(6, 6) acceleration of a body's frame by a wrench there, all joints at zero."""
    model = robot.pin_model
    data, q = model.createData(), pin.neutral(model)
    joint = robot.pin_joint_ids[body_index(robot, where)]
    inverse = np.triu(pin.computeMinverse(model, data, q))
    inverse = inverse + np.triu(inverse, 1).T
    pin.computeJointJacobians(model, data, q)
    J = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)
    return np.asarray(J @ inverse @ J.T)


def recoil(motion: Motion, force: Array) -> Array:
    """(N, 3) by which the whole accelerates under a force (N, 3) [N], in the force's frame.

    Zero where the motion's accelerations hold it already.
    """
    if not motion.coasts:
        return np.zeros_like(force)
    return np.asarray(force / np.sum(motion.robot.inertial_parameters[:, 0]))


def spring(values: Values, hidden: Array, size: int) -> Array:
    """(N, size) 2 zeta omega eta' + omega^2 eta."""
    omega = values['frequency']
    rate = 2.0 * values['damping'] * omega
    return omega**2 * hidden[:, :size] + rate * hidden[:, size:]


def frequency_parameter(doc: str) -> Parameter:
    """Natural frequency of a part on its spring, the host held."""
    return Parameter(
        name='frequency',
        unit='rad/s',
        doc=doc,
        nominal=1.0,
        above=0.0,
        maximum=1e4,
        size=10.0,
        role='search',
        grid=FREQUENCIES,
    )


def damping_parameter(default: float) -> Parameter:
    """Damping ratio of a part on its spring."""
    return Parameter(
        name='damping',
        unit='',
        doc='Damping as a share of the critical one.',
        nominal=default,
        default=default,
        minimum=0.0,
        maximum=10.0,
        size=0.1,
        role='search',
        grid=(FIRST_DAMPING,),
    )
