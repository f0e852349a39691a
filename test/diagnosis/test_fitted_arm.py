"""Coefficients of an arm's causes: least squares, bounds, and a gain's conversion."""

import tracemalloc

import numpy as np
import pytest

from spacerobot_ros.diagnosis.arms.fitted_arm import FittedArm
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.estimation.balance.arm_priors import DRY, friction_of
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.arm_rows_about import about_model
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.real_arm import JOINTS, RealArm, arm_file


def fit_of(hidden, kinds, chosen):
    """A fit to an arm whose file is right but for what is hidden; white noise of 0.1 N m."""
    file = arm_file()
    record = observed(RealArm(0, hidden, leftover=0.0).record(0, duration=12.0), file.robot)
    rows = ArmRows.of(
        [balance_of(record, file.robot, file.effects)], [CATALOGUE[kind] for kind in kinds]
    )
    numbers = [i for i, c in enumerate(rows.candidates) if c.key in chosen]
    white = [np.array([0.01, *[1e-12] * 5])] * len(JOINTS)
    return FittedArm.of(rows, white, numbers)


def test_columns_do_not_hold_all_samples_of_all_causes():
    """Whole, the samples of every column were held four times and more."""
    file = arm_file()
    record = observed(RealArm(0, [], leftover=0.0).record(0, duration=12.0), file.robot)
    balance = balance_of(record, file.robot, file.effects)
    rows = ArmRows.of([balance], CATALOGUE.values())
    steps = [step for c in rows.candidates for step in c.small_steps]
    balance.columns(steps[:1])
    tracemalloc.start()
    columns = balance.columns(steps)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < columns.nbytes / len(columns) * len(balance.arm.times)


def test_a_gain_is_that_of_the_motor():
    """Measured torques are those needed by g: the coefficient of the measured is 1 - 1 / g."""
    gain = CATALOGUE['joint_torque_constant'](name='g', where='joint_2', values={'gain': 1.25})
    fit = fit_of([gain], ('joint_torque_constant',), {('joint_torque_constant', 'joint_2')})
    (own,) = fit.rows.places[fit.chosen[0]]
    # friction counts too, and the smoothing of its sign at reversals
    assert fit.values[own] == pytest.approx(1.0 - 1.0 / 1.25, abs=2e-3)
    (named,) = fit.effects(fit.chosen)
    assert named['gain'] == pytest.approx(1.25, abs=4e-3)


def test_a_reading_that_is_off_is_off_beside_a_gain_as_much():
    """A bias is taken from what is measured, before the gain; it was multiplied by the gain."""
    effects = [
        CATALOGUE['joint_torque_constant'](name='g', where='joint_2', values={'gain': 1.25}),
        CATALOGUE['torque_sensor_bias'](name='b', where='joint_2', values={'bias': 4.0}),
    ]
    keys = {(e.id, e.where) for e in effects}
    fit = fit_of(effects, [kind for kind, _ in keys], keys)
    named = {e.id: e for e in fit.effects(fit.chosen)}
    # a bias of 4 N m is known as well as a gain of 66 N m rms is
    assert named['joint_torque_constant']['gain'] == pytest.approx(1.25, abs=4e-3)
    assert named['torque_sensor_bias']['bias'] == pytest.approx(4.0, abs=0.1)


def test_friction_of_the_load_is_of_a_motor_s_whole_torque():
    """Once its friction is found: a file that lacks it has half of the elbow's torque."""
    load = CATALOGUE['joint_load_friction'](
        name='load', where='joint_3', values={'coefficient': 0.1}
    )
    file = arm_file(has_friction=False)
    friction = arm_file().effects
    record = observed(RealArm(0, [load], leftover=0.0).record(0, duration=12.0), file.robot)
    bare, without, whole = (
        balance_of(record, file.robot, effects) for effects in ((), friction, (*friction, load))
    )
    rows = ArmRows.of([bare], [CATALOGUE['joint_load_friction']])
    moving = bare.arm.is_moving[:: bare.arm.stride, 2]
    applied = (without.torque - whole.torque)[moving, 2]
    numbers = [c.where for c in rows.candidates].index('joint_3')
    (at,) = rows.places[numbers]
    off = [
        np.std(0.1 * found.columns[0][moving, 2, at] - applied) / np.std(applied)
        for found in (rows, about_model(rows, {0: whole}, [numbers]))
    ]
    assert off[0] > 0.2
    assert off[1] < 0.02  # links and motion are the file's; rates are smoothed


def test_friction_keeps_its_sign():
    """A joint that runs easier than its file has no friction below zero added."""
    easier = CATALOGUE['joint_viscous_friction'](
        name='f', where='joint_3', values={'coefficient': -3.0}
    )
    fit = fit_of([easier], ('joint_viscous_friction',), {('joint_viscous_friction', 'joint_3')})
    (own,) = fit.rows.places[fit.chosen[0]]
    gram = fit.blocks.whole
    assert gram.vector[own] / gram.matrix[own, own] == pytest.approx(-3.0, abs=0.1)
    assert fit.values[own] == pytest.approx(0.0, abs=1e-2)


@pytest.mark.parametrize(
    ('kind', 'values'),
    [
        ('joint_coulomb_friction', {'torque': 4.0}),
        ('joint_stribeck_friction', {'coulomb': 4.0, 'static': 6.0, 'velocity': 0.01}),
        ('joint_presliding_friction', {'torque': 4.0, 'displacement': 0.01}),
        ('joint_asymmetric_friction', {'forward': 4.0, 'backward': 4.0}),
    ],
)
def test_every_friction_that_is_dry_counts_as_dry(kind, values):
    """By its torque at a constant rate, far from where it changes: the same at half of it."""
    robot = arm_file().robot
    effect = CATALOGUE[kind](name='dry', where='joint_3', values=values)
    rates = np.zeros((2, robot.n_joints))
    rates[:, 2] = [1.0, 0.5]
    motion = Motion(robot, np.arange(2.0), np.zeros_like(rates), rates, np.zeros_like(rates))
    torque = effect.force(motion, np.ones((2, effect.hidden)))[:, 6 + 2]
    found = friction_of([effect], DRY, 'joint_3')
    np.testing.assert_allclose(-torque, found, rtol=1e-6)  # the sign is smooth below 1e-3 rad/s
    assert friction_of([effect], DRY, 'joint_2') == 0.0
