"""Wheels that are not what the model believes: momentum, drag, imbalance, free rotors.

A link's inertia includes its gyrostat wheels, locked, and excludes its true rotors
(`model.robot`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...dynamics.rotation import cross_rows
from ...model.robot import Gyrostat, Robot
from ...types import Array
from ..effect import Effect
from ..motion import Motion
from ..parameter import Parameter, amount, phase, searched, xyz
from ..prior import Prior, Scale


class WheelEffect(Effect):
    """An effect of the gyrostat wheels of one link, the captured body's among them."""

    group = 'wheels'

    @classmethod
    def prior(cls, scale: Scale) -> Prior | None:
        """Of wheels on an arm that stands on the ground nothing is asked."""
        return None

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every link with wheels; a free base counts as one."""
        base = (robot.base_link,) if robot.is_free else ()
        return (*base, *(g.link for g in robot.target_wheels))

    def wheels(self, robot: Robot) -> Gyrostat:
        """The gyrostat; None and a base without target wheels mean the servicer's."""
        targets = (g for g in robot.target_wheels if g.link == self.where)
        return next(targets, robot.servicer_wheels)

    def on_link(self, motion: Motion, torque: Array, momentum: Array) -> Array:
        """(N, 6 + n) of a torque less omega x a momentum, (N, 3) in the carrying body's frame."""
        link = self._carrier(motion.robot)
        return motion.wrench(link, None, torque - cross_rows(motion.twist(link)[:, 3:], momentum))

    def couple(self, motion: Motion, momentum: Array) -> Array:
        """(N, 6) in base coordinates of a momentum (N, 3) in the carrying body's frame."""
        R = motion.base_rotation(self._carrier(motion.robot))
        angular = np.einsum('nij,nj->ni', R, momentum)
        return np.concatenate([np.zeros_like(angular), angular], axis=1)

    def _carrier(self, robot: Robot) -> str:
        return robot.bodies[self.wheels(robot).body].name


class TargetWheels(WheelEffect):
    """An effect of the captured body's wheels."""

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Links with target wheels."""
        return tuple(gyrostat.link for gyrostat in robot.target_wheels)


class ServicerWheels(WheelEffect):
    """An effect of the servicer's wheels; they are on the base and need no place."""

    needs_free_base = True

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """The system as a whole."""
        return (None,)

    def wheels(self, robot: Robot) -> Gyrostat:
        """The servicer's."""
        return robot.servicer_wheels


class WheelMomentum(WheelEffect):
    """h = h_believed + (x, y, z).

    Source: Hughes, Spacecraft Attitude Dynamics, chapter 6.
    """

    def change(self, robot: Robot) -> Robot:
        """Another constant momentum of the wheels."""
        wheels = self.wheels(robot)
        more = replace(wheels, momentum=wheels.momentum + self.vector())
        servicer, *targets = (more if g is wheels else g for g in robot.gyrostats)
        return replace(robot, servicer_wheels=servicer, target_wheels=tuple(targets))


class TargetWheelMomentum(WheelMomentum, TargetWheels):
    """In the carrying link's frame.

    Typical: 0.1 to 100 N m s.
    Signature: torques -omega x h on the carrying link, and its share of the momentum balance.

    Args:
        x, y, z: Momentum added to the believed one, along the link's axes.
    """

    id = 'target_wheel_momentum'
    title = "momentum of the captured body's wheels beyond the believed one"
    parameters = xyz('N m s', 50.0, 0.01)


class ServicerWheelMomentumError(WheelMomentum, ServicerWheels):
    """In base coordinates.

    Typical: 0.1 to 5 N m s: tachometers and rotor inertias.
    Signature: a torque -omega x h on the base.

    Args:
        x, y, z: Momentum added to the believed one, along the base's axes.
    """

    id = 'servicer_wheel_momentum_error'
    title = "momentum of the servicer's wheels beyond the believed one"
    parameters = xyz('N m s', 5.0, 0.01)


class WheelDrag(WheelEffect):
    """h = h0 exp(-t / tau); the body takes what the wheels lose: torque -omega x h - h'.

    Typical: time constants of 100 s (dry or damaged bearings) to 10 000 s.
    Source: Bialke, American Astronautical Society paper 98-063; Hughes, Spacecraft Attitude
        Dynamics, chapter 6.

    Args:
        time_constant: Time in which the momentum falls to 1/e.
    """

    is_timed = True
    parameters = (
        Parameter(
            'time_constant', 's', 3e-3, 3e-5, nominal=math.inf, above=0.0, role='reciprocal'
        ),
    )

    def force(self, motion: Motion, hidden: Array) -> Array:
        """The torque less that of the constant h0, which belongs to the robot."""
        lost = self._lost(motion)
        slowing = (self.wheels(motion.robot).body_momentum - lost) / self['time_constant']
        return self.on_link(motion, slowing, -lost)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """What the wheels have less than h0."""
        return self.couple(motion, -self._lost(motion))

    def _lost(self, motion: Motion) -> Array:
        """(N, 3) h0 - h in the body's frame."""
        gone = -np.expm1(-motion.time / self['time_constant'])
        return gone[:, None] * self.wheels(motion.robot).body_momentum


