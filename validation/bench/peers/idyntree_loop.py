"""iDynTree, which has no simulator: RK4 over its mass matrix and bias forces in Python."""

from __future__ import annotations

import tempfile
from importlib.metadata import version
from pathlib import Path

import harness
import idyntree.bindings as idyn
import numpy as np
import servicer


class Machine:
    """iDynTree's model of the servicer; velocities in the inertial frame."""

    def __init__(self) -> None:
        names, loader = [f'j_{name}' for name in servicer.JOINTS], idyn.ModelLoader()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / 'servicer.urdf'
            path.write_text('<?xml version="1.0"?>' + servicer.urdf())
            loader.loadReducedModelFromFile(str(path), names)
        self.engine = idyn.KinDynComputations()
        self.engine.loadRobotModel(loader.model())
        self.engine.setFloatingBase('base')
        self.engine.setFrameVelocityRepresentation(idyn.MIXED_REPRESENTATION)
        n = self.n = len(names)
        self.mass = idyn.MatrixDynSize(6 + n, 6 + n)
        self.bias = idyn.FreeFloatingGeneralizedTorques(self.engine.model())
        self.pose, self.no_gravity, self.force = np.eye(4), np.zeros(3), np.zeros(6 + n)
        self.x = harness.start_vector()
        R = servicer.rotation_matrix(servicer.ATTITUDE_XYZW)
        self.x[10 + n : 13 + n] = R @ servicer.OMEGA_B

    def rate(self, x: np.ndarray, tau: tuple[float, float, float]) -> np.ndarray:
        """Time derivative of the state."""
        n = self.n
        twist, w, q, s = x[7 + n : 13 + n].copy(), x[10 + n : 13 + n], x[3:6], x[6]
        self.pose[:3, :3], self.pose[:3, 3] = servicer.rotation_matrix(x[3:7]), x[:3]
        self.engine.setRobotState(
            self.pose, x[7 : 7 + n].copy(), twist, x[13 + n :].copy(), self.no_gravity
        )
        self.engine.getFreeFloatingMassMatrix(self.mass)
        self.engine.generalizedBiasForces(self.bias)
        bias = np.concatenate(
            [self.bias.baseWrench().toNumPy(), self.bias.jointTorques().toNumPy()]
        )
        self.force[6:9] = tau
        out = np.empty_like(x)
        out[:3], out[3:6], out[6] = twist[:3], 0.5 * (s * w + np.cross(w, q)), -0.5 * w @ q
        out[7 : 7 + n] = x[13 + n :]
        out[7 + n :] = np.linalg.solve(self.mass.toNumPy(), self.force - bias)
        return out

    def state(self) -> tuple:
        """What `harness.run_seconds` asks for."""
        n, x = self.n, self.x
        R, velocity, omega = (
            servicer.rotation_matrix(x[3:7]),
            x[7 + n : 10 + n],
            x[10 + n : 13 + n],
        )
        return R, omega, velocity, x[7 : 7 + n], x[13 + n :], x[3:7]


if __name__ == '__main__':
    by_step = harness.by_step(
        lambda scenario, h: harness.rk4(Machine(), scenario, h), (5e-2, 1e-2, 5e-3, 2e-3)
    )
    harness.report('iDynTree', version('idyntree'), by_step)
