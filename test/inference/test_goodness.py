"""A fit's probability is uniform under a right model, and says by how much noise is too large."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import chdtrc
from scipy.stats import kstest
from support.drawn_hypotheses import drawn

from spacerobot_ros.inference.goodness import goodness
from spacerobot_ros.inference.hypotheses import Hypotheses


def of(problem, factor: float = 1.0):
    blocks = problem.sums
    if factor != 1.0:
        from dataclasses import replace

        noise = problem.data - problem.columns @ problem.coefficients
        blocks = replace(problem, data=problem.data + (factor - 1.0) * noise).sums
    hypotheses = Hypotheses(blocks, problem.every)
    marginal = hypotheses.marginal(problem.causes)
    return goodness(hypotheses.fitted(marginal, problem.causes))


def overdispersion(found):
    return np.sum(found.squares) / np.sum(found.freedom)


def test_p_values_of_right_models_are_uniform():
    found = [of(drawn(seed, count=4, rows=180)) for seed in range(120)]
    assert kstest([f.p_value for f in found], 'uniform').pvalue > 0.01
    first = [chdtrc(f.freedom[0], f.squares[0]) for f in found]
    assert kstest(first, 'uniform').pvalue > 0.01
    assert np.mean([overdispersion(f) for f in found]) == pytest.approx(1.0, abs=0.03)


def test_noise_that_is_too_large_is_no_good_fit():
    found = of(drawn(0, rows=1200), factor=1.3)
    assert overdispersion(found) == pytest.approx(1.69, rel=0.1)
    assert not found.is_good
    assert of(drawn(0, rows=1200)).is_good
