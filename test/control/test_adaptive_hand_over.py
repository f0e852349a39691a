"""An identifier's estimate as the start of an adaptive law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.models import H_TARGET, random_tree, robot_of, table_one

from spacerobot_ros.control.adaptive.controller import AdaptiveController
from spacerobot_ros.control.adaptive.law_signals import AdaptiveSettings
from spacerobot_ros.control.adaptive.regressors import with_parameters
from spacerobot_ros.errors import IdentificationError
from spacerobot_ros.estimation.unknowns.minimal import minimal_set
from spacerobot_ros.identification.estimate import Estimate

TRUE = robot_of(
    table_one(),
    servicer_wheels={'momentum': [25.0, 27.0, 28.0]},
    target_wheels={'links': ['link_3'], 'momentum': H_TARGET.tolist()},
)
WRONG = np.array([1.25, 1.3, 0.8, 1.2])  # factors on the bodies


def believed():
    rows = TRUE.inertial_parameters * WRONG[:, None]
    return TRUE.with_inertial_parameters(rows).with_target_momentum(np.zeros(3))


def estimate(std=1e-3):
    minimal = minimal_set(TRUE, 'symmetric')
    parameters = minimal.of_robot(TRUE)
    size = 3 + len(parameters)
    return Estimate(
        method='ml',
        valid=True,
        reason='',
        aam_links=('link_3',),
        aam=H_TARGET.copy(),
        parameter_names=minimal.names,
        parameters=parameters,
        covariance=std**2 * np.eye(size),
        rank=size,
        unknowns=size,
        condition=100.0,
        unexcited=(),
        total_momentum=np.zeros(3),
        total_momentum_covariance=np.eye(3),
        chi2_per_dof=1.0,
        samples=1000,
        stamp_ns=0,
    )


def adaptive():
    return AdaptiveController(believed(), AdaptiveSettings(), 0.01)


def test_the_estimate_becomes_the_mean():
    law, given = adaptive(), estimate()
    law.hand_over(given, 'symmetric')
    found = law.parameters
    np.testing.assert_allclose(found.values[-3:], H_TARGET, rtol=0.0, atol=1e-2)  # ten std
    reached = minimal_set(TRUE, 'symmetric').of_robot(with_parameters(TRUE, found.values))
    np.testing.assert_allclose(reached, given.parameters, rtol=0.0, atol=1e-2)  # ten std
    assert law.health.physical


def test_the_covariance_is_handed_over():
    law, before = adaptive(), adaptive().parameters.std
    law.hand_over(estimate(), 'symmetric')
    std = law.parameters.std
    np.testing.assert_allclose(std[-3:], 1e-3, rtol=0.01)
    assert np.all(std[:40] <= before[:40] * (1.0 + 1e-6))
    # momentum never tells the total mass: what the estimate does not know stays as it was
    assert std[0] > 0.1 * before[0]


def test_joints_that_slide_and_frames_without_mass_are_handed_over(rng):
    parts = random_tree(rng, [0, 1, 2, 3], prismatic=(3,))
    parts[2] = replace(parts[2], mass=0.0, com=np.zeros(3), inertia=np.zeros((3, 3)))
    truth = robot_of(parts)
    factors = np.array([[1.1], [0.9], [1.0], [1.05], [0.95]])
    minimal = minimal_set(truth, 'generic')
    x = minimal.of_robot(truth)
    believed = truth.with_inertial_parameters(truth.inertial_parameters * factors)
    law = AdaptiveController(believed, AdaptiveSettings(), 0.01)
    told = replace(
        estimate(),
        aam_links=(),
        aam=np.zeros(0),
        parameter_names=minimal.names,
        parameters=x,
        covariance=1e-6 * np.eye(len(x)),
    )
    law.hand_over(told, 'generic')
    found = with_parameters(believed, law.parameters.values)
    assert found.bodies[2].mass == 0.0
    np.testing.assert_allclose(minimal.of_robot(found), x, rtol=0.0, atol=1e-2)  # ten std


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'valid': False, 'reason': 'too short'}, 'not valid: too short'),
        ({'aam_links': ('link_2',)}, 'names do not fit'),
        ({'covariance': -np.eye(22)}, 'negative variance'),
        ({'covariance': np.full((22, 22), 1.0) - 0.5 * np.eye(22)}, 'covariance is indefinite'),
    ],
)
def test_an_estimate_that_must_not_be_used(changes, message):
    law = adaptive()
    before = law.parameters.values
    with pytest.raises(IdentificationError, match=message):
        law.hand_over(replace(estimate(), **changes), 'symmetric')
    np.testing.assert_array_equal(law.parameters.values, before)
