"""One of the drawn robots that MuJoCo flies: what `validation.momentum_flights` says of many."""

from __future__ import annotations

import numpy as np
import pytest

from validation.mujoco.momentum_flights import identified


@pytest.mark.parametrize(('seed', 'off'), [(25, 0.1)])
def test_a_drawn_arm_that_slides(seed, off):
    row = identified(seed, off)
    assert (row['joints'], row['slides']) == (3, True)
    assert row['valid'], row['reason']
    assert np.max(np.abs(row['z'])) < 4.5
    assert row['error_percent'] < 2.0
    assert 0.9 < row['chi2'] < 1.1
