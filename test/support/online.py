"""The online identifier, fed with the samples of a simulated run."""

from __future__ import annotations

from functools import cache

import numpy as np

from spacerobot_ros.identification.estimate import Estimate
from spacerobot_ros.identification.online import OnlineIdentifier
from spacerobot_ros.model.settings import IdentifierSettings
from spacerobot_ros.recording.record import Record
from support.identification import (
    ORIGIN_NS,
    Run,
    changed,
    errors_of,
    measure,
    servicer,
    simulate,
    truth_of,
)

WRONG = 1.5  # factor on the prior's inertial parameters, alternating with its inverse

# Noise of the reference in the columns counts as excitation while the constants are uncertain.


def identifier(axes='zyx', sensors=None, structure='symmetric', **settings):
    robot = servicer(axes, prior=WRONG) if sensors is None else servicer(axes, sensors)
    return OnlineIdentifier(robot, IdentifierSettings(structure=structure, **settings))


def events(data):
    """Samples of all sensors in order of time: (stamp_ns, method, values)."""
    out = [
        (ORIGIN_NS + round(t * 1e9), 'add_joints', (q, qd))
        for t, q, qd in zip(
            data.joint_time, data.q, data.q if data.qd is None else data.qd, strict=True
        )
    ]
    out += [
        (ORIGIN_NS + round(t * 1e9), 'add_rate', (w,))
        for t, w in zip(data.rate_time, data.omega, strict=True)
    ]
    out += [
        (ORIGIN_NS + round(t * 1e9), 'add_attitude', (a,))
        for t, a in zip(data.attitude_time, data.attitude_xyzw, strict=True)
    ]
    return sorted(out, key=lambda event: event[0])


def seconds(event):
    return (event[0] - ORIGIN_NS) * 1e-9


def feed(online, data, period=2.0):
    """Feed all samples, solving once a period [s]; the estimates in order."""
    estimates, due = [], period
    for stamp, method, values in events(data):
        while (stamp - ORIGIN_NS) * 1e-9 > due + 1e-9:
            estimates.append(online.solve())
            due += period
        getattr(online, method)(stamp, *values)
    return [*estimates, online.solve()]


def error_of(estimate, run):
    """Errors of the wheel momentum and their standard deviations."""
    error, std = errors_of(estimate, truth_of(run))
    return error[3:6], std[3:6]


def assert_never_confidently_wrong(estimates, run, sigmas=5.0):
    for estimate in estimates:
        estimate.check()
        if estimate.valid:
            error, std = error_of(estimate, run)
            assert np.max(np.abs(error) / std) <= sigmas, estimate.stamp_ns


def same(a, b):
    """Equal to the last bit."""
    np.testing.assert_array_equal(a.aam, b.aam)
    np.testing.assert_array_equal(a.parameters, b.parameters)
    np.testing.assert_array_equal(a.covariance, b.covariance)
    assert (a.valid, a.reason, a.stamp_ns) == (b.valid, b.reason, b.stamp_ns)


def cut(data, sensor, start, end):
    """The data without one sensor's samples between two times."""
    fields = {
        'joint': ('joint_time', 'q', 'qd'),
        'rate': ('rate_time', 'omega'),
        'attitude': ('attitude_time', 'attitude_xyzw'),
    }[sensor]
    time = getattr(data, fields[0])
    kept = (time < start) | (time > end)
    return changed(data, **{name: getattr(data, name)[kept] for name in fields})


def streams(online):
    return online.samples.streams.values()


@cache
def half_minute() -> tuple[Run, Record, list[Estimate]]:
    """Run, data and estimates of a noisy half minute, solved once a second."""
    run = simulate('zyx', 30.0)
    data = measure(run, 0)
    return run, data, feed(identifier(), data, period=1.0)
