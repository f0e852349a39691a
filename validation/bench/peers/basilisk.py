"""Basilisk: `MJScene`, its MuJoCo back end, with its own RK4 and high-order attitude."""

from __future__ import annotations

import re
from importlib.metadata import version

import harness
import numpy as np
import servicer
from Basilisk.architecture import messaging
from Basilisk.simulation import mujoco, svIntegrators
from Basilisk.utilities import SimulationBaseClass, macros


class Machine:
    """A scene at the start of a run."""

    def __init__(self, scenario: str, step: float) -> None:
        self.simulation = SimulationBaseClass.SimBaseClass()
        process = self.simulation.CreateNewProcess('process')
        process.addTask(self.simulation.CreateNewTask('task', macros.sec2nano(step)))
        # Basilisk finds actuators by name.
        model = servicer.mjcf(step)
        for k in (1, 2, 3):
            model = model.replace(
                f'<motor joint="j_link{k}"', f'<motor name="m{k}" joint="j_link{k}"'
            )
        self.scene = mujoco.MJScene(model)
        self.scene.extraEoMCall = True
        self.scene.highOrderAttitudeIntegration = True
        self.simulation.AddModelToTask('task', self.scene)
        # Joints follow each other as in the XML, depth first.
        found = re.findall(r'joint name="j_(\w+)"', model)
        self.order = [found.index(name) for name in servicer.JOINTS]
        self.integrator = svIntegrators.svIntegratorRK4(self.scene)
        self.scene.setIntegrator(self.integrator)
        self.drives = [self._drive(k, scenario) for k in range(3)]
        self.simulation.InitializeSimulation()
        self._place()
        self.has_begun = False

    def run_to(self, t: float) -> None:
        """Integrate up to a time [s]."""
        self.has_begun = True
        self.simulation.ConfigureStopTime(macros.sec2nano(t))
        self.simulation.ExecuteSimulation()

    def hold(self, torques: tuple[float, float, float]) -> None:
        """Torques from now on."""
        for message, value in zip(self.drives, torques, strict=True):
            payload = messaging.SingleActuatorMsgPayload()
            payload.input = value
            message.write(payload)

    def state(self) -> tuple:
        """What `harness.run_seconds` asks for."""
        message = self.scene.stateOutMsg.read()
        qpos, qvel = np.array(message.qpos).ravel(), np.array(message.qvel).ravel()
        w, x, y, z = qpos[3:7]
        R = servicer.rotation_matrix((x, y, z, w))
        q, qd = qpos[7:][self.order], qvel[6:][self.order]
        return R, R @ qvel[3:6], qvel[:3], q, qd, (x, y, z, w)

    def _drive(self, k: int, scenario: str) -> object:
        motor = self.scene.getSingleActuator(f'm{k + 1}')
        if scenario == 'held':
            message = messaging.SingleActuatorMsg()
            motor.actuatorInMsg.subscribeTo(message)
            return message
        # Its cost grows with the table: 0.1 s apart, a cubic interpolation.
        curve = mujoco.SingleActuatorInterpolator()
        times = np.arange(205) * 0.1
        points = [[macros.sec2nano(t), servicer.torque(t)[k]] for t in times]
        curve.setDataPoints(np.array(points), 3)
        motor.actuatorInMsg.subscribeTo(curve.interpolatedOutMsg)
        self.scene.AddModelToDynamicsTask(curve)
        return curve

    def _place(self) -> None:
        x, y, z, w = servicer.ATTITUDE_XYZW
        base = self.scene.getBody('base')
        base.setPosition([0.0, 0.0, 0.0])
        base.setVelocity([0.0, 0.0, 0.0])
        base.setAttitude((np.array([x, y, z]) / (1.0 + w)).tolist())
        base.setAttitudeRate(servicer.OMEGA_B.tolist())
        for name, rate in zip(servicer.JOINTS, servicer.RATES, strict=True):
            self.scene.getBody(name).getScalarJoint(f'j_{name}').setVelocity(float(rate))


def run(scenario: str, step: float) -> harness.Outcome:
    """One run; a held one stops at every control period to change the torques."""
    machine = Machine(scenario, step)
    start = servicer.rotation_matrix(servicer.ATTITUDE_XYZW)
    # The scene publishes its state with the first step only.
    initial = (
        start,
        start @ servicer.OMEGA_B,
        np.zeros(3),
        np.zeros(len(servicer.JOINTS)),
        servicer.RATES,
        servicer.ATTITUDE_XYZW,
    )

    def state() -> tuple:
        return machine.state() if machine.has_begun else initial

    return harness.stepped(machine, scenario, state)


if __name__ == '__main__':
    steps = harness.by_step(run, (1e-2, 5e-3, 2e-3, 1e-3))
    harness.report('Basilisk', version('bsk'), steps)
