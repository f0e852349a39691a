"""The filter against a plain augmented Kalman filter, least squares and numerical integration."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from spacerobot_ros.estimation.momentum_filter import (
    Measurements,
    MomentumFilter,
    Noise,
    SquareRootInformation,
    transitions,
)
from spacerobot_ros.estimation.momentum_process import RateErrorModel
from spacerobot_ros.estimation.reference import Kinematics

N, JOINTS, P = 60, 2, 3  # times, joints, constants
NOISE = Noise(1e-2, 3e-2, 2e-2, 5e-2, np.array([0.5, 2.0]))


class Problem:
    """A small linear problem with arbitrary coefficients and patchy measurements."""

    def __init__(self, seed=0):
        rng = np.random.default_rng(seed)
        time = np.cumsum(rng.uniform(0.02, 0.08, N))
        self.reference = Kinematics(
            time,
            np.column_stack([np.sin(time), np.cos(time)]),
            np.column_stack([np.cos(time), -np.sin(time)]),
            rng.standard_normal((N, 3)),
            Rotation.from_rotvec(np.column_stack([np.sin(time), 0.3 * time, np.cos(time)])),
        )
        self.model = RateErrorModel(
            0.1 * rng.standard_normal((N, 3)),
            0.5 * rng.standard_normal((N, 3, 3 + 2 * JOINTS)),
            rng.standard_normal((N, 3, P)),
            rng.standard_normal((N, 3, P)),  # placebo: no part of the estimate
        )
        self.measured = Measurements(
            rng.standard_normal((N, JOINTS)),
            rng.standard_normal((N, JOINTS)),
            0.3 * rng.standard_normal((N, 3)),
            0.3 * rng.standard_normal((N, 3)),
        )
        for values, share in zip(vars_of(self.measured), (0.2, 0.5, 0.3, 0.8), strict=True):
            values[rng.random(N) < share] = np.nan
        self.start = rng.standard_normal((4, JOINTS))
        self.start_std = np.full((4, JOINTS), 2.0)
        self.mean, self.std = rng.standard_normal(P), np.array([1.0, 2.0, 0.5])

    def filter(self):
        engine = MomentumFilter(P, NOISE, self.start, self.start_std)
        engine.information.add(np.diag(1.0 / self.std), self.mean / self.std)
        return engine

    def part(self, start, stop):
        """Kinematics, model and measurements of some of the times."""
        cut = slice(start, stop)
        return (
            Kinematics(
                self.reference.time[cut],
                self.reference.q[cut],
                self.reference.qd[cut],
                self.reference.omega[cut],
                self.reference.rotation[cut],
            ),
            RateErrorModel(
                self.model.offset[cut],
                self.model.state[cut],
                self.model.constants[cut],
                self.model.placebo[cut],
            ),
            Measurements(*(values[cut] for values in vars_of(self.measured))),
        )


def vars_of(measured):
    return measured.q, measured.qd, measured.gyro, measured.attitude


def augmented_kalman(problem):
    """Plain Kalman filter with the constants as states: mean, covariance and sum of squares."""
    d = 3 + 4 * JOINTS
    ref, model = problem.reference, problem.model
    drives = np.delete(model.with_absolute_joints(ref), np.s_[1 : 1 + P], axis=2)  # no placebo
    transition, drive, noise = transitions(ref, model.state, drives, NOISE.snap)
    mean = np.concatenate([np.zeros(3), problem.start.ravel(), problem.mean])
    start_std = np.concatenate([np.full(3, 0.05), problem.start_std.ravel(), problem.std])
    cov = np.diag(start_std**2)
    squares, rows = 0.0, 0
    for k in range(N):
        if k:
            F = np.eye(d + P)
            F[:d, :d] = transition[k - 1]
            F[:3, d:] = drive[k - 1][:, 1:]
            mean = F @ mean
            mean[:3] += drive[k - 1][:, 0]
            cov = F @ cov @ F.T
            cov[:d, :d] += noise[k - 1]
        blocks, values, variances = [], [], []
        for name, first, std in (('q', 3, 1e-2), ('qd', 3 + JOINTS, 3e-2), ('attitude', 0, 5e-2)):
            value = getattr(problem.measured, name)[k]
            if np.isfinite(value[0]):
                H = np.zeros((len(value), d + P))
                H[:, first : first + len(value)] = np.eye(len(value))
                blocks.append(H)
                values.append(value)
                variances.append(np.full(len(value), std**2))
        if np.isfinite(problem.measured.gyro[k, 0]):
            H = np.zeros((3, d + P))
            H[:, : 3 + 2 * JOINTS], H[:, d:] = model.state[k], model.constants[k]
            # deviation of the gyro = offset + S [dphi; q - q_ref; q' - q'_ref] + V t
            known = model.state[k][:, 3:] @ np.concatenate([ref.q[k], ref.qd[k]])
            blocks.append(H)
            values.append(problem.measured.gyro[k] - model.offset[k] + known)
            variances.append(np.full(3, 2e-2**2))
        if not blocks:
            continue
        H, y, R = np.vstack(blocks), np.concatenate(values), np.diag(np.concatenate(variances))
        S = H @ cov @ H.T + R
        gap = y - H @ mean
        gain = np.linalg.solve(S, H @ cov).T
        squares += gap @ np.linalg.solve(S, gap)
        rows += len(y)
        mean = mean + gain @ gap
        rest = np.eye(d + P) - gain @ H
        cov = rest @ cov @ rest.T + gain @ R @ gain.T
    return mean, cov, squares, rows


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_equals_the_augmented_kalman_filter(seed):
    problem = Problem(seed)
    mean, cov, squares, rows = augmented_kalman(problem)
    engine = problem.filter()
    engine.information.reset_residual()
    engine.run(*problem.part(0, N))
    estimate, covariance = engine.information.solve()
    d = 3 + 4 * JOINTS
    # two algorithms of 60 updates, condition of the covariances about 1e6
    np.testing.assert_allclose(estimate, mean[d:], rtol=0, atol=1e-8)
    np.testing.assert_allclose(covariance, cov[d:, d:], rtol=0, atol=1e-8 * np.max(cov[d:, d:]))
    state = engine.affine[:, 0] + engine.affine[:, 1 + P :] @ estimate
    np.testing.assert_allclose(state, mean[:d], rtol=0, atol=1e-8 * np.max(np.abs(mean[:d])))
    marginal = (
        engine.covariance + engine.affine[:, 1 + P :] @ covariance @ engine.affine[:, 1 + P :].T
    )
    np.testing.assert_allclose(marginal, cov[:d, :d], rtol=0, atol=1e-8 * np.max(cov))
    assert engine.information.residual == pytest.approx(squares, rel=1e-9)
    assert engine.information.rows == rows


@pytest.mark.parametrize('cuts', [(1,), (20, 21, 45), (59,)])
def test_blocks_equal_one_run(cuts):
    problem = Problem()
    whole, parts = problem.filter(), problem.filter()
    whole.run(*problem.part(0, N))
    edges = [0, *cuts, N]
    for start, stop in pairwise(edges):
        parts.run(*problem.part(start, stop))
    for got, want in zip(parts.information.solve(), whole.information.solve(), strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-11)
    np.testing.assert_allclose(parts.affine, whole.affine, rtol=0, atol=1e-11)
    assert parts.information.residual == pytest.approx(whole.information.residual, rel=1e-11)


def test_shift_of_the_constants_changes_no_prediction():
    problem = Problem()
    engine = problem.filter()
    engine.run(*problem.part(0, N))
    before, covariance = engine.information.solve()
    state = engine.affine[:, 0] + engine.affine[:, 1 + P :] @ before
    change = np.array([0.3, -2.0, 5.0])
    engine.shift_constants(change)
    after, same = engine.information.solve()
    np.testing.assert_allclose(after, before - change, rtol=0, atol=1e-12)
    np.testing.assert_allclose(same, covariance, rtol=0, atol=1e-12)
    np.testing.assert_allclose(
        engine.affine[:, 0] + engine.affine[:, 1 + P :] @ after, state, rtol=0, atol=1e-12
    )


def test_attitude_error_is_taken_once():
    problem = Problem()
    engine = problem.filter()
    engine.run(*problem.part(0, N))
    error = engine.affine[:3, 0].copy()
    np.testing.assert_array_equal(engine.take_attitude(), error)
    np.testing.assert_array_equal(engine.take_attitude(), 0.0)


def test_no_measurement_adds_no_information():
    problem = Problem()
    for values in vars_of(problem.measured):
        values[:] = np.nan
    engine = problem.filter()
    engine.run(*problem.part(0, N))
    estimate, covariance = engine.information.solve()
    np.testing.assert_allclose(estimate, problem.mean, rtol=0, atol=1e-14)
    np.testing.assert_allclose(covariance, np.diag(problem.std**2), rtol=0, atol=1e-14)
    assert engine.information.rows == P


def test_covariance_stays_symmetric_and_positive():
    problem = Problem()
    engine = problem.filter()
    engine.run(*problem.part(0, N))
    np.testing.assert_allclose(engine.covariance, engine.covariance.T, rtol=0, atol=1e-12)
    assert np.linalg.eigvalsh(engine.covariance)[0] > 0.0


# --- square-root information


def test_information_equals_least_squares(rng):
    A, b = rng.standard_normal((80, 5)), rng.standard_normal(80)
    information = SquareRootInformation(5)
    for start, stop in (
        (0, 2),
        (2, 3),
        (3, 60),
        (60, 60),
        (60, 80),
    ):  # fewer rows than unknowns too
        information.add(A[start:stop], b[start:stop])
    want, squares, _, _ = np.linalg.lstsq(A, b, rcond=None)
    estimate, covariance = information.solve()
    np.testing.assert_allclose(estimate, want, rtol=0, atol=1e-13)
    np.testing.assert_allclose(covariance, np.linalg.inv(A.T @ A), rtol=0, atol=1e-14)
    assert information.residual == pytest.approx(squares[0], rel=1e-12)
    assert information.rows == 80


def test_information_of_columns_of_very_different_size(rng):
    scale = np.array([1e-6, 1.0, 1e6])
    A, x = rng.standard_normal((40, 3)), np.array([1.0, 2.0, 3.0])
    information = SquareRootInformation(3)
    information.add(A * scale, A @ x)
    estimate, covariance = information.solve()
    np.testing.assert_allclose(estimate * scale, x, rtol=0, atol=1e-13)
    unit = covariance * np.outer(scale, scale)
    np.testing.assert_allclose(unit, np.linalg.inv(A.T @ A), rtol=0, atol=1e-14)


def test_directions_without_information_stay_at_zero(rng):
    information = SquareRootInformation(3)
    information.add(np.array([[1.0, 1.0, 0.0]]), np.array([2.0]))
    estimate, _ = information.solve()
    np.testing.assert_allclose(estimate, [1.0, 1.0, 0.0], rtol=0, atol=1e-14)
    empty, none = SquareRootInformation(2).solve()
    np.testing.assert_array_equal(empty, 0.0)
    np.testing.assert_array_equal(none, 0.0)


def test_shift_and_reset_of_the_residual(rng):
    A, x = rng.standard_normal((10, 3)), np.array([1.0, -2.0, 3.0])
    information = SquareRootInformation(3)
    information.add(A, A @ x + 0.1)
    before, _ = information.solve()
    information.shift(np.array([1.0, 0.0, -1.0]))
    np.testing.assert_allclose(
        information.solve()[0], before - [1.0, 0.0, -1.0], rtol=0, atol=1e-13
    )
    information.reset_residual()
    assert (information.residual, information.rows) == (0.0, 0)


# --- transitions


def constant_reference(dt, rotation_rate):
    """Two times, the reference turning at a constant rate in body axes."""
    turn = Rotation.from_rotvec(dt * rotation_rate)
    zeros = np.zeros((2, JOINTS))
    return Kinematics(
        np.array([0.0, dt]),
        zeros,
        zeros,
        np.tile(rotation_rate, (2, 1)),
        Rotation.concatenate([Rotation.identity(), turn]),
    )


def chain():
    """Generator of the joints' quartic: q' = q', ..., q'''' = white noise."""
    return np.kron(np.diag(np.ones(3), 1), np.eye(JOINTS))


def test_joint_steps_are_exact():
    dt = 0.037
    reference = constant_reference(dt, np.zeros(3))
    state, drives = np.zeros((2, 3, 3 + 2 * JOINTS)), np.zeros((2, 3, 1 + P))
    transition, drive, noise = transitions(reference, state, drives, NOISE.snap)
    np.testing.assert_allclose(transition[0, 3:, 3:], expm(dt * chain()), rtol=0, atol=1e-15)
    shock = np.zeros((4 * JOINTS, 4 * JOINTS))
    shock[-JOINTS:, -JOINTS:] = np.diag(NOISE.snap)
    want, _ = quad_vec(
        lambda s: expm(s * chain()) @ shock @ expm(s * chain()).T, 0.0, dt, epsabs=0, epsrel=1e-12
    )
    np.testing.assert_allclose(noise[0, 3:, 3:], want, rtol=1e-10, atol=0)
    np.testing.assert_array_equal(noise[0, :3, :3], 0.0)
    np.testing.assert_array_equal(drive, 0.0)


def numerical_step(dt, rotation_rate, S, V):
    """Transition and drive of dphi' = -w x dphi + S [dphi; q; q'] + V [1; t], by small steps."""
    d = 3 + 4 * JOINTS
    w = rotation_rate
    skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    total = np.eye(d + 1 + P)
    count = 400
    for i in range(count):
        s = (i + 0.5) / count
        A = np.zeros((d + 1 + P, d + 1 + P))
        A[3:d, 3:d] = chain()
        A[:3, : 3 + 2 * JOINTS] = (1.0 - s) * S[0] + s * S[1]
        A[:3, :3] -= skew
        A[:3, d:] = (1.0 - s) * V[0] + s * V[1]
        total = expm(A * dt / count) @ total
    return total[:d, :d], total[:3, d:]


def test_transitions_against_numerical_integration(rng):
    w = np.array([0.5, -0.8, 0.3])
    S, V = (np.tile(rng.standard_normal((3, k)), (2, 1, 1)) for k in (3 + 2 * JOINTS, 1 + P))
    S[1] += 0.04 * rng.standard_normal(S[1].shape)
    V[1] += 0.04 * rng.standard_normal(V[1].shape)
    errors = []
    for dt in (0.04, 0.02, 0.01):
        middle = S[0] + (S[1] - S[0]) * dt / 0.04, V[0] + (V[1] - V[0]) * dt / 0.04
        ends = np.array([S[0], middle[0]]), np.array([V[0], middle[1]])
        got = transitions(constant_reference(dt, w), *ends, NOISE.snap)
        want = numerical_step(dt, w, *ends)
        errors.append([np.max(np.abs(got[0][0] - want[0])), np.max(np.abs(got[1][0] - want[1]))])
    errors = np.array(errors)
    assert errors[0].max() < 3e-4  # dt^3 / 12 times second derivatives of about 30
    # trapezoid: a local error of third order, an eighth at half the step
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 3.0, rtol=0, atol=0.2)


def test_noise_of_the_attitude_follows_the_joints(rng):
    dt, w = 0.02, np.zeros(3)
    S = np.tile(rng.standard_normal((3, 3 + 2 * JOINTS)), (2, 1, 1))
    S[:, :, :3] = 0.0
    _, _, noise = transitions(constant_reference(dt, w), S, np.zeros((2, 3, 1 + P)), NOISE.snap)
    # the joints' noise at the end of the step, times half of it
    lever = 0.5 * dt * S[0][:, 3:]
    joints = noise[0, 3 : 3 + 2 * JOINTS, 3 : 3 + 2 * JOINTS]
    want = lever @ joints @ lever.T
    np.testing.assert_allclose(noise[0, :3, :3], want, rtol=0, atol=1e-12 * np.max(want))
    scale = np.sqrt(np.diag(noise[0]))
    assert np.linalg.eigvalsh(noise[0] / np.outer(scale, scale))[0] > -1e-9
