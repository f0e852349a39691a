"""Magnitudes of an arm and its recordings, which say how large its causes may be."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...dynamics.equations import Dynamics
from ...effects.bodies.bodies import MovingBodyEffect
from ...effects.effect import Effect
from ...effects.prior import BodyScale, Prior, Scale
from ...model.robot import Robot
from ...model.robot_settings import LINK_SIDE
from ...types import Array
from ..columns import Candidate
from .balance import Balance

_GAIN_TOLERANCE, _SENSOR_TOLERANCE = 0.08, 0.03
"""Of a torque that is a motor current times a constant from a data sheet; of a torque sensor."""
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

    def prior(self, candidate: Candidate) -> Prior | None:
        """Of its coefficients.

        None: it is no cause on an arm, or nothing of it can show.
        """
        scale = self._scale(candidate)
        return None if scale is None else candidate.kind.prior(scale)

    def prior_of_load(self, candidate: Candidate) -> Prior | None:
        """Of what is put on a body, wherever that is, or taken off."""
        scale = self._scale(candidate)
        if scale is None or scale.body is None:
            return None
        body = replace(scale.body, is_last=True, uncertainty=None)
        return candidate.kind.prior(replace(scale, body=body))

    def _scale(self, candidate: Candidate) -> Scale | None:
        """At its place; None of a joint that never moves, or has no effort."""
        where, robot = candidate.where, self.robot
        names = [body.name for body in robot.bodies]
        common = Scale(
            sizes=candidate.sizes, interval=self.interval, gravity=np.array(robot.gravity)
        )
        if issubclass(candidate.kind, MovingBodyEffect):
            return replace(common, body=body_scale(self.robot, names.index(str(where))))
        if where not in robot.joints:
            return common
        j = robot.joints.index(str(where))
        if not self.torque[j]:
            return None
        return replace(
            common,
            torque=float(self.torque[j]),
            needed=float(self.torque_scale[j]),
            rate=max(float(self.rate[j]), 1e-6),
            acceleration=float(self.acceleration[j]),
            range=float(self.range[j]),
            has_angle=where not in robot.rate_only,
            inertia=float(self.inertia[j]),
            unit=self._unit(where),
            gain=float(torque_tolerance(robot)[j]),
            dry=self.friction(DRY, where),
            viscous=self.friction(VISCOUS, where),
        )

    def _unit(self, where: str | None) -> float:
        """Torque of an ampere of a joint's motor [N m]."""
        units = dict(zip(self.robot.arm, self.robot.known_effort_units.tolist(), strict=True))
        return float(units.get(str(where), 1.0))

    def friction(self, kind: str, where: str | None) -> float:
        """Of a joint, in the file: the first number of this law and of those that refine it."""
        return friction_of(self.balances[0].effects, kind, where)

    def _rms(self, every: Sequence[Array], state: str = '') -> Array:
        """(n,) of (N, n) values of every recording where joints move, motors on or off."""
        total, count = np.zeros(self.robot.n_joints), np.zeros(self.robot.n_joints)
        for b, values in zip(self.balances, every, strict=True):
            moving = b.arm.is_moving & (getattr(b.arm, state) if state else True)
            total += np.sum(values**2 * moving, axis=0)
            count += np.sum(moving, axis=0)
        return np.sqrt(total / np.maximum(count, 1))


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


def body_scale(robot: Robot, k: int) -> BodyScale:
    """Magnitudes of a robot's body number k."""
    is_last = robot.bodies[k].name in robot.last_links
    is_load = is_last and k not in robot.uncertain_bodies  # it is there or not
    steps = [float(np.linalg.norm(b.translation)) for b in robot.bodies[1:]]
    return BodyScale(
        row=robot.inertial_parameters[k],
        uncertainty=None if is_load else robot.uncertainty_of(k),
        whole=float(np.sum(robot.inertial_parameters[1:, 0])),
        length=max(*steps, 1e-3),
        is_last=is_last,
        is_lone=robot.n_joints == 1,
    )
