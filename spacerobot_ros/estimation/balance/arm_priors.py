"""How large a cause may be on a machine, and how wrong every machine's file is at the least.

A cause's size is the standard deviation that its coefficients are thought to have where it is one;
its tolerance the one that they have anyway, on any real machine, without being worth a name. Both
are in the machine's own units: torques by the rms that it needs, masses by its own. The figures
are those of measured arms, tried on simulated ones with a coloured leftover
(docs/real_machines.md): wider tolerances hide more causes than they save false names.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...dynamics.equations import Dynamics
from ...effects.effect import Effect
from ...model.robot import Robot
from ...model.robot_settings import LINK_SIDE
from ...types import Array
from ..columns import Candidate
from .balance import Balance

_GAIN_TOLERANCE, _SENSOR_TOLERANCE = 0.08, 0.03
"""Of a torque that is a motor current times a constant from a data sheet; of a torque sensor."""
NOTHING = 1e-4
"""Of a size: no tolerance, and still a number."""
_BY_ANGLE = (
    'joint_torque_ripple',
    'joint_stiffness',
    'encoder_offset',
    'joint_presliding_friction',
)
"""Nothing of a wheel of which only the rate is measured: its angle begins anywhere, and drifts."""
_POSES = 20  # of a recording, for the largest inertia
DRY = 'joint_coulomb_friction'
VISCOUS = 'joint_viscous_friction'
OF_LOAD = 'joint_load_friction'
COUPLED = 'joint_coupled_friction'
"""Of the motor that two joints turn."""
SHAPES = (
    'joint_stribeck_friction',
    'joint_friction_curvature',
    'joint_presliding_friction',
    COUPLED,
)
"""Laws of friction that are finer than a straight one."""
FRICTION = (DRY, VISCOUS, *SHAPES)
"""Laws of the rates alone."""
_BODY_TOLERANCE, BODY_SIZE = 0.1, 0.5
"""Of a body's mass, and of that times its size: what any file is off by (docs/real_machines.md),
and what one that is wrong may be off by."""
RUN_TO_RUN = 0.05
"""Of a friction: by so much it differs from run to run of one machine, which a single recording
can not show (docs/real_machines.md)."""
BY_DIRECTION = RUN_TO_RUN / math.sqrt(2.0)
"""Of a friction: half of the difference between its directions, each of which differs by that."""


@dataclass(frozen=True, eq=False)
class Machine:
    """Magnitudes of a robot and its recordings.

    Args:
        robot: As the file says.
        balances: Of every recording.
    """

    robot: Robot
    balances: Sequence[Balance]

    @cached_property
    def torque(self) -> Array:
        """(n,) rms of the measured torques where the joints move [N m].

        Of a joint without a motor those of its weight and of its own inertia, which balance.
        """
        measured = self._rms([b.arm.effort for b in self.balances], 'powered')
        inertial = [np.hypot(b.weight, self.inertia * b.arm.kinematics.qdd) for b in self.balances]
        own = self._rms(inertial, 'unpowered')
        passive = ~np.any([b.arm.powered.any(axis=0) for b in self.balances], axis=0)
        return np.where(passive, own, measured)

    @cached_property
    def torque_scale(self) -> Array:
        """(n,) the same, or the rms that the model needs there if that is more [N m].

        A zero that is off may be as large as the weight that efforts leave out.
        """
        return np.maximum(self.torque, self._rms([b.motion.effort for b in self.balances]))

    @cached_property
    def rate(self) -> Array:
        """(n,) rms [rad/s]."""
        return self._rms([b.motion.qd for b in self.balances])

    @cached_property
    def acceleration(self) -> Array:
        """(n,) rms [rad/s^2]."""
        return np.maximum(self._rms([b.arm.kinematics.qdd for b in self.balances]), 1e-6)

    @cached_property
    def interval(self) -> float:
        """Longest sample interval of the recordings [s]."""
        return max(b.arm.interval for b in self.balances)

    @cached_property
    def range(self) -> Array:
        """(n,) [rad]."""
        q = np.concatenate([b.motion.q for b in self.balances])
        return np.maximum(np.ptp(q, axis=0), 1e-3)

    @cached_property
    def inertia(self) -> Array:
        """(n,) largest diagonal of the mass matrix, at zero and as recorded [kg m^2].

        Of a vertical arm that is upright at zero the first joint turns next to nothing there.
        """
        n, dynamics = self.robot.n_joints, Dynamics(self.robot)
        poses = [b.motion.q[:: max(1, len(b.motion.q) // _POSES)] for b in self.balances]
        every = np.concatenate([np.zeros((1, n)), *poses])
        return np.max([np.diag(dynamics.mass_matrix(q))[-n:] for q in every], axis=0)

    @cached_property
    def mass(self) -> float:
        """Of all that moves [kg]."""
        return float(np.sum(self.robot.inertial_parameters[1:, 0]))

    @cached_property
    def length(self) -> float:
        """Longest distance from one joint to the next [m]."""
        offsets = [float(np.linalg.norm(b.translation)) for b in self.robot.bodies[1:]]
        return max(*offsets, 1e-3)

    def prior(self, candidate: Candidate) -> tuple[Array, Array] | None:
        """(K,) sizes and (K,) tolerances of its coefficients.

        None: it is no cause on an arm, or nothing of it can show.
        """
        kind, where = candidate.kind.id, candidate.where
        if kind == 'inertial_parameters':
            return self._body(str(where))
        if kind in _BY_ANGLE and where in self.robot.rate_only:
            return None
        if where in self.robot.joints:
            j = self.robot.joints.index(str(where))
            if not self.torque[j]:  # it never moves, or has no effort
                return None
            torque, rate = float(self.torque[j]), max(float(self.rate[j]), 1e-6)
            scale = float(self.torque_scale[j])
            inertia = max(0.5 * float(self.inertia[j]), 0.3 * torque / float(self.acceleration[j]))
        else:
            j, torque, rate, scale, inertia = 0, 0.0, 1.0, 0.0, 0.0
        own = 0.2 * np.array([torque, torque / rate])
        dry, unit = self.friction(DRY, where), self._unit(where)
        sizes: dict[str, tuple[float | Array, float]] = {
            'joint_coulomb_friction': (torque, RUN_TO_RUN * dry),
            'joint_viscous_friction': (torque / rate, RUN_TO_RUN * self.friction(kind, where)),
            'joint_stribeck_friction': (0.3 * torque, RUN_TO_RUN * dry),
            'joint_friction_curvature': (torque, RUN_TO_RUN * dry),
            'joint_presliding_friction': (torque, 0.0),
            OF_LOAD: (0.1, 0.0),
            'joint_coupled_friction': (own, 0.0),
            'joint_torque_constant': (0.15, torque_tolerance(self.robot)[j]),
            'joint_torque_ripple': (0.1 * torque, 0.0),
            'joint_stiffness': (0.3 * torque / self.range[j], 0.0),
            'motor_inertia': (inertia, 0.0),
            'torque_sensor_bias': (0.3 * scale, BY_DIRECTION * dry),
            'current_offset': (0.3 * scale / unit, BY_DIRECTION * dry / unit),
            'joint_sensor_delay': (max(0.01, self.interval), 0.0),
            'encoder_offset': (0.02, 0.0),
            'effort_delay': (max(0.01, self.interval), 0.0),
            'gravity_error': (0.2, 0.0),
        }
        if candidate.kind.is_own:
            return candidate.sizes, NOTHING * candidate.sizes
        if kind not in sizes:
            return None
        size, tolerance = sizes[kind]
        shares = np.ones(len(candidate.sizes))
        if kind == 'gravity_error':  # a tilt: its magnitude is known, and no scale of all masses
            down = self.robot.gravity / max(float(np.linalg.norm(self.robot.gravity)), 1e-9)
            shares = np.where(np.abs(down) > 0.9, NOTHING, 1.0)
        return size * shares, np.maximum(tolerance, NOTHING * size) * shares

    def _unit(self, where: str | None) -> float:
        """Torque of an ampere of a joint's motor [N m]."""
        units = dict(zip(self.robot.arm, self.robot.known_effort_units.tolist(), strict=True))
        return float(units.get(str(where), 1.0))

    def friction(self, kind: str, where: str | None) -> float:
        """Of a joint, in the file: the first number of this law and of those that refine it."""
        return friction_of(self.balances[0].effects, kind, where)

    def _body(self, where: str) -> tuple[Array, Array]:
        names = [body.name for body in self.robot.bodies]
        row = self.robot.inertial_parameters[names.index(where)]
        mass = max(float(row[0]), 1e-3 * self.mass)
        com = float(np.linalg.norm(row[1:4])) / mass
        gyration = float(np.sqrt(max(row[4] + row[6] + row[9], 0.0) / mass))
        own = _scales(mass, max(com, gyration, 0.2 * self.length))
        if where not in self.robot.last_links:
            return BODY_SIZE * own, _BODY_TOLERANCE * own
        sizes = _scales(0.1 * self.mass, 0.3 * self.length)
        if self.robot.n_joints > 1:
            sizes = np.maximum(sizes, BODY_SIZE * own)
        elif self.robot.passive_joints:
            sizes = np.maximum(sizes, BODY_SIZE * own * _along(row[1:4]))
        # of a lone motor's it is a rotor's inertia, an encoder's zero, a scale of torques
        return sizes, NOTHING * sizes  # a load is there or not

    def _rms(self, every: Sequence[Array], state: str = '') -> Array:
        """(n,) of (N, n) values of every recording where joints move, motors on or off."""
        total, count = np.zeros(self.robot.n_joints), np.zeros(self.robot.n_joints)
        for b, values in zip(self.balances, every, strict=True):
            moving = b.arm.is_moving & (getattr(b.arm, state) if state else True)
            total += np.sum(values**2 * moving, axis=0)
            count += np.sum(moving, axis=0)
        return np.sqrt(total / np.maximum(count, 1))


