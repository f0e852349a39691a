"""N states of one robot: all that a physical effect may depend on.

The simulator asks with N = 1 inside an integration step, the diagnosis with every sample of a
record at once; an effect does not see the difference.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import pinocchio as pin

from ..dynamics.rotation import cross_rows
from ..model.robot import Robot
from ..types import Array


class Motion:
    """Kinematics of N states.

    Generalised vectors are (N, 6 + n): base [linear; angular] in base coordinates, then the
    joints, for a fixed base too, whose first six entries are zero.

    Args:
        robot: The robot as all effects have made it.
        time: (N,) time since the start [s].
        q: (N, n) joint positions [rad]. qd: (N, n) joint rates [rad/s].
        effort: (N, n) motor torques [N m].
        rotation: (N, 3, 3) R_WB; None: base and inertial frame aligned.
        omega: (N, 3) omega_WB_B [rad/s]; None: zero.
        velocity: (N, 3) v_WB_B [m/s]; None: zero.
        acceleration: (N, 6 + n) time derivative of [v_WB_B; omega_WB_B; qd]; None where it is not
            known yet.
    """

    def __init__(
        self,
        robot: Robot,
        time: Array,
        q: Array,
        qd: Array,
        effort: Array,
        *,
        rotation: Array | None = None,
        omega: Array | None = None,
        velocity: Array | None = None,
        acceleration: Array | None = None,
    ) -> None:
        self.robot = robot
        self.time = time
        self.q, self.qd, self.effort = q, qd, effort
        count = len(time)
        zeros = np.zeros((count, 3))
        self.rotation = np.broadcast_to(np.eye(3), (count, 3, 3)) if rotation is None else rotation
        self.omega = zeros if omega is None else omega
        self.velocity = zeros if velocity is None else velocity
        self.acceleration = acceleration
        self._twists: dict[str, Array] = {}
        self._drifts: dict[str, Array] = {}

    def of(self, robot: Robot) -> Motion:
        """The same motion of another robot with the same joints; shares what both move alike."""
        other = Motion(
            robot,
            self.time,
            self.q,
            self.qd,
            self.effort,
            rotation=self.rotation,
            omega=self.omega,
            velocity=self.velocity,
            acceleration=self.acceleration,
        )
        if _moves_alike(robot, self.robot):
            other.__dict__['_kinematics'] = self._kinematics
            other._twists, other._drifts = self._twists, self._drifts
        return other

    def __len__(self) -> int:
        """Number N of states."""
        return len(self.time)

    @property
    def rates(self) -> Array:
        """(N, 6 + n) generalised velocity."""
        return np.concatenate([self.velocity, self.omega, self.qd], axis=1)

    def zeros(self) -> Array:
        """(N, 6 + n) of zeros: no force."""
        return np.zeros((len(self), 6 + self.robot.n_joints))

    def joint_force(self, joint: str, torque: Array) -> Array:
        """(N, 6 + n) generalised force of a torque (N,) on one joint."""
        out = self.zeros()
        out[:, 6 + self.robot.joints.index(joint)] = torque
        return out

    def wrench(
        self, link: str, force: Array | None, torque: Array | None, point: Array | None = None
    ) -> Array:
        """(N, 6 + n) generalised force of a force and a torque on a body.

        Args:
            link: Name of the body.
            force: (N, 3) or (3,) in the body's frame [N], or None.
            torque: (N, 3) or (3,) in the body's frame [N m], or None.
            point: (3,) or (N, 3) where the force acts, in the body's frame [m]; None: its origin.
        """
        jacobian = self.jacobian(link)
        total = np.zeros((len(self), 6))
        if force is not None:
            total[:, :3] = force
            if point is not None:
                total[:, 3:] = cross_rows(np.asarray(point), np.asarray(force))
        if torque is not None:
            total[:, 3:] += torque
        return np.asarray(np.einsum('nij,ni->nj', jacobian, total))

    def jacobian(self, link: str) -> Array:
        """(N, 6, 6 + n) twist [linear; angular] of a body's frame, in it, by generalised rates."""
        return self._kinematics[0][:, self._body(link)]

    def link_rotation(self, link: str) -> Array:
        """(N, 3, 3) takes coordinates of a body to the inertial frame."""
        return np.asarray(self.rotation @ self.base_rotation(link))

    def base_rotation(self, link: str) -> Array:
        """(N, 3, 3) takes coordinates of a body to base coordinates."""
        return self._kinematics[1][:, self._body(link)]

    def link_position(self, link: str) -> Array:
        """(N, 3) origin of a body in base coordinates [m]."""
        return self._kinematics[2][:, self._body(link)]

    def twist(self, link: str) -> Array:
        """(N, 6) [linear; angular] velocity of a body's frame, in it."""
        if link not in self._twists:
            self._twists[link] = np.einsum('nij,nj->ni', self.jacobian(link), self.rates)
        return self._twists[link]

    def link_acceleration(self, link: str) -> Array:
        """(N, 6) time derivative of `twist`, in the body's frame; needs `acceleration`."""
        if self.acceleration is None:
            raise ValueError('the accelerations of this motion are not known')
        forced = np.einsum('nij,nj->ni', self.jacobian(link), self.acceleration)
        if link not in self._drifts:
            self._drifts[link] = self._drift(link)
        return np.asarray(forced + self._drifts[link])

    def _body(self, link: str) -> int:
        return [body.name for body in self.robot.bodies].index(link)

    @cached_property
    def _kinematics(self) -> tuple[Array, Array, Array]:
        """Jacobians (N, bodies, 6, 6 + n), rotations and origins of all bodies in the base."""
        robot = self.robot
        model, ids = robot.pin_model, robot.pin_joint_ids
        data = model.createData()
        shape = (len(self), len(robot.bodies))
        jacobians = np.zeros((*shape, 6, 6 + robot.n_joints))
        rotations, origins = np.empty((*shape, 3, 3)), np.empty((*shape, 3))
        columns = self.pin_columns
        for k, q in enumerate(self.configurations):
            pin.computeJointJacobians(model, data, q)
            for b, joint in enumerate(ids):
                if joint:
                    local = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)
                    # one joint alone comes without its axis
                    jacobians[k, b][:, columns] = np.reshape(local, (6, -1))
                rotations[k, b] = data.oMi[joint].rotation
                origins[k, b] = data.oMi[joint].translation
        return jacobians, rotations, origins

    def _drift(self, link: str) -> Array:
        """(N, 6) acceleration of a body's frame at zero generalised acceleration."""
        robot = self.robot
        model, joint = robot.pin_model, robot.pin_joint_ids[self._body(link)]
        data, zero = model.createData(), np.zeros(model.nv)
        out = np.zeros((len(self), 6))
        velocities = self.rates[:, self.pin_columns]
        for k, (q, v) in enumerate(zip(self.configurations, velocities, strict=True)):
            pin.forwardKinematics(model, data, q, v, zero)
            out[k] = data.a[joint].vector
        return out

    @cached_property
    def pin_columns(self) -> Array:
        """(nv,) places of Pinocchio's velocities in a generalised vector."""
        order = np.empty(self.robot.n_joints, dtype=int)
        order[self.robot.velocity_indices] = np.arange(self.robot.n_joints)
        base = np.arange(6) if self.robot.is_free else np.zeros(0, dtype=int)
        return np.concatenate([base, 6 + order])

    @cached_property
    def configurations(self) -> Array:
        """(N, nq) Pinocchio's configurations, the base at the origin of the inertial frame."""
        robot = self.robot
        out = np.zeros((len(self), robot.pin_model.nq))
        if robot.is_free:
            out[:, 6] = 1.0
        offset = 7 if robot.is_free else 0
        out[:, offset + robot.velocity_indices] = self.q
        return out


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
