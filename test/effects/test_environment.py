"""Forces from outside against MuJoCo, closed forms and the ledgers."""

from __future__ import annotations

import numpy as np
import pytest
from support.against_mujoco import (
    MUJOCO_WHEELS,
    WHEELS,
    assert_same,
    plant_with,
    run_mujoco,
    run_plant,
)
from support.models import robot_of, table_one

from spacerobot_ros.effects.catalogue import bind_effect, bind_effects
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.effects.surroundings.environment import FORCE
from spacerobot_ros.errors import ConfigurationError

SECONDS = 2.0
# MuJoCo's RK4 at 1 ms and ours of order 8 at 10 ms: both below 1e-10 here; sums of 2000 steps
SAME = 1e-9
LEAK = dict(zip(FORCE, (3.0, -2.0, 1.0), strict=True))
AT = {'at_x': 0.8, 'at_y': 0.3, 'at_z': -0.4}


@pytest.mark.parametrize(
    ('effect', 'values'),
    [
        ('external_torque_body', {'x': 30.0, 'y': -20.0, 'z': 10.0}),
        ('external_torque_inertial', {'x': 30.0, 'y': -20.0, 'z': 10.0}),
        ('thruster_leak', {**LEAK, **AT}),
        ('gravity_gradient', {'orbital_rate': 0.1, 'x': 1.0, 'y': -2.0, 'z': 0.5}),
    ],
)
def test_a_free_base_moves_as_in_mujoco(effect, values):
    parts = table_one()
    plant = plant_with(parts, {'it': {'effect': effect, **values}}, **WHEELS)
    other = run_mujoco(parts, effect, None, values, SECONDS, wheels=MUJOCO_WHEELS)
    here = run_plant(plant, SECONDS)
    assert_same(here, other, SAME)
    without = run_plant(plant_with(parts, {}, **WHEELS), SECONDS)
    assert np.max(np.abs(here.omega - without.omega)) > 1e3 * SAME  # the effect does something


def test_an_arm_on_the_ground_feels_another_gravity_as_in_mujoco():
    parts, error = table_one(), {'x': 0.4, 'y': -0.3, 'z': 0.2}
    ground = {'base': 'fixed', 'gravity': [0.0, 0.0, -9.81]}
    plant = plant_with(parts, {'tilt': {'effect': 'gravity_error', **error}}, **ground)
    other = run_mujoco(
        parts, 'gravity_error', None, error, 1.0, free=False, gravity=(0.0, 0.0, -9.81)
    )
    here = run_plant(plant, 1.0)
    np.testing.assert_allclose(here.q, other.q, rtol=0, atol=1e-8)  # faster: RK4 at 1 ms shows
    np.testing.assert_allclose(here.qd, other.qd, rtol=0, atol=1e-8)


ENVIRONMENT = {
    'external_torque_body': {'x': 3.0, 'y': -2.0, 'z': 1.0},
    'external_torque_inertial': {'x': 3.0, 'y': -2.0, 'z': 1.0},
    'thruster_leak': {**LEAK, **AT},
    'thruster_pulses': {**LEAK, **AT, 'period': 0.3, 'width': 0.1, 'start': 0.05},
    'gravity_gradient': {'orbital_rate': 0.1, 'x': 1.0, 'y': 1.0, 'z': 0.0},
    'magnetic_dipole': {'x': 1e4, 'y': 0.0, 'z': 2e4},
    'atmospheric_drag': {'area': 1e3, 'at_x': 1.0, 'density': 1e-9},
    'solar_pressure': {'area': 1e5, 'at_y': 1.0},
}


@pytest.mark.parametrize('effect', ENVIRONMENT)
def test_momentum_changes_by_exactly_the_impulse_and_energy_by_the_work(effect):
    plant = plant_with(table_one(), {'it': {'effect': effect, **ENVIRONMENT[effect]}}, **WHEELS)
    before = plant.ledger()
    run_plant(plant, 1.0)
    after = plant.ledger()
    # integrated beside the state by the same method; 12 stages of sums of 1e3 N m s
    tolerance = 1e-9 if effect != 'thruster_pulses' else 1e-6  # valve: kinks at its ends
    np.testing.assert_allclose(
        after.linear - before.linear, after.linear_impulse, rtol=0, atol=tolerance
    )
    np.testing.assert_allclose(
        after.angular - before.angular, after.angular_impulse, rtol=0, atol=tolerance
    )
    assert abs(after.energy_drift) < tolerance
    assert np.linalg.norm(after.angular_impulse) > 1e-3
    assert after.effect_work != 0.0


def test_a_torque_that_is_constant_in_space_gives_its_product_with_time():
    torque = np.array([3.0, -2.0, 1.0])
    entry = {'effect': 'external_torque_inertial', **dict(zip('xyz', torque, strict=True))}
    plant = plant_with(table_one(), {'it': entry}, **WHEELS)
    before = plant.ledger().angular
    run_plant(plant, 1.0)
    # no integration error: the impulse is linear in time
    np.testing.assert_allclose(plant.ledger().angular - before, torque, rtol=0, atol=1e-10)


