"""Data that contradict what the online identifier learned are left out, whatever is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.identification import ORIGIN_NS, changed, measure, simulate
from support.online import assert_never_confidently_wrong, events, feed, identifier

RUN = 24.0  # s
X, Y, Z = np.eye(3)


def clean():
    """A run and what was measured."""
    run = simulate('zyx', RUN)
    return run, measure(run, 11)


def off(data, sensor, start, end, change):
    """The data with the samples of a sensor between two times [s] changed."""
    time = {'omega': data.rate_time, 'attitude_xyzw': data.attitude_time}.get(
        sensor, data.joint_time
    )
    rows = (time >= start) & (time < end)
    values = getattr(data, sensor).copy()
    values[rows] = change(values[rows])
    return changed(data, **{sensor: values})


def turned(values):
    """Attitudes after a tracker took another frame for the inertial one."""
    return (Rotation.from_rotvec([0.3, -0.2, 0.1]) * Rotation.from_quat(values)).as_quat()


def later(data, start, delay):
    """The data of a clock that jumped."""
    times = ('joint_time', 'rate_time', 'attitude_time')
    return changed(
        data,
        **{name: (t := getattr(data, name)) + np.where(t >= start, delay, 0.0) for name in times},
    )


def stood(values):
    """What a sensor says that is stuck."""
    return np.repeat(values[:1], len(values), axis=0)


FAULTS = {
    'a burst of joint rates': lambda d: off(d, 'qd', 9.2, 9.35, lambda v: v + 0.1 * Y),
    'a burst of the gyro': lambda d: off(d, 'omega', 9.2, 9.35, lambda v: v + 0.1 * X),
    'a burst of positions': lambda d: off(d, 'q', 9.2, 9.6, lambda v: v + 0.03 * Z),
    'joints that read zero': lambda d: off(
        off(d, 'q', 9.2, 9.5, np.zeros_like), 'qd', 9.2, 9.5, np.zeros_like
    ),
    'a stuck gyro': lambda d: off(d, 'omega', 9.2, 10.0, stood),
    'a stuck tracker': lambda d: off(d, 'attitude_xyzw', 9.2, 11.0, stood),
    'a clock somewhat ahead': lambda d: later(d, 9.2, 0.3),
    'another inertial frame': lambda d: off(d, 'attitude_xyzw', 9.2, 99.0, turned),
    'another gyro bias': lambda d: off(d, 'omega', 9.2, 99.0, lambda v: v + 1e-3 * Y),
    'before anything was known': lambda d: off(d, 'omega', 2.0, 2.2, lambda v: v + 0.1),
}


@pytest.mark.parametrize('name', FAULTS)
def test_what_contradicts_is_left_out(name):
    run, data = clean()
    online = identifier()
    estimates = feed(online, FAULTS[name](data), 1.0)
    assert_never_confidently_wrong(estimates, run)
    assert estimates[-1].valid
    if name != 'before anything was known':
        assert sum(online.left_out.values()) > 10
        known = next(k for k, e in enumerate(estimates) if e.valid)
        assert all(e.valid for e in estimates[known:])
    best = feed(identifier(), data, 1.0)[-1]
    # of 20 s that count 1.5 to 5 s are lost, and perhaps total momentum and biases are found anew
    assert np.max(estimates[-1].std[:3] / best.std[:3]) < (4.0 if 'another' in name else 2.0)


def test_a_model_that_goes_on_to_be_wrong_is_said_and_comes_back():
    run, data = clean()
    wrong = off(data, 'omega', 8.0, 17.0, lambda v: 1.1 * v)
    estimates = feed(identifier(), wrong, 1.0)
    assert_never_confidently_wrong(estimates, run)
    assert any('does not explain' in e.reason for e in estimates)
    assert estimates[-1].valid


@pytest.mark.parametrize('far', [0.5, -0.3])
def test_constants_that_are_far_off_are_left_behind(far):
    data = measure(simulate('zyx', 12.0), 1)
    online, other = identifier(), identifier()
    for stamp, method, values in events(data):
        if method == 'add_joints' and stamp - ORIGIN_NS in (5_500_000_000, 7_000_000_000):
            online.solve()
            other.solve()
        if (method, stamp - ORIGIN_NS) == ('add_joints', 5_500_000_000):
            likelihood = online._segment.likelihood
            likelihood.constants[likelihood.model.y] += far
            likelihood.is_converged = False
            other._segment._next_rerun = 0.0  # whole again, as what is sought anew
        for each in (online, other):
            getattr(each, method)(stamp, *values)
    found, wanted = online.solve(), other.solve()
    assert found.valid
    # about constants that are within their noise of the others
    assert np.max(np.abs(found.aam - wanted.aam) / wanted.std[:3]) < 0.1
    np.testing.assert_allclose(found.std[:3], wanted.std[:3], rtol=0.1, atol=0)
    assert sum(online.left_out.values()) == 0
