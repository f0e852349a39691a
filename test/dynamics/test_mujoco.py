"""Accelerations and a 20 s run against MuJoCo, an engine that shares no code with Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest
from support.attitudes import angle_between
from support.models import (
    ATTITUDE_XYZW,
    DUAL_ARM,
    H_BASE,
    H_TARGET,
    OMEGA,
    WHEEL_SPIN,
    quaternion_matrix,
    random_tree,
    robot_of,
    settings_of,
    table_one,
    to_mjcf,
    wheel_joints,
    with_wheels,
)
from support.states import random_state

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.simulation.truth import true_robot
from validation.smooth_motion import simulate_smooth

mujoco = pytest.importorskip('mujoco')

DT, DURATION = 1e-3, 20.0
ROTORS = {
    'servicer_wheels': {'joints': wheel_joints(0), 'rates': list(H_BASE / WHEEL_SPIN)},
    'target_wheels': {'joints': wheel_joints(3), 'rates': list(H_TARGET / WHEEL_SPIN)},
}
ARM = ['j_link_1', 'j_link_2', 'j_link_3']


class Engine:
    """A MuJoCo model of parts; joints by name, quaternions to MuJoCo's wxyz and back."""

    def __init__(self, parts, **options):
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(parts, DT, **options))
        self.data = mujoco.MjData(self.model)
        self.free = options.get('free', True)

    def addresses(self, joints):
        ids = [self.model.joint(name).id for name in joints]
        return self.model.jnt_qposadr[ids], self.model.jnt_dofadr[ids]

    def place(self, state, joints):
        """Set the state; MuJoCo's base velocity is in the world, its rate in the body."""
        q, v = self.addresses(joints)
        self.data.qpos[q], self.data.qvel[v] = state.q, state.qd
        if self.free:
            self.data.qpos[:3], self.data.qpos[3:7] = state.p_WB, np.roll(state.q_WB_xyzw, 1)
            self.data.qvel[:3] = quaternion_matrix(state.q_WB_xyzw) @ state.v_WB_B
            self.data.qvel[3:6] = state.omega_WB_B

    def motors(self, joints):
        order = [self.model.actuator(i).trnid[0] for i in range(self.model.nu)]
        return [order.index(self.model.joint(name).id) for name in joints]


CASES = {
    'serial': ([0, 1, 2], (), {}),
    'dual arm': (DUAL_ARM, (), {}),
    'slides': ([0, 1, 2, 1], (2, 4), {'gravity': [0.5, -1.0, -9.81]}),
    'fixed base': ([0, 1, 2, 0], (3,), {'base': 'fixed', 'gravity': [0.0, 0.0, -9.81]}),
}


