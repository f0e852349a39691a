"""Motors said in amperes, and joints without one: closed forms, and the plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.effects import motion_of
from support.models import robot_of, table_one

from spacerobot_ros.dynamics.state import State
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.robot_settings import SensorSettings
from spacerobot_ros.model.settings import SimulatorSettings
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from spacerobot_ros.sensing.sensor_faults import SensorFaults, corrected_record
from spacerobot_ros.sensing.sensors import SensorSuite
from spacerobot_ros.simulation.plant import Plant

KINDS = ['motor', 'current', 'current']
STATED = robot_of(table_one(), base='fixed', effort_kind=KINDS, motor_constant=[1.0, 8.0, 16.0])
UNKNOWN = robot_of(table_one(), base='fixed', effort_kind=KINDS)
PASSIVE = robot_of(table_one(), base='fixed', passive_joints=['j_link_2'])


@pytest.mark.parametrize(('robot', 'stated'), [(STATED, 8.0), (UNKNOWN, 1.0)])
def test_a_motor_gives_its_own_constant_times_the_current(robot, stated, rng):
    motion = motion_of(robot, rng, 5)
    effect = bind_effect('k', 'motor_constant', 'j_link_2', {'constant': 10.0}, robot)
    force = effect.force(motion, np.zeros((5, 0)))[:, 6:]
    current = motion.effort[:, 1] / stated
    np.testing.assert_allclose(motion.effort[:, 1] + force[:, 1], 10.0 * current, rtol=1e-14)
    np.testing.assert_array_equal(force[:, [0, 2]], 0.0)


def test_the_zero_of_a_current_is_a_torque_by_the_constant(rng):
    motion = motion_of(STATED, rng, 5)
    effect = bind_effect('z', 'current_offset', 'j_link_3', {'offset': 0.05}, STATED)
    said = effect.sense('joint_effort', motion.effort, motion)
    np.testing.assert_allclose(said - motion.effort, np.tile([0.0, 0.0, 0.8], (5, 1)), atol=1e-13)
    assert CATALOGUE['torque_sensor_bias'].fitted_places(STATED) == ('j_link_1',)
    assert CATALOGUE['current_offset'].fitted_places(STATED) == ('j_link_2', 'j_link_3')


@pytest.mark.parametrize(
    ('kind', 'where', 'values', 'robot'),
    [
        ('motor_constant', 'j_link_1', {'constant': 2.0}, STATED),
        ('current_offset', 'j_link_1', {'offset': 0.1}, STATED),
        ('joint_torque_constant', 'j_link_2', {'gain': 1.1}, PASSIVE),
        ('torque_sensor_bias', 'j_link_2', {'bias': 1.0}, PASSIVE),
        ('motor_inertia', 'j_link_2', {'inertia': 1.0}, PASSIVE),
    ],
)
def test_where_there_is_no_such_motor(kind, where, values, robot):
    with pytest.raises(ConfigurationError, match=f'{kind} has no place {where!r}'):
        bind_effect('x', kind, where, values, robot)


def test_a_plant_gives_no_torque_where_there_is_no_motor():
    """Commanded or not, and the joint is pushed by the others alone."""
    still = rest()
    pushed, free = (Plant(PASSIVE, still, 0.01, 1) for _ in range(2))
    for _ in range(20):
        pushed.step(np.array([3.0, 5.0, -2.0]))
        free.step(np.array([3.0, 0.0, -2.0]))
    np.testing.assert_array_equal(pushed.effort, [3.0, 0.0, -2.0])
    np.testing.assert_array_equal(pushed.state.q, free.state.q)


def rest():
    zero = np.zeros(3)
    return State(zero, np.array([0.0, 0.0, 0.0, 1.0]), zero, zero, zero, zero)


def test_one_joint_is_late_with_all_that_it_says():
    """Of 15 ms at samples of 10 ms; undone to the spline's error of h^4 / 384 of q''''."""
    effect = bind_effect('d', 'joint_sensor_delay', 'j_link_2', {'delay': 0.015}, PASSIVE)
    plain = replace(PASSIVE, passive_joints=())
    plant = Plant(plain, rest(), 0.01, 1)
    settings = SimulatorSettings(noise=False)
    suites = [
        SensorSuite(SensorSettings(), settings, 3, 0, SensorFaults(plain, effects))
        for effects in ((), (effect,))
    ]
    seen = [[], []]
    for k in range(120):
        for suite, said in zip(suites, seen, strict=True):
            joints = suite.sample(k, plant.state, plant.effort, plant.hidden).joints
            said.append([joints.position, joints.velocity, joints.effort])
        plant.step(20.0 * np.sin(0.05 * k + np.arange(3)))
    truth, late = np.array(seen)
    np.testing.assert_array_equal(late[..., [0, 2]], truth[..., [0, 2]])
    # between the last two samples but one, the rates' cubic is good to 1e-6 of a slow motion
    middle = 0.5 * (truth[:-2, 0, 1] + truth[1:-1, 0, 1])
    np.testing.assert_allclose(late[2:, 0, 1], middle, rtol=0, atol=1e-4)
    times = to_stamps(0.01 * np.arange(120))
    record = Record(joints=JointSeries(plain.joints, times, *np.moveaxis(late, 1, 0)))
    undone = corrected_record(record, plain, [effect])
    inner = slice(5, -5)
    np.testing.assert_allclose(undone.q[inner], truth[inner, 0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(undone.qd[inner], truth[inner, 1], rtol=0, atol=1e-4)
