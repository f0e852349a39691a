"""The integral of samples against SciPy's."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from spacerobot_ros.recording.integral import integral


@pytest.mark.parametrize('shape', [(1, 3), (2,), (40,), (40, 2), (40, 2, 3)])
def test_it_is_scipys(rng, shape):
    time, rates = np.cumsum(rng.uniform(0.1, 1.0, shape[0])), rng.normal(size=shape)
    theirs = cumulative_trapezoid(rates, time, axis=0, initial=0.0)
    # sums of 40 numbers of order one, rounded in another order
    np.testing.assert_allclose(integral(time, rates), theirs, rtol=0, atol=1e-13)
