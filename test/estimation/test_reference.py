"""Reference trajectories: smoothing, integrated attitude, alignment, and the filter's times."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from support.identification import NOISE, changed, measure, simulate

from spacerobot_ros.errors import IdentificationError
from spacerobot_ros.estimation.filters.momentum_filter import Stretch
from spacerobot_ros.estimation.trajectory.reference import ReferenceTrajectory, integrated_rotation
from spacerobot_ros.estimation.trajectory.time_base import filter_times, refuse_long_gaps
from spacerobot_ros.identification.maximum_likelihood import prepare


def stacked(rate):
    """A rate of one time as one of many."""
    return lambda times: np.array([rate(t) for t in times])


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
        times = np.linspace(0.0, 20.0, count + 1)
        rotation = integrated_rotation(stacked(rate), times, Rotation.identity())
        errors.append(np.linalg.norm((exact(20.0).inv() * rotation[-1]).as_rotvec()))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.3)


def test_attitude_against_dop853():
    start = Rotation.from_rotvec([0.3, -0.8, 0.4])
    rotation = integrated_rotation(stacked(tumbling), np.linspace(0.0, 20.0, 2001), start)
    want = integrated(tumbling, start.as_matrix(), 20.0)
    # 0.01 s steps, local error 1e-2 dt^5, and DOP853's 1e-11
    assert angle_between(want, rotation[-1]) < 1e-10


def test_steps_may_be_uneven(rng):
    times = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 20.0, 3000)), [20.0]])
    rotation = integrated_rotation(stacked(tumbling), times, Rotation.identity())
    # fourth order on steps of up to 0.06 s
    assert angle_between(integrated(tumbling, np.eye(3), 20.0), rotation[-1]) < 1e-8


def through(record, **options):
    """The reference through a run of twenty seconds."""
    return ReferenceTrajectory(record, NOISE, simulate('zyx', 20.0).time, **options)


def test_reference_of_a_noisy_run_is_near_the_truth():
    run = simulate('zyx', 20.0)
    start = Rotation.from_quat(run.attitude_xyzw[0])
    reference = through(measure(run, 5), start=start).at(run.time)
    for got, want, std in (
        (reference.q, run.q, NOISE.joint_position),
        (reference.qd, run.qd, NOISE.joint_velocity),
        (reference.omega, run.omega, NOISE.gyro),
    ):
        assert np.sqrt(np.mean((got - want) ** 2)) < 0.5 * std
    error = (Rotation.from_quat(run.attitude_xyzw).inv() * reference.rotation).magnitude()
    # a random walk of the gyro: 2e-5 rad/s * sqrt(20 s * 0.01 s) = 9e-6 rad an axis
    assert np.max(error) < 5e-5


def test_accelerations_belong_to_the_rates():
    run = simulate('zyx', 20.0)
    reference = through(measure(run, 5)).at(run.time)
    for rates, accelerations in (
        (reference.qd, reference.qdd),
        (reference.omega, reference.alpha),
    ):
        want = np.gradient(rates, run.time, axis=0)[5:-5]
        # second order at 10 ms
        np.testing.assert_allclose(
            accelerations[5:-5], want, rtol=0, atol=1e-3 * np.max(np.abs(want))
        )


def test_rates_are_smoothed_without_measured_rates():
    run = simulate('zyx', 20.0)
    reference = through(changed(measure(run, 5), qd=None)).at(run.time)
    assert np.sqrt(np.mean((reference.qd - run.qd) ** 2)) < NOISE.joint_velocity


def test_alignment_averages_the_tracker():
    run = simulate('zyx', 20.0)
    start = through(measure(run, 5)).at(run.time).rotation[0]
    error = (Rotation.from_quat(run.attitude_xyzw[0]).inv() * start).magnitude()
    # 3e-5 rad / sqrt(201) = 2e-6, and the gyro's walk of 1e-5
    assert error < 4e-5


def test_alignment_is_exact_for_exact_attitudes(rng):
    run = simulate('zyx', 20.0)
    signs = rng.choice([-1.0, 1.0], len(run.time))[:, None]
    exact = measure(run, 5, scale=0.0, attitude_every=1)
    exact = changed(exact, attitude_xyzw=signs * exact.attitude_xyzw)
    reference = through(exact).at(run.time)
    error = (Rotation.from_quat(run.attitude_xyzw).inv() * reference.rotation).magnitude()
    assert np.max(error) < 2e-6  # of splines that are told of noise; the start's is far smaller
    assert error[0] < 1e-8


def test_a_biased_gyro_is_drawn_to_the_tracker_and_to_none_from_a_given_start():
    run = simulate('zyx', 20.0)
    biased = measure(run, 5)
    biased = changed(biased, omega=biased.omega + np.array([1e-3, 0.0, -5e-4]))
    truth = Rotation.from_quat(run.attitude_xyzw)
    drawn = through(biased).at(run.time).rotation
    left = np.max((truth.inv() * drawn).magnitude())
    free = through(biased, start=truth[0]).at(run.time).rotation
    lost = np.max((truth.inv() * free).magnitude())
    assert lost > 0.01
    assert left < 0.05 * lost


# --- times


def stamps_of(*lists):
    return [np.array(stamps, dtype=float) for stamps in lists]


def test_times_have_every_stamp_once_and_fill_gaps():
    stamps = stamps_of([0.0, 0.01, 0.02, 1.0], [0.005, 0.02, 0.99], [0.0, 1.0])
    times = filter_times(stamps, (0.0, 1.0))
    assert np.all(np.diff(times) > 0.0)
    assert np.max(np.diff(times)) <= 0.0301
    for each in stamps:
        assert np.isin(each, times).all()


def test_times_without_gaps_are_the_stamps():
    stamps = stamps_of([0.0, 0.01, 0.02], [0.0, 0.01, 0.02], [0.0, 0.02])
    np.testing.assert_array_equal(filter_times(stamps, (0.0, 0.02)), [0.0, 0.01, 0.02])


def test_stamps_that_nearly_agree_are_one_time():
    stamps = stamps_of([0.0, 0.01], [5e-8, 0.01 + 5e-8])
    np.testing.assert_array_equal(filter_times(stamps, (0.0, 0.02)), [0.0, 0.01])


def test_stamps_of_late_clocks_stay_apart():
    late = stamps_of([0.0, 0.01], [3e-6, 0.01 + 3e-6])  # which a fast motion of 20 s shows
    times = filter_times(late, (0.0, 0.02))
    np.testing.assert_array_equal(times, [0.0, 3e-6, 0.01, 0.01 + 3e-6])


def test_a_gap_that_cannot_be_bridged_is_refused_with_its_place():
    # one stamp ten hours ahead must not be filled with steps of 20 ms
    with pytest.raises(IdentificationError, match=r'no samples for 36000 s after t = 20 s'):
        refuse_long_gaps(np.array([0.0, 20.0, 36_020.0]))


# --- a stretch


def test_deviations_are_those_from_the_reference_at_the_samples_own_times():
    run = simulate('zyx', 20.0)
    data = measure(run, 9, joint_every=3, rate_every=2, attitude_every=10)
    stretch = prepare(data, NOISE)
    rows, record, reference = stretch.rows, stretch.record, stretch.reference
    for channel, samples, smooth in (
        (0, record.q, reference.at(record.joint_time).q),
        (1, record.qd, reference.at(record.joint_time).qd),
        (2, record.omega, reference.at(record.rate_time).omega),
    ):
        found = stretch.deviations[rows.channel == channel].reshape(-1, 3)
        np.testing.assert_allclose(found, samples - smooth, rtol=0, atol=1e-15)
    attitude = stretch.deviations[rows.channel == 3].reshape(-1, 3)
    seen = reference.at(record.attitude_time).rotation * Rotation.from_rotvec(attitude)
    difference = (seen.inv() * Rotation.from_quat(record.attitude_xyzw)).magnitude()
    np.testing.assert_allclose(difference, 0.0, rtol=0, atol=1e-14)
    # aligned with the tracker to its own noise
    assert np.sqrt(np.mean(attitude**2)) < 3.0 * NOISE.attitude


def test_joint_states_and_snap():
    run = simulate('zyx', 20.0)
    stretch = Stretch(measure(run, 5), NOISE, through(measure(run, 5)))
    states = stretch.joint_states
    assert states.shape == (len(run.time), 12)
    np.testing.assert_allclose(states[0, :3], run.q[0], rtol=0, atol=1e-4)
    # the rms of the motion, by differences of the exact rates
    want = np.sqrt(np.mean(np.gradient(run.qd, run.time, axis=0) ** 2, axis=0))
    np.testing.assert_allclose(
        np.sqrt(np.mean(states[:, 6:9] ** 2, axis=0)), want, rtol=0.05, atol=0
    )
    assert np.all(stretch.snap_density > 0.0)