@pytest.mark.parametrize(('parents', 'prismatic', 'options'), CASES.values(), ids=CASES.keys())
def test_accelerations_of_random_trees(parents, prismatic, options, rng):
    parts = random_tree(rng, parents, prismatic)
    joints = tuple(parts[i].joint for i in 1 + rng.permutation(len(parents)))
    robot = robot_of(parts, list(joints), **options)
    dynamics, n = Dynamics(robot), robot.n_joints
    engine = Engine(
        parts, free=robot.is_free, gravity=tuple(options.get('gravity', (0.0, 0.0, 0.0)))
    )
    for _ in range(20):
        state, tau = random_state(rng, n), 10.0 * rng.standard_normal(n)
        engine.place(state, joints)
        engine.data.ctrl[engine.motors(joints)] = tau
        mujoco.mj_forward(engine.model, engine.data)
        rate = dynamics.rate(state.to_vector(), tau)
        # Accelerations of order 1e2, conditioned by joints of 1e-1 kg m^2 on 1e2.
        np.testing.assert_allclose(
            engine.data.qacc[engine.addresses(joints)[1]], rate[13 + n :], rtol=1e-9, atol=1e-9
        )
        if robot.is_free:
            R, w = quaternion_matrix(state.q_WB_xyzw), state.omega_WB_B
            linear = R @ (rate[7 + n : 10 + n] + np.cross(w, state.v_WB_B))
            np.testing.assert_allclose(engine.data.qacc[:3], linear, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(
                engine.data.qacc[3:6], rate[10 + n : 13 + n], rtol=1e-9, atol=1e-9
            )


def _torque(t):
    return np.array([40.0 * np.sin(0.9 * t), 40.0 * np.sin(0.7 * t), 20.0 * np.sin(1.1 * t)])


def _run(engine, hold_wheels):
    """Attitude xyzw and arm joints after 20 s of RK4 at 1 ms, torque of each step's middle.

    With `hold_wheels` each wheel's motor gives the torque that keeps its relative rate, found at
    every step from the engine's own mass matrix and bias: a gyrostat made of bodies.
    """
    model, data = engine.model, engine.data
    wheels = [*wheel_joints(0), *wheel_joints(3)]
    arm_motors, wheel_motors = engine.motors(ARM), engine.motors(wheels)
    dofs = engine.addresses(wheels)[1]
    for k in range(round(DURATION / DT)):
        data.ctrl[arm_motors] = _torque((k + 0.5) * DT)
        if hold_wheels:
            _hold(model, data, wheel_motors, dofs)
        mujoco.mj_step(model, data)
    q, _ = engine.addresses(ARM)
    return np.roll(data.qpos[3:7], -1), data.qpos[q].copy()


def _hold(model, data, motors, dofs):
    data.ctrl[motors] = 0.0
    mujoco.mj_forward(model, data)
    columns = np.zeros((len(dofs), model.nv))
    columns[np.arange(len(dofs)), dofs] = 1.0
    solved = np.zeros_like(columns)
    mujoco.mj_solveM(model, data, solved, columns)
    data.ctrl[motors] = np.linalg.solve(solved[:, dofs], -data.qacc[dofs])


@pytest.fixture
def engine():
    """Return Table I with six explicit wheels, spinning, at Table II's initial state."""
    engine = Engine(with_wheels(table_one()))
    wheels = [*wheel_joints(0), *wheel_joints(3)]
    rates = np.concatenate([H_BASE, H_TARGET]) / WHEEL_SPIN
    state = State(
        np.zeros(3),
        ATTITUDE_XYZW,
        np.zeros(9),
        np.zeros(3),
        OMEGA,
        np.concatenate([np.zeros(3), rates]),
    )
    engine.place(state, [*ARM, *wheels])
    return engine


def _ours(robot):
    n = robot.n_joints
    qd = np.concatenate([np.zeros(3), robot.rotor_rates])
    x = State(np.zeros(3), ATTITUDE_XYZW, np.zeros(n), np.zeros(3), OMEGA, qd).to_vector()

    def torque(t, _):
        return np.concatenate([_torque(t), np.zeros(n - 3)])

    return simulate_smooth(Dynamics(robot), x, torque, np.array([0.0, DURATION]))[-1]


def test_free_rotors_for_20_s(engine):
    parts = with_wheels(table_one())
    x = _ours(true_robot(robot_of(parts, **ROTORS), settings_of(parts, **ROTORS)))
    attitude, joints = _run(engine, hold_wheels=False)
    assert (
        angle_between(x[3:7], attitude) <= 1e-6
    )  # the target; MuJoCo's own step error is some 1e-8
    np.testing.assert_allclose(x[7:10], joints, rtol=0, atol=1e-6)


def test_gyrostats_for_20_s(engine):
    wheels = {
        'servicer_wheels': {'momentum': list(H_BASE)},
        'target_wheels': {'links': ['link_3'], 'momentum': list(H_TARGET)},
    }
    x = _ours(robot_of(table_one(), **wheels))
    attitude, joints = _run(engine, hold_wheels=True)
    assert angle_between(x[3:7], attitude) <= 1e-6
    np.testing.assert_allclose(x[7:10], joints, rtol=0, atol=1e-6)
