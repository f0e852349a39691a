"""Equations of motion: consistency, conservation, cases by hand, joint orders, fixed base."""

from __future__ import annotations

import numpy as np
import pytest
from support.models import (
    AXIS,
    DUAL_ARM,
    Part,
    momentum_and_energy,
    quaternion_matrix,
    random_tree,
    robot_of,
    to_rotation,
    turn,
)
from support.states import motion_of, random_state

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.dynamics.state import State

WHEELS = {
    'servicer_wheels': {'momentum': [25.0, 27.0, 28.0]},
    'target_wheels': {
        'links': ['link_3', 'link_1'],
        'momentum': [42.0, 49.0, 41.0, -3.0, 5.0, 2.0],
    },
}
CASES = {
    'serial': ([0, 1, 2], (), {}),
    'dual arm': (DUAL_ARM, (), {}),
    'slides': ([0, 1, 2, 1], (2, 4), {}),
    'gravity': ([0, 1, 2], (), {'gravity': [0.3, -0.2, -9.81]}),
    'fixed base': ([0, 1, 2, 0], (3,), {'base': 'fixed', 'gravity': [0.0, 0.0, -9.81]}),
}


@pytest.fixture(params=CASES.values(), ids=CASES.keys())
def robot(request, rng):
    """Return a random robot with wheels, joints listed in a random order."""
    parents, prismatic, options = request.param
    parts = random_tree(rng, parents, prismatic)
    joints = [parts[i].joint for i in 1 + rng.permutation(len(parents))]
    return robot_of(parts, joints, **{**WHEELS, **options})


def test_inverse_undoes_forward(robot, rng):
    dynamics, n = Dynamics(robot), robot.n_joints
    for _ in range(20):
        state, tau, wrench = random_state(rng, n), rng.standard_normal(n), rng.standard_normal(6)
        rate = dynamics.rate(state.to_vector(), tau, wrench)
        base, joints = dynamics.inverse(state, rate[7 + n : 13 + n], rate[13 + n :])
        # Forces of order 1e3 in between.
        np.testing.assert_allclose(joints, tau, rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            base, wrench if robot.is_free else np.zeros(6), rtol=0, atol=1e-10
        )


def test_rate_of_the_configuration(robot, rng):
    dynamics, n = Dynamics(robot), robot.n_joints
    state = random_state(rng, n)
    rate = dynamics.rate(state.to_vector(), np.zeros(n))
    np.testing.assert_array_equal(rate[7 : 7 + n], state.qd)
    expected = quaternion_matrix(state.q_WB_xyzw) @ state.v_WB_B if robot.is_free else np.zeros(3)
    np.testing.assert_allclose(rate[:3], expected, rtol=0, atol=1e-14)


def test_length_and_sign_of_the_quaternion_do_not_matter(robot, rng):
    dynamics, n = Dynamics(robot), robot.n_joints
    x = random_state(rng, n).to_vector()
    scaled = x.copy()
    scaled[3:7] *= -1.7
    a, b = (dynamics.rate(y, np.ones(n))[7 + n :] for y in (x, scaled))
    np.testing.assert_allclose(a, b, rtol=0, atol=1e-11 * np.max(np.abs(a)))


def test_mass_matrices_are_symmetric_and_positive(robot, rng):
    dynamics, n = Dynamics(robot), robot.n_joints
    for _ in range(20):
        state = random_state(rng, n)
        for M in (dynamics.mass_matrix(state.q), dynamics.reduced(state).H):
            np.testing.assert_allclose(M, M.T, rtol=0, atol=1e-12 * np.max(M))
            assert np.linalg.eigvalsh(M)[0] > 0.0


def test_reduced_equation_gives_the_joint_acceleration(robot, rng):
    dynamics, n = Dynamics(robot), robot.n_joints
    for _ in range(20):
        state, tau = random_state(rng, n), 10.0 * rng.standard_normal(n)
        reduced = dynamics.reduced(state)
        qdd = dynamics.rate(state.to_vector(), tau)[13 + n :]
        np.testing.assert_allclose(reduced.H @ qdd + reduced.c, tau, rtol=0, atol=1e-10)


@pytest.mark.parametrize('parents', [[0, 1, 2], DUAL_ARM], ids=['serial', 'dual arm'])
def test_momentum_is_kept_along_the_flow(parents, rng):
    # Derivative of the first-principles momentum, wheels added by hand, along the product's rate.
    parts = random_tree(rng, parents)
    robot = robot_of(parts, **WHEELS)
    dynamics, n, dt = Dynamics(robot), robot.n_joints, 1e-4

    def total(x):
        state = State.from_vector(x)
        state.q_WB_xyzw[:] /= np.linalg.norm(state.q_WB_xyzw)
        P, h, _ = momentum_and_energy(parts, motion_of(state, robot.joints))
        return np.concatenate([P, h + _wheels(parts, state, robot)])

    for _ in range(5):
        x = random_state(rng, n).to_vector()
        rate = dynamics.rate(x, rng.standard_normal(n))
        steps = [total(x + k * dt * rate) for k in (-2, -1, 1, 2)]
        slope = (steps[0] - 8.0 * steps[1] + 8.0 * steps[2] - steps[3]) / (12.0 * dt)
        # Truncation dt^4 h^(5), roundings 1e-16 * 1e3 / dt.
        np.testing.assert_allclose(slope, 0.0, rtol=0, atol=1e-7)


