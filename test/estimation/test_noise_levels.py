"""Sensor noise from the data."""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.identification import SENSORS, SILENT, STDS, changed, measure, simulate

from spacerobot_ros.estimation.noise_levels import fourth_difference_std, noise_levels
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps


def of(levels):
    return {f'{name}_std': value for name, value in asdict(levels).items()}


@pytest.mark.parametrize('std', [1e-6, 1e-4, 1e-2])
def test_noise_of_a_smooth_signal(std, rng):
    t = np.arange(0.0, 20.0, 0.01)
    smooth = np.column_stack([np.sin(t), t**2, np.cos(2.0 * t)])
    got = fourth_difference_std(smooth + std * rng.standard_normal(smooth.shape))
    # 6000 values, correlated over four: standard deviation about 1.5 %
    assert got == pytest.approx(std, rel=0.05)


@pytest.mark.parametrize('scale', [0.3, 1.0, 10.0])
@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_noise_of_a_run(axes, scale):
    levels, notes = noise_levels(SILENT, measure(simulate(axes, 60.0), 3, scale), is_checked=False)
    for name, std in STDS.items():
        # The tracker has 600 samples (4 %), and at 10 Hz the motion itself shows below 2e-5 rad.
        tolerance = (0.12 if scale >= 1.0 else 0.25) if name == 'attitude_std' else 0.05
        assert of(levels)[name] == pytest.approx(scale * std, rel=tolerance), name
    assert len(notes) == 4


def test_outliers_do_not_count(rng):
    values = 1e-3 * rng.standard_normal((4000, 1))
    values[::200] += 1.0
    assert fourth_difference_std(values) == pytest.approx(1e-3, rel=0.1)


def test_stated_levels_are_kept_and_only_missing_ones_estimated():
    data = measure(simulate('zyx', 20.0), 1)
    levels, notes = noise_levels(SENSORS, data, is_checked=False)
    assert {name: of(levels)[name] for name in STDS} == STDS
    assert notes == ()
    levels, notes = noise_levels(replace(SENSORS, gyro_std=None), data, is_checked=False)
    assert levels.joint_position == STDS['joint_position_std']
    assert levels.gyro == pytest.approx(STDS['gyro_std'], rel=0.05)
    assert len(notes) == 1
    assert notes[0].startswith('gyro_std is not stated; estimated from the data: ')


def test_data_that_are_noisier_than_stated_count_where_they_are_checked():
    data = measure(simulate('zyx', 20.0), 1, scale=3.0)
    levels, notes = noise_levels(SENSORS, data)
    assert levels.gyro == pytest.approx(3.0 * STDS['gyro_std'], rel=0.1)
    assert any(note.startswith('gyro: the data are noisier than stated') for note in notes)
    assert noise_levels(SENSORS, data, is_checked=False)[0].gyro == STDS['gyro_std']


def test_levels_stay_above_rounding():
    data = measure(simulate('zyx', 20.0), 1, scale=0.0)
    levels, _ = noise_levels(SILENT, data)
    assert min(of(levels).values()) >= 1e-8
    stated = SensorSettings(**dict.fromkeys(STDS, 1e-15))
    assert min(of(noise_levels(stated, data)[0]).values()) >= 1e-8


def test_too_few_or_unmeasured_samples_give_the_floor():
    assert fourth_difference_std(np.zeros((4, 3))) == 0.0
    assert fourth_difference_std(np.full((100, 3), np.nan)) == 0.0
    data = measure(simulate('zyx', 20.0), 1)
    empty = changed(data, attitude_time=np.zeros(0), attitude_xyzw=np.zeros((0, 4)))
    assert noise_levels(SILENT, empty)[0].attitude == 1e-8


