"""Dry friction and an offset of one joint are one friction of two sizes, if they can be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.diagnosis import cause_within_a_tenth

from spacerobot_ros.diagnosis.arms.two_directions import direction_notes, with_directions
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE
from validation.hidden.real_arm import RealArm, arm_file

JOINT = 'joint_2'


FRICTION = cause_within_a_tenth('joint_coulomb_friction', JOINT, torque=4.25)


@pytest.mark.parametrize(
    ('kind', 'offset'),
    [
        ('motor', cause_within_a_tenth('torque_sensor_bias', JOINT, bias=-1.75)),
        ('command', cause_within_a_tenth('torque_sensor_bias', JOINT, bias=-1.75)),
        ('current', cause_within_a_tenth('current_offset', JOINT, offset=-0.35)),  # by 5 N m/A
    ],
)
def test_both_torques_have_one_name(kind, offset):
    constant = CATALOGUE['motor_constant'](name='k', where=JOINT, values={'constant': 5.0})
    robot = arm_file(effort_kind=kind).robot
    (found,) = with_directions([offset, FRICTION], robot, [constant] * (kind == 'current'))
    assert found.applied.id == 'joint_asymmetric_friction'
    assert dict(found.applied.values) == pytest.approx({'forward': 2.5, 'backward': 6.0})
    assert found.parameters['forward'].std == pytest.approx(np.hypot(0.425, 0.175))
    (note,) = direction_notes([found], robot)
    assert 'friction of 2.5 and 6 N m' in note
    assert 'an offset of the efforts of -1.75 N m' in note


@pytest.mark.parametrize(('kind', 'bias'), [('link', -1.75), ('motor', 2.5)])
def test_zeros_of_torque_sensors_and_large_ones_stay(kind, bias):
    both = (FRICTION, cause_within_a_tenth('torque_sensor_bias', JOINT, bias=bias))
    assert with_directions(both, arm_file(effort_kind=kind).robot, ()) == both


def test_friction_of_two_sizes_in_data():
    """13.5 and 11.9 N m more than the file's friction, which is known within 5 %."""
    record, robot = RealArm(4, leftover=0.3).record(0), arm_file(has_friction=False).robot
    j = robot.joints.index('joint_4')
    rate = np.gradient(record.q[:, j], record.joint_time)
    effort = record.effort.copy()
    effort[:, j] += np.where(rate > 0.0, 10.5, -8.9)
    record = replace(record, joints=replace(record.joints, effort=effort))
    found = diagnose(record, robot)
    (cause,) = (c for c in found.causes if c.applied.id == 'joint_asymmetric_friction')
    assert cause.applied.where == 'joint_4'
    for name, true in (('forward', 13.5), ('backward', 11.9)):
        value = cause.parameters[name]
        assert abs(value.value - true) < 3.0 * value.std < 0.3 * true
    (law,) = (law for law in found.friction if law.joint == 'joint_4')
    assert law.coulomb_forward - law.coulomb_backward == pytest.approx(1.6, abs=0.5)
