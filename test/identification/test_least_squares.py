"""The published method: exact without noise, biased with it, and refused where it can not be."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.identification import (
    NOISE,
    changed,
    errors_of,
    measure,
    servicer,
    simulate,
    truth_of,
)

from spacerobot_ros.errors import IdentificationError
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.identification.least_squares import (
    momentum_columns,
    sampled_motion,
    solve_least_squares,
)
from spacerobot_ros.identification.summary import Source
from spacerobot_ros.model.settings import IdentifierSettings

SETTINGS = IdentifierSettings(structure='symmetric')


def solve(axes, record, structure='symmetric'):
    settings = IdentifierSettings(structure=structure)
    return solve_least_squares(record, servicer(axes), settings, NOISE, Source(0, 0))


def columns_of(axes, motion):
    """(N, 3, p) columns of [h_W; AAM; x]."""
    robot = servicer(axes)
    return momentum_columns(robot, minimal_set(robot, 'symmetric'), motion)


def exact(axes, every=1):
    """Noise-free samples, the tracker at the joints' stamps."""
    return measure(simulate(axes, 20.0), 0, scale=0.0, attitude_every=every)


@pytest.mark.parametrize('structure', ['symmetric', 'generic'])
@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_exact_without_noise(axes, structure):
    truth = truth_of(simulate(axes, 20.0), structure)
    error, _ = errors_of(solve(axes, exact(axes), structure), truth)
    # momentum-integrated data: rounding times a condition number of 1e3 to 1e4
    np.testing.assert_allclose(error, 0.0, rtol=0, atol=1e-9 * np.max(np.abs(truth)))


def test_equals_plain_least_squares():
    record = measure(simulate('zyx', 20.0), 1, attitude_every=1)
    motion, h0 = sampled_motion(record), servicer('zyx').servicer_wheels.body_momentum
    columns = (motion.matrices @ columns_of('zyx', motion)).reshape(-1, 25)
    values = (motion.matrices @ h0).ravel()
    want, squares, _, _ = np.linalg.lstsq(columns, values, rcond=None)
    estimate = solve('zyx', record)
    np.testing.assert_allclose(errors_of(estimate, want)[0] / want, 0.0, rtol=0, atol=1e-9)
    variance = squares[0] / (len(values) - 25)
    np.testing.assert_allclose(
        estimate.covariance,
        variance * np.linalg.inv(columns.T @ columns)[3:, 3:],
        rtol=1e-6,
        atol=1e-12,
    )
    assert estimate.rank == estimate.unknowns == 22
    assert (estimate.unexcited, set(estimate.sources)) == ((), {'data'})
    assert np.isnan(estimate.prior_factor)


@pytest.mark.parametrize('motion', ['still', 'last_joint_only'])
def test_directions_that_are_not_excited_are_named(motion):
    record = measure(simulate('zyx', 20.0, motion), 1, attitude_every=1)
    estimate = solve('zyx', record)
    assert not estimate.valid
    assert 'directions are not excited yet' in estimate.reason
    assert 0 < len(estimate.unexcited) == 22 - estimate.rank
    assert estimate.chi2_per_dof == pytest.approx(1.0, abs=0.25)
    names = {*estimate.parameter_names, *(f'h_link_3_{a}' for a in 'xyz')}
    assert {word for text in estimate.unexcited for word in text.split()[1::2]} <= names


def test_condition_is_that_of_the_reference_study():
    # 1000 samples at 20 ms, raw columns of [AAM; x] with the momentum of the first sample known.
    for axes, want in (('zyx', 801.0), ('xyy', 928.0)):
        reference = sampled_motion(exact(axes)).part(slice(0, 2000, 2))
        rows = (reference.matrices @ columns_of(axes, reference))[:, :, 3:]
        assert np.linalg.cond((rows - rows[0]).reshape(-1, 22)) == pytest.approx(want, rel=0.01)


def test_noise_biases_the_estimate_and_maximum_likelihood_is_free_of_it():
    # Five times nominal noise, dominated by the joint rates; every estimate is pulled to zero.
    run = simulate('xyy', 20.0)
    truth, robot = truth_of(run), servicer('xyy')
    scale = 5.0
    errors = {'ls': [], 'ml': []}
    for seed in range(8):
        record = measure(run, seed, scale, attitude_every=1)
        for method, found in errors.items():
            found.append(
                errors_of(identify(record, robot, SETTINGS, method).estimate, truth)[0][3:]
            )
    for method, found in errors.items():
        bias = np.abs(np.mean(found, axis=0))
        rmse = np.sqrt(np.mean(np.square(found), axis=0))
        share = np.median(bias / rmse)
        if method == 'ls':
            assert share > 0.9
            ls_rmse = rmse
        else:
            # eight runs without bias: 1 / sqrt(8) = 0.35, all components moving together
            assert share < 0.7
            assert np.median(ls_rmse / rmse) > 20.0


def test_residual_beyond_the_noise_shows():
    run = simulate('zyx', 20.0)
    record = measure(run, 1, attitude_every=1)
    good = identify(record, servicer('zyx'), SETTINGS, 'ls').estimate
    assert good.chi2_per_dof == pytest.approx(1.0, abs=0.25)
    noisy = measure(run, 1, scale=3.0, attitude_every=1)
    bad = identify(noisy, servicer('zyx'), SETTINGS, 'ls').estimate
    assert bad.chi2_per_dof > 5.0


def test_sampling_interpolates_at_the_joints_stamps():
    data = measure(simulate('zyx', 20.0), 0, scale=0.0, joint_every=7, attitude_every=2)
    reference = sampled_motion(data)
    np.testing.assert_array_equal(reference.time, data.joint_time)
    np.testing.assert_array_equal(reference.omega, simulate('zyx', 20.0).omega[::7])
    true = Rotation.from_quat(simulate('zyx', 20.0).attitude_xyzw[::7])
    # Slerp over 20 ms at rates that change by 0.5 rad/s^2: 0.5 * 0.02^2 / 8
    assert np.max((reference.rotation.inv() * true).magnitude()) < 5e-5


def test_only_what_all_sensors_cover_is_used():
    data = measure(simulate('zyx', 20.0), 0).between(-1.0, 20.0)
    late = changed(
        data, attitude_time=data.attitude_time[50:], attitude_xyzw=data.attitude_xyzw[50:]
    )
    assert sampled_motion(late).time[0] == pytest.approx(5.0, abs=1e-9)


def test_refusals():
    data = measure(simulate('zyx', 20.0), 0)
    one = changed(data, attitude_time=data.attitude_time[:1], attitude_xyzw=data.attitude_xyzw[:1])
    with pytest.raises(IdentificationError, match='at least two'):
        sampled_motion(one)
    with pytest.raises(IdentificationError, match='positions and rates'):
        sampled_motion(changed(data, qd=None))
    apart = changed(data, joint_time=data.joint_time + 100.0)
    with pytest.raises(IdentificationError, match='while gyro and attitude are measured'):
        sampled_motion(apart)
