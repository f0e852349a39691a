"""An identifier's estimate in the control loop of a free-flying robot."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from support.free_flying import errors, estimate_of, file_with, free_flying_parameters, rms_degrees
from support.models import random_tree, robot_of

from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.control.plausible import EstimateCheck
from spacerobot_ros.errors import MessageRejectedError
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.model.uncertainty import BodyUncertainty
from spacerobot_ros.simulation.closed_loop import ClosedLoop


def tracked(law, with_estimate):
    file = file_with(free_flying_parameters(law, 0.05))
    estimate = estimate_of(file) if with_estimate else None
    loop = ClosedLoop(file.robot, file.settings, estimate)
    start = loop.plant.state
    steps = list(loop.run(200))
    assert all(s.command.uses_estimate == with_estimate for s in steps)
    return rms_degrees(np.array([errors(start, s.state, s.stamp_ns * 1e-9) for s in steps]))


def test_an_estimate_takes_the_place_of_wrong_beliefs():
    assert np.all(tracked('passivity', True) < 0.3 * tracked('passivity', False))


def test_an_adapting_law_that_is_told_starts_ahead_of_one_that_must_learn():
    assert np.all(tracked('adaptive_lyapunov', True) < tracked('adaptive_lyapunov', False))


def test_mean_and_covariance_start_the_adaptation():
    file = file_with(free_flying_parameters('adaptive_rls', 0.05))
    loop = ControlLoop(file.robot, file.settings)
    before = loop.adaptive.parameters
    loop.set_estimate(estimate_of(file))
    after = loop.adaptive.parameters
    assert np.abs(after.values - before.values).max() > 0.01
    # told in every direction that the estimate knows, nowhere less sure than before
    change = before.covariance - after.covariance
    assert np.linalg.eigvalsh(change).min() > -1e-9 * np.linalg.norm(before.covariance)
    assert np.linalg.matrix_rank(change, tol=1e-6 * np.linalg.norm(change)) >= 10


def test_only_the_first_estimate_starts_it():
    file = file_with(free_flying_parameters('adaptive_composite', 0.05))
    loop, estimate = ControlLoop(file.robot, file.settings), estimate_of(file)
    loop.set_estimate(estimate)
    first = loop.adaptive
    loop.set_estimate(replace(estimate, parameters=1.1 * estimate.parameters))
    assert loop.adaptive is first
    loop.set_estimate(None)
    assert loop.estimate is None
    fresh = ControlLoop(file.robot, file.settings).adaptive.parameters.values
    assert_allclose(loop.adaptive.parameters.values, fresh, rtol=0, atol=0)


def test_fixed_parameters_follow_every_estimate():
    file = file_with(free_flying_parameters('passivity', 0.05))
    loop, estimate = ControlLoop(file.robot, file.settings), estimate_of(file)
    values = []
    for scale in (1.0, 1.1):
        loop.set_estimate(replace(estimate, parameters=scale * estimate.parameters))
        values.append(loop.adaptive.parameters.values)
    assert np.abs(values[1] - values[0]).max() > 0.01


def test_how_far_an_estimate_may_be_off_is_what_the_robot_file_says():
    """Six times ten of the stated widths, and six of the largest parameter at least."""
    file = file_with(free_flying_parameters('passivity', 0.05))
    estimate = estimate_of(file)

    def check(width, factor):
        bodies = (BodyUncertainty(width, width, width),) * 5
        changed = replace(estimate, parameters=factor * estimate.parameters)
        EstimateCheck(replace(file.robot, uncertainties=bodies), file.settings).check(changed)

    check(1e-3, 5.0)
    with pytest.raises(MessageRejectedError, match=r'implausible, .*robot\.uncertainty\)'):
        check(1e-3, 20.0)
    check(1.0, 20.0)
    with pytest.raises(MessageRejectedError, match='implausible'):
        check(1.0, 1e3)


def test_an_arm_that_slides_has_estimates_to_be_refused(rng):
    file = file_with({})
    robot = robot_of(random_tree(rng, [0, 1, 2], prismatic=(2,)))
    x = minimal_set(robot, 'generic').of_robot(robot)
    check = EstimateCheck(robot, file.settings)
    told = replace(estimate_of(file), parameters=x, covariance=np.eye(len(x)))
    check.check(told)
    with pytest.raises(MessageRejectedError, match='implausible'):
        check.check(replace(told, parameters=-20.0 * x))


def indefinite(covariance):
    out = covariance.copy()
    out[0, 1] = out[1, 0] = 2.0 * np.sqrt(out[0, 0] * out[1, 1])
    return out


@pytest.mark.parametrize(
    ('change', 'reason'),
    [
        (lambda e: {'covariance': indefinite(e.covariance)}, 'covariance is indefinite'),
        (lambda e: {'covariance': -e.covariance}, 'negative variance'),
        (lambda e: {'parameters': np.full(len(e.parameters), np.nan)}, 'not finite'),
        (lambda e: {'parameter_names': ('x',) * len(e.parameters)}, 'names do not fit'),
        (lambda e: {'valid': False, 'reason': 'too early'}, 'not valid: too early'),
    ],
)
def test_unusable_estimates_change_nothing(change, reason):
    file = file_with(free_flying_parameters('adaptive_composite', 0.05))
    loop, estimate = ControlLoop(file.robot, file.settings), estimate_of(file)
    before = loop.adaptive.parameters.values
    with pytest.raises(MessageRejectedError, match=reason) as caught:
        loop.set_estimate(replace(estimate, **change(estimate)))
    assert '\n' not in str(caught.value)
    assert loop.estimate is None
    assert np.array_equal(loop.adaptive.parameters.values, before)