def _scales(mass: float, arm: float) -> Array:
    """(10,) of the inertial parameters of a body of a mass [kg] and an extent [m]."""
    return mass * np.array([1.0, *[arm] * 3, *[arm**2] * 6])


def _along(moment: Array) -> Array:
    """(10,) shares of a body that do not turn its first moment, as the zero of an encoder does."""
    size = float(np.linalg.norm(moment))
    along = np.abs(moment) / size if size else np.ones(3)
    return np.array([1.0, *np.maximum(along, NOTHING), *[1.0] * 6])


def is_kind_of(effect: Effect | type[Effect], law: str) -> bool:
    """Whether an effect is a simple law, or one of those that refine it."""
    return law in (effect.id, *effect.refines)


def friction_of(effects: Iterable[Effect], law: str, where: str | None) -> float:
    """Of a joint by a simple law, `DRY` or `VISCOUS`: the first numbers of all its effects."""
    own = (e for e in effects if e.where == where and is_kind_of(e, law))
    return float(sum(next(iter(e.values.values())) for e in own))


def torque_tolerance(robot: Robot) -> Array:
    """(n,) share by which the scale of each joint's measured torques is uncertain."""
    kinds = dict(zip(robot.arm, robot.effort_kinds, strict=True))
    is_sensor = [kinds.get(joint) == LINK_SIDE for joint in robot.joints]
    known = np.where(is_sensor, _SENSOR_TOLERANCE, _GAIN_TOLERANCE)
    return np.where(np.isin(robot.joints, robot.passive_joints), 0.0, known)
