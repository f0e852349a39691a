"""Lines of gyros and efforts against the angles of wheels, whose rates alone are measured.

Records are made of closed forms: no effect of the package is in them.
"""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from spacerobot_ros.diagnosis import diagnose
from spacerobot_ros.diagnosis.answer.output import to_dict
from spacerobot_ros.diagnosis.answer.result import Diagnosis
from spacerobot_ros.diagnosis.orders.orders import find_orders
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record, to_stamps
from spacerobot_ros.report.leftover_tables import _order_line

SECONDS, GYRO, TACHO = 60.0, 100.0, 40.0
STD = 1e-4  # rad/s
MEAN = np.array([120.0, -90.0, 160.0])  # rad/s
SWING, SLOW = np.array([40.0, 30.0, 25.0]), np.array([0.5, 0.31, 0.23])  # rad/s


def rates(t):
    """(N, 3) of the wheels."""
    return MEAN + SWING * np.sin(SLOW * t[:, None])


def angles(t):
    """(N, 3) their integrals from zero."""
    return MEAN * t[:, None] + SWING / SLOW * (1.0 - np.cos(SLOW * t[:, None]))


def gyro_times():
    return 0.37 + np.arange(round(SECONDS * GYRO)) / GYRO


def record(rng, hum=None, *, tacho=0.05, read=rates):
    """A gyro on a base that sways, with a hum (N,) about y and less of it about z."""
    t, slow = gyro_times(), np.arange(round(SECONDS * TACHO)) / TACHO
    omega = 0.03 * np.sin(0.4 * t[:, None] + np.arange(3)) + STD * rng.standard_normal((len(t), 3))
    if hum is not None:
        omega += hum[:, None] * [0.0, 1.0, 0.3]
    measured = read(slow)
    measured = measured + tacho * rng.standard_normal(measured.shape)
    wheels = JointSeries(('u', 'v', 'w'), to_stamps(slow), np.zeros_like(measured), measured)
    return Record(rates=RateSeries(to_stamps(t), omega), wheels=wheels)


@pytest.mark.parametrize(('order', 'wheel'), [(1.0, 0), (2.4, 1), (0.41, 2)])
def test_a_hum_of_a_wheel_is_found_with_its_order(order, wheel, rng):
    size = 0.4 * STD
    hum = size * np.sin(order * angles(gyro_times())[:, wheel] + 0.7)
    (found,) = find_orders([record(rng, hum)], {})
    assert (found.joint, found.unit, found.channel) == ('uvw'[wheel], 'rad/s', 'gyro/y')
    assert found.order == pytest.approx(order, rel=1e-3)
    assert found.amplitude == pytest.approx(size, rel=0.25)  # of 6000 samples: 5 % is one std
    assert abs((found.phase - 0.7 + np.pi) % (2.0 * np.pi) - np.pi) < 0.4
    assert found.p_value < 1e-7


def test_noise_and_what_follows_a_clock_have_no_order(rng):
    assert not find_orders([record(rng)], {})
    assert not find_orders([record(rng, STD * np.sin(2.0 * np.pi * 17.0 * gyro_times()))], {})


def test_of_wheels_that_turn_alike_nobody_can_tell_which_hums(rng):
    hum = STD * np.sin(angles(gyro_times())[:, 0])
    (found,) = find_orders([record(rng, hum)], {})
    assert found.joint == 'u'

    def alike(t):
        return rates(t)[:, [0, 0, 2]]

    assert not find_orders([record(rng, hum, read=alike)], {})


def test_an_effort_hums_with_a_wheel(rng):
    t = gyro_times()
    effort = 2.0 * np.sin(0.3 * t) + 0.1 * rng.standard_normal(len(t))
    effort += 0.05 * np.sin(3.0 * angles(t)[:, 1])
    joints = JointSeries(('j',), to_stamps(t), np.sin(0.3 * t)[:, None], None, effort[:, None])
    (found,) = find_orders([replace(record(rng), joints=joints)], {'j': 'N m'})
    assert (found.joint, found.channel, found.unit) == ('v', 'joint_torque/j', 'N m')
    assert found.order == pytest.approx(3.0, rel=1e-3)


@pytest.mark.parametrize(
    ('fit_p', 'turning'), [(0.0, ['j', 'u']), (None, ['j', 'u']), (0.5, ['u'])]
)
def test_of_a_flight_that_fits_lines_of_wheels_alone_are_asked(fit_p, turning, rng, monkeypatch):
    """Ripple of a joint that the model explains is no candidate; what is left is of no law."""
    t = gyro_times()
    q = 0.9 * np.sin(0.5 * t)
    effort = 0.1 * rng.standard_normal(len(t)) + 0.05 * np.sin(200.0 * q)
    joints = JointSeries(('j',), to_stamps(t), q[:, None], None, effort[:, None])
    flown = replace(record(rng, STD * np.sin(angles(t)[:, 0])), joints=joints)
    robot = SimpleNamespace(arm=('j',), unit_of=lambda unit, joint: unit)
    found = SimpleNamespace(
        fit=SimpleNamespace(run=SimpleNamespace(record=flown, robot=robot, timing='held_before'))
    )
    answer = Diagnosis(verdict='consistent', sentence='', fit_p=fit_p)
    monkeypatch.setattr(diagnose, 'conclude', lambda found, notes: answer)
    said = diagnose._concluded(found, (), lambda what, share: None)
    assert [order.joint for order in said.orders] == turning
    assert said.leftover is None


def test_orders_of_wheels_are_said_in_the_report_and_the_json(rng):
    hum = STD * np.sin(angles(gyro_times())[:, 0])
    orders = find_orders([record(rng, hum)], {})
    (line,) = [_order_line(order) for order in orders]
    assert line.startswith('u: gyro/y has a line of ')
    assert '1.000 periods a turn' in line
    assert 'wheel_imbalance' in line
    answer = Diagnosis(verdict='consistent', sentence='', orders=orders)
    (entry,) = json.loads(json.dumps(to_dict(answer)))['orders']
    assert list(entry) == ['joint', 'unit', 'order', 'amplitude', 'phase', 'p_value']
    assert (entry['joint'], entry['unit']) == ('u', 'rad/s')
    other = replace(orders[0], order=2.4)
    assert 'no effect of the catalogue' in _order_line(other)
