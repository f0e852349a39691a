"""What acts for a while: impulses and work by the ledger, J^T w by virtual work, bad values."""

from __future__ import annotations

import numpy as np
import pytest
from support.against_mujoco import plant_with, run_plant
from support.models import robot_of, table_one

from spacerobot_ros.control.computed_torque import FeedForward
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.effects.surroundings.external import pulse_shape
from spacerobot_ros.errors import ConfigurationError

SPAN = {'start': 0.1, 'end': 0.5}


def test_an_angular_impulse_is_its_integral_in_space():
    entry = {'effect': 'angular_impulse', **SPAN, 'x': 0.3, 'y': -0.2, 'z': 0.1}
    plant = plant_with(table_one(), {'bump': entry})
    run_plant(plant, 1.0)
    # kinks of the second derivative at the ends of the bell
    np.testing.assert_allclose(plant.ledger().angular_impulse, [0.3, -0.2, 0.1], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ('effect', 'where', 'sizes'),
    [
        ('external_wrench', 'link_2', {'force_x': 5.0, 'torque_z': 2.0}),
        ('external_joint_torque', 'j_link_2', {'torque': 3.0}),
    ],
)
def test_momentum_and_energy_follow_the_ledger(effect, where, sizes):
    plant = plant_with(table_one(), {'it': {'effect': effect, 'where': where, **SPAN, **sizes}})
    before = plant.ledger()
    run_plant(plant, 1.0)
    after = plant.ledger()
    np.testing.assert_allclose(
        after.angular - before.angular, after.angular_impulse, rtol=0, atol=1e-6
    )
    assert abs(after.energy_drift) < 1e-6
    assert after.effect_work != 0.0
    is_external = np.linalg.norm(after.linear_impulse) > 1e-3
    assert is_external == (effect == 'external_wrench')  # a drive takes hold of both its sides


def test_shape_rises_stays_and_falls():
    phase = np.array([-0.1, 0.0, 0.1, 0.2, 0.5, 0.9, 1.0, 1.1])
    np.testing.assert_allclose(
        pulse_shape(phase, 0.2), [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0], rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(pulse_shape(phase, 0.5)[2:6], np.sin(np.pi * phase[2:6]) ** 2)


def test_no_controller_expects_an_event(rng):
    robot = robot_of(table_one())
    where = {'external_joint_torque': 'j_link_1', 'external_wrench': 'link_1'}
    size = {'external_joint_torque': 'torque', 'external_wrench': 'force_x'}
    kinds = [kind for kind in CATALOGUE.values() if kind.group == 'events']
    assert len(kinds) == 3
    for kind in kinds:
        values = {**SPAN, size.get(kind.id, 'x'): 2.0}
        effect = bind_effect('it', kind.id, where.get(kind.id), values, robot)
        at = Motion(robot, np.array([0.3]), *np.zeros((3, 1, 3)))
        assert np.any(effect.force(at, np.zeros((1, 0))))
        assert not FeedForward(robot, [effect])._effects


@pytest.mark.parametrize(
    ('values', 'message'),
    [
        ({'start': 1.0, 'end': 1.0}, 'is not after the start'),
        ({'start': -1.0, 'end': 1.0}, 'start'),
        ({'start': 0.0, 'end': 1.0, 'edge': 0.0}, 'edge'),
        ({'start': 0.0, 'end': 1.0, 'edge': 0.7}, 'edge'),
        ({'start': 0.0}, 'end: is missing'),
    ],
)
def test_nonsense_is_refused(values, message):
    with pytest.raises(ConfigurationError, match=message):
        bind_effect(
            'it',
            'external_joint_torque',
            'j_link_1',
            {'torque': 1.0, **values},
            robot_of(table_one()),
        )