def test_sign_of_the_quaternions_does_not_matter(rng):
    data = measure(simulate('zyx', 20.0), 1)
    signs = rng.choice([-1.0, 1.0], len(data.attitude_xyzw))
    flipped = changed(data, attitude_xyzw=data.attitude_xyzw * signs[:, None])
    got, want = (noise_levels(SILENT, d)[0].attitude for d in (flipped, data))
    assert got == pytest.approx(want, rel=1e-9)


def test_attitude_noise_while_turning_fast(rng):
    t = np.arange(0.0, 60.0, 0.1)
    still = Rotation.from_rotvec(np.outer(t, [0.3, 0.2, -0.5]))
    noise = Rotation.from_rotvec(3e-5 * rng.standard_normal((len(t), 3)))
    data = changed(
        measure(simulate('zyx', 20.0), 1),
        rate_time=np.arange(0.0, 60.0, 0.01),
        omega=np.tile([0.3, 0.2, -0.5], (6000, 1)),
        attitude_time=t,
        attitude_xyzw=(still * noise).as_quat(),
    )
    assert noise_levels(SILENT, data)[0].attitude == pytest.approx(3e-5, rel=0.1)


@pytest.mark.parametrize(('step', 'is_rounded'), [(0.0, False), (1e-3, True)])
def test_a_joint_that_only_moves_on_is_not_rounded(rng, step, is_rounded):
    # 501 numbers, about 2e-4 rad apart, against rounding to 1e-3 rad: sigma 1e-3 / sqrt 12
    data = measure(simulate('zyx', 5.0), 1)
    t = data.joint_time[:, None]
    moved = 0.02 * t + 0.001 * t**2 + 2e-5 * rng.standard_normal((len(t), data.q.shape[1]))
    if is_rounded:
        moved = step * np.round(moved / step)
    levels, _ = noise_levels(
        SENSORS, replace(data, joints=replace(data.joints, position=moved)), is_checked=False
    )
    expected = step / np.sqrt(12.0) if is_rounded else STDS['joint_position_std']
    assert levels.joint_position == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize('every', [4, 7, 20])
def test_lost_samples_make_no_noise(rng, every):
    time = np.arange(0.0, 20.0, 0.01)
    kept = np.arange(len(time)) % every > 0
    values = np.sin(3.0 * time)[:, None] + 1e-5 * rng.standard_normal((len(time), 1))
    got = fourth_difference_std(values[kept], time[kept])
    assert got == pytest.approx(1e-5, rel=0.15)


def test_the_level_that_counts_is_the_one_that_is_said(rng):
    """Of joints most of which stand: 7e-19 was said, their encoders' steps counted."""
    step, time = 4e-4, np.arange(0.0, 20.0, 0.01)
    q = np.column_stack([step * np.round(np.sin(time) / step), *([np.full(len(time), 0.1)] * 3)])
    record = Record(joints=JointSeries(tuple('abcd'), to_stamps(time), q))
    levels, (note, *_) = noise_levels(SensorSettings(), record)
    assert levels.joint_position == pytest.approx(step / np.sqrt(12.0))
    assert note.endswith(f'estimated from the data: {levels.joint_position:.3g}')


@pytest.mark.parametrize('unit', [1e-3, 0.7, 1.1])
def test_efforts_of_a_passive_joint_are_no_noise(unit, rng):
    """Of one motor beside it on a coarse scale, whose noise fell to rounding in other units."""
    counts = np.cumsum(np.round(rng.standard_normal(400)))
    one = 0.0041 * np.column_stack([counts, np.zeros(400)])
    level = fourth_difference_std(one)
    assert level == fourth_difference_std(one[:, :1])
    assert fourth_difference_std(one / unit * unit) == pytest.approx(level, rel=1e-9)


def test_of_a_few_smooth_samples_none_is_like_the_others():
    """Fourth differences all alike, and far from nothing: t^4 twenty times, and rounding."""
    time = np.arange(20.0)
    assert fourth_difference_std(time[:, None] ** 4 * (1.0 + 1e-9)) < 1e-6
