"""A cause of many numbers gives way to several that need fewer and tell as much."""

from __future__ import annotations

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from validation.hidden.diagnosis_scenario import robot_file, simulated

HIDDEN = {
    'rotational_drag': (None, {'coefficient': 0.02}),
    'torque_sensor_bias': ('joint_1', {'bias': -0.02}),
    'joint_coulomb_friction': ('joint_2', {'torque': 0.02}),
}
OTHER = 'thruster_leak'


def test_two_small_causes_beside_a_third_are_no_leaking_thruster():
    """A force of three numbers, and three where it acts, follow drag and a bias together."""
    robot = robot_file('servicer').robot
    hidden = [
        bind_effect(f'hidden_{effect}', effect, where, values, robot)
        for effect, (where, values) in HIDDEN.items()
    ]
    record = simulated('servicer', 'default', 3, hidden, 10.0)
    said = diagnose(record, robot, catalogue=[CATALOGUE[id_] for id_ in (*HIDDEN, OTHER)])
    assert said.verdict == 'explained', said.sentence
    assert {c.applied.id for c in said.causes} == set(HIDDEN)
