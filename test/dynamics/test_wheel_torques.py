"""Joint torques and base wrench against recursive Newton-Euler with six explicit wheel bodies."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.models import (
    H_BASE,
    H_TARGET,
    WHEEL_SPIN,
    robot_of,
    settings_of,
    table_one,
    to_urdf,
    wheel_joints,
    with_wheels,
)
from support.states import random_state

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.simulation.truth import true_robot

STATES = 200
LIMIT = 1e-9  # N m and N; torques are of order 1e3, so about 1e3 roundings


class ExplicitWheels:
    """Pinocchio on a URDF in which all six wheels are bodies."""

    def __init__(self, axes: str) -> None:
        self.model = pin.buildModelFromXML(
            to_urdf(with_wheels(table_one(axes))), pin.JointModelFreeFlyer()
        )
        self.model.gravity.setZero()
        self.data = self.model.createData()

    def torques(
        self, state: State, qd: dict[str, float], base_acceleration, qdd: dict[str, float]
    ):
        """Base wrench, and torque of every joint by name."""
        model = self.model
        q, v, a = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        q[:3], q[3:7] = state.p_WB, state.q_WB_xyzw
        v[:6] = [*state.v_WB_B, *state.omega_WB_B]
        a[:6] = base_acceleration
        for k, angle in enumerate(state.q[:3]):
            joint = model.joints[model.getJointId(f'j_link_{k + 1}')]
            q[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
        for name, rate in qd.items():
            index = model.joints[model.getJointId(name)].idx_v
            v[index], a[index] = rate, qdd[name]
        tau = pin.rnea(model, self.data, q, v, a)
        return tau[:6], {name: tau[model.joints[model.getJointId(name)].idx_v] for name in qd}


@pytest.fixture(params=['zyx', 'xyy', 'zyy'])
def axes(request):
    return request.param


def _mismatch(axes: str, rng, joint_reaction: bool):
    robot = robot_of(
        table_one(axes),
        servicer_wheels={'momentum': list(H_BASE)},
        target_wheels={'links': ['link_3'], 'momentum': list(H_TARGET)},
    )
    dynamics, oracle = Dynamics(robot, joint_reaction=joint_reaction), ExplicitWheels(axes)
    spin = dict(
        zip(
            [*wheel_joints(0), *wheel_joints(3)],
            np.concatenate([H_BASE, H_TARGET]) / WHEEL_SPIN,
            strict=True,
        )
    )
    base_worst, joint_worst = 0.0, np.zeros(3)
    for _ in range(STATES):
        state, a0, qdd = random_state(rng, 3), rng.standard_normal(6), rng.standard_normal(3)
        base, tau = dynamics.inverse(state, a0, qdd)
        expected_base, torques = oracle.torques(
            state,
            {**dict(zip(robot.joints, state.qd, strict=True)), **spin},
            a0,
            {**dict(zip(robot.joints, qdd, strict=True)), **dict.fromkeys(spin, 0.0)},
        )
        base_worst = max(base_worst, np.max(np.abs(base - expected_base)))
        joint_worst = np.maximum(
            joint_worst, np.abs(tau - [torques[name] for name in robot.joints])
        )
    return base_worst, joint_worst


def test_gyrostats_agree_with_wheels_held_at_constant_relative_rate(axes, rng):
    base, joints = _mismatch(axes, rng, joint_reaction=True)
    assert base <= LIMIT
    assert np.max(joints) <= LIMIT


def test_without_the_joint_term_joint_torques_are_tens_of_newton_metres_off(axes, rng):
    base, joints = _mismatch(axes, rng, joint_reaction=False)
    assert base <= LIMIT  # the printed base equation is right
    assert np.min(joints) > 50.0


def test_true_rotors_through_the_loader_agree(axes, rng):
    parts = with_wheels(table_one(axes))
    wheels = {
        'servicer_wheels': {'joints': wheel_joints(0), 'rates': list(H_BASE / WHEEL_SPIN)},
        'target_wheels': {'joints': wheel_joints(3), 'rates': list(H_TARGET / WHEEL_SPIN)},
    }
    plant = true_robot(robot_of(parts, **wheels), settings_of(parts, **wheels))
    dynamics, oracle = Dynamics(plant), ExplicitWheels(axes)
    for _ in range(STATES):
        state, a0, qdd = random_state(rng, 9), rng.standard_normal(6), rng.standard_normal(9)
        state.qd[3:] = plant.rotor_rates + rng.standard_normal(6)
        base, tau = dynamics.inverse(state, a0, qdd)
        expected_base, torques = oracle.torques(
            state,
            dict(zip(plant.joints, state.qd, strict=True)),
            a0,
            dict(zip(plant.joints, qdd, strict=True)),
        )
        np.testing.assert_allclose(base, expected_base, rtol=0, atol=LIMIT)
        np.testing.assert_allclose(
            tau, [torques[name] for name in plant.joints], rtol=0, atol=LIMIT
        )
