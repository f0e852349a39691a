r"""A first bending mode of a panel or boom in hybrid coordinates.

With a_O the acceleration of the host's frame less gravity, alpha and w its angular acceleration
and rate, v its velocity, all in the host's frame; a the axis and t the translation that the mode
takes part in, p the place of the mass that sways, I its inertia, eta its angle, P = I t and

    J = I (2 (p . t) 1 - p t^T - t p^T)                     inertia of the whole by eta
    s = 2 w x P eta' + w x (w x P eta) + alpha x P eta

the equations are Lagrange's of T = 1/2 V^T M V + eta' (P . v + I a . w) + v . (w x P) eta
+ 1/2 (I eta'^2 + eta w^T J w), to first order in eta (Likins, AIAA J. 5 (1967)):

    eta'' = -t . a_O - a . alpha + w^T J w / (2 I) - 2 zeta omega eta' - omega^2 eta
    force on the host  = -P eta'' - s
    torque on the host = -I a eta'' - w x I a eta' - P eta x a_O - d/dt (J w eta)
    momentum           = P eta' + w x P eta, and I a eta' + J w eta + P eta x v about its origin

M includes the part at rest, as the robot file does. I a a^T, which is an inertia, is taken out of
the host; I t t^T, a mass in one direction only, can not be: there the force follows the
acceleration.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import cached_property

import numpy as np

from ...dynamics.equations import spatial_inertias
from ...dynamics.rotation import cross_rows
from ...model.robot import Robot
from ...types import Array, Matrix3, Vector3
from ..effect import Effect
from ..motion import Motion
from ..own_states import driven_states
from ..parameter import amount, searched
from .sprung import FIRST_DAMPING, FREQUENCIES, Sprung, spring_parameters

_TRANSLATION = ('translation_x', 'translation_y', 'translation_z')
_PLACE = ('at_x', 'at_y', 'at_z')


class Appendage(Sprung):
    """A mode that takes part in the rotation of its host about an axis, and in its translation.

    Typical: 0.5 to 10 rad/s, damping 0.002 to 0.02, 10 to 100 kg m^2 for solar panels.
    Signature: a decaying oscillation of the body after every change of its motion.
    Source: Likins, AIAA J. 5 (1967); Hughes, Spacecraft Attitude Dynamics (1986), 3.6.

    Args:
        inertia: What of the body's inertia about the axis takes part.
        x, y, z: Axis in the body's frame, of any length.
        translation_x, translation_y, translation_z: What of a translation of the body's origin
            takes part, by what of a rotation does: m a x l over the angular momentum per rate of
            the mode, of a mass m at l from its hinge.
        at_x, at_y, at_z: Place of that mass in the body's frame.
    """

    id = 'flexible_appendage'
    title = 'a flexible panel or boom on a body'
    hidden = 2
    parameters = (
        amount('inertia', 'kg m^2', 50.0, 0.05),
        *spring_parameters(0.005),
        *(searched(axis, '', 1.0) for axis in 'xyz'),
        *(searched(name, '1/m', 1.0, default=0.0) for name in _TRANSLATION),
        *(searched(name, 'm', 1.0, default=0.0) for name in _PLACE),
    )

    @cached_property
    def axis(self) -> Vector3:
        """(3,) of unit length."""
        axis = self.vector()
        return np.asarray(axis / np.linalg.norm(axis))

    @cached_property
    def translation(self) -> Vector3:
        """(3,) t [1/m]."""
        return self.vector(*_TRANSLATION)

    @cached_property
    def growth(self) -> Matrix3:
        """(3, 3) J / I."""
        p, t = self.vector(*_PLACE), self.translation
        return np.asarray(2.0 * (p @ t) * np.eye(3) - np.outer(p, t) - np.outer(t, p))

    def change(self, robot: Robot) -> Robot:
        """The host without the part's inertia about the axis.

        Raises:
            ConfigurationError: the host has less than takes part.
        """
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = self['inertia'] * np.outer(self.axis, self.axis)
        changed = self.with_addition(
            robot, -np.array([0.0, 0.0, 0.0, 0.0, xx, xy, yy, xz, yz, zz])
        )
        if self.follows_acceleration:
            S = self.directions(robot)
            part = self['inertia'] * S @ S.T
            host = spatial_inertias(self.row(robot)[None])[0]
            least = float(np.linalg.eigvalsh(host - part)[0])
            if least < 0.0:
                raise self.refusal(
                    f'{self.where} has less mass than takes part: lower it or the inertia',
                    _TRANSLATION[int(np.argmax(np.abs(self.translation)))],
                )
        return changed

    @property
    def follows_acceleration(self) -> bool:
        """Where it takes part in translations."""
        return bool(self.translation.any())

    def force(self, motion: Motion, hidden: Array) -> Array:
        """What the mode does beyond the mass that the host keeps."""
        w, inertia = motion.twist(self.where)[:, 3:], self['inertia']
        angle, rate = hidden[:, :1], hidden[:, 1:]
        axial = inertia * ((w @ self.axis)[:, None] + rate) * self.axis
        if not self.follows_acceleration:
            torque = inertia * self.spring(hidden) * self.axis - cross_rows(w, axial)
            return motion.wrench(self.where, None, torque)
        frame = self._frame(motion)
        bent = self.hidden_rate(motion, hidden)[:, 1:]
        force = -inertia * bent * self.translation - self._sway(frame, w, hidden)
        at = frame[:, :3] + force / self._recoiling(motion)
        torque = -inertia * (bent + (frame[:, 3:] @ self.axis)[:, None]) * self.axis
        torque = torque - cross_rows(w, axial) - inertia * cross_rows(angle * self.translation, at)
        grown = inertia * w @ self.growth
        torque = torque - inertia * angle * (frame[:, 3:] @ self.growth) - rate * grown
        torque = torque - angle * cross_rows(w, grown)
        return motion.wrench(self.where, force, torque)

    def hidden_rate(self, motion: Motion, hidden: Array) -> Array:
        """[eta', eta'']; of a motion that coasts, with the recoil of the whole."""
        return self._rate_along(motion)(hidden)

    def _rate_along(self, motion: Motion) -> Callable[[Array], Array]:
        """`hidden_rate` along a motion: what does not depend on the mode is computed once."""
        turn = motion.link_acceleration(self.where)[:, 3:] @ self.axis
        if not self.follows_acceleration:
            return lambda own: np.column_stack([own[:, 1], -turn - self.spring(own)[:, 0]])
        frame, whole = self._frame(motion), self._recoiling(motion)
        w = motion.twist(self.where)[:, 3:]
        centrifugal = 0.5 * np.sum(w @ self.growth * w, axis=1)
        share = self['inertia'] * self.translation @ self.translation / whole

        def rate(own: Array) -> Array:
            drive = (frame[:, :3] - self._sway(frame, w, own) / whole) @ self.translation + turn
            bent = (centrifugal - drive - self.spring(own)[:, 0]) / (1.0 - share)
            return np.column_stack([own[:, 1], bent])

        return rate

    def driven(self, motion: Motion) -> Array:
        """An oscillator along the motion; the sway matters to it where there is a translation."""
        if self.follows_acceleration:
            return driven_states(self._rate_along(motion), motion.time, 2)
        return self.swing(self.hidden_rate(motion, np.zeros((len(motion), 2)))[:, 1], motion.time)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """The mode's, and the inertia taken out of the host."""
        V, inertia = motion.twist(self.where), self['inertia']
        w, (angle, rate) = V[:, 3:], (hidden[:, :1], hidden[:, 1:])
        shift = inertia * angle * self.translation
        linear = inertia * rate * self.translation + cross_rows(w, shift)
        angular = inertia * ((w @ self.axis)[:, None] + rate) * self.axis
        angular = angular + inertia * angle * (w @ self.growth) + cross_rows(shift, V[:, :3])
        return self.to_base(motion, np.concatenate([linear, angular], axis=1))

    def check(self, robot: Robot) -> None:
        """The axis has a direction, and the host that much inertia."""
        if not self.vector().any():
            raise self.refusal('the axis x, y, z has no direction: all zero', 'x')
        super().check(robot)

    def canonical(self) -> Effect:
        """The axis of unit length; the translation turns round with it."""
        out = self.with_unit_axis()
        turned = float(np.sign(out.vector() @ self.axis))
        return out.changed(**{name: turned * self[name] for name in _TRANSLATION})

    @classmethod
    def variants(cls, robot: Robot, where: str | None) -> tuple[dict[str, float], ...]:
        """Every frequency about every axis of the host's frame."""
        return tuple(
            {'frequency': frequency, 'damping': FIRST_DAMPING, 'x': x, 'y': y, 'z': z}
            for frequency, (x, y, z) in itertools.product(FREQUENCIES, np.eye(3).tolist())
        )

    def directions(self, robot: Robot) -> Array:
        """(6, 1) [t; a]."""
        return np.concatenate([self.translation, self.axis])[:, None]

    def moved(self, robot: Robot) -> Array:
        """(1, 1) inertia."""
        return np.array([[self['inertia']]])

    def _frame(self, motion: Motion) -> Array:
        """(N, 6) acceleration of the host's frame less gravity, and its angular acceleration."""
        V, A = motion.twist(self.where), motion.link_acceleration(self.where)
        linear = A[:, :3] + cross_rows(V[:, 3:], V[:, :3]) - self.gravity(motion)
        return np.concatenate([linear, A[:, 3:]], axis=1)

    def _sway(self, frame: Array, w: Array, hidden: Array) -> Array:
        """(N, 3) s [N]."""
        shift, rate = (self['inertia'] * hidden[:, [k]] * self.translation for k in (0, 1))
        return np.asarray(
            cross_rows(w, 2.0 * rate + cross_rows(w, shift)) + cross_rows(frame[:, 3:], shift)
        )

    def _recoiling(self, motion: Motion) -> float:
        """Mass of the whole [kg]; infinite where the motion's accelerations hold its recoil."""
        return float(np.sum(motion.robot.inertial_parameters[:, 0])) if motion.coasts else np.inf