class TargetWheelDrag(WheelDrag, TargetWheels):
    """Of the captured body's wheels.

    Signature: a torque along the wheel momentum, fixed in the carrying link, that fades.
    """

    id = 'target_wheel_drag'
    title = "the captured body's wheels run down"
    excludes = ('target_wheel_drag',)


class ServicerWheelDrag(WheelDrag, ServicerWheels):
    """Of the servicer's wheels.

    Signature: a torque along the wheel momentum, fixed in the base, that fades.
    """

    id = 'servicer_wheel_drag'
    title = "the servicer's wheels run down"
    excludes = ('servicer_wheel_drag',)


class WheelImbalance(WheelEffect):
    """Torque A (cos(w t + p), sin(w t + p), 0) of a wheel that turns about the link's z axis.

    The wheel's own transverse momentum A / w (-sin, cos, 0) turns with it, so the whole keeps its
    momentum; -omega x that is part of the torque.

    Typical: 0.01 to 10 N m at 10 to 600 rad/s, growing with the square of the rate.
    Signature: a line at the frequency of the wheel in rates and torques.
    Source: Masterson, Miller and Grogan, J. Sound and Vibration 249 (2002).

    Args:
        amplitude: Size of the turning torque.
        frequency: Rate of the wheel.
        phase: Direction of the torque at the start.
    """

    id = 'wheel_imbalance'
    title = 'dynamic imbalance of a wheel'
    is_timed = True
    parameters = (
        amount('amplitude', 'N m', 2.0, 0.02),
        searched('frequency', 'rad/s', above=0.0, guesses=(3.0, 1000.0)),
        phase(),
    )

    @classmethod
    def argument(cls, motion: Motion, where: str | None) -> Array | None:
        """Time, which the frequency multiplies."""
        return motion.time

    def force(self, motion: Motion, hidden: Array) -> Array:
        """Rotating torque on the link."""
        own = self._own(motion) if self['frequency'] > 0.0 else np.zeros((len(motion), 3))
        return self.on_link(motion, self._turning(motion, self['amplitude']), own)

    def momentum(self, motion: Motion, hidden: Array) -> Array:
        """The wheel's transverse momentum."""
        return self.couple(motion, self._own(motion))

    def fastest(self, robot: Robot) -> float:
        """The wheel's rate."""
        return self['frequency']

    def _own(self, motion: Motion) -> Array:
        return self._turning(motion, self['amplitude'] / self['frequency'], 0.5 * math.pi)

    def _turning(self, motion: Motion, size: float, lead: float = 0.0) -> Array:
        """(N, 3) vector that turns with the wheel, in the carrying body's frame."""
        angle = self['frequency'] * motion.time + self['phase'] + lead
        turning = np.stack([np.cos(angle), np.sin(angle), np.zeros(len(motion))], axis=1)
        return np.asarray(size * turning @ self.wheels(motion.robot).rotation.T)


class FreeRotors(WheelEffect):
    """Three wheels along the link's axes turn freely: each keeps its absolute axial momentum.

    With J a rotor's axial inertia and h = J (Omega + omega) its axial momentum in the inertial
    frame, constant, the link moves as one of inertia I - J 1 with the gyrostat h; a model with
    locked wheels has I and J Omega. What the model believes of the momentum is then taken as h.

    Typical: 0.01 to 1 kg m^2.
    Signature: a link that resists turning less than its inertia says.
    Source: Hughes, Spacecraft Attitude Dynamics, chapter 6.

    Args:
        axial_inertia: Inertia of each of three rotors about its axis.
    """

    id = 'free_wheel_rotors'
    title = 'wheels that turn freely instead of at a constant relative rate'
    excludes = ('free_wheel_rotors',)
    parameters = (amount('axial_inertia', 'kg m^2', 0.5, 0.05),)

    def change(self, robot: Robot) -> Robot:
        """The link without its wheels' axial inertias."""
        index, axial = self.wheels(robot).body, self['axial_inertia']
        body = robot.bodies[index]
        least = float(np.linalg.eigvalsh(body.inertia)[0])
        if axial >= least:
            raise self.refusal(
                f'{axial:g} kg m^2 is not below {least:g} kg m^2, the smallest moment of '
                f'{self.where}, which includes the wheels',
                'axial_inertia',
            )
        inertia = body.inertia - axial * np.eye(3)
        return robot.with_body(index, replace(body, inertia=inertia))
