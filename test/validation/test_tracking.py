"""Tracking in continuous time, on the correct plant and on the paper's."""

from functools import cache

import numpy as np
import pytest

from validation.papers import tracking
from validation.papers.tracking import soft_bandwidth

track = cache(tracking.track)  # some runs are asked for twice
EXACT = 1e-6  # deg; truncation of RK4 at 20 ms is 1e-7


@pytest.mark.parametrize('axes', ['zyx', 'xyy'])
@pytest.mark.parametrize('bandwidth', [0.5, 1.0])
def test_corrected_law_is_exact(axes, bandwidth):
    run = track(axes, 'correct', 'corrected', bandwidth)
    assert run['max_joint_error_deg'] <= EXACT
    assert run['max_end_effector_error_m'] <= 1e-7  # m


@pytest.mark.parametrize(
    ('axes', 'plant', 'law', 'degrees', 'metres'),
    [
        ('zyx', 'correct', 'no_aam', 2.10, 0.083),
        ('xyy', 'correct', 'no_aam', 2.22, 0.104),
        ('zyx', 'paper', 'no_aam', 3.34, 0.128),
        ('xyy', 'paper', 'no_aam', 1.19, 0.062),
        ('zyx', 'correct', 'paper', 3.08, 0.127),
        ('xyy', 'correct', 'paper', 2.92, 0.141),
    ],
)
def test_errors_without_the_wheels_torque(axes, plant, law, degrees, metres):
    run = track(axes, plant, law, 1.0)
    # the prototype's figures, three digits
    np.testing.assert_allclose(run['max_joint_error_deg'], degrees, rtol=0.01)
    np.testing.assert_allclose(run['max_end_effector_error_m'], metres, rtol=0.01)


def test_the_papers_law_is_exact_on_the_papers_plant_only():
    assert track('zyx', 'paper', 'paper', 1.0)['max_joint_error_deg'] <= EXACT
    assert track('zyx', 'correct', 'paper', 1.0)['max_joint_error_deg'] > 2.5


@pytest.mark.parametrize(('axes', 'plant', 'bandwidth'), [('xyy', 'paper', 0.31)])
def test_eight_degrees_need_soft_gains(axes, plant, bandwidth):
    run = soft_bandwidth(axes, plant, 8.0)
    np.testing.assert_allclose(run['max_joint_error_deg'], 8.0, rtol=0.01)
    np.testing.assert_allclose(run['bandwidth'], bandwidth, rtol=0, atol=0.01)
    np.testing.assert_allclose(run['max_end_effector_error_m'], 0.43, rtol=0, atol=0.01)
