"""The gradient laws on robots of other sizes and trees: they stay bounded and reduce the error."""

from __future__ import annotations

import numpy as np
import pytest
from support.models import DUAL_ARM, random_tree, robot_of
from support.states import hold_step

from spacerobot_ros.control.adaptive.controller import AdaptiveController
from spacerobot_ros.control.adaptive.law_signals import AdaptiveSettings, Measured, Target
from spacerobot_ros.control.adaptive.learning_kernel import sampled_step
from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.robot_file import load_robot_file

PULSE = 2.0 * np.pi / 10.0
AXIS = np.array([1.0, 0.0, 0.0])
WIDE = dict.fromkeys(('mass', 'com', 'inertia'), 0.3)  # as wrong as `scaled` makes densities
GRADIENT = [
    ('adaptive_lyapunov', 'none'),
    ('adaptive_lyapunov', 'natural'),
    ('adaptive_composite', 'project'),
]


def robots():
    rng = np.random.default_rng(11)
    yield 'servicer', load_robot_file('config/servicer.yaml').robot
    yield 'dual arm', robot_of(random_tree(rng, DUAL_ARM), uncertainty=WIDE)
    sliding = random_tree(rng, [0, 1, 2, 1], prismatic=(2,))
    yield 'sliding', robot_of(sliding, uncertainty=WIDE)


ROBOTS = dict(robots())


def scaled(robot, seed):
    """Bodies of other densities: physical, wrong by some 30 %."""
    factors = np.exp(0.3 * np.random.default_rng(seed).standard_normal(len(robot.bodies)))
    return robot.with_inertial_parameters(robot.inertial_parameters * factors[:, None])


def swing(start, t):
    """Base about x and all joints by 0.2 rad (or m) in ten seconds, from rest."""
    s, sd, sdd = 1.0 - np.cos(PULSE * t), PULSE * np.sin(PULSE * t), PULSE**2 * np.cos(PULSE * t)
    half = 0.05 * s
    attitude = np.array([np.sin(half), 0.0, 0.0, np.cos(half)])
    ones = np.full(len(start), 0.1)
    motion = (start + ones * s, ones * sd, ones * sdd)
    return Target(attitude, 0.1 * sd * AXIS, 0.1 * sdd * AXIS, *motion)


def joint_errors(robot, law, consistency, seconds=20.0, period=0.05, **values):
    """(N,) norms of the joints' errors, the law believing in other densities."""
    settings = AdaptiveSettings(law=law, physical_consistency=consistency, **values)
    controller = AdaptiveController(scaled(robot, 3), settings, period)
    dynamics, n = Dynamics(robot), robot.n_joints
    zeros, start, out = np.zeros(3), np.zeros(n), []
    x = State(zeros, np.array([0.0, 0.0, 0.0, 1.0]), start, zeros, zeros, np.zeros(n)).to_vector()
    for k in range(round(seconds / period)):
        s, target = State.from_vector(x), swing(start, k * period)
        measured = Measured(s.q_WB_xyzw, s.omega_WB_B, s.q, s.qd, s.v_WB_B)
        torques = controller.step(measured, target)
        out.append(np.linalg.norm(torques.joint_error))
        wrench = np.concatenate([zeros, torques.base])
        x = hold_step(dynamics, x, torques.joints, period, 2, wrench)
    return np.array(out)


@pytest.mark.parametrize(('law', 'consistency'), GRADIENT)
@pytest.mark.parametrize('name', ROBOTS)
def test_gradient_laws_fit_robots_of_any_size(name, law, consistency):
    fixed = joint_errors(ROBOTS[name], 'passivity', 'none')
    found = joint_errors(ROBOTS[name], law, consistency)
    last = slice(len(found) // 2, None)
    assert np.max(found) < 2.0 * np.max(fixed)
    # learning halves the error at least, on motions that excite every joint
    assert np.sqrt(np.mean(found[last] ** 2)) < 0.5 * np.sqrt(np.mean(fixed[last] ** 2))


@pytest.mark.parametrize('name', ROBOTS)
def test_any_gain_is_bounded_by_the_sampling(name):
    """A gain a million times the usual one: the step is what the period allows."""
    found = joint_errors(ROBOTS[name], 'adaptive_lyapunov', 'none', adaptation_error=5e-6)
    fixed = joint_errors(ROBOTS[name], 'passivity', 'none')
    assert np.max(found) < 2.0 * np.max(fixed)


def test_the_bound_is_a_fifth_of_the_sampled_loop_s_stability_limit():
    """Poles of the loop of rates and parameters, from its matrix, at five times the step."""
    rng = np.random.default_rng(5)
    Y, h, kappa = rng.standard_normal((1, 4)), 0.05, 2.0
    M, G = 3.0, np.diag(rng.uniform(1.0, 2.0, 4))
    W = np.array([[1.0 / np.sqrt(kappa * M)]])
    step = sampled_step(1e9, W, Y, G, 4)
    for factor, is_stable in ((1.0, True), (4.9, True), (5.1, False)):
        coupling = factor * step * (Y @ G @ Y.T)[0, 0] / M
        loop = np.array([[1.0 - kappa * h, h], [-coupling, 1.0]])
        assert (np.max(np.abs(np.linalg.eigvals(loop))) < 1.0) == is_stable


def test_a_blocked_metric_is_the_whole_one():
    rng = np.random.default_rng(6)
    G = np.zeros((24, 24))
    for at, size in ((0, 10), (10, 10), (20, 4)):
        L = rng.standard_normal((size, size))
        G[at : at + size, at : at + size] = L @ L.T
    W, Y = np.tril(rng.standard_normal((8, 8))), rng.standard_normal((8, 24))
    expected = 0.2 / np.trace(W @ Y @ G @ Y.T @ W.T)
    for width in (10, 24):
        # sums of a few thousand products
        np.testing.assert_allclose(sampled_step(1e9, W, Y, G, width), expected, rtol=1e-12, atol=0)
