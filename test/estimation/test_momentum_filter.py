"""The filter against a plain augmented Kalman filter, least squares and numerical integration."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from spacerobot_ros.estimation.filters import momentum_filter
from spacerobot_ros.estimation.filters.linear_steps import Steps
from spacerobot_ros.estimation.filters.momentum_filter import (
    MomentumFilter,
    Part,
    Stretch,
    state_space,
)
from spacerobot_ros.estimation.filters.momentum_process import RateErrorModel
from spacerobot_ros.estimation.filters.momentum_steps import add_stops, transitions_of
from spacerobot_ros.estimation.trajectory.time_base import CHANNELS, measured_rows
from spacerobot_ros.recording.record import Record

N, JOINTS, P = 60, 2, 3  # times, joints, constants
SIZE = 3 + 4 * JOINTS
STDS = {'joint_position': 1e-2, 'joint_velocity': 3e-2, 'gyro': 2e-2, 'attitude': 5e-2}
SEEN = {'joint_position': 0.8, 'joint_velocity': 0.5, 'gyro': 0.7, 'attitude': 0.2}
SNAP = np.array([0.5, 2.0])
STATES = {
    'joint_position': 3 + np.arange(JOINTS),
    'joint_velocity': 3 + JOINTS + np.arange(JOINTS),
    'gyro': SIZE + np.arange(3),
    'attitude': np.arange(3),
}


class Moving(NamedTuple):
    """Stands for the kinematics: all that the filter asks of them."""

    rate: RateErrorModel
    omega: np.ndarray
    rotation: Rotation

    def part(self, which):
        rate = RateErrorModel(
            self.rate.offset[which], self.rate.state[which], self.rate.constants[which]
        )
        return Moving(rate, self.omega[which], self.rotation[which])


class Problem:
    """A small linear problem with arbitrary coefficients and patchy measurements."""

    def __init__(self, seed=0, seen=SEEN):
        rng = np.random.default_rng(seed)
        self.time = time = np.cumsum(rng.uniform(0.02, 0.08, N))
        self.joints = np.hstack(
            [np.column_stack([np.sin(time + k * 1.6), np.cos(time + k * 1.6)]) for k in range(4)]
        )
        self.omega = rng.standard_normal((N, 3))
        self.rate = RateErrorModel(
            0.1 * rng.standard_normal((N, 3)),
            0.5 * rng.standard_normal((N, 3, 3 + 2 * JOINTS)),
            rng.standard_normal((N, 3, P)),
        )
        self.stamps = {name: time[rng.random(N) < share] for name, share in seen.items()}
        self.deviations = {
            name: 0.3 * rng.standard_normal((N, len(STATES[name]))) for name in CHANNELS
        }
        self.mean, self.std = rng.standard_normal(P), np.array([1.0, 2.0, 0.5])

    def filter(self):
        model = SimpleNamespace(
            filter_size=P,
            n=JOINTS,
            filter_other=slice(P, P),
            linearize=lambda kinematics, _, **__: kinematics.rate,
        )
        engine = MomentumFilter(model)
        engine.information.add(np.diag(1.0 / self.std), self.mean / self.std)
        return engine

    def part(self, start, stop):
        """Some of the times; what was measured at the first belongs to the part before."""
        cut = slice(start, stop)
        time = self.time[cut]
        since = time[0] if start else -np.inf
        stamps = {c: t[(t > since) & (t <= time[-1])] for c, t in self.stamps.items()}
        rows = measured_rows(time, stamps, STATES)
        at = start + np.repeat(np.arange(len(time)), np.diff(rows.first))
        channels = [CHANNELS[c] for c in rows.channel]
        names = ('offset', 'state', 'constants')
        rate = RateErrorModel(*(getattr(self.rate, name)[cut] for name in names))
        measured = zip(channels, at, rows.axis, strict=True)
        stretch = SimpleNamespace(
            reference=SimpleNamespace(times=time),
            kinematics=Moving(rate, self.omega[cut], Rotation.identity(len(time))),
            rows=rows,
            deviations=np.array([self.deviations[c][k, axis] for c, k, axis in measured]),
            row_variance=np.array([STDS[c] ** 2 for c in channels]),
            joint_states=self.joints[cut],
            snap_density=SNAP,
            record=Record(),
            fastest=np.ones((3, JOINTS)),
            misreadings=lambda *_: (np.zeros(len(channels)), np.zeros((len(channels), 0))),
        )
        stretch.parts = list(Stretch.parts.fget(stretch))
        return stretch

    def start_covariance(self):
        """Wide against the noise, but no wider than the motion."""
        q, others = self.joints[:, :JOINTS], self.joints[:, JOINTS:]
        spread = [np.std(q, axis=0), np.sqrt(np.mean(others**2, axis=0))]
        return np.diag(np.concatenate([np.full(3, 0.05), np.concatenate(spread) + 1e-6]) ** 2)


def run(engine, *stretches):
    for stretch in stretches:
        engine.run(stretch, np.zeros(P))


def state_of(engine, constants):
    """Mean of the state, joints counted from zero."""
    return engine._mean[:, 0] + engine._mean[:, 1:] @ constants


def augmented_kalman(problem):
    """Plain Kalman filter with the constants as states: mean, covariance and sum of squares."""
    d = SIZE
    whole, rate = problem.part(0, N), problem.rate
    (part,) = whole.parts
    space, defects = state_space(whole, part, rate)
    mean = np.concatenate([np.zeros(d), problem.mean])
    cov = np.diag(np.concatenate([np.zeros(d), problem.std**2]))
    cov[:d, :d] = problem.start_covariance()
    squares = 0.0
    for k in range(N):
        if k:
            half, F = 0.5 * space.durations[k - 1], np.eye(d + P)
            F[:d, :d] = space.transitions[k - 1]
            F[:d, d:] = half * F[:d, :3] @ rate.constants[k - 1]
            F[:3, d:] += half * rate.constants[k]
            mean = F @ mean
            mean[:d] += half * F[:d, :3] @ rate.offset[k - 1] + defects[k - 1]
            mean[:3] += half * rate.offset[k]
            cov = F @ cov @ F.T
            cov[:d, :d] += space.noise[k - 1]
        rows = range(whole.rows.first[k], whole.rows.first[k + 1])
        if not rows:
            continue
        H, y = np.zeros((len(rows), d + P)), whole.deviations[list(rows)]
        for i, r in enumerate(rows):
            axis = whole.rows.axis[r]
            if CHANNELS[whole.rows.channel[r]] == 'gyro':
                # deviation of the gyro = offset + S [dphi; dq; dq'] + V t
                H[i, : 3 + 2 * JOINTS] = rate.state[k, axis]
                H[i, d:] = rate.constants[k, axis]
                y[i] -= rate.offset[k, axis]
            else:
                H[i, whole.rows.state[r]] = 1.0
        R = np.diag(whole.row_variance[list(rows)])
        S = H @ cov @ H.T + R
        gap = y - H @ mean
        gain = np.linalg.solve(S, H @ cov).T
        squares += gap @ np.linalg.solve(S, gap)
        mean = mean + gain @ gap
        rest = np.eye(d + P) - gain @ H
        cov = rest @ cov @ rest.T + gain @ R @ gain.T
    return mean, cov, squares


@pytest.mark.parametrize('seed', [0, 1, 2])
def test_equals_the_augmented_kalman_filter(seed):
    problem = Problem(seed)
    mean, cov, squares = augmented_kalman(problem)
    engine = problem.filter()
    engine.information.reset_residual()
    run(engine, problem.part(0, N))
    estimate, covariance = engine.information.solve()
    d = SIZE
    # two algorithms of 60 updates, condition of the covariances about 1e6
    np.testing.assert_allclose(estimate, mean[d:], rtol=0, atol=1e-8)
    np.testing.assert_allclose(covariance, cov[d:, d:], rtol=0, atol=1e-8 * np.max(cov[d:, d:]))
    state = state_of(engine, estimate)
    state[3:] -= problem.joints[-1]
    np.testing.assert_allclose(state, mean[:d], rtol=0, atol=1e-8 * np.max(np.abs(mean[:d])))
    columns = engine._mean[:, 1:]
    marginal = engine._covariance + columns @ covariance @ columns.T
    np.testing.assert_allclose(marginal, cov[:d, :d], rtol=0, atol=1e-8 * np.max(cov))
    assert engine.information.residual == pytest.approx(squares, rel=1e-9)
    assert engine.information.rows == len(problem.part(0, N).deviations)


@pytest.mark.parametrize('cuts', [(1,), (20, 21, 45), (58,)])
def test_blocks_equal_one_run(cuts):
    problem = Problem()
    whole, parts = problem.filter(), problem.filter()
    run(whole, problem.part(0, N))
    # the start's covariance is that of the whole motion
    parts._last = problem.time[0], Rotation.identity()
    parts._covariance = problem.start_covariance()
    parts._mean[3:, 0] = problem.joints[0]
    edges = [0, *cuts, N - 1]
    run(parts, *(problem.part(start, stop + 1) for start, stop in pairwise(edges)))
    for got, want in zip(parts.information.solve(), whole.information.solve(), strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-11)
    np.testing.assert_allclose(parts._mean, whole._mean, rtol=0, atol=1e-11)
    assert parts.information.residual == pytest.approx(whole.information.residual, rel=1e-11)


@pytest.mark.parametrize('at_once', [1, 7, 58, 59, 60])
def test_parts_of_a_stretch_equal_one_run(at_once, monkeypatch):
    problem = Problem()
    whole, parts = problem.filter(), problem.filter()
    wanted = whole.run(problem.part(0, N), np.zeros(P))
    monkeypatch.setattr(momentum_filter, '_AT_ONCE', at_once)
    stretch = problem.part(0, N)
    assert len(stretch.parts) == -(-(N - 1) // at_once)
    for got, want in zip(parts.run(stretch, np.zeros(P)), wanted, strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-11)  # the same steps, rounded alike
    for got, want in zip(parts.information.solve(), whole.information.solve(), strict=True):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-11)
    np.testing.assert_allclose(parts._covariance, whole._covariance, rtol=0, atol=1e-11)
    rows = [r for part in stretch.parts for r in range(part.rows.start, part.rows.stop)]
    assert rows == list(range(len(stretch.deviations)))


def test_shift_of_the_constants_changes_no_prediction():
    problem = Problem()
    engine = problem.filter()
    run(engine, problem.part(0, N))
    before, covariance = engine.information.solve()
    state = state_of(engine, before)
    change = np.array([0.3, -2.0, 5.0])
    engine.shift_constants(change)
    after, same = engine.information.solve()
    np.testing.assert_allclose(after, before - change, rtol=0, atol=1e-12)
    np.testing.assert_allclose(same, covariance, rtol=0, atol=1e-12)
    np.testing.assert_allclose(state_of(engine, after), state, rtol=0, atol=1e-12)


def test_attitude_error_is_taken_once():
    problem = Problem()
    engine = problem.filter()
    run(engine, problem.part(0, N))
    error = engine._mean[:3, 0].copy()
    time, first = engine.take_end()
    assert time == problem.time[-1]
    np.testing.assert_allclose(first.as_rotvec(), error, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(engine.take_end()[1].as_rotvec(), 0.0)


def test_no_measurement_adds_no_information():
    problem = Problem(seen=dict.fromkeys(SEEN, 0.0))
    engine = problem.filter()
    run(engine, problem.part(0, N))
    estimate, covariance = engine.information.solve()
    np.testing.assert_allclose(estimate, problem.mean, rtol=0, atol=1e-14)
    np.testing.assert_allclose(covariance, np.diag(problem.std**2), rtol=0, atol=1e-14)
    assert engine.information.rows == P


def test_covariance_stays_symmetric_and_positive():
    problem = Problem()
    engine = problem.filter()
    run(engine, problem.part(0, N))
    covariance = engine._covariance
    np.testing.assert_allclose(covariance, covariance.T, rtol=0, atol=1e-12)
    assert np.linalg.eigvalsh(covariance)[0] > 0.0


# --- the model of the deviations


def chain():
    """Generator of the joints: position to jerk, the fourth derivative is white noise."""
    return np.kron(np.diag(np.ones(3), 1), np.eye(JOINTS))


def space_of(dt, omega, state):
    """State space of one step with given (2, 3) rates and (2, 3, 3 + 2 n) coefficients."""
    rows = measured_rows(np.array([0.0, dt]), dict.fromkeys(CHANNELS, np.zeros(0)), STATES)
    stretch = SimpleNamespace(
        reference=SimpleNamespace(times=np.array([0.0, dt])),
        kinematics=SimpleNamespace(omega=omega),
        rows=rows,
        row_variance=np.zeros(0),
        joint_states=np.zeros((2, 4 * JOINTS)),
        snap_density=SNAP,
        record=Record(),
        fastest=np.ones((3, JOINTS)),
    )
    rate = RateErrorModel(np.zeros((2, 3)), state, np.zeros((2, 3, P)))
    part = Part(slice(0, 2), slice(0, 0), rows.first)
    return state_space(stretch, part, rate)[0]


def test_joint_steps_are_exact():
    dt = 0.037
    space = space_of(dt, np.zeros((2, 3)), np.zeros((2, 3, 3 + 2 * JOINTS)))
    np.testing.assert_allclose(
        space.transitions[0, 3:, 3:], expm(dt * chain()), rtol=0, atol=1e-15
    )
    shock = np.zeros((4 * JOINTS, 4 * JOINTS))
    shock[-JOINTS:, -JOINTS:] = np.diag(SNAP)
    want, _ = quad_vec(
        lambda s: expm(s * chain()) @ shock @ expm(s * chain()).T, 0.0, dt, epsabs=0, epsrel=1e-12
    )
    np.testing.assert_allclose(space.noise[0, 3:, 3:], want, rtol=1e-10, atol=0)
    np.testing.assert_array_equal(space.noise[0, :3, :3], 0.0)


def numerical_step(dt, w, S):
    """Transition of dphi' = -w x dphi + S [dphi; q; q'], by small steps."""
    skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    total, count = np.eye(SIZE), 400
    for i in range(count):
        s = (i + 0.5) / count
        A = np.zeros((SIZE, SIZE))
        A[3:, 3:] = chain()
        A[:3, : 3 + 2 * JOINTS] = (1.0 - s) * S[0] + s * S[1]
        A[:3, :3] -= skew
        total = expm(A * dt / count) @ total
    return total


def test_transitions_against_numerical_integration(rng):
    w = np.array([0.5, -0.8, 0.3])
    S = np.tile(rng.standard_normal((3, 3 + 2 * JOINTS)), (2, 1, 1))
    S[1] += 0.04 * rng.standard_normal(S[1].shape)
    errors = []
    for dt in (0.16, 0.08):
        ends = np.array([S[0], S[0] + (S[1] - S[0]) * dt / 0.16])
        got = space_of(dt, np.tile(w, (2, 1)), ends).transitions[0]
        errors.append(np.max(np.abs(got - numerical_step(dt, w, ends))))
    assert errors[0] < 1e-5
    # a local error of fifth order
    assert np.log2(errors[0] / errors[1]) > 4.0


def test_noise_of_the_attitude_follows_the_joints(rng):
    dt = 0.02
    S = np.tile(rng.standard_normal((3, 3 + 2 * JOINTS)), (2, 1, 1))
    noise = space_of(dt, np.zeros((2, 3)), S).noise
    # the joints' noise at the end of the step, times half of it
    lever = 0.5 * dt * S[0][:, 3:]
    joints = noise[0, 3 : 3 + 2 * JOINTS, 3 : 3 + 2 * JOINTS]
    want = lever @ joints @ lever.T
    np.testing.assert_allclose(noise[0, :3, :3], want, rtol=0, atol=1e-12 * np.max(want))
    scale = np.sqrt(np.diag(noise[0]))
    assert np.linalg.eigvalsh(noise[0] / np.outer(scale, scale))[0] > -1e-9


@pytest.mark.parametrize('n', [1, 3])
def test_transitions_are_those_of_any_linear_system(rng, n):
    size, count = 3 + 4 * n, 20
    matrices = np.zeros((count, size, size))
    matrices[:, :3, : 3 + 2 * n] = 20.0 * rng.standard_normal((count, 3, 3 + 2 * n))
    matrices[:, 3:, 3:] = np.kron(np.diag(np.ones(3), 1), np.eye(n))
    durations = rng.uniform(0.005, 0.02, count - 1)
    expected = Steps(durations, matrices).transitions
    # rounding
    np.testing.assert_allclose(
        transitions_of(durations, matrices[:, :3].copy()), expected, rtol=0, atol=1e-13
    )


def test_a_stop_is_a_white_acceleration_by_which_momentum_is_kept(rng):
    dt, sizes = 0.02, rng.uniform(0.5, 2.0, (3, JOINTS))
    slopes = rng.standard_normal((2, 3, JOINTS))
    noise = np.zeros((2, SIZE, SIZE))
    add_stops(noise, np.full(2, dt), slopes, np.array([False, True]), sizes)
    assert not noise[0].any()

    def density(s):
        own = np.diag(sizes[0]) / np.sqrt(dt)
        answer = np.vstack([(dt - s) * slopes[1] @ own, (dt - s) * own, own])
        return answer @ answer.T

    turns = 3 + 2 * JOINTS
    expected, _ = quad_vec(density, 0.0, dt)
    np.testing.assert_allclose(noise[1, :turns, :turns], expected, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(noise[1, turns:, turns:], np.diag(sizes[1:].ravel() ** 2))
