"""An `effects:` section through file, simulation and identification."""

from __future__ import annotations

from inspect import cleandoc
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.models import robot_of, table_one

from spacerobot_ros.dynamics.equations import Dynamics
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effects
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.model.schema import meanings
from spacerobot_ros.model.settings import parse_settings
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from spacerobot_ros.simulation.forced import ForcedMotion

SERVICER = Path(__file__).parents[2] / 'config' / 'servicer.yaml'
EFFECTS = {
    'elbow': {'effect': 'joint_viscous_friction', 'where': 'joint_2', 'coefficient': 30.0},
    'wheels': {'effect': 'target_wheel_momentum', 'where': 'link_3', 'x': 1.0, 'y': 2.0, 'z': 3},
    'tracker': {'effect': 'attitude_delay', 'delay': 0.02},
    'leak': {'effect': 'external_torque_body', 'x': 0.5, 'y': 0.0, 'z': 0.0},
    'gyro': {'effect': 'gyro_bias', 'x': 1e-3, 'y': 0.0, 'z': 0.0},
}


def robot_file(folder, effects):
    content = yaml.safe_load(SERVICER.read_text())
    parameters = content['/**']['ros__parameters']
    parameters['effects'] = effects
    parameters['simulator']['noise'] = False
    parameters['simulator']['attitude_rate'] = 100.0
    path = folder / 'extended.yaml'
    path.write_text(yaml.safe_dump(content))
    return load_robot_file(path)


def test_a_file_with_effects_is_a_robot_with_effects(tmp_path):
    file = robot_file(tmp_path, EFFECTS)
    assert [effect.name for effect in file.effects] == sorted(EFFECTS)
    assert file.effects[0].where == 'joint_2'
    np.testing.assert_array_equal(file.robot.target_momentum, [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(file.believed.target_momentum, [1.0, 2.0, 3.0])
    back = file.before_effects(file.believed)
    np.testing.assert_array_equal(back.target_momentum, [0.0, 0.0, 0.0])


def test_the_simulation_runs_all_of_them_and_keeps_its_books(tmp_path):
    file = robot_file(tmp_path, EFFECTS)
    loop = ClosedLoop(file.robot, file.settings)
    steps = list(loop.run(60))
    ledger = loop.plant.ledger()
    assert ledger.momentum_drift < 1e-11
    assert abs(ledger.energy_drift) < 1e-9
    assert ledger.effect_work != 0.0
    assert np.linalg.norm(ledger.angular_impulse) == pytest.approx(0.5 * 0.6, rel=1e-2)
    late = steps[50]
    np.testing.assert_allclose(
        late.measured.omega - late.state.omega_WB_B, [1e-3, 0, 0], atol=1e-15
    )
    before = steps[48].state.q_WB_xyzw
    np.testing.assert_allclose(late.measured.attitude_xyzw, before, rtol=0, atol=1e-15)


def test_without_effects_the_run_is_the_same_to_the_last_bit(tmp_path):
    plain, empty = load_robot_file(SERVICER), robot_file(tmp_path, {})
    assert empty.effects == ()
    assert empty.believed is empty.robot
    runs = []
    for file in (plain, empty):
        loop = ClosedLoop(file.robot, empty.settings)
        runs.append([step.state.to_vector() for step in loop.run(20)])
    np.testing.assert_array_equal(*runs)


@pytest.mark.parametrize(
    ('section', 'message'),
    [
        ([1, 2], 'effects: expected a map of named entries'),
        ({'a': 3}, r'effects\.a: expected a map'),
        ({'a.b': {'effect': 'imu_delay', 'delay': 0.0}}, 'no name: give text without a dot'),
        ({'a': {'effect': 'imu_delay', 'delay': None}}, r'effects\.a\.delay: expected a number'),
        ({'a': {'effect': 'imu_delay', 'delay': True}}, r'effects\.a\.delay: expected a number'),
    ],
)
def test_a_malformed_section_is_refused(section, message):
    with pytest.raises(ConfigurationError, match=message):
        parse_settings({'robot': {'joints': ['a']}, 'effects': section})


@pytest.mark.parametrize(
    ('entry', 'message'),
    [
        ({'delay': 0.1}, r'effects\.a: expected \{effect'),
        ({'effect': 'imu_delay', 'delay': 'soon'}, "expected a number, got 'soon'"),
        (
            {'effect': 'joint_viscous_friction', 'where': 'joint_2', 'coefficient': -1.0},
            r'-1 N m s/rad must be at least 0',
        ),
        (
            {'effect': 'joint_viscous_friction', 'where': 'joint_4', 'coefficient': 1.0},
            "no place 'joint_4'",
        ),
    ],
)
def test_nonsense_is_refused_when_the_file_is_loaded(tmp_path, entry, message):
    with pytest.raises(ConfigurationError, match=message):
        robot_file(tmp_path, {'a': entry})


@pytest.mark.parametrize('effect', CATALOGUE.values(), ids=lambda effect: effect.id)
def test_every_entry_says_what_a_reader_needs(effect):
    said = ''.join(cleandoc(base.__doc__ or '') for base in effect.__mro__)
    for what in ('Typical: ', 'Signature: ', 'Source: '):
        assert f'\n{what}' in said
    groups = 'joint sensor wheels bodies environment learned own inputs events'
    assert effect.group in groups.split()
    for parameter in effect.parameters:
        assert meanings(effect)[parameter.name].endswith('.')
        assert parameter.role in ('linear', 'phase', 'reciprocal', 'square', 'search')
        if parameter.role in ('linear', 'reciprocal', 'square'):
            assert 0.0 <= parameter.relevant < parameter.size < np.inf
        if parameter.role == 'search':
            assert parameter.guesses or effect.acts('variants')


def test_a_fast_effect_makes_the_steps_shorter():
    fast = {
        'effect': 'wheel_imbalance',
        'where': 'base_link',
        'amplitude': 1.0,
        'frequency': 450.0,
    }
    robot = robot_of(table_one())
    motion = ForcedMotion(Dynamics(robot), bind_effects({'it': fast}, robot), 0.01, 1)
    assert motion.substeps == 5  # one radian a step
