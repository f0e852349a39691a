"""Samples in a row that are off together are found, and what a machine does is not."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.recording.faults.bursts import LONGEST, bursts
from validation.hidden.diagnosis_scenario import packaged, simulated

STD = 2e-5
TIME = np.arange(0.0, 20.0, 0.01)


def motion(seed):
    """Rates (N, 3) of a smooth motion, and noise."""
    rng = np.random.default_rng(seed)
    waves = [0.05 * np.sin(2.0 * np.pi * f * TIME + f) for f in (0.1, 0.35, 0.7)]
    return np.column_stack(waves) + STD * rng.standard_normal((len(TIME), 3))


def kinked(values, at, step, slope):
    """The values with another level and another slope from a sample on."""
    later = TIME - TIME[at]
    return values + np.where(later >= 0.0, step + slope * later, 0.0)[:, None]


@pytest.mark.parametrize('length', [2, 3, 5, 10, LONGEST])
@pytest.mark.parametrize('size', [15.0, 1e3, 1e8])
def test_bursts_are_found_and_nothing_beside_them(length, size):
    values, burst = motion(length), np.zeros(len(TIME), dtype=bool)
    for start in range(100, 1900, 200):
        burst[start : start + length] = True
    values[burst] += size * STD * np.array([0.6, 0.0, -0.8])
    assert np.flatnonzero(bursts(TIME, values, STD) != burst).size == 0


@pytest.mark.parametrize('seed', range(5))
def test_noise_has_none(seed):
    assert not bursts(TIME, motion(seed), STD).any()


@pytest.mark.parametrize('step', [0.0, 30.0, 1e4])
@pytest.mark.parametrize('slope', [0.0, 2e4])
def test_jumps_and_kinks_are_none(step, slope):
    for at in (300, 700, 1300):
        assert not bursts(TIME, kinked(motion(at), at, STD * step, STD * slope), STD).any()


def test_torques_held_in_a_fast_flight_make_none():
    flight = simulated('minisat', 'fast', 3, (), 20.0)
    noise, _ = noise_levels(packaged('minisat').robot.sensors, flight)
    assert not bursts(flight.rate_time, flight.omega, noise.gyro).any()
    assert not bursts(flight.joint_time, flight.qd, noise.joint_velocity).any()


def test_stamps_need_not_be_even():
    rng = np.random.default_rng(2)
    kept = np.sort(rng.choice(len(TIME), 1900, replace=False))
    values, burst = motion(4)[kept], slice(900, 906)
    values[burst] += 20.0 * STD
    assert np.flatnonzero(bursts(TIME[kept], values, STD)).tolist() == list(range(900, 906))


def test_slow_sensors_and_few_samples_are_not_judged():
    values = motion(1)
    values[500:504] += 50.0 * STD
    assert not bursts(5.0 * TIME, values, STD).any()
    assert not bursts(TIME[:20], values[495:515], STD).any()
