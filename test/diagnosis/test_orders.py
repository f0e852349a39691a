"""Ripple against a joint's angle, far above the band of a balance."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis.orders.orders import find_orders
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from spacerobot_ros.report.leftover_tables import _order_line

NAMES = ('a', 'b')
UNITS = dict.fromkeys(NAMES, 'N m')
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
    (found,) = find_orders([record(rng), record(rng, ripple=0.05, order=order)], UNITS)
    assert found.joint == 'a'
    assert found.order == pytest.approx(order, abs=2.0 * np.pi / 2.3)  # resolution of the way
    assert found.amplitude == pytest.approx(0.05, rel=0.5)  # off the order by a share of that
    assert found.p_value < 1e-7


def test_noise_and_what_follows_a_clock_have_no_order(rng):
    assert not find_orders([record(rng)], UNITS)
    assert not find_orders([record(rng, clock=0.3)], UNITS)


def along(rng, q, added):
    """A joint along (N,) angles with something in its effort beside noise."""
    effort = 0.1 * rng.standard_normal(len(q)) + added
    time = np.arange(len(q)) / RATE
    return Record(joints=JointSeries(('a',), to_stamps(time), q[:, None], None, effort[:, None]))


def test_at_one_speed_a_line_of_a_clock_is_no_order_and_a_ripple_is_one(rng):
    """There and back at 0.5 rad/s: what turns back with the joint follows it, and no clock."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    there_and_back = 0.5 * np.abs((time + 1.3) % 8.0 - 4.0)
    hum = 0.3 * np.sin(2.0 * np.pi * 17.0 * time)
    assert not find_orders([along(rng, there_and_back, hum)], {'a': 'N m'})
    ripple = 0.1 * np.sin(200.0 * there_and_back)
    (found,) = find_orders([along(rng, there_and_back, ripple)], {'a': 'N m'})
    assert found.order == pytest.approx(200.0, abs=2.0 * np.pi / 2.0)
    # one way all along: nobody can tell a ripple from a hum
    one_way = 0.5 * time
    for added in (hum, 0.1 * np.sin(200.0 * one_way)):
        assert not find_orders([along(rng, one_way, added)], {'a': 'N m'})


def test_of_a_slider_periods_are_by_the_metre(rng):
    """A ball screw of 5 mm: 200 periods a metre."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    q = 0.2 * np.sin(0.5 * time) + 0.05 * np.sin(1.1 * time)
    record = along(rng, q, 0.1 * np.sin(2.0 * np.pi * 200.0 * q))
    (found,) = find_orders([record], {'a': 'N'})
    assert found.order / (2.0 * np.pi) == pytest.approx(200.0, rel=0.02)
    assert '200' in _order_line(found) or '199' in _order_line(found)
    assert 'periods a metre' in _order_line(found)
