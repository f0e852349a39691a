"""What a hypothesis may be, and the coordinates in which its two priors are independent."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.inference.decisive import MOST_RESOLVED
from spacerobot_ros.inference.hypothesis import Hypothesis, standardized


def random_covariance(rng, k):
    root = rng.standard_normal((k, k))
    return root @ root.T + 0.1 * np.eye(k)


@pytest.mark.parametrize('k', [1, 2, 10])
def test_coordinates_give_both_priors_back(k, rng):
    slab, spike = random_covariance(rng, k), 0.01 * random_covariance(rng, k)
    basis, variances, odds = standardized(slab, spike, np.zeros((k, k)), 100)
    np.testing.assert_allclose(basis @ basis.T, slab, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(basis @ np.diag(variances) @ basis.T, spike, rtol=0.0, atol=1e-12)
    assert odds == 0.0


def test_a_slab_that_the_data_resolve_too_well_costs_what_one_datum_s_worth_does():
    slab, nothing = np.diag([4.0, 9.0]), np.zeros((2, 2))
    # the first: 1000 data of information 1e5 resolve 1e-2; the second is less sharp than that
    basis, _, odds = standardized(slab, nothing, np.diag([1e5, 1.0]), 1000)
    np.testing.assert_allclose(basis @ basis.T, slab, rtol=1e-12)
    assert odds == pytest.approx(0.5 * np.log(4.0 / 1e-2))


def test_a_slab_is_at_most_so_much_wider_than_what_the_data_resolve():
    slab, nothing = np.diag([4.0, 9.0]), np.zeros((2, 2))
    basis, _, odds = standardized(slab, nothing, np.diag([1e9, 1.0]), 1000)
    np.testing.assert_allclose(basis @ basis.T, np.diag([MOST_RESOLVED * 1e-6, 9.0]), rtol=1e-12)
    assert odds == pytest.approx(0.5 * np.log(MOST_RESOLVED))


def test_a_slab_of_what_is_tolerated_costs_what_it_does():
    slab, spike = np.diag([4.0, 4.0]), np.diag([0.1, 0.0])
    basis, variances, odds = standardized(slab, spike, 1e5 * np.eye(2), 1000)
    np.testing.assert_allclose(basis @ basis.T, slab, rtol=1e-9)
    np.testing.assert_allclose(basis @ np.diag(variances) @ basis.T, spike, rtol=0.0, atol=1e-12)
    assert odds == pytest.approx(0.5 * np.log(4.0 / 1e-2))


REFUSED = {
    'a prior of shape': {'slab': np.ones(3)},
    'its slab is not positive definite': {'slab': np.array([1.0, 0.0])},
    'zero is not within its bounds': {'lower': np.array([0.1, 0.0])},
    'a prior of shape (2,)': {'spike': np.array([np.nan, 0.0])},
}


@pytest.mark.parametrize(('reason', 'wrong'), REFUSED.items())
def test_what_is_no_hypothesis_is_refused(reason, wrong):
    right = {'key': 'friction', 'columns': np.arange(2), 'slab': np.ones(2), 'spike': np.zeros(2)}
    with pytest.raises(ValueError, match='friction: ') as refused:
        Hypothesis(**(right | wrong))
    assert reason in str(refused.value)