def _wheels(parts, state, robot):
    R = quaternion_matrix(state.q_WB_xyzw)
    q = dict(zip(robot.joints, state.q, strict=True))
    h = np.array(WHEELS['servicer_wheels']['momentum'])
    momenta = np.array(WHEELS['target_wheels']['momentum']).reshape(-1, 3)
    for link, momentum in zip(WHEELS['target_wheels']['links'], momenta, strict=True):
        h = h + _link_rotation(parts, link, q) @ momentum
    return R @ h


def _link_rotation(parts, link, q):
    index = next(i for i, part in enumerate(parts) if part.name == link)
    R = np.eye(3)
    while index > 0:
        part = parts[index]
        R = to_rotation(part.rpy) @ turn(part.axis, q[part.joint]) @ R
        index = part.parent
    return R


def test_order_of_the_joints_only_permutes(rng):
    parts = random_tree(rng, [0, 1, 2, 1, 4])
    n = len(parts) - 1
    straight = robot_of(parts, **WHEELS)
    order = np.array([4, 2, 0, 3, 1])  # children before their parents
    shuffled = robot_of(parts, [straight.joints[i] for i in order], **WHEELS)
    a, b = Dynamics(straight), Dynamics(shuffled)
    for _ in range(10):
        s, tau = random_state(rng, n), rng.standard_normal(n)
        t = State(s.p_WB, s.q_WB_xyzw, s.q[order], s.v_WB_B, s.omega_WB_B, s.qd[order])
        ra, rb = a.rate(s.to_vector(), tau), b.rate(t.to_vector(), tau[order])
        np.testing.assert_allclose(rb[13 + n :], ra[13 + n :][order], rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            rb[: 7 + n], np.concatenate([ra[:7], ra[7 : 7 + n][order]]), rtol=0, atol=1e-12
        )
        np.testing.assert_allclose(
            b.reduced(t).H, a.reduced(s).H[np.ix_(order, order)], rtol=0, atol=1e-11
        )
        np.testing.assert_allclose(b.reduced(t).c, a.reduced(s).c[order], rtol=0, atol=1e-10)
        np.testing.assert_allclose(b.momentum(t), a.momentum(s), rtol=0, atol=1e-10)
        np.testing.assert_allclose(
            b.body_position(t, 1 + int(np.flatnonzero(order == 2)[0]), np.ones(3)),
            a.body_position(s, 3, np.ones(3)),
            rtol=0,
            atol=1e-13,
        )


def test_fixed_joints_merge_into_one_body(rng):
    # The same machine, its second link once whole and once as two halves on a turned and shifted
    # mount.
    parts = random_tree(rng, [0, 1])
    half = Part(
        'half',
        2,
        'fixed',
        3.0,
        rng.uniform(-1, 1, 3),
        np.diag([0.3, 0.4, 0.5]),
        AXIS['x'],
        rng.uniform(-1, 1, 3),
        (0.3, -0.7, 1.1),
    )
    robot = robot_of([*parts, half])
    assert [body.name for body in robot.bodies] == ['base_link', 'link_1', 'link_2']
    dynamics = Dynamics(robot)
    for _ in range(10):
        state = random_state(rng, 2)
        motion = motion_of(state, robot.joints)
        motion.q['j_half'], motion.qd['j_half'] = 0.0, 0.0
        P, h, T = momentum_and_energy([*parts, half], motion)
        np.testing.assert_allclose(dynamics.momentum(state), [*P, *h], rtol=0, atol=1e-11)
        assert dynamics.energy(state)[0] == pytest.approx(T, rel=1e-13)


I0, I1 = 30.0, 6.0  # kg m^2 about z


def _two_discs(**options):
    base = Part('base_link', -1, 'base', 10.0, np.zeros(3), np.diag([20.0, 20.0, I0]))
    link = Part('link_1', 0, 'continuous', 4.0, np.zeros(3), np.diag([5.0, 5.0, I1]), AXIS['z'])
    return robot_of([base, link], **options)


