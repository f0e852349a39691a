"""The published method: exact without noise, the same recursively, and biased with noise."""

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
from spacerobot_ros.estimation.filters.momentum_process import MomentumModel
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.batch import identify
from spacerobot_ros.identification.least_squares import (
    momentum_rows,
    sampled_motion,
    solve_least_squares,
)
from spacerobot_ros.model.settings import IdentifierSettings

SETTINGS = IdentifierSettings()


def model_of(axes, structure='symmetric'):
    robot = servicer(axes)
    return MomentumModel(robot, minimal_set(robot, structure))


def solve(model, motion, method):
    return solve_least_squares(model, SETTINGS, motion, NOISE, method)


def exact(axes, every=1):
    """Noise-free samples, the tracker at the joints' stamps."""
    return measure(simulate(axes, 20.0), 0, scale=0.0, attitude_every=every)


@pytest.mark.parametrize('structure', ['symmetric', 'generic'])
@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_exact_without_noise(axes, structure):
    model = model_of(axes, structure)
    constants = solve(model, sampled_motion(exact(axes)), 'ls').constants
    truth = truth_of(simulate(axes, 20.0), structure)
    # momentum-integrated data: rounding times a condition number of 1e3 to 1e4
    np.testing.assert_allclose(constants, truth, rtol=0, atol=1e-9 * np.max(np.abs(truth)))


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
def test_recursive_equals_batch(axes):
    model = model_of(axes)
    reference = sampled_motion(measure(simulate(axes, 20.0), 1, attitude_every=1))
    at_once, in_blocks = (solve(model, reference, method) for method in ('ls', 'recursive'))
    batch, whole = at_once.constants, at_once.information
    steps, parts = in_blocks.constants, in_blocks.information
    np.testing.assert_allclose(steps, batch, rtol=1e-10, atol=0)
    np.testing.assert_allclose(parts.solve()[1], whole.solve()[1], rtol=1e-8, atol=1e-12)


def test_batch_equals_plain_least_squares():
    model = model_of('zyx')
    reference = sampled_motion(measure(simulate('zyx', 20.0), 1, attitude_every=1))
    columns, values = momentum_rows(model, reference)
    want, squares, _, _ = np.linalg.lstsq(columns, values, rcond=None)
    solution = solve(model, reference, 'ls')
    got, information = solution.constants, solution.information
    np.testing.assert_allclose(got, want, rtol=1e-9, atol=0)
    variance = squares[0] / (len(values) - model.size)
    _, covariance = information.solve()
    np.testing.assert_allclose(
        covariance, variance * np.linalg.inv(columns.T @ columns), rtol=1e-6, atol=1e-12
    )


def test_condition_is_that_of_the_reference_study():
    # 1000 samples at 20 ms, raw columns of [AAM; x] with the momentum of the first sample known.
    for axes, want in (('zyx', 801.0), ('xyy', 928.0)):
        reference = sampled_motion(exact(axes)).part(slice(0, 2000, 2))
        model = model_of(axes)
        columns, _ = momentum_rows(model, reference)
        rows = columns.reshape(-1, 3, model.size)[:, :, 3:]
        assert np.linalg.cond((rows - rows[0]).reshape(-1, model.size - 3)) == pytest.approx(
            want, rel=0.01
        )


def test_noise_biases_the_estimate_and_maximum_likelihood_is_free_of_it():
    # Five times nominal noise, dominated by the joint rates; every estimate is pulled to zero.
    run = simulate('xyy', 20.0)
    truth, robot = truth_of(run), servicer('xyy')
    scale = 5.0
    errors = {'ls': [], 'ml': []}
    for seed in range(8):
        record = measure(run, seed, scale, attitude_every=1)
        for method, found in errors.items():
            found.append(errors_of(identify(record, robot, SETTINGS, method), truth)[0][3:])
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


@pytest.mark.parametrize('method', ['ls', 'recursive'])
def test_residual_beyond_the_noise_shows(method):
    run = simulate('zyx', 20.0)
    record = measure(run, 1, attitude_every=1)
    good = identify(record, servicer('zyx'), SETTINGS, method)
    assert good.chi2_per_dof == pytest.approx(1.0, abs=0.25)
    noisy = measure(run, 1, scale=3.0, attitude_every=1)
    bad = identify(noisy, servicer('zyx'), SETTINGS, method)
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
