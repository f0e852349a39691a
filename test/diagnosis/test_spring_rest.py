"""A spring that rests off the middle of the motion is one cause."""

from __future__ import annotations

import pytest
from support.diagnosis import cause_within_a_tenth

from spacerobot_ros.diagnosis.arms.spring_rest import with_rests
from validation.hidden.real_arm import arm_file

ROBOT = arm_file().robot


def test_a_spring_and_an_offset_are_a_spring_that_rests_elsewhere():
    """Both torques are 40 (q + 0.3) - 24; the offset's tenth of 0.6 rad, and the spring's."""
    spring = cause_within_a_tenth('joint_stiffness', 'joint_2', stiffness=40.0, rest_angle=-0.3)
    offset = cause_within_a_tenth('torque_sensor_bias', 'joint_2', bias=-24.0)
    (found,) = with_rests([offset, spring], ROBOT)
    assert dict(found.applied.values) == pytest.approx({'stiffness': 40.0, 'rest_angle': 0.3})
    assert found.parameters['rest_angle'].value == pytest.approx(0.3)
    assert found.parameters['rest_angle'].std == pytest.approx(0.06 * 2.0**0.5)


@pytest.mark.parametrize(
    ('where', 'bias'),
    [('joint_3', -24.0), ('joint_2', -4000.0)],  # another joint's; a rest a hundred turns off
)
def test_other_offsets_stand_for_themselves(where, bias):
    both = [
        cause_within_a_tenth('joint_stiffness', 'joint_2', stiffness=40.0, rest_angle=-0.3),
        cause_within_a_tenth('torque_sensor_bias', where, bias=bias),
    ]
    assert with_rests(both, ROBOT) == tuple(both)
