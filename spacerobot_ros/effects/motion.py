"""N states of one robot: all that a physical effect may depend on.

The simulator asks with N = 1 inside an integration step, the diagnosis with every sample of a
record at once; an effect does not see the difference.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property

import numpy as np

from ..dynamics.equations import Dynamics
from ..dynamics.forward_kinematics import BodyKinematics, body_accelerations, forward_kinematics
from ..dynamics.rnea import generalized_force
from ..dynamics.rotation import cross_rows, rotation_matrix
from ..dynamics.state import State
from ..dynamics.tree import Records, tree_of
from ..model.robot import Robot
from ..types import Array, BoolArray


@dataclass(eq=False)
class Motion:
    """Kinematics of N states.

    Generalized vectors are (N, 6 + n): base [linear; angular] in base coordinates, then the
    joints, for a fixed base too, whose first six entries are zero.

    Args:
        robot: The robot as all effects have made it.
        time: (N,) time since the start [s].
        q: (N, n) joint positions [rad].
        qd: (N, n) joint rates [rad/s].
        effort: (N, n) motor torques [N m].
        rotation: (N, 3, 3) R_WB; without it base and inertial frame are aligned.
        omega: (N, 3) omega_WB_B [rad/s].
        velocity: (N, 3) v_WB_B [m/s].
        acceleration: (N, 6 + n) time derivative of [v_WB_B; omega_WB_B; qd]; None where it is not
            known yet.
        unpowered: (N, n) where motors are off, so that their torque is zero; None: nowhere.
        coasts: Whether the base's linear acceleration is that of a robot on which no force acts,
            so that what an effect does to the whole comes on top: nobody measures translations.
        window: (N, 2) times between which inputs count with their mean [s]; None: around
            each time.

    Attributes:
        swung: Forces of effects with states of their own along it, or along one that differs
            from it as little as models of one record do, by effect and values; None where they
            are not asked twice.
    """

    robot: Robot
    time: Array
    q: Array
    qd: Array
    effort: Array
    _: KW_ONLY
    rotation: Array = field(default_factory=lambda: np.eye(3)[None])
    omega: Array = field(default_factory=lambda: np.zeros((1, 3)))
    velocity: Array = field(default_factory=lambda: np.zeros((1, 3)))
    acceleration: Array | None = None
    unpowered: BoolArray | None = None
    coasts: bool = False
    window: Array | None = None
    swung: dict[tuple[object, ...], Array] | None = field(init=False, default=None)
    _accelerated: tuple[Array, Array] | None = field(init=False, default=None)

    def __post_init__(self) -> None:
        """Repeat what is the same for all states."""
        for name in ('rotation', 'omega', 'velocity'):
            value = getattr(self, name)
            if len(value) != len(self):
                setattr(self, name, np.repeat(value, len(self), axis=0))

    def of(self, robot: Robot) -> Motion:
        """The same motion of another robot with the same joints; shares what both move alike."""
        other = replace(self, robot=robot)
        if _moves_alike(robot, self.robot):
            other.__dict__.update(tree=self.tree, kinematics=self.kinematics)
            if self.acceleration is not None:
                other._accelerated = self.acceleration, self.accelerations
        return other

    def __len__(self) -> int:
        """Number N of states."""
        return len(self.time)

    @property
    def rates(self) -> Array:
        """(N, 6 + n) generalized velocity."""
        return np.concatenate([self.velocity, self.omega, self.qd], axis=1)

    def zeros(self) -> Array:
        """(N, 6 + n) of zeros: no force."""
        return np.zeros((len(self), 6 + self.robot.n_joints))

    def column(self, joint: str | None) -> int:
        """Place of a joint in joint vectors."""
        return self.robot.joints.index(str(joint))

    def joint_force(self, joint: str | None, torque: Array) -> Array:
        """(N, 6 + n) generalized force of a torque (N,) on one joint."""
        out = self.zeros()
        out[:, 6 + self.column(joint)] = torque
        return out

    def wrench(
        self,
        link: str | None,
        force: Array | None,
        torque: Array | None,
        point: Array | None = None,
    ) -> Array:
        """(N, 6 + n) generalized force of a force and a torque on a body.

        Args:
            link: Name of the body.
            force: (N, 3) or (3,) in the body's frame [N], or None.
            torque: (N, 3) or (3,) in the body's frame [N m], or None.
            point: (3,) or (N, 3) where the force acts, in the body's frame [m]; None: its origin.
        """
        total = np.zeros((len(self), 6))
        if force is not None:
            total[:, :3] = force
            if point is not None:
                total[:, 3:] = cross_rows(np.asarray(point), np.asarray(force))
        if torque is not None:
            total[:, 3:] += torque
        return np.asarray(
            generalized_force(self.tree, body_index(self.robot, link), self.kinematics, total)
        )

    def link_rotation(self, link: str | None) -> Array:
        """(N, 3, 3) takes coordinates of a body to the inertial frame."""
        return np.asarray(self.rotation @ self.base_rotation(link))

    def base_rotation(self, link: str | None) -> Array:
        """(N, 3, 3) takes coordinates of a body to base coordinates."""
        return self.kinematics.rotations[:, body_index(self.robot, link)]

    def link_position(self, link: str | None) -> Array:
        """(N, 3) origin of a body in base coordinates [m]."""
        return self.kinematics.origins[:, body_index(self.robot, link)]

    def twist(self, link: str | None) -> Array:
        """(N, 6) [linear; angular] velocity of a body's frame, in it."""
        return self.kinematics.twists[:, body_index(self.robot, link)]

    def link_acceleration(self, link: str | None) -> Array:
        """(N, 6) time derivative of `twist`, in the body's frame; needs `acceleration`."""
        return self.accelerations[:, body_index(self.robot, link)]

    @cached_property
    def tree(self) -> Records:
        """What the compiled functions take of the robot; only its geometry may be used."""
        return tree_of(self.robot)

    @cached_property
    def kinematics(self) -> BodyKinematics:
        """Rotations, origins, velocities and drifts of all bodies."""
        q, qd = (np.ascontiguousarray(x, dtype=float) for x in (self.q, self.qd))
        return forward_kinematics(self.tree, q, self.rates, qd)

    @property
    def centres(self) -> Array:
        """(N, n + 1, 3) centres of mass of the bodies in base coordinates [m]."""
        com = np.array([body.com for body in self.robot.bodies])
        turned = np.einsum('nbij,bj->nbi', self.kinematics.rotations, com)
        return np.asarray(self.kinematics.origins + turned)

    @cached_property
    def extra(self) -> Mapping[str, Array]:
        """(N,) what else was measured, by name."""
        inputs = self.robot.inputs
        signals = {} if inputs is None else inputs.extra
        return {name: signal.at(self.time)[:, 0] for name, signal in signals.items()}

    @property
    def accelerations(self) -> Array:
        """(N, bodies, 6) `link_acceleration` of all bodies."""
        known = self.acceleration
        if known is None:
            raise ValueError('the accelerations of this motion are not known')
        if self._accelerated is None or self._accelerated[0] is not known:
            bodies = body_accelerations(self.tree, self.kinematics, np.ascontiguousarray(known))
            self._accelerated = known, bodies
        return self._accelerated[1]


