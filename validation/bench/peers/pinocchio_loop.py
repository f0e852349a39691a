"""Pinocchio, which has no simulator: the plain loop, RK4 over `aba` in Python.

The quaternion is integrated by its own rate in every stage; `integrate`, one exponential of an
averaged rate, would leave second order.
"""

from __future__ import annotations

import harness
import numpy as np
import pinocchio as pin
import servicer


class Machine:
    """Pinocchio's model of the servicer."""

    def __init__(self) -> None:
        self.model = pin.buildModelFromXML(servicer.urdf(), pin.JointModelFreeFlyer())
        self.model.gravity.linear[:] = 0.0
        self.data = self.model.createData()
        joints = [self.model.joints[self.model.getJointId(f'j_{n}')] for n in servicer.JOINTS]
        # Joints of type "continuous" are two numbers, cos and sin, in Pinocchio's configuration.
        self.places = np.array([joint.idx_q for joint in joints])
        self.rates = np.array([joint.idx_v for joint in joints])
        self.arm, self.effort = self.rates[:3], np.zeros(self.model.nv)
        self.q, self.x = pin.neutral(self.model), harness.start_vector()
        self.v, self.n = np.zeros(self.model.nv), len(joints)

    def rate(self, x: np.ndarray, tau: tuple[float, float, float]) -> np.ndarray:
        """Time derivative of the state."""
        n, q, v = self.n, self.q, self.v
        angles, qx, qy, qz, qw = x[7 : 7 + n], *x[3:7].tolist()
        a, b, c = x[10 + n : 13 + n].tolist()
        q[:3], q[3:7] = x[:3], x[3:7] / np.sqrt(x[3:7] @ x[3:7])
        q[self.places], q[self.places + 1] = np.cos(angles), np.sin(angles)
        v[:6], v[self.rates] = x[7 + n : 13 + n], x[13 + n :]
        self.effort[self.arm] = tau
        acceleration = pin.aba(self.model, self.data, q, v, self.effort)
        out = np.empty_like(x)
        out[:3] = self.data.oMi[1].rotation @ x[7 + n : 10 + n]
        out[3:7] = (
            0.5 * (qw * a + qy * c - qz * b),
            0.5 * (qw * b + qz * a - qx * c),
            0.5 * (qw * c + qx * b - qy * a),
            -0.5 * (qx * a + qy * b + qz * c),
        )
        out[7 : 7 + n], out[7 + n : 13 + n] = x[13 + n :], acceleration[:6]
        out[13 + n :] = acceleration[self.rates]
        return out

    def state(self) -> tuple:
        """What `harness.run_seconds` asks for."""
        n, x = self.n, self.x
        R = servicer.rotation_matrix(x[3:7])
        velocity, omega = R @ x[7 + n : 10 + n], R @ x[10 + n : 13 + n]
        return R, omega, velocity, x[7 : 7 + n], x[13 + n :], x[3:7]


if __name__ == '__main__':
    by_step = harness.by_step(
        lambda scenario, h: harness.rk4(Machine(), scenario, h), (5e-2, 1e-2, 5e-3, 2e-3, 1e-3)
    )
    harness.report('Pinocchio, plain loop', pin.__version__, by_step)
