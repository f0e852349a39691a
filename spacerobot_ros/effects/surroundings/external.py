r"""Events: what acts from outside for a while, with a start and an end.

    f(t) = size * w((t - start) / (end - start)),

w rises from 0 to 1 over the share `edge` of the duration along half a cosine, stays and falls
alike; an edge of one half is sin^2, the bell of a hand's push.
"""

from __future__ import annotations

import math

import numpy as np

from ...model.robot import Robot
from ...types import Array
from ..bodies.bodies import MovingBodyEffect
from ..effect import Effect
from ..joint import JointEffect
from ..motion import Motion
from ..parameter import Parameter, searched, xyz
from .environment import FORCE, External, into_base

TORQUE = ('torque_x', 'torque_y', 'torque_z')


def pulse_shape(phase: Array, edge: float) -> Array:
    """Shape of an event: 0 before phase 0 and after 1, 1 between its edges.

    Args:
        phase: Time since the start by the duration, any shape.
        edge: Share of the duration that the rise takes, and the fall.
    """
    inside = np.clip(np.minimum(phase, 1.0 - phase) / edge, 0.0, 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * inside))


_SPAN = (
    searched('start', 's', minimum=0.0, guesses=(0.0,)),
    searched('end', 's', above=0.0, nominal=1.0, guesses=(1.0,)),
)
_EDGE = searched('edge', '', default=0.5, nominal=0.5, above=0.0, maximum=0.5, guesses=(0.5,))


class TransientEffect(Effect):
    """An effect that has a start and an end [s since the start of the recording].

    The diagnosis looks for it by a scan of its own (`diagnosis/events`): it is no constant cause,
    and no controller expects it.
    """

    is_timed = True
    is_fitted = False
    group = 'events'

    def check(self, robot: Robot) -> None:
        """Refuse an end before the start."""
        if self['end'] <= self['start']:
            why = f'{self["end"]:g} s is not after the start, {self["start"]:g} s'
            raise self.refusal(why, 'end')

    def shape(self, time: Array) -> Array:
        """(N,) share of the size at times [s]."""
        duration = self['end'] - self['start']
        return pulse_shape((time - self['start']) / duration, self['edge'])

    def fastest(self, robot: Robot) -> float:
        """Of its edges."""
        return math.pi / (self['edge'] * (self['end'] - self['start']))


class ExternalJointTorque(TransientEffect, JointEffect):
    """tau = T w: a drive, a brake or an obstacle adds to a joint's own torque.

    Typical: 0.1 to 100 N m for 0.1 to 10 s.
    Signature: a torque residual of one joint that comes once and goes.
    Source: Haddadin, De Luca and Albu-Schaffer, IEEE Trans. Robotics 33 (2017).

    Args:
        start: When it begins.
        end: When it is over.
        edge: Share of its duration that its rise takes, and its fall.
        torque: Largest torque on the joint.
    """

    id = 'external_joint_torque'
    title = 'a torque from outside on a joint for a while'
    parameters = (*_SPAN, _EDGE, Parameter('torque', 'N m', 30.0, 0.1))

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque at its joint."""
        return motion.joint_force(self.where, self['torque'] * self.shape(motion.time))


class ExternalWrench(TransientEffect, MovingBodyEffect):
    """A force and a torque at the origin of a link, in its frame: J^T w on the joints.

    Typical: 1 to 200 N for 0.1 to 10 s, a hand's push or a collision.
    Signature: torque residuals of all joints nearer the base, together, that come once and go.
    Source: Haddadin, De Luca and Albu-Schaffer, IEEE Trans. Robotics 33 (2017).

    Args:
        start: When it begins.
        end: When it is over.
        edge: Share of its duration that its rise takes, and its fall.
        force_x, force_y, force_z: Largest force along the link's axes.
        torque_x, torque_y, torque_z: Largest torque about the link's origin.
    """

    id = 'external_wrench'
    title = 'a push on a link'
    is_external = True
    parameters = (
        *_SPAN,
        _EDGE,
        *xyz('N', 100.0, 1.0, 'force_'),
        *xyz('N m', 30.0, 0.1, 'torque_'),
    )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The wrench on its link."""
        shape = self.shape(motion.time)[:, None]
        return motion.wrench(self.where, shape * self.vector(*FORCE), shape * self.vector(*TORQUE))


class AngularImpulse(TransientEffect, External):
    """A torque on the base whose integral over time is h, its direction fixed in space.

    torque = h w(t) / ((1 - edge) (end - start)). Its linear part would show in translations
    alone, which nobody measures.

    Typical: 1e-3 to 10 N m s: a bump, a thruster that fires once.
    Signature: a step of the system's angular momentum.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.4.

    Args:
        start: When it begins.
        end: When it is over.
        edge: Share of its duration that its rise takes, and its fall.
        x, y, z: Angular impulse about the centre of mass along the inertial axes.
    """

    id = 'angular_impulse'
    title = 'a step of the angular momentum'
    parameters = (*_SPAN, _EDGE, *xyz('N m s', 1.0, 1e-3))

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque on the base."""
        area = (1.0 - self['edge']) * (self['end'] - self['start'])
        torque = into_base(motion, self.vector() / area)
        return self.on_base(motion, torque * self.shape(motion.time)[:, None])
