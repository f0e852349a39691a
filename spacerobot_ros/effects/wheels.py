"""Wheels that are not what the model believes: momentum, drag, imbalance, free rotors.

A link's inertia includes its gyrostat wheels, locked, and excludes its true rotors
(`model.robot`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..dynamics.rotation import cross_rows
from ..errors import ConfigurationError
from ..model.robot import Gyrostat, Robot
from ..types import Array
from .effect import Effect, Parameter, Values
from .motion import Motion
from .sensors import vector, xyz

_WHEEL_SOURCE = 'Hughes, Spacecraft Attitude Dynamics, chapter 6'


@dataclass(frozen=True, kw_only=True)
class WheelEffect(Effect):
    """An effect of the gyrostat wheels of one link.

    Args:
        on_target: Whether the wheels are the captured body's; else the servicer's, on the base.
    """

    on_target: bool

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Links with target wheels; the servicer's need no place."""
        if not self.on_target:
            return (None,)
        return tuple(gyrostat.link for gyrostat in robot.target_wheels)


class WheelMomentum(WheelEffect):
    """h = h_believed + (x, y, z), in the carrying link's frame."""

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """Another constant momentum of the wheels."""
        extra = vector(values)
        if not self.on_target:
            wheels = robot.servicer_wheels
            return replace(
                robot, servicer_wheels=replace(wheels, momentum=wheels.momentum + extra)
            )
        targets = tuple(
            replace(g, momentum=g.momentum + extra) if g.link == where else g
            for g in robot.target_wheels
        )
        return replace(robot, target_wheels=targets)


