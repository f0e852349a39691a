"""Causes of very different size, and causes that look like steps of the momentum."""

from __future__ import annotations

import pytest

from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from validation.hidden.diagnosis_scenario import robot_file, simulated

WHEELS, DRY = 'servicer_wheel_drag', 'joint_coulomb_friction'
TOGETHER = {WHEELS: (None, {'time_constant': 2000.0}), DRY: ('joint_1', {'torque': 0.55})}


def test_wheels_that_run_down_beside_dry_friction_are_both_named():
    robot = robot_file('servicer').robot
    hidden = [
        bind_effect(f'hidden_{effect}', effect, where, values, robot)
        for effect, (where, values) in TOGETHER.items()
    ]
    record = simulated('servicer', 'default', 3, hidden)
    said = diagnose(record, robot)
    assert said.verdict == 'explained', said.sentence
    found = {c.applied.id: c for c in said.causes}
    assert {id_: c.applied.where for id_, c in found.items()} == {
        id_: where for id_, (where, _) in TOGETHER.items()
    }
    for id_, (_, values) in TOGETHER.items():
        for name, truth in values.items():
            estimated = found[id_].parameters[name]
            assert abs(estimated.value - truth) <= 4.0 * estimated.std  # two numbers, one draw


@pytest.mark.parametrize(
    ('effect', 'where', 'delay'),
    [('joint_delay', None, 3.946e-4), ('joint_sensor_delay', 'joint_2', 5e-4)],
)
def test_late_clocks_are_no_steps_of_the_momentum(effect, where, delay):
    """The clock of all joints, or of one; its misses are steep where the motion turns."""
    robot = robot_file('minisat').robot
    hidden = bind_effect('hidden', effect, where, {'delay': delay}, robot)
    kinds = [CATALOGUE[e] for e in ('joint_delay', 'joint_sensor_delay', 'gyro_bias')]
    said = diagnose(simulated('minisat', 'slow', 902, [hidden]), robot, catalogue=kinds)
    assert not said.events.named
    (cause,) = (*said.causes, *said.minor)
    assert (cause.applied.id, cause.applied.where) == (effect, where)
    found = cause.parameters['delay']
    assert abs(found.value - delay) <= 4.0 * found.std
