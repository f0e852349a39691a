"""Coefficients of an arm's causes: least squares, bounds, and a gain's conversion."""

import tracemalloc

import numpy as np
import pytest

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.estimation.balance.arm_fit import ArmFit, Posterior
from spacerobot_ros.estimation.balance.arm_priors import DRY, friction_of
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.arm_rows_about import about_loads
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.inference.evidence import Gram, sum_of
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
    return ArmFit(rows, sum_of(rows.parts(white)), tuple(numbers))


def test_without_tolerances_it_is_least_squares(rng):
    """Wide priors of some columns, the others held at nothing: the normal equations."""
    columns, data = rng.standard_normal((200, 6)), rng.standard_normal(200)
    deviations = np.where(np.arange(6) < 4, 1e4, 1e-8)
    found = Posterior.of(Gram.of(columns, data), deviations)
    exact, *_ = np.linalg.lstsq(columns[:, :4], data)
    # priors of 1e4 pull by 1e-8 / 200 of the values
    np.testing.assert_allclose(found.mean[:4], exact, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.mean[4:], 0.0, rtol=0, atol=1e-10)
    inverse = np.linalg.inv(columns[:, :4].T @ columns[:, :4])
    np.testing.assert_allclose(found.covariance[:4, :4], inverse, rtol=1e-8, atol=1e-12)


def test_a_group_alone_is_the_schur_complement(rng):
    columns, data = rng.standard_normal((50, 4)), rng.standard_normal(50)
    gram, deviations = Gram.of(columns, data), np.array([1.0, 2.0, 0.5, 3.0])
    own = np.array([1, 3])
    alone = Posterior.of(gram, deviations).group(own)
    rest = np.array([0, 2])
    held = gram.matrix[np.ix_(rest, rest)] + np.diag(deviations[rest] ** -2.0)
    across = gram.matrix[np.ix_(rest, own)]
    matrix = gram.matrix[np.ix_(own, own)] - across.T @ np.linalg.solve(held, across)
    vector = gram.vector[own] - across.T @ np.linalg.solve(held, gram.vector[rest])
    np.testing.assert_allclose(alone.matrix, matrix, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(alone.vector, vector, rtol=1e-9, atol=1e-9)


def test_other_priors_are_as_if_they_had_been_there(rng):
    """Woodbury's identity against the whole inverse, with what is not there and what is."""
    gram, deviations = (
        Gram.of(rng.standard_normal((50, 6)), rng.standard_normal(50)),
        np.array([1.0, 2.0, 0.5, 3.0, 1.0, 0.1]),
    )
    own, others = np.array([1, 4]), deviations.copy()
    others[own] = [1e-4, 5.0]
    changed = Posterior.of(gram, deviations).under(own, others[own])
    exact = Posterior.of(gram, others)
    np.testing.assert_allclose(changed.covariance, exact.covariance, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(changed.mean, exact.mean, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(changed.precision, exact.precision, rtol=1e-12)


def test_a_group_alone_does_not_know_its_own_prior(rng):
    """What a selection rests on, which asks one posterior about every cause, chosen or not."""
    gram, deviations = Gram.of(rng.standard_normal((50, 5)), rng.standard_normal(50)), np.ones(5)
    own = np.array([0, 3])
    alone = Posterior.of(gram, deviations).group(own)
    tight = Posterior.of(gram, np.where(np.isin(range(5), own), 1e-3, 1.0)).group(own)
    np.testing.assert_allclose(tight.matrix, alone.matrix, rtol=1e-6)
    np.testing.assert_allclose(tight.vector, alone.vector, rtol=1e-6)


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
        for found in (rows, about_loads(rows, [whole], [numbers]))
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
    assert fit.posterior.mean[own] == pytest.approx(-3.0, abs=0.1)
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
