"""The online identifier with sensors at their own rates, that start, stop and come late."""

from __future__ import annotations

import numpy as np
import pytest
from support.identification import changed, measure, simulate
from support.online import (
    assert_never_confidently_wrong,
    cut,
    events,
    feed,
    identifier,
    same,
    seconds,
    streams,
)


@pytest.mark.parametrize(
    'rates',
    [
        {'attitude_every': 50},
        {'joint_every': 2, 'rate_every': 3, 'attitude_every': 14},
    ],
    ids=['tracker 2 Hz', '50 Hz, 33 Hz and 7 Hz'],
)
def test_rates_that_differ(rates):
    run = simulate('zyx', 20.0)
    estimates = feed(identifier(), measure(run, 3, **rates))
    assert_never_confidently_wrong(estimates, run)
    assert estimates[-1].valid


def shifted(data, joint=0.0, rate=0.0, attitude=0.0):
    """The same samples, said to be taken a little later."""
    return changed(
        data,
        joint_time=data.joint_time + joint,
        rate_time=data.rate_time + rate,
        attitude_time=data.attitude_time + attitude,
    )


def test_stamps_between_those_of_other_sensors():
    # Samples at 3, 5 and 7 ms after those of a 100 Hz grid, as sensors without a common trigger.
    run = simulate('zyx', 20.0)
    data = measure(run, 4, attitude_every=10)
    mid = np.searchsorted(run.time, data.joint_time)
    later = run.q[mid] + 3e-3 * run.qd[mid]
    acceleration = np.gradient(run.qd, run.time, axis=0)[mid]
    later += 0.5 * 3e-3**2 * acceleration
    q = data.q - run.q[mid] + later
    qd = data.qd + 3e-3 * acceleration
    estimates = feed(identifier(), shifted(changed(data, q=q, qd=qd), joint=3e-3))
    assert_never_confidently_wrong(estimates, run)
    assert estimates[-1].valid


@pytest.mark.parametrize(
    ('sensor', 'start', 'end'),
    [
        ('joint', 6.0, 6.3),
        ('rate', 6.0, 6.5),
        ('attitude', 6.0, 11.0),
        ('rate', -1.0, 5.0),
        ('joint', -1.0, 3.0),
        ('attitude', -1.0, 6.0),
    ],
)
def test_gaps_and_late_starts(sensor, start, end):
    run = simulate('zyx', 20.0)
    estimates = feed(identifier(), cut(measure(run, 6), sensor, start, end))
    assert_never_confidently_wrong(estimates, run)
    assert estimates[-1].valid


@pytest.mark.parametrize('sensor', ['joint', 'rate', 'attitude'])
def test_a_sensor_that_stops(sensor):
    run = simulate('zyx', 20.0)
    estimates = feed(identifier(), cut(measure(run, 7), sensor, 12.0, 99.0))
    assert_never_confidently_wrong(estimates, run)
    if sensor != 'attitude':  # nothing new can be said without them
        same(estimates[-1], estimates[-4])


@pytest.mark.parametrize('sensor', ['joint', 'rate', 'attitude'])
def test_a_sensor_that_never_starts(sensor):
    data = cut(measure(simulate('zyx', 20.0), 7), sensor, -1.0, 99.0)
    online = identifier()
    what = {'joint': 'joint states', 'rate': 'gyro', 'attitude': 'attitude'}[sensor]
    assert all(e.reason == f'no {what} yet' for e in feed(online, data, period=5.0))


def test_order_between_sensors_does_not_matter():
    # Between two solutions the sensors may come one after the other.
    run = simulate('zyx', 12.0)
    data = measure(run, 8)
    mixed, sorted_ = identifier(), identifier()
    for stop in (6.0, 12.0):
        part = data.between(stop - 6.0 if stop > 6.0 else -1.0, stop)
        for event in events(part):
            getattr(mixed, event[1])(event[0], *event[2])
        for method in ('add_attitude', 'add_rate', 'add_joints'):
            for event in events(part):
                if event[1] == method:
                    getattr(sorted_, method)(event[0], *event[2])
        a, b = mixed.solve(), sorted_.solve()
        np.testing.assert_allclose(a.aam, b.aam, rtol=1e-9, atol=0)


@pytest.mark.parametrize(('lateness', 'delay'), [(0.5, 0.4), (2.0, 1.5)])
def test_late_and_disordered_samples_serve_as_well_as_prompt_ones(lateness, delay, rng):
    data = measure(simulate('zyx', 14.0), 2, attitude_every=50)
    prompt, late = identifier(lateness=lateness), identifier(lateness=lateness)
    in_order = [e for e in events(data) if e[1] != 'add_attitude' or not 5 < seconds(e) < 9]
    # the tracker, with a gap of four seconds, up to the delay late and in any order
    arrival = [
        seconds(e) + (delay * rng.uniform() if e[1] == 'add_attitude' else 0.0) for e in in_order
    ]
    for online, order in (
        (prompt, range(len(in_order))),
        (late, np.argsort(arrival, kind='stable')),
    ):
        due = 1.0
        for k in order:
            stamp, method, values = in_order[k]
            getattr(online, method)(stamp, *values)
            if method == 'add_joints' and seconds(in_order[k]) > due:
                online.solve()
                due += 1.0
    one, other = late.solve(), prompt.solve()
    assert one.valid
    same(one, other)


@pytest.mark.parametrize('sensor', ['joint', 'rate'])
def test_a_sensor_that_starts_long_after_the_others(sensor):
    run = simulate('zyx', 20.0)
    for start in (4.4, 5.5):
        estimates = feed(identifier(), cut(measure(run, 6), sensor, -1.0, start), period=2.0)
        assert_never_confidently_wrong(estimates, run)
        assert estimates[-1].valid


@pytest.mark.parametrize('sensor', ['joint', 'rate'])
def test_a_sensor_that_stops_and_comes_back(sensor):
    run = simulate('zyx', 30.0)
    data = cut(measure(run, 7), sensor, 12.0, 17.0)
    estimates = feed(identifier(), data, 1.0)
    assert_never_confidently_wrong(estimates, run)
    first = next(i for i, e in enumerate(estimates) if e.valid)
    assert all(e.valid for e in estimates[first:])
    std = [np.max(e.std[:3]) for e in estimates[first:]]
    assert std[-1] < 0.7 * std[12 - first]
    assert estimates[-1].samples > 2000


def test_what_waits_for_a_sensor_is_bounded():
    data = measure(simulate('zyx', 100.0, 'still'), 0, joint_every=5, rate_every=5)
    online = identifier(buffer=10.0)
    feed(online, cut(data, 'rate', -1.0, 99.9))
    assert max(len(s.stamps) for s in streams(online)) <= 20 * 71
