"""Samples come in any order; the buffer puts them in order and says how far it is complete."""

import numpy as np
import pytest

from spacerobot_ros.errors import MessageRejectedError
from spacerobot_ros.recording.buffer import PATIENCE_NS, SENSORS, SampleBuffer

NAMES = ('a', 'b')
UNIT = np.array([0.0, 0.0, 0.0, 1.0])


def add(buffer, sensor, stamp):
    if sensor == 'joints':
        buffer.add_joints(stamp, np.full(2, stamp), np.zeros(2))
    elif sensor == 'imu':
        buffer.add_rate(stamp, np.full(3, stamp))
    else:
        buffer.add_attitude(stamp, UNIT)


def test_order_of_arrival_does_not_matter(rng):
    samples = [(sensor, 10 * k) for sensor in SENSORS for k in range(50)]
    for _ in range(20):
        # each message is late by up to 30, so neighbours overtake each other
        shuffled = sorted(samples, key=lambda s: s[1] + rng.uniform(0, 30))
        buffer = SampleBuffer(NAMES)
        for k, (sensor, stamp) in enumerate(shuffled):
            add(buffer, sensor, stamp)
            # nothing older than what is settled comes any more, but for the disorder
            assert all(later > buffer.settled_ns(0) - 40 for _, later in shuffled[k + 1 :])
        record = buffer.record()
        assert record.joints.stamp_ns.tolist() == list(range(0, 500, 10))
        np.testing.assert_array_equal(record.omega[:, 0], np.arange(0.0, 500.0, 10.0))
        assert buffer.settled_ns(0) == 490


def test_a_sensor_that_is_worked_off_slowly_is_waited_for():
    buffer = SampleBuffer(NAMES, sensors=('joints', 'imu'))
    for k in range(0, 5 * PATIENCE_NS, PATIENCE_NS // 2):
        add(buffer, 'joints', k)
        assert buffer.settled_ns(PATIENCE_NS - 1) == -1
    add(buffer, 'imu', 7)
    assert buffer.settled_ns(PATIENCE_NS - 1) == 7


def test_a_silent_sensor_is_not_waited_for():
    buffer = SampleBuffer(NAMES, sensors=('joints', 'imu'))
    add(buffer, 'joints', 0)
    assert buffer.settled_ns(0) == -1
    add(buffer, 'joints', 2 * PATIENCE_NS)
    assert buffer.settled_ns(PATIENCE_NS) == -1
    add(buffer, 'joints', 3 * PATIENCE_NS)
    assert buffer.settled_ns(PATIENCE_NS + 1) == 3 * PATIENCE_NS
    assert buffer.settled_ns() == 3 * PATIENCE_NS  # without a wall the stamps alone count


def test_a_sensor_that_comes_back_late_is_waited_for_again():
    buffer, step = SampleBuffer(NAMES, sensors=('joints', 'imu')), PATIENCE_NS // 100
    taken = 0
    for k in range(1000):
        wall = k * step
        add(buffer, 'joints', k * step)
        if k < 100 or k >= 400:
            lag = 30 if k >= 400 else 0  # it lags by more than what was used already
            try:
                add(buffer, 'imu', (k - lag) * step)
                taken += 1
            except MessageRejectedError:
                pass
        settled = buffer.settled_ns(wall)
        if settled is not None and settled > 15 * step:
            buffer.close(settled - 15 * step, 10 * step)
    assert taken >= 100 + 600 - 30


def test_late_and_duplicate_samples_are_refused():
    buffer = SampleBuffer(NAMES, lateness=50e-9, ahead=1e-6)
    add(buffer, 'joints', 100)
    add(buffer, 'joints', 50)
    for stamp, reason in (
        (100, 'duplicate'), (50, 'duplicate'), (49, 'backwards by 5.1e-08 s'),
        (1200, 'ahead of all others'),
    ):  # fmt: skip
        with pytest.raises(MessageRejectedError, match=reason):
            add(buffer, 'joints', stamp)
    buffer.close(100, 20)
    with pytest.raises(MessageRejectedError, match='too late to be used'):
        add(buffer, 'imu', 100)
    add(buffer, 'imu', 101)
    assert buffer.record().joints.stamp_ns.tolist() == [100]
    with pytest.raises(MessageRejectedError, match='duplicate'):
        add(buffer, 'imu', 101)


def test_a_forgotten_sample_is_not_new_again():
    buffer = SampleBuffer(NAMES)
    add(buffer, 'imu', 100)
    buffer.streams['imu'].forget(101)
    with pytest.raises(MessageRejectedError, match='duplicate'):
        add(buffer, 'imu', 100)


def test_a_record_counts_from_the_first_sample_and_has_efforts_if_all_have():
    buffer = SampleBuffer(NAMES)
    buffer.add_joints(2_000, np.ones(2), np.ones(2), np.ones(2))
    add(buffer, 'imu', 1_000)
    assert buffer.record().effort.tolist() == [[1.0, 1.0]]
    add(buffer, 'joints', 3_000)
    assert buffer.record().effort is None
    assert buffer.record(2_500).joint_time.tolist() == [2e-6]
    assert buffer.record(0, 1_500).joints is None
    assert buffer.after(1_000) == 2_000
    assert buffer.missing == ('attitude',)
