"""The compiled forward dynamics against Pinocchio's, with the wheels' torques put in by hand."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.attitudes import quaternion_rate
from support.models import DUAL_ARM, WHEELS, random_tree, robot_of
from support.states import random_state

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.pinocchio_model import in_pinocchio
from spacerobot_ros.dynamics.rotation import rotation_matrix

CASES = {
    'one joint': ([0], (), {'gravity': [0.3, -0.2, -9.81]}),
    'dual arm': (DUAL_ARM, (), WHEELS),
    'slides': ([0, 1, 2, 1], (2, 4), WHEELS),
    'gravity': ([0, 1, 2, 3, 4, 5, 6], (4,), {**WHEELS, 'gravity': [0.3, -0.2, -9.81]}),
    'fixed base': ([0, 1, 2, 0], (3,), {**WHEELS, 'base': 'fixed', 'gravity': [0.0, 1.0, -9.8]}),
}


def pinocchio_rate(robot, x, tau, wrench, joint_reaction):
    """Pinocchio's articulated-body algorithm with -omega x h on every body that carries wheels."""
    model, n = in_pinocchio(robot).model, robot.n_joints
    data, base = model.createData(), 6 if robot.is_free else 0
    joints = in_pinocchio(robot).velocity_indices
    q, v, force = np.zeros(model.nq), np.zeros(model.nv), np.zeros(model.nv)
    q[joints + (base and 7)], v[joints + base], force[joints + base] = (
        x[7 : 7 + n],
        x[13 + n :],
        tau,
    )
    attitude = x[3:7] / np.linalg.norm(x[3:7])
    if base:
        q[:3], q[3:7], v[:6], force[:6] = x[:3], attitude, x[7 + n : 13 + n], wrench
    pin.forwardKinematics(model, data, q, v)
    external = pin.StdVec_Force([pin.Force.Zero() for _ in range(model.njoints)])
    for g in robot.gyrostats:
        joint = in_pinocchio(robot).joint_ids[g.body]
        torque = -np.cross(data.v[joint].angular, g.body_momentum)
        carrier = joint if joint_reaction else in_pinocchio(robot).joint_ids[0]
        turn = data.oMi[carrier].rotation.T @ data.oMi[joint].rotation
        external[carrier] += pin.Force(np.zeros(3), turn @ torque)
    a = pin.aba(model, data, q, v, force, external)
    out = np.zeros(13 + 2 * n)
    if base:
        out[:3] = rotation_matrix(attitude) @ v[:3]
        out[3:7] = quaternion_rate(x[3:7], v[3:6])
        out[7 + n : 13 + n] = a[:6]
    out[7 : 7 + n], out[13 + n :] = x[13 + n :], a[joints + base]
    return out


@pytest.mark.parametrize('joint_reaction', [True, False])
@pytest.mark.parametrize('case', CASES.values(), ids=CASES.keys())
def test_rate_equals_pinocchio(case, joint_reaction, rng):
    parents, prismatic, options = case
    for _ in range(5):
        parts = random_tree(rng, parents, prismatic)
        joints = [parts[i].joint for i in 1 + rng.permutation(len(parents))]
        robot = robot_of(parts, joints, **options)
        dynamics, n = Dynamics(robot, joint_reaction=joint_reaction), robot.n_joints
        for _ in range(10):
            x = random_state(rng, n).to_vector()
            x[3:7] *= 1.3  # the length of the quaternion must not matter
            tau, wrench = rng.standard_normal(n), rng.standard_normal(6)
            expected = pinocchio_rate(robot, x, tau, wrench, joint_reaction)
            np.testing.assert_allclose(
                dynamics.rate(x, tau, wrench),
                expected,
                rtol=0,
                atol=1e-12 * np.max(np.abs(expected)),
            )


def test_fast_wheel_far_from_the_base_loses_no_digits(rng):
    # 0.1 kg m^2 at 500 rad/s, 40 m out: about the base origin its terms would be 1e5 times larger.
    parts = random_tree(rng, [0, 1, 2])
    robot = robot_of(parts)
    for part in robot.bodies[1:]:
        part.translation[:] *= 40.0
    dynamics, n = Dynamics(robot), robot.n_joints
    x = random_state(rng, n).to_vector()
    x[-1] = 500.0
    expected = pinocchio_rate(robot, x, np.ones(n), np.zeros(6), True)
    np.testing.assert_allclose(
        dynamics.rate(x, np.ones(n)), expected, rtol=0, atol=1e-12 * np.max(np.abs(expected))
    )


def test_inputs_of_any_type_and_layout(rng):
    robot = robot_of(random_tree(rng, [0, 1]))
    dynamics = Dynamics(robot)
    x, wide = random_state(rng, 2).to_vector(), np.zeros((4, 3))
    wide[:2, 1] = 2.0, -1.0
    expected = dynamics.rate(x, np.array([2.0, -1.0]))
    np.testing.assert_array_equal(dynamics.rate(x, wide[:2, 1]), expected)
    np.testing.assert_array_equal(dynamics.rate(x, np.array([2, -1])), expected)
    with pytest.raises(ValueError, match='broadcast'):
        dynamics.rate(x, np.zeros(3))
