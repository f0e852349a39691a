"""Ripple against a joint's angle, far above the band of a balance."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.arms.orders import find_orders
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

NAMES = ('a', 'b')
RATE, SECONDS = 100.0, 40.0


def record(rng, *, ripple=0.0, order=200.0, clock=0.0):
    time = np.arange(round(SECONDS * RATE)) / RATE
    q = np.column_stack([0.9 * np.sin(0.5 * time) + 0.3 * np.sin(1.1 * time), 0.01 * time])
    effort = 3.0 * np.sin(q * 2.0) + 0.1 * rng.standard_normal(q.shape)
    effort[:, 0] += ripple * np.sin(order * q[:, 0] + 0.7)
    effort[:, 0] += clock * np.sin(2.0 * np.pi * 17.0 * time)
    return Record(joints=JointSeries(NAMES, to_stamps(time), q, None, effort))


@pytest.mark.parametrize('order', [120.0, 202.0])
def test_a_ripple_is_found_with_its_order(order, rng):
    (found,) = find_orders([record(rng), record(rng, ripple=0.05, order=order)], NAMES)
    assert found.joint == 'a'
    assert found.order == pytest.approx(order, abs=2.0 * np.pi / 2.3)  # resolution of the way
    assert found.amplitude == pytest.approx(0.05, rel=0.5)  # off the order by a share of that
    assert found.p_value < 1e-7


def test_noise_and_what_follows_a_clock_have_no_order(rng):
    assert not find_orders([record(rng)], NAMES)
    assert not find_orders([record(rng, clock=0.3)], NAMES)