class WheelDrag(WheelEffect):
    """h = h0 exp(-t / tau); the body takes what the wheels lose: torque -omega x h - h'."""

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """The torque less that of the constant h0, which belongs to the robot."""
        wheels = wheels_at(motion.robot, where)
        link = motion.robot.bodies[wheels.body].name
        lost = self._lost(wheels, motion, values)
        slowing = (wheels.body_momentum - lost) / values['time_constant']
        return motion.wrench(link, None, slowing + cross_rows(motion.twist(link)[:, 3:], lost))

    def momentum(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """What the wheels have less than h0."""
        wheels = wheels_at(motion.robot, where)
        return _couple(motion, wheels, -self._lost(wheels, motion, values))

    def _lost(self, wheels: Gyrostat, motion: Motion, values: Values) -> Array:
        """(N, 3) h0 - h in the body's frame."""
        gone = -np.expm1(-motion.time / values['time_constant'])
        return gone[:, None] * wheels.body_momentum


class WheelImbalance(Effect):
    """Torque A (cos(w t + p), sin(w t + p), 0) of a wheel that turns about the link's z axis.

    The wheel's own transverse momentum A / w (-sin, cos, 0) turns with it, so the whole keeps its
    momentum; -omega x that is part of the torque.
    """

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Every link with wheels; a free base counts as one."""
        base = (robot.base_link,) if robot.is_free else ()
        return (*base, *(g.link for g in robot.target_wheels))

    def argument(self, motion: Motion, where: str | None) -> Array:
        """Time, which the frequency multiplies."""
        return motion.time

    def force(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """Rotating torque on the link."""
        wheels = wheels_at(motion.robot, where)
        link = motion.robot.bodies[wheels.body].name
        torque = values['amplitude'] * self._turning(motion, values) @ wheels.rotation.T
        if values['frequency'] > 0.0:
            own = self._own(motion, wheels, values)
            torque = torque - cross_rows(motion.twist(link)[:, 3:], own)
        return motion.wrench(link, None, torque)

    def momentum(self, motion: Motion, where: str | None, values: Values, hidden: Array) -> Array:
        """The wheel's transverse momentum."""
        wheels = wheels_at(motion.robot, where)
        return _couple(motion, wheels, self._own(motion, wheels, values))

    def fastest(self, robot: Robot, where: str | None, values: Values) -> float:
        """The wheel's rate."""
        return values['frequency']

    def _turning(self, motion: Motion, values: Values, lead: float = 0.0) -> Array:
        angle = values['frequency'] * motion.time + values['phase'] + lead
        return np.stack([np.cos(angle), np.sin(angle), np.zeros(len(motion))], axis=1)

    def _own(self, motion: Motion, wheels: Gyrostat, values: Values) -> Array:
        size = values['amplitude'] / values['frequency']
        return size * self._turning(motion, values, 0.5 * math.pi) @ wheels.rotation.T


class FreeRotors(Effect):
    """Three wheels along the link's axes turn freely: each keeps its absolute axial momentum.

    With J a rotor's axial inertia and h = J (Omega + omega) its axial momentum in the inertial
    frame, constant, the link moves as one of inertia I - J 1 with the gyrostat h; a model with
    locked wheels has I and J Omega. What the model believes of the momentum is then taken as h.
    """

    def places(self, robot: Robot) -> tuple[str | None, ...]:
        """Every link with wheels; a free base counts as one."""
        base = (robot.base_link,) if robot.is_free else ()
        return (*base, *(g.link for g in robot.target_wheels))

    def check(self, robot: Robot, where: str | None, values: Values, place: str) -> None:
        """Refuse rotors that the link's inertia can not include."""
        self._without(robot, where, values, place)

    def change(self, robot: Robot, where: str | None, values: Values) -> Robot:
        """The link without its wheels' axial inertias."""
        return self._without(robot, where, values, self.id)

    def _without(self, robot: Robot, where: str | None, values: Values, place: str) -> Robot:
        index, axial = wheels_at(robot, where).body, values['axial_inertia']
        bodies = list(robot.bodies)
        least = float(np.linalg.eigvalsh(bodies[index].inertia)[0])
        if axial >= least:
            raise ConfigurationError(
                f'{place}.axial_inertia',
                f'{axial:g} kg m^2 is not below {least:g} kg m^2, the smallest moment of {where}, '
                'which includes the wheels',
            )
        inertia = bodies[index].inertia - axial * np.eye(3)
        bodies[index] = replace(bodies[index], inertia=inertia)
        return replace(robot, bodies=tuple(bodies))


def wheels_at(robot: Robot, where: str | None) -> Gyrostat:
    """The gyrostat of a link; None and a base without target wheels mean the servicer's."""
    for gyrostat in robot.target_wheels:
        if gyrostat.link == where:
            return gyrostat
    return robot.servicer_wheels


def _couple(motion: Motion, wheels: Gyrostat, momentum: Array) -> Array:
    """(N, 6) in base coordinates of a momentum (N, 3) in the carrying body's frame."""
    link = motion.robot.bodies[wheels.body].name
    out = np.zeros((len(motion), 6))
    out[:, 3:] = np.einsum('nij,nj->ni', motion.base_rotation(link), momentum)
    return out


def _time_constant() -> Parameter:
    return Parameter(
        name='time_constant',
        unit='s',
        doc='Time in which the momentum falls to 1/e.',
        nominal=math.inf,
        above=0.0,
        size=3e-3,
        relevant=3e-5,
        role='reciprocal',
    )


_DRAG_MAGNITUDE = 'time constants of 100 s (dry or damaged bearings) to 10 000 s'
_DRAG_SOURCE = 'Bialke, American Astronautical Society paper 98-063; ' + _WHEEL_SOURCE

EFFECTS = (
    WheelMomentum(
        id='target_wheel_momentum',
        title="momentum of the captured body's wheels beyond the believed one",
        group='wheels',
        on_target=True,
        parameters=xyz(
            'N m s',
            "Momentum added to the believed one, along the link's",
            size=50.0,
            relevant=0.01,
        ),
        magnitude='0.1 to 100 N m s',
        signature='torques -omega x h on the carrying link, and its share of the momentum balance',
        source=_WHEEL_SOURCE,
    ),
    WheelMomentum(
        id='servicer_wheel_momentum_error',
        title="momentum of the servicer's wheels beyond the believed one",
        group='wheels',
        on_target=False,
        needs_free_base=True,
        parameters=xyz(
            'N m s',
            "Momentum added to the believed one, along the base's",
            size=5.0,
            relevant=0.01,
        ),
        magnitude='0.1 to 5 N m s: tachometers and rotor inertias',
        signature='a torque -omega x h on the base',
        source=_WHEEL_SOURCE,
    ),
    WheelDrag(
        id='target_wheel_drag',
        title="the captured body's wheels run down",
        group='wheels',
        on_target=True,
        is_timed=True,
        excludes=('target_wheel_drag',),
        parameters=(_time_constant(),),
        magnitude=_DRAG_MAGNITUDE,
        signature='a torque along the wheel momentum, fixed in the carrying link, that fades',
        source=_DRAG_SOURCE,
    ),
    WheelDrag(
        id='servicer_wheel_drag',
        title="the servicer's wheels run down",
        group='wheels',
        on_target=False,
        needs_free_base=True,
        is_timed=True,
        excludes=('servicer_wheel_drag',),
        parameters=(_time_constant(),),
        magnitude=_DRAG_MAGNITUDE,
        signature='a torque along the wheel momentum, fixed in the base, that fades',
        source=_DRAG_SOURCE,
    ),
    WheelImbalance(
        id='wheel_imbalance',
        title='dynamic imbalance of a wheel',
        group='wheels',
        is_timed=True,
        parameters=(
            Parameter(
                name='amplitude',
                unit='N m',
                doc='Size of the turning torque.',
                minimum=0.0,
                size=2.0,
                relevant=0.02,
            ),
            Parameter(
                name='frequency',
                unit='rad/s',
                doc='Rate of the wheel.',
                above=0.0,
                role='search',
                grid=(3.0, 1000.0),
            ),
            Parameter(
                name='phase',
                unit='rad',
                doc='Direction of the torque at the start.',
                default=0.0,
                role='phase',
            ),
        ),
        magnitude='0.01 to 10 N m at 10 to 600 rad/s, growing with the square of the rate',
        signature='a line at the frequency of the wheel in rates and torques',
        source='Masterson, Miller and Grogan, J. Sound and Vibration 249 (2002)',
    ),
    FreeRotors(
        id='free_wheel_rotors',
        title='wheels that turn freely instead of at a constant relative rate',
        group='wheels',
        excludes=('free_wheel_rotors',),
        parameters=(
            Parameter(
                name='axial_inertia',
                unit='kg m^2',
                doc='Inertia of each of three rotors about its axis.',
                minimum=0.0,
                size=0.5,
                relevant=0.05,
            ),
        ),
        magnitude='0.01 to 1 kg m^2',
        signature='a link that resists turning less than its inertia says',
        source=_WHEEL_SOURCE,
    ),
)
