"""Motion of an arm on even times: no delay, joints at rest, gaps, efforts that are missing."""

import numpy as np
import pytest

from spacerobot_ros.estimation.balance.arm_motion import ArmMotion
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

STEP, LENGTH = 0.008, 20.0  # s
TIMES = np.arange(0.0, LENGTH, STEP)


def motion(position, effort=None, times=TIMES):
    """Two joints."""
    effort = np.zeros((len(times), 2)) if effort is None else effort
    joints = JointSeries(('a', 'b'), to_stamps(times), position, None, effort)
    return ArmMotion(Record(joints=joints))


def swinging(times=TIMES, rate=3.0):
    """Angle of a joint that swings at half a hertz."""
    return np.sin(rate * times)


def test_the_filters_do_not_delay():
    """A sine below the band passes with its phase; its derivatives are those of the sine."""
    angle = swinging()
    arm = motion(np.column_stack([angle, angle]), np.column_stack([angle, angle]))
    inner = slice(100, -100)
    truth = swinging(arm.times)[inner]
    # gain of the forward-backward Butterworth at a twentieth of its cut: 1 - 1e-7
    np.testing.assert_allclose(arm.kinematics.q[inner, 0], truth, rtol=0, atol=1e-4)
    np.testing.assert_allclose(arm.effort[inner, 0], truth, rtol=0, atol=1e-4)
    # central differences: (rate step)^2 / 6 = 1e-4
    slope = 3.0 * np.cos(3.0 * arm.times)[inner]
    np.testing.assert_allclose(arm.kinematics.qd[inner, 0], slope, rtol=0, atol=2e-3)
    np.testing.assert_allclose(arm.kinematics.qdd[inner, 0], -9.0 * truth, rtol=0, atol=2e-2)
    np.testing.assert_allclose(arm.in_band(arm.effort)[inner, 0], truth, rtol=0, atol=1e-3)


def test_no_end_of_a_run_makes_an_acceleration():
    """In full swing: of one that the reflection of a path loses, the band brings 5 % to rows."""
    arm = motion(np.cos(3.0 * TIMES)[:, None] * [1.0, 2.0])
    truth = -9.0 * np.cos(3.0 * arm.times)[:, None] * [1.0, 2.0]
    error = np.abs(arm.in_band(arm.kinematics.qdd - truth))[arm.is_known] / [9.0, 18.0]
    assert np.max(error) < 2e-3


def test_a_joint_that_stands_has_no_rows():
    stands = np.where(TIMES < 10.0, swinging(), swinging(np.array(10.0)))
    arm = motion(np.column_stack([stands, swinging()]))
    moves = arm.is_moving
    assert not moves[arm.times > 10.5, 0].any()
    # where it turns round it does not rest
    assert moves[(arm.times > 1.0) & (arm.times < 9.0), 0].mean() > 0.9
    assert moves[(arm.times > 1.0) & (arm.times < 19.0), 1].mean() > 0.9


def flickering(rng, step):
    """Readings of a joint that stands between two steps of its encoder."""
    return step * np.floor(0.5 + 0.3 * rng.standard_normal(len(TIMES)))


@pytest.mark.parametrize('step', [4e-4, 1.5e-3])
def test_readings_that_flicker_are_no_motion(rng, step):
    """Their rates, 0.007 rad/s and more, are 2 % of those of a joint that moves slowly."""
    slow = step * np.round(swinging(rate=0.3) / step)
    arm = motion(np.column_stack([flickering(rng, step), slow]))
    assert not arm.is_moving[:, 0].any()
    assert not arm.is_touched.any()
    assert arm.is_moving[(arm.times > 1.0) & (arm.times < 4.0), 1].mean() > 0.95


def test_a_joint_in_jerks_is_touched_and_not_judged(rng):
    """A tenth of a second of motion is a rest's margins, and nothing between them."""
    jerks = np.cumsum(np.where(np.mod(TIMES, 1.0) < 0.1, 2.0, 0.0)) * STEP
    noise = 1e-5 * rng.standard_normal(len(TIMES))
    arm = motion(np.column_stack([jerks + noise, np.zeros_like(jerks)]))
    assert not arm.is_moving.any()
    np.testing.assert_array_equal(arm.is_touched, [True, False])


def test_a_gap_is_not_known():
    times = TIMES[(TIMES < 8.0) | (TIMES > 9.0)]
    angle = swinging(times)
    arm = motion(np.column_stack([angle, angle]), times=times)
    inside = (arm.times > 8.0) & (arm.times < 9.0)
    assert not arm.is_known[inside].any()
    assert not arm.is_moving[inside].any()
    assert arm.is_known[(arm.times > 1.0) & (arm.times < 7.5)].all()


def test_a_joint_without_effort_never_counts():
    angle = np.column_stack([swinging(), swinging()])
    effort = np.column_stack([np.zeros(len(TIMES)), np.full(len(TIMES), np.nan)])
    arm = motion(angle, effort)
    assert arm.is_moving[:, 0].any()
    assert not arm.is_moving[:, 1].any()
    assert np.all(np.isfinite(arm.effort))


def test_rows_follow_the_band():
    slow = np.arange(0.0, LENGTH, 0.1)
    arm = motion(np.column_stack([swinging(slow), swinging(slow)]), times=slow)
    assert arm.band == pytest.approx(1.0 / 0.6)
    fast = motion(np.column_stack([swinging(), swinging()]))
    assert fast.band == 4.0
    assert fast.stride * fast.step <= 1.0 / (2.5 * fast.band)
