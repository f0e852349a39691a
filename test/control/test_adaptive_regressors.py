"""The regressors by identity, against Pinocchio and finite differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from support.models import DUAL_ARM, random_tree, robot_of

from spacerobot_ros.control.adaptive.regressors import (
    Regressors,
    parameter_names,
    parameter_values,
)
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.pinocchio_model import in_pinocchio
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.errors import ConfigurationError

CLOSE = {'rtol': 1e-12, 'atol': 1e-12}  # a few hundred products of numbers of order ten
WHEELS = {
    'servicer_wheels': {'momentum': [1.0, -2.0, 3.0]},
    'target_wheels': {'links': ['link_3'], 'momentum': [4.0, 5.0, -6.0]},
}
TREES = {'chain': ([0, 1, 2], ()), 'dual arm': (DUAL_ARM, ()), 'sliding': ([0, 1, 0, 3], (2, 3))}


@pytest.fixture(params=TREES)
def robot(request):
    parents, prismatic = TREES[request.param]
    return robot_of(random_tree(np.random.default_rng(3), parents, prismatic), **WHEELS)


def pin_state(robot, q, *vectors):
    """Pinocchio's configuration at the origin and its order of velocities."""
    q_pin = pin.neutral(in_pinocchio(robot).model)
    q_pin[7:][in_pinocchio(robot).velocity_indices] = q
    order = np.concatenate([np.arange(6), 6 + in_pinocchio(robot).velocity_indices])
    out = []
    for vector in vectors:
        reordered = np.empty(len(vector))
        reordered[order] = vector
        out.append(reordered)
    return q_pin, order, out


def random_state(robot, count):
    rng = np.random.default_rng(8)
    return rng.uniform(-1.0, 1.0, robot.n_joints), rng.normal(size=(count, 6 + robot.n_joints))


def without_wheels(robot):
    pi = parameter_values(robot)
    pi[10 * len(robot.bodies) :] = 0.0
    return pi


def test_slotine_li_is_mass_and_coriolis(robot):
    q, (V, Vr, Ar) = random_state(robot, 3)
    q_pin, order, (v, vr) = pin_state(robot, q, V, Vr)
    model, data = in_pinocchio(robot).model, in_pinocchio(robot).model.createData()
    M = Dynamics(robot).mass_matrix(q)
    C = pin.computeCoriolisMatrix(model, data, q_pin, v)
    torque = Regressors(robot).slotine_li(q, V, Vr, Ar) @ without_wheels(robot)
    np.testing.assert_allclose(torque, M @ Ar + (C @ vr)[order], **CLOSE)


def test_mass_rate_minus_twice_coriolis_is_skew(robot):
    q, (V, *_) = random_state(robot, 1)
    regressors, pi, size = Regressors(robot), parameter_values(robot), 6 + robot.n_joints
    zero, h = np.zeros(size), 1e-6

    def columns(apply):
        return np.array([apply(unit) for unit in np.eye(size)]).T

    wheels = columns(lambda unit: regressors.slotine_li(q, V, unit, zero) @ pi)
    later, before = (Dynamics(robot).mass_matrix(q + sign * h * V[6:]) for sign in (1.0, -1.0))
    N = (later - before) / (2.0 * h) - 2.0 * wheels
    # central differences of the mass matrix: h^2 of its third derivative and rounding / h
    np.testing.assert_allclose(N, -N.T, rtol=0.0, atol=1e-6)


def test_two_calls_of_pinocchio_give_the_same_columns(robot):
    q, (V, Vr, Ar) = random_state(robot, 3)
    A = Ar.copy()
    A[:6] += 0.5 * pin.Motion(V[:6]).cross(pin.Motion(Vr[:6])).vector
    q_pin, order, (v, vr, a) = pin_state(robot, q, V, Vr, A)
    model, data = in_pinocchio(robot).model, in_pinocchio(robot).model.createData()
    model.gravity.linear = np.zeros(3)
    both = pin.computeJointTorqueRegressor(model, data, q_pin, v + vr, 2.0 * a).copy()
    both -= pin.computeJointTorqueRegressor(model, data, q_pin, v - vr, -2.0 * a)
    blocks = [np.arange(10 * (i - 1), 10 * i) for i in in_pinocchio(robot).joint_ids]
    Y = Regressors(robot).slotine_li(q, V, Vr, Ar)[:, : 10 * len(robot.bodies)]
    np.testing.assert_allclose(Y, 0.25 * both[order][:, np.concatenate(blocks)], **CLOSE)


def test_inverse_dynamics_with_wheels(robot):
    q, (V, A) = random_state(robot, 2)
    state = State(np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0]), q, V[:3], V[3:6], V[6:])
    base, tau = Dynamics(robot).inverse(state, A[:6], A[6:])
    torque = Regressors(robot).slotine_li(q, V, V, A) @ parameter_values(robot)
    np.testing.assert_allclose(torque, np.concatenate([base, tau]), **CLOSE)


def test_momentum_regressors_balance_the_torques(robot):
    """d/dt (Y_p pi) - Y_c pi = u along a motion, differences against inverse dynamics."""
    q, (V, A) = random_state(robot, 2)
    regressors, pi, h = Regressors(robot), parameter_values(robot), 1e-6
    later, before = (
        regressors.momentum(q + s * h * V[6:] + 0.5 * h**2 * A[6:], V + s * h * A)[0] @ pi
        for s in (1.0, -1.0)
    )
    rate = (later - before) / (2.0 * h)
    torque = regressors.slotine_li(q, V, V, A) @ pi
    balance = rate - regressors.momentum(q, V)[1] @ pi
    np.testing.assert_allclose(balance, torque, rtol=1e-6, atol=1e-5)  # central differences


def test_momentum_is_mass_times_velocity(robot):
    q, (V, *_) = random_state(robot, 1)
    Yp, _ = Regressors(robot).momentum(q, V)
    np.testing.assert_allclose(
        Yp @ without_wheels(robot), Dynamics(robot).mass_matrix(q) @ V, **CLOSE
    )


def test_names_tell_links_and_wheels(robot):
    names = parameter_names(robot)
    assert names[:2] == ('base_link.m', 'base_link.mcx')
    assert names[-3:] == ('link_3.aam_x', 'link_3.aam_y', 'link_3.aam_z')
    assert len(names) == Regressors(robot).shape[1]


def test_a_fixed_base_is_refused():
    fixed = robot_of(random_tree(np.random.default_rng(1), [0, 1]), base='fixed')
    with pytest.raises(ConfigurationError, match=r'robot\.base: adaptive laws control'):
        Regressors(fixed)
