"""Kinematics trajectories: smoothing, integrated attitude, alignment, the time grid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support.identification import STDS, measure, simulate

from spacerobot_ros.errors import IdentificationError
from spacerobot_ros.estimation.reference import Kinematics
from spacerobot_ros.estimation.smoothing import SensorData, Smoothed, align, smooth, time_grid
from spacerobot_ros.estimation.splines import SplineFit

NOISE = (STDS['joint_position_std'], STDS['joint_velocity_std'], STDS['gyro_std'])


class Curve:
    """An exact signal in place of a fitted spline."""

    def __init__(self, value, n=3):
        self.value, self.n = value, n

    def __call__(self, time):
        return np.array([self.value(t) for t in np.atleast_1d(time)])

    def derivative(self, order=1):
        return lambda time: np.zeros((len(time), self.n))


def smoothed_with(rate):
    zero = Curve(lambda t: np.zeros(3))
    return Smoothed(SplineFit(zero, zero, 1.0, 1.0), SplineFit(Curve(rate), zero, 1.0, 1.0))


def tumbling(t):
    """A body rate without constant axis."""
    return np.array([0.4 * np.sin(0.7 * t) + 0.2, 0.3 * np.cos(1.1 * t), 0.5 - 0.02 * t])


def integrated(rate, start, end):
    """Attitude by DOP853 on the nine entries of R' = R skew(w)."""

    def slope(t, x):
        return np.cross(x.reshape(3, 3), rate(t)).ravel()

    # rows r of R obey r' = r x w, since (R skew(w)) row = r x w
    solution = solve_ivp(slope, (0.0, end), start.ravel(), method='DOP853', rtol=1e-12, atol=1e-13)
    return solution.y[:, -1].reshape(3, 3)


def angle_between(a, b):
    return float(np.linalg.norm((Rotation.from_matrix(a).inv() * b).as_rotvec()))


def test_attitude_of_a_precession_is_exact_to_fourth_order():
    # R = exp(t c) exp(-t s e_z) with constant c has the body rate [a cos(st), a sin(st), b].
    a, b, s = 0.3, 0.2, 0.9
    c = np.array([a, 0.0, b + s])

    def exact(t):
        return Rotation.from_rotvec(t * c) * Rotation.from_rotvec([0.0, 0.0, -s * t])

    def rate(t):
        return np.array([a * np.cos(s * t), a * np.sin(s * t), b])

    errors = []
    for count in (20, 40, 80):
        reference = smoothed_with(rate).reference(
            np.linspace(0.0, 20.0, count + 1), Rotation.identity()
        )
        errors.append(np.linalg.norm((exact(20.0).inv() * reference.rotation[-1]).as_rotvec()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.3)


def test_attitude_against_dop853():
    start = Rotation.from_rotvec([0.3, -0.8, 0.4])
    reference = smoothed_with(tumbling).reference(np.linspace(0.0, 20.0, 2001), start)
    want = integrated(tumbling, start.as_matrix(), 20.0)
    # 0.01 s steps, local error 1e-2 dt^5, and DOP853's 1e-11
    assert angle_between(want, reference.rotation[-1]) < 1e-10


def test_steps_may_be_uneven(rng):
    times = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 20.0, 3000)), [20.0]])
    reference = smoothed_with(tumbling).reference(times, Rotation.identity())
    # fourth order on steps of up to 0.06 s
    assert angle_between(integrated(tumbling, np.eye(3), 20.0), reference.rotation[-1]) < 1e-8


def test_reference_of_a_noisy_run_is_near_the_truth():
    run = simulate('zyx', 20.0)
    data = measure(run, 5)
    smoothed = smooth(data, 0.0, 20.0, NOISE)
    reference = smoothed.reference(run.time, Rotation.from_quat(run.attitude_xyzw[0]))
    for got, want, std in (
        (reference.q, run.q, NOISE[0]),
        (reference.qd, run.qd, NOISE[1]),
        (reference.omega, run.omega, NOISE[2]),
    ):
        assert np.sqrt(np.mean((got - want) ** 2)) < 0.5 * std
    error = (Rotation.from_quat(run.attitude_xyzw).inv() * reference.rotation).magnitude()
    # a random walk of the gyro: 2e-5 rad/s * sqrt(20 s * 0.01 s) = 9e-6 rad an axis
    assert np.max(error) < 5e-5


