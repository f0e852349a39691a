"""Minimal sets, condition numbers and identification without noise."""

import numpy as np
import pytest

from spacerobot_ros.errors import ConfigurationError
from validation.papers.estimators import noise_free, relative_errors
from validation.papers.paper import momentum_motion, scenario


@pytest.mark.parametrize(
    ('axes', 'k', 'raw', 'unit'),
    [('zyx', 19, 801.0, 248.0), ('xyy', 19, 928.0, 306.0), ('zyy', 24, 1602.0, 782.0)],
)
def test_published_case(axes, k, raw, unit):
    symmetric, generic = noise_free(axes, 'moving', ('symmetric', 'generic'))
    assert (symmetric['k'], generic['k']) == (k, 45)
    np.testing.assert_allclose(list(symmetric['condition'].values()), [raw, unit], rtol=0.01)
    for result in (symmetric, generic):
        exact, forward = result['max_error_percent'].values()
        assert exact <= 1e-10  # %
        assert forward <= 5e-9  # %, integrated at rtol 1e-13


@pytest.mark.parametrize(('axes', 'raw'), [('zyx', 663.0), ('xyy', 577.0)])
def test_own_wheels_spun_up_from_rest(axes, raw):
    (result,) = noise_free(axes, 'spin_up')
    np.testing.assert_allclose(result['condition']['raw'], raw, rtol=0.01)
    exact, forward = result['max_error_percent'].values()
    assert exact <= 1e-10
    assert forward <= 5e-9


def test_spinning_up_turns_the_base():
    start = scenario('zyx').start('spin_up')
    # own derivation, three digits
    np.testing.assert_allclose(start.omega_WB_B, [-0.0159, -0.0047, -0.0066], rtol=0, atol=6e-5)


def test_leaving_the_wheels_out_ruins_everything():
    (result,) = noise_free('zyx', 'moving')
    assert 55.0 < result['wrong_model_median_error_percent'] < 65.0  # 60 % in the notes


def test_momentum_of_the_first_state():
    case = scenario('xyy')
    h = case.dynamics.momentum(case.initial)[3:]
    np.testing.assert_allclose(h, [-300.4, 643.2, 941.2], rtol=0, atol=0.06)  # four digits


def test_relative_errors_of_zero_parameters_are_left_out():
    errors = relative_errors(np.array([1.1, 0.1]), np.array([1.0, 0.0]))
    np.testing.assert_allclose(errors, [-10.0, np.nan], rtol=1e-12)


@pytest.mark.parametrize('axes', ['zy', 'zyw', ''])
def test_unknown_axes_are_refused(axes):
    with pytest.raises(ConfigurationError, match='axes'):
        scenario(axes)


def test_unknown_start_is_refused():
    with pytest.raises(ConfigurationError, match='start'):
        momentum_motion('zyx', 'running')
