"""MuJoCo: its C loop (`mj_step` with a count) with held torques, and RK4 along a smooth torque."""

from __future__ import annotations

import harness
import mujoco
import servicer


class Machine:
    """A model and its data at the start of a run."""

    def __init__(self, step: float, integrator: str) -> None:
        self.model = mujoco.MjModel.from_xml_string(servicer.mjcf(step, integrator))
        self.data = mujoco.MjData(self.model)
        x, y, z, w = servicer.ATTITUDE_XYZW
        self.data.qpos[3:7] = w, x, y, z
        self.data.qvel[3:6] = servicer.OMEGA_B
        self.joints = [self.model.joint(f'j_{name}') for name in servicer.JOINTS]
        for joint, rate in zip(self.joints, servicer.RATES, strict=True):
            self.data.qvel[joint.dofadr[0]] = rate

    def state(self) -> tuple:
        """What `harness.run_seconds` asks for."""
        w, x, y, z = self.data.qpos[3:7]
        rotation = servicer.rotation_matrix((x, y, z, w))
        q = [self.data.qpos[j.qposadr[0]] for j in self.joints]
        qd = [self.data.qvel[j.dofadr[0]] for j in self.joints]
        omega, velocity = rotation @ self.data.qvel[3:6], self.data.qvel[:3].copy()
        return rotation, omega, velocity, q, qd, (x, y, z, w)


def held(step: float, integrator: str) -> harness.Outcome:
    """Torques held over control periods."""
    machine, torques = Machine(step, integrator), harness.held_torques()
    count, periods = round(servicer.PERIOD / step), round(1.0 / servicer.PERIOD)

    def advance(second: int) -> None:
        for k in range(second * periods, (second + 1) * periods):
            machine.data.ctrl[:] = torques[k]
            mujoco.mj_step(machine.model, machine.data, nstep=count)

    return harness.run_seconds(advance, machine.state)


def smooth(step: float, integrator: str) -> harness.Outcome:
    """The torque is asked for in every stage, by MuJoCo's control callback."""
    machine, count = Machine(step, integrator), round(1.0 / step)

    def control(_: object, data: mujoco.MjData) -> None:
        data.ctrl[:] = servicer.torque(data.time)

    mujoco.set_mjcb_control(control)
    try:
        return harness.run_seconds(
            lambda _: mujoco.mj_step(machine.model, machine.data, nstep=count), machine.state
        )
    finally:
        mujoco.set_mjcb_control(None)


def settings() -> list[harness.Setting]:
    """Steps from coarse to fine."""
    scenarios, integrators = {'smooth': smooth, 'held': held}, ('implicitfast', 'RK4')
    return [
        (name, f'{i} {1e3 * step:g} ms', lambda r=run, s=step, i=i: r(s, i))
        for name, run in scenarios.items()
        for i in integrators
        for step in (1e-2, 5e-3, 2e-3, 1e-3, 5e-4)
    ]


if __name__ == '__main__':
    harness.report('MuJoCo', mujoco.__version__, settings())