def motion_at(robot: Robot, time: float, state: State, torque: Array) -> Motion:
    """A single state as a motion.

    Args:
        robot: The robot.
        time: Since the start [s].
        state: The state.
        torque: (n,) motor torques [N m].
    """
    joints = state.q[None], state.qd[None], torque[None]
    rotation = rotation_matrix(state.q_WB_xyzw)[None]
    omega, v = state.omega_WB_B[None], state.v_WB_B[None]
    return Motion(robot, np.array([time]), *joints, rotation=rotation, omega=omega, velocity=v)


def body_index(robot: Robot, link: str | None) -> int:
    """Number of a body."""
    return [body.name for body in robot.bodies].index(str(link))


def inverse_mass(robot: Robot) -> Array:
    """(6 + n, 6 + n) inverse mass matrix, all joints at zero; zero for the base of a fixed one."""
    out = np.zeros((6 + robot.n_joints, 6 + robot.n_joints))
    first = 0 if robot.is_free else 6
    out[first:, first:] = np.linalg.inv(Dynamics(robot).mass_matrix(np.zeros(robot.n_joints)))
    return out


def mobility(robot: Robot, column: int) -> float:
    """Acceleration of a coordinate by its own force, the others free [1/kg or 1/(kg m^2)]."""
    return float(inverse_mass(robot)[column, column])


def _moves_alike(a: Robot, b: Robot) -> bool:
    """Whether two robots differ in mass, inertia and wheels only."""
    return len(a.bodies) == len(b.bodies) and all(
        x.name == y.name
        and x.parent == y.parent
        and x.rotation is y.rotation
        and x.translation is y.translation
        and x.axis is y.axis
        for x, y in zip(a.bodies, b.bodies, strict=True)
    )
