"""A ripple of which a record shows a part of a round is no bias and no spring, nor are they it."""

from __future__ import annotations

import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from validation.hidden.diagnosis_scenario import robot_file, simulated

WHERE = 'joint_2'
HIDDEN = {
    'joint_torque_ripple': {'amplitude': 0.5, 'harmonic': 3.0, 'phase': 0.3},
    'joint_stiffness': {'stiffness': 1.0, 'rest_angle': 0.3},
}


@pytest.mark.parametrize('effect', HIDDEN)
def test_a_ripple_of_a_part_of_a_round_is_told_from_a_spring(effect):
    robot = robot_file('servicer').robot
    hidden = bind_effect('hidden', effect, WHERE, HIDDEN[effect], robot)
    record = simulated('servicer', 'fast', 3, [hidden], 8.0)
    kinds = [CATALOGUE[id_] for id_ in (*HIDDEN, 'torque_sensor_bias', 'motor_inertia')]
    said = diagnose(record, robot, catalogue=kinds)
    assert said.verdict == 'explained', said.sentence
    (cause,) = said.causes
    assert (cause.applied.id, cause.applied.where) == (effect, WHERE)
    for name, found in cause.parameters.items():
        assert abs(found.value - HIDDEN[effect][name]) < 4.0 * found.std
