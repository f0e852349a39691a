"""The adaptive laws: identities of the loop, updates that stay physical, and bad input."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh

from spacerobot_ros.control.adaptive.controller import AdaptiveController
from spacerobot_ros.control.adaptive.law_signals import LIMIT, AdaptiveSettings, Measured
from spacerobot_ros.control.adaptive.physical_consistency import (
    is_physical,
    natural_step,
    project,
)
from spacerobot_ros.dynamics.equations import Dynamics, without_translation
from spacerobot_ros.dynamics.pseudo_inertia import parameters_of, pseudo_inertia
from spacerobot_ros.dynamics.random_body import body_scales
from spacerobot_ros.errors import ConfigurationError, MessageRejectedError
from validation.papers.adaptive_judge import identities
from validation.papers.adaptive_run import (
    START,
    LoopCase,
    harmonic,
    minisat,
    run_case,
    wrong_prior,
)

PERIOD = 0.05


def controller(law='adaptive_composite', robot=None, **values):
    settings = AdaptiveSettings(law=law, **values)
    return AdaptiveController(minisat() if robot is None else robot, settings, PERIOD)


def measured(t=0.0, velocity=True, **values):
    point = harmonic(t)
    v = np.zeros(3) if velocity else None
    state = Measured(point.q_WD_xyzw, point.omega_WD_D, point.q, point.qd, v)
    return replace(state, **values)


def drive(law, steps, **values):
    """Some steps along the task, slightly behind it."""
    out = controller(law, **values)
    for k in range(steps):
        out.step(measured(k * PERIOD - 0.02), harmonic(k * PERIOD))
    return out


def test_identities_and_ranks_on_the_robot():
    found = identities()
    assert max(found['rnea'], found['slotine_li'], found['coriolis']) <= 1e-12
    assert found['lyapunov'] <= 1e-11
    assert (found['rank'], found['rank_without_force']) == (38, 37)


def test_mass_matrix_of_the_notes():
    """Translation eliminated at the start: diagonal as the notes print it."""
    M = Dynamics(minisat()).mass_matrix(START)
    reduced = M[3:, 3:] - M[3:, :3] @ np.linalg.solve(M[:3, :3], M[:3, 3:])
    expected = [4.77, 4.12, 1.71, 0.81, 2.12, 0.54, 0.091]
    np.testing.assert_allclose(np.diag(reduced), expected, rtol=0.0, atol=6e-3)  # as printed


@pytest.mark.parametrize('law', ['passivity', 'adaptive_rls', 'adaptive_composite'])
def test_nothing_pushes_the_base(law):
    adaptive = drive(law, 30)
    assert np.max(np.abs(adaptive._u[:3])) <= 1e-12


@pytest.mark.parametrize('law', ['adaptive_rls', 'adaptive_composite'])
@pytest.mark.parametrize('velocity', [True, False])
def test_wrong_parameters_are_learnt_to_the_floor(law, velocity):
    settings = AdaptiveSettings(law=law)
    case = LoopCase(task='harmonic', settings=settings, prior='iid', eta=0.4, seed=1)
    run = run_case(replace(case, measures_velocity=velocity))
    assert run['attitude_rms_deg'] <= 0.0035
    assert run['joint_rms_deg'] <= 0.012
    assert run['indefinite'] == 0.0


def test_the_opposite_quaternion_is_the_same_attitude():
    target = harmonic(3.0)
    flipped = replace(target, q_WD_xyzw=-target.q_WD_xyzw)
    one, two = (controller().step(measured(2.0), point) for point in (target, flipped))
    np.testing.assert_allclose(one.base, two.base, rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(one.attitude_error, two.attitude_error, rtol=1e-13, atol=1e-15)


def test_pseudo_inertia_there_and_back():
    rows = minisat().inertial_parameters
    np.testing.assert_allclose(parameters_of(pseudo_inertia(rows)), rows, rtol=1e-12, atol=1e-14)


def test_projection_makes_every_body_physical():
    rng = np.random.default_rng(4)
    rows = minisat().inertial_parameters
    truth, scales = rows.ravel(), body_scales(rows)
    for _ in range(50):
        L = rng.normal(size=(50, 50)) * np.maximum(np.abs(truth), 1e-3)[:, None]
        pi = truth * (1.0 + 0.5 * rng.normal(size=50))
        project(pi, L @ L.T, scales, truth)
        eigenvalues = np.linalg.eigvalsh(pseudo_inertia(pi.reshape(-1, 10)))
        assert np.min(eigenvalues) > 0.0


def test_natural_steps_stay_physical():
    rng = np.random.default_rng(4)
    rows = minisat().inertial_parameters
    pi, scales = rows.ravel().copy(), body_scales(rows)
    for _ in range(50):
        natural_step(pi, rng.normal(size=50), np.ones(5), scales)
        assert is_physical(pi, scales)


def test_a_prior_that_is_not_physical_is_projected():
    adaptive = controller(robot=wrong_prior('iid', 0.4, 0))
    assert adaptive.health.physical
    assert not controller(
        robot=wrong_prior('iid', 0.4, 0), physical_consistency='none'
    ).health.physical


def test_no_mass_is_refused():
    rows = -minisat().inertial_parameters
    with pytest.raises(ConfigurationError, match='total mass must be above zero'):
        controller(robot=minisat().with_inertial_parameters(rows), physical_consistency='none')


def test_bandwidths_beyond_the_sampling_limit():
    with pytest.raises(ConfigurationError, match='choose lower bandwidths or a shorter period'):
        controller(kappa=40.0)
    assert 'above 0.7' in controller(kappa=40.0, sampling_check='warn').health.sampling_warning
    assert controller().health.sampling_warning == ''


@pytest.mark.parametrize(
    'values', [{'omega_WB_B': np.array([0.0, np.nan, 0.0])}, {'q': np.zeros(3)}]
)
def test_a_bad_sample_changes_nothing(values):
    adaptive = drive('adaptive_composite', 10)
    before = adaptive.parameters.values
    with pytest.raises(MessageRejectedError, match='measured: '):
        adaptive.step(measured(**values), harmonic(0.5))
    np.testing.assert_array_equal(adaptive.parameters.values, before)
    adaptive.step(measured(0.48), harmonic(0.5))
    assert adaptive.health.adapting


def test_saturation_pauses_the_adaptation():
    adaptive = drive('adaptive_composite', 20)
    command = adaptive.step(measured(0.98), harmonic(1.0))
    before = adaptive.parameters.values
    adaptive.applied(0.5 * command.base, 0.5 * command.joints)
    adaptive.step(measured(1.03), harmonic(1.05))
    np.testing.assert_array_equal(adaptive.parameters.values, before)
    assert adaptive.health.reason == 'a torque limit was reached'
    adaptive.step(measured(1.08), harmonic(1.1))
    assert adaptive.health.adapting


def test_lost_samples_restart_the_regression():
    adaptive = drive('adaptive_rls', 20)
    before = adaptive.parameters.values
    adaptive.step(measured(1.9), harmonic(2.0), elapsed=1.0)
    np.testing.assert_array_equal(adaptive.parameters.values, before)
    assert adaptive.health.reason == 'samples were lost'


def test_velocity_that_stops_being_measured():
    adaptive = drive('adaptive_rls', 20)
    adaptive.step(measured(0.98, velocity=False), harmonic(1.0))
    assert not adaptive.health.base_velocity_measured
    assert not adaptive.health.adapting


@pytest.mark.parametrize('law', ['adaptive_rls', 'adaptive_lyapunov', 'adaptive_composite'])
def test_noise_at_rest_teaches_nothing(law):
    adaptive, rng = controller(law), np.random.default_rng(2)
    before, target = adaptive.parameters.values, harmonic(0.0)
    target = replace(target, omega_WD_D=np.zeros(3), qd=np.zeros(4))
    std = minisat().sensors
    for _ in range(300):
        state = Measured(
            np.array([0.0, 0.0, 0.0, 1.0]),
            std.gyro_std * rng.normal(size=3),
            START,
            std.joint_velocity_std * rng.normal(size=4),
            np.zeros(3),
        )
        adaptive.step(state, target)
    np.testing.assert_array_equal(adaptive.parameters.values, before)
    assert 'within the noise' in adaptive.health.reason


def test_directions_without_excitation_keep_their_variance():
    adaptive = drive('adaptive_rls', 100, physical_consistency='none')
    std = adaptive.parameters.std
    assert np.all(std <= controller('adaptive_rls').parameters.std * (1.0 + 1e-9))
    assert controller('adaptive_lyapunov').parameters.covariance is None


def test_gravity_moves_nothing_against_itself():
    falling = replace(minisat(), gravity=np.array([0.0, 0.0, -9.81]))
    free, weighed = controller('passivity'), controller('passivity', falling)
    for k in range(10):
        state, t = measured(k * PERIOD - 0.02), k * PERIOD
        R = np.array([0.0, 0.0, -9.81 * t])
        x, w = state.q_WB_xyzw[0], state.q_WB_xyzw[3]
        turn = np.array([[1, 0, 0], [0, 1 - 2 * x * x, 2 * x * w], [0, -2 * x * w, 1 - 2 * x * x]])
        one = free.step(state, harmonic(t))
        two = weighed.step(replace(state, v_WB_B=turn @ R), harmonic(t))
        np.testing.assert_allclose(one.base, two.base, rtol=1e-9, atol=1e-12)


def test_far_from_the_start_no_more_gain_is_taken_than_the_period_samples(rng):
    law, robot = controller('passivity'), minisat()
    kappa, bandwidth = law.settings.kappa, law.settings.attitude_bandwidth

    def rates(q):
        M = without_translation(Dynamics(robot).mass_matrix(q))
        return eigh(law._K[3:, 3:], M, eigvals_only=True)

    start = measured()
    law.step(start, harmonic(0.0))
    np.testing.assert_allclose(rates(start.q), kappa, rtol=1e-9)  # rounding
    whole = law._K.copy()
    fastest = []
    for q in rng.uniform(-np.pi, np.pi, (50, 4)):
        law._K[:] = whole
        fastest.append(rates(q)[-1])
        law.step(replace(start, q=q), harmonic(0.0))
        # rounding
        assert (rates(q)[-1] + bandwidth) * PERIOD <= LIMIT * (1.0 + 1e-9)
    assert (max(fastest) + bandwidth) * PERIOD > 1.5 * LIMIT  # of 50 some are far off
