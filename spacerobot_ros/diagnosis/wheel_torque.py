"""Gyrostats on a tree: the torque of their turning, and its gradient."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from ..dynamics.rotation import skew
from ..model.robot import Robot
from ..types import Array


class WheelTorque:
    """Gyrostats as external torques -omega x h.

    Args:
        robot: The robot that carries them.
    """

    def __init__(self, robot: Robot) -> None:
        self._model = robot.pin_model
        self._data = self._model.createData()
        self._external = pin.StdVec_Force([pin.Force.Zero() for _ in range(self._model.njoints)])
        momenta: dict[int, Array] = {}
        for g in robot.gyrostats:
            joint = robot.pin_joint_ids[g.body]
            if g.momentum.any() and joint:
                momenta[joint] = momenta.get(joint, np.zeros(3)) + g.body_momentum
        self._wheels = [(joint, skew(h)) for joint, h in momenta.items()]
        # views into Pinocchio's memory, which lives as long as this object
        self._views = [
            (h, self._data.v[joint].angular, self._external[joint].angular)
            for joint, h in self._wheels
        ]

    def forces(self, q: Array, v: Array) -> pin.StdVec_Force:
        """Torque on each of Pinocchio's joints, in its frame; valid until the next call."""
        if self._views:
            pin.forwardKinematics(self._model, self._data, q, v)
            for h, omega, torque in self._views:
                np.dot(h, omega, out=torque)
        return self._external

    def gradients(self, q: Array, v: Array) -> tuple[Array, Array]:
        """(nv, nv) generalised wheel torque's derivatives by q and v, through the body rates."""
        model, data = self._model, self._data
        by_q, by_v = np.zeros((model.nv, model.nv)), np.zeros((model.nv, model.nv))
        if not self._wheels:
            return by_q, by_v
        pin.computeForwardKinematicsDerivatives(model, data, q, v, np.zeros(model.nv))
        for joint, h in self._wheels:
            dv_dq, dv_dv = pin.getJointVelocityDerivatives(
                model, data, joint, pin.ReferenceFrame.LOCAL
            )
            onto = dv_dv[3:].T @ h
            by_q += onto @ dv_dq[3:]
            by_v += onto @ dv_dv[3:]
        return by_q, by_v
