"""Sequential tests: rare false alarms on white noise, and what raises and ends an alarm."""

import math
from itertools import pairwise

import numpy as np
import pytest

from spacerobot_ros.diagnosis.flight.block_innovations import Block
from spacerobot_ros.diagnosis.flight.probes import Probe
from spacerobot_ros.diagnosis.flight.sequential_tests import SequentialTests
from spacerobot_ros.estimation.trajectory.time_base import CHANNELS

PROBES = (Probe('joint_torque', 0, 'a torque', 'N m', 3), Probe('gyro', 0, 'gyro x', 'rad/s'))
ROWS = 100


def block(data, columns):
    channel = np.full(len(data), CHANNELS.index('gyro'))
    time = np.arange(len(data)) * 0.01
    none = np.zeros((len(data), 1, 0))  # torques from outside
    axis = np.zeros(len(data), dtype=int)
    return Block(channel, axis, time, data, columns, columns[:, ::-1], none)


def run(interval, blocks, rng, add=0.0, scale=1.0):
    tests = SequentialTests(PROBES, interval, 1.0, clear_after=3.0)
    columns = rng.standard_normal((ROWS, 2))
    verdicts = []
    for k in range(blocks):
        data = scale * rng.standard_normal(ROWS)
        data += (add(k) if callable(add) else add) * columns[:, 0]
        verdicts.append(tests.add(block(data, columns), np.zeros(2)))
    return tests, verdicts


def test_threshold_is_that_of_the_stated_rate():
    tests = SequentialTests(PROBES, 3.6e6, 1.0, 5.0)
    assert tests.count == 4 * 2 + 2  # four a probe; noise and structure of a sensor
    assert math.isclose(tests.threshold, math.log(10 * 3.6e6), rel_tol=1e-12)


def test_false_alarms_are_rarer_than_stated(rng):
    interval = 500.0  # short, so that some come
    _, verdicts = run(interval, 6000, rng)
    alarmed = np.array([v.alarmed.any() for v in verdicts])
    count = np.count_nonzero(alarmed[1:] & ~alarmed[:-1])
    assert count <= 6000 / interval, count  # Lorden's bound is far from tight


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_a_shift_of_either_sign_is_raised_with_its_value(rng, sign):
    _, verdicts = run(3.6e6, 6, rng, add=0.8 * sign)
    assert verdicts[-1].alarmed[0]
    # 100 rows of unit columns: std 0.1
    np.testing.assert_allclose(verdicts[-1].value[0], 0.8 * sign, rtol=0.0, atol=0.5)
    np.testing.assert_allclose(verdicts[-1].std[0], 0.1, rtol=0.3, atol=0.0)


def test_a_sign_that_changes_is_raised_too(rng):
    _, verdicts = run(3.6e6, 8, rng, add=lambda k: 0.8 * (-1) ** k)
    assert verdicts[-1].alarmed[0]


def test_noise_half_as_large_again_is_raised_and_a_little_more_is_not(rng):
    _, loud = run(3.6e6, 60, rng, scale=1.6)
    assert loud[-1].alarmed[1]
    assert loud[-1].loud[1]
    assert not any(v.alarmed.any() for v in run(3.6e6, 60, rng, scale=1.1)[1])


def test_an_alarm_ends_late_and_not_by_one_quiet_block(rng):
    _, verdicts = run(3.6e6, 60, rng, add=lambda k: 0.8 * (10 <= k < 15))
    alarmed = [bool(v.alarmed.any()) for v in verdicts]
    assert not any(alarmed[:10])
    assert all(alarmed[12:18])
    assert not alarmed[-1]
    assert sum(a != b for a, b in pairwise(alarmed)) == 2


def test_structure_counts_as_evidence(rng):
    tests = SequentialTests(PROBES, 3.6e6, 1.0, 5.0)
    data, columns = rng.standard_normal(ROWS), rng.standard_normal((ROWS, 2))
    verdict = tests.add(block(data, columns), np.array([0.0, 1.1 * tests.threshold]))
    assert verdict.alarmed.tolist() == [False, True]