def test_rates_are_smoothed_without_measured_rates():
    run = simulate('zyx', 20.0)
    data = measure(run, 5)
    encoders = replace(data, qd=np.full_like(data.qd, np.nan))
    smoothed = smooth(encoders, 0.0, 20.0, NOISE)
    error = smoothed.joints(run.time, 1) - run.qd
    assert np.sqrt(np.mean(error**2)) < NOISE[1]


def test_alignment_averages_the_tracker():
    run = simulate('zyx', 20.0)
    data = measure(run, 5)
    reference = smooth(data, 0.0, 20.0, NOISE).reference(run.time, Rotation.identity())
    start = align(reference, data.attitude_time, data.attitude_xyzw)
    error = (Rotation.from_quat(run.attitude_xyzw[0]).inv() * start).magnitude()
    # 3e-5 rad / sqrt(201) = 2e-6, and the gyro's walk of 1e-5
    assert error < 4e-5


def test_alignment_is_exact_for_exact_attitudes(rng):
    times = np.linspace(0.0, 5.0, 51)
    path = Rotation.from_rotvec(np.outer(times, [0.3, -0.2, 0.5])) * Rotation.random(rng=rng)
    offset = Rotation.random(rng=rng)
    reference = Kinematics(times, np.zeros((51, 1)), np.zeros((51, 1)), np.zeros((51, 3)), path)
    measured = (offset * path).as_quat() * rng.choice([-1.0, 1.0], 51)[:, None]
    picks = [3, 17, 40]
    start = align(reference, times[picks], measured[picks])
    assert (start.inv() * (offset * path[0])).magnitude() < 1e-14


def data_at(joints, rates, attitudes):
    j, r, a = (np.array(t, dtype=float) for t in (joints, rates, attitudes))
    q = np.column_stack([j, j])
    return SensorData(
        j, q, q, r, np.column_stack([r, r, r]), a, np.column_stack([a, a, a, np.ones(len(a))])
    )


def test_grid_has_every_stamp_once_and_fills_gaps():
    data = data_at([0.0, 0.01, 0.02, 1.0], [0.005, 0.02, 0.99], [0.0, 1.0])
    grid = time_grid(data)
    assert np.all(np.diff(grid) > 0.0)
    assert np.max(np.diff(grid)) <= 0.0301
    for stamps in (data.joint_time, data.rate_time, data.attitude_time):
        assert np.isin(stamps, grid).all()


def test_grid_without_gaps_is_the_stamps():
    data = data_at([0.0, 0.01, 0.02], [0.0, 0.01, 0.02], [0.0, 0.02])
    np.testing.assert_array_equal(time_grid(data), [0.0, 0.01, 0.02])


def test_between_excludes_the_start_and_includes_the_end():
    data = data_at([0.0, 1.0, 2.0, 3.0], [0.5, 1.0, 3.5], [1.0])
    part = data.between(0.0, 3.0)
    np.testing.assert_array_equal(part.joint_time, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(part.q[:, 0], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(part.rate_time, [0.5, 1.0])
    np.testing.assert_array_equal(part.attitude_time, [1.0])
    assert len(data.between(1.0, 3.0).attitude_time) == 0


def test_start_of_the_joints_and_its_spread():
    run = simulate('zyx', 20.0)
    smoothed = smooth(measure(run, 5), 0.0, 20.0, NOISE)
    start, spread = smoothed.joint_start(run.time)
    assert start.shape == spread.shape == (4, 3)
    np.testing.assert_allclose(start[0], run.q[0], rtol=0, atol=1e-4)
    # the rms of the motion, by differences of the exact rates
    want = np.sqrt(np.mean(np.gradient(run.qd, run.time, axis=0) ** 2, axis=0))
    np.testing.assert_allclose(spread[2], want, rtol=0.05, atol=0)
    assert np.all(smoothed.snap_density(run.time) > 0.0)


def test_a_gap_that_cannot_be_bridged_is_refused_with_its_place():
    data = measure(simulate('zyx', 20.0), 0)
    late = data.joint_time.copy()
    late[-1] += 36_000.0  # one stamp ten hours ahead must not be filled with steps of 20 ms
    with pytest.raises(IdentificationError, match=r'no samples for 36000 s after t = 20 s'):
        time_grid(replace(data, joint_time=late))