def test_pulses_give_force_times_width_each():
    entry = {'effect': 'thruster_pulses', 'force_x': 20.0, 'force_y': 0.0, 'force_z': 0.0}
    timing = {'period': 0.25, 'width': 0.1, 'start': 0.05}
    still = {'servicer_wheels': {'momentum': [0.0, 0.0, 0.0]}}
    plant = plant_with(table_one(), {'it': {**entry, **timing}}, **still)
    for _ in range(100):  # four pulses; the arm is left alone, the base turns little
        plant.step(np.zeros(3))
    pushed = np.linalg.norm(plant.ledger().linear_impulse)
    assert pushed == pytest.approx(20.0 * 0.1 * 4, rel=5e-3)  # the force turns by 0.1 rad


def one(effect, robot, time=0.0, **values):
    """Generalized force of an effect at one state at rest."""
    applied = bind_effect('it', effect, None, values, robot)
    n = robot.n_joints
    still = np.zeros((1, n))
    motion = Motion(robot, np.array([time]), still, still, still)
    return applied.force(motion, np.zeros((1, 0)))[0]


def test_the_orbit_has_the_field_speed_and_pressure_of_low_orbit():
    robot = robot_of(table_one())
    rate = 1.131e-3  # 400 km: r = 6 778 km, v = 7.67 km/s
    dipole = one('magnetic_dipole', robot, x=1.0, y=0.0, z=0.0, orbital_rate=rate, inclination=0.0)
    # on the equator the field is k / r^3 = 2.5e-5 T to the north (z): x cross z = -y
    np.testing.assert_allclose(dipole[3:6], [0.0, -2.495e-5, 0.0], rtol=2e-3, atol=1e-12)
    drag = one(
        'atmospheric_drag',
        robot,
        area=10.0,
        density=3e-12,
        at_z=1.0,
        inclination=0.0,
        orbital_rate=rate,
    )
    force = 0.5 * 3e-12 * 10.0 * 7668.0**2
    np.testing.assert_allclose(drag[:3], [0.0, -force, 0.0], rtol=2e-3, atol=1e-15)
    np.testing.assert_allclose(drag[3:6], [force, 0.0, 0.0], rtol=2e-3, atol=1e-15)
    sun = one('solar_pressure', robot, area=20.0, at_y=2.0, x=0.0, y=0.0, z=5.0)
    np.testing.assert_allclose(sun[:6], [0, 0, -9.12e-5, -1.824e-4, 0, 0], rtol=1e-12, atol=0)


def test_an_orbit_comes_back_after_its_period():
    robot = robot_of(table_one())
    values = {'x': 1.0, 'y': 2.0, 'z': 3.0, 'orbital_rate': 1e-3, 'inclination': 1.0}
    first = one('magnetic_dipole', robot, **values)
    again = one('magnetic_dipole', robot, time=2e3 * np.pi, **values)
    opposite = one('magnetic_dipole', robot, time=1e3 * np.pi, **values)
    np.testing.assert_allclose(again, first, rtol=0, atol=1e-16)  # of 1e-4 N m
    np.testing.assert_allclose(opposite, first, rtol=0, atol=1e-16)  # twice an orbit


def test_a_vertical_and_its_opposite_pull_alike():
    robot = robot_of(table_one())
    down = one('gravity_gradient', robot, orbital_rate=1e-3, x=0.3, y=-0.5, z=2.0)
    up = one('gravity_gradient', robot, orbital_rate=1e-3, x=-0.3, y=0.5, z=-2.0)
    np.testing.assert_allclose(down, up, rtol=0, atol=1e-18)
    np.testing.assert_allclose(down[:3], 0.0, rtol=0, atol=1e-15)  # no force on the whole


@pytest.mark.parametrize(
    ('entry', 'message'),
    [
        (
            {'effect': 'external_torque_body', 'where': 'link_1', 'x': 1.0, 'y': 0.0, 'z': 0.0},
            "acts on the system as a whole: leave `where` out, got 'link_1'",
        ),
        (
            {'effect': 'gravity_gradient', 'orbital_rate': 1e-3, 'x': 0.0, 'y': 0.0, 'z': 0.0},
            'give the direction of the vertical',
        ),
        (
            {'effect': 'gravity_gradient', 'orbital_rate': -1.0, 'x': 1.0, 'y': 0.0, 'z': 0.0},
            r'-1 rad/s must be at least 0',
        ),
        (
            {'effect': 'thruster_pulses', **LEAK, 'period': 0.1, 'width': 0.098},
            r'effects\.it\.width: 0\.098 s and 0\.005 s to open and close',
        ),
        ({'effect': 'solar_pressure', 'area': 1.0, 'x': 0.0}, 'give the direction of the sun'),
        ({'effect': 'thruster_leek'}, r"no effect 'thruster_leek' \(did you mean thruster_leak"),
    ],
)
def test_bad_input_is_refused_with_its_place(entry, message):
    with pytest.raises(ConfigurationError, match=message):
        bind_effects({'it': entry}, robot_of(table_one()))


def test_a_fixed_base_has_no_external_torque():
    entry = {'effect': 'external_torque_body', 'x': 1.0, 'y': 0.0, 'z': 0.0}
    with pytest.raises(ConfigurationError, match='shows nothing on a fixed base'):
        bind_effects({'it': entry}, robot_of(table_one(), base='fixed'))