def test_two_discs_by_hand():
    # Two discs on one axis: the joint torque turns one forwards and the other backwards.
    dynamics, tau = Dynamics(_two_discs()), 2.0
    state = State(
        np.zeros(3),
        np.array([0.0, 0.0, 0.0, 1.0]),
        np.array([0.4]),
        np.zeros(3),
        np.zeros(3),
        np.zeros(1),
    )
    rate = dynamics.rate(state.to_vector(), np.array([tau]))
    np.testing.assert_allclose(
        rate[8:14], [0.0, 0.0, 0.0, 0.0, 0.0, -tau / I0], rtol=0, atol=1e-15
    )
    assert rate[14] == pytest.approx(tau * (1.0 / I0 + 1.0 / I1), rel=1e-14)
    reduced = dynamics.reduced(state)
    assert reduced.H[0, 0] == pytest.approx(I0 * I1 / (I0 + I1), rel=1e-14)
    assert reduced.c[0] == pytest.approx(0.0, abs=1e-15)


def test_gyroscopic_reaction_on_the_joint_by_hand():
    # Base turning at w about y, wheels h along the link's x: w y X h x = -w h z must be held by
    # the joint about z.
    w, h = 0.3, 40.0
    robot = _two_discs(target_wheels={'links': ['link_1'], 'momentum': [h, 0.0, 0.0]})
    state = State(
        np.zeros(3),
        np.array([0.0, 0.0, 0.0, 1.0]),
        np.zeros(1),
        np.zeros(3),
        np.array([0.0, w, 0.0]),
        np.zeros(1),
    )
    base, tau = Dynamics(robot).inverse(state, np.zeros(6), np.zeros(1))
    assert tau[0] == pytest.approx(-w * h, rel=1e-14)
    np.testing.assert_allclose(base, [0.0, 0.0, 0.0, 0.0, 0.0, -w * h], rtol=0, atol=1e-13)
    printed = Dynamics(robot, joint_reaction=False).inverse(state, np.zeros(6), np.zeros(1))
    assert printed[1][0] == pytest.approx(0.0, abs=1e-14)
    assert printed[0][5] == pytest.approx(-w * h, rel=1e-14)


def test_base_wrench_acts_at_the_base_origin():
    # A force along y and a torque about z on the two discs, joint free: only the base turns; both
    # translate.
    state = State(
        np.zeros(3),
        np.array([0.0, 0.0, 0.0, 1.0]),
        np.zeros(1),
        np.zeros(3),
        np.zeros(3),
        np.zeros(1),
    )
    rate = Dynamics(_two_discs()).rate(
        state.to_vector(), np.zeros(1), np.array([0.0, 7.0, 0.0, 0.0, 0.0, 3.0])
    )
    np.testing.assert_allclose(
        rate[8:], [0.0, 7.0 / 14.0, 0.0, 0.0, 0.0, 3.0 / I0, -3.0 / I0], rtol=0, atol=1e-15
    )


def test_pendulum_under_gravity():
    mass, length, inertia, g = 2.0, 0.7, 0.05, 9.81
    base = Part('base_link', -1, 'base', 1.0, np.zeros(3), np.eye(3))
    bob = Part(
        'link_1',
        0,
        'continuous',
        mass,
        np.array([0.0, 0.0, -length]),
        inertia * np.eye(3),
        AXIS['x'],
    )
    robot = robot_of([base, bob], base='fixed', gravity=[0.0, 0.0, -g])
    dynamics = Dynamics(robot)
    for angle in np.linspace(-3.0, 3.0, 7):
        state = State(
            np.zeros(3),
            np.array([0.0, 0.0, 0.0, 1.0]),
            np.array([angle]),
            np.zeros(3),
            np.zeros(3),
            np.ones(1),
        )
        rate = dynamics.rate(state.to_vector(), np.zeros(1))
        assert rate[14] == pytest.approx(
            -mass * g * length * np.sin(angle) / (inertia + mass * length**2), abs=1e-13
        )
        assert dynamics.energy(state)[1] == pytest.approx(
            -mass * g * length * np.cos(angle), abs=1e-13
        )


def test_wheels_of_a_fixed_base_do_nothing_and_those_of_a_link_do(rng):
    parts = random_tree(rng, [0, 1])
    state = random_state(rng, 2)
    still = Dynamics(robot_of(parts, base='fixed')).rate(state.to_vector(), np.zeros(2))
    on_base = robot_of(parts, base='fixed', servicer_wheels={'momentum': [50.0, 0.0, 0.0]})
    np.testing.assert_array_equal(Dynamics(on_base).rate(state.to_vector(), np.zeros(2)), still)
    on_link = robot_of(
        parts, base='fixed', target_wheels={'links': ['link_2'], 'momentum': [50.0, 0.0, 0.0]}
    )
    assert np.max(np.abs(Dynamics(on_link).rate(state.to_vector(), np.zeros(2)) - still)) > 0.1
