"""Steps of a free base's momentum: found beside wheels that nobody knows, none where none is."""

from __future__ import annotations

import numpy as np
import pytest

from spacerobot_ros.diagnosis import diagnose
from spacerobot_ros.diagnosis.events import transient_search as search
from spacerobot_ros.diagnosis.events.event import Events, PossibleEvent
from spacerobot_ros.diagnosis.events.impulses import spans_of, steps_beside_usual
from spacerobot_ros.effects.catalogue import CATALOGUE, bind_effect
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from validation.hidden.diagnosis_scenario import robot_file, simulated

STEPS = ((4.0, 4.1, (0.1, -0.15, 0.08)), (9.0, 9.8, (-0.3, 0.2, 0.4)))
"""Start, end [s] and impulse [N m s] along inertial axes."""


@pytest.fixture(scope='module')
def robot():
    """Wheels of 42, 49 and 41 N m s that the file does not know."""
    return robot_file('servicer').robot.with_target_momentum(np.zeros(3))


def run_of(robot, steps, duration=13.0):
    effects = [
        bind_effect(
            f'bump_{start:g}',
            'angular_impulse',
            None,
            {'start': start, 'end': end, **dict(zip('xyz', impulse, strict=True))},
            robot,
        )
        for start, end, impulse in steps
    ]
    record = observed(simulated('servicer', 'default', 3, effects, duration=duration), robot)
    return Run(record, robot, (), noise_levels(robot.sensors, record)[0], 'held_before')


@pytest.fixture(scope='module')
def bumped(robot):
    run = run_of(robot, STEPS)
    return run, steps_beside_usual(run)[0]


def test_impulses_are_named_with_time_and_size(bumped):
    named = bumped[1].named
    assert len(named) == len(STEPS)
    for event, (start, end, impulse) in zip(named, STEPS, strict=True):
        off = 0.5 * (event.start + event.end) - 0.5 * (start + end)
        assert abs(off) < 4.0 * event.middle_std < 0.1
        found = np.array([event.peak[axis] for axis in 'xyz'])
        stds = np.array([event.peak_std[axis] for axis in 'xyz'])
        # the standard deviation, and a share for the shape: 3 % of the whole
        off = 4.0 * np.linalg.norm(stds) + 0.03 * np.linalg.norm(impulse)
        assert np.linalg.norm(found - impulse) < off < np.linalg.norm(impulse)


def test_two_that_one_would_cover_are_two(robot):
    """0.4 s apart; one of 2.8 s explains most of both, and 2,000 less in chi-square."""
    pair = (8.0, 9.0, (0.6, 0.3, -0.6)), (9.4, 9.5, (0.3, 0.15, -0.3))
    named = steps_beside_usual(run_of(robot, pair))[0].named
    for event, (start, end, _) in zip(named, pair, strict=True):
        off = 0.5 * (event.start + event.end) - 0.5 * (start + end)
        assert abs(off) < 4.0 * event.middle_std < 0.1


def test_as_many_as_are_looked_for_are_named(bumped, monkeypatch):
    monkeypatch.setattr(search, '_MOST', len(STEPS))
    assert len(steps_beside_usual(bumped[0])[0].named) == len(STEPS)


def test_what_changes_all_the_time_is_no_step(robot, monkeypatch, rng):
    monkeypatch.setattr(search, '_MOST', 4)
    walk = [(0.6 * k, 0.6 * (k + 1), rng.normal(size=3)) for k in range(12)]
    events = steps_beside_usual(run_of(robot, walk, 8.0))[0]
    assert events.named == events.possible == ()
    assert 'is no noise' in events.notes[0]


def test_limits_know_that_the_wheels_are_unknown(bumped):
    event, limits = bumped[1].named[0], bumped[1].limits
    for axis in 'xyz':
        std = limits[axis].peak / limits[axis].snr  # of 0.3 s anywhere, against 0.1 s at 4 s
        assert std == pytest.approx(event.peak_std[axis], rel=0.4)


def test_what_lasts_is_as_without_them(bumped):
    """Their times left out, the true wheels leave noise; with them they do not."""
    run, events = bumped
    wheels = bind_effect(
        'wheels', 'target_wheel_momentum', 'link_3', {'x': 42.0, 'y': 49.0, 'z': 41.0}, run.robot
    )
    left = {}
    for spans in ((), spans_of(events)):
        data = Fit(run.without(spans), [wheels]).data
        left[bool(spans)] = float(np.mean(data**2))
    assert left[False] > 1.5
    assert left[True] < 1.05


def test_a_quiet_record_has_none(robot):
    events = steps_beside_usual(run_of(robot, ()))[0]
    assert not events.named
    assert all(0.0 < limit.peak < 0.2 for limit in events.limits.values())


@pytest.mark.parametrize(('duration', 'asked'), [(1.0, None), (2.0, None), (2.5, (0.05, 0.3))])
def test_a_short_record_is_asked_for_what_fits_into_it(robot, duration, asked):
    events = steps_beside_usual(run_of(robot, (), duration))[0]
    assert not events.named
    if asked is None:
        assert set(events.limits.values()) == {None}
        assert 'too short' in events.notes[0]
    else:
        assert {limit.durations for limit in events.limits.values()} == {asked}


@pytest.mark.parametrize('lasts', [True, False])
def test_steps_that_are_not_named_hide_no_cause_that_lasts(bumped, robot, monkeypatch, lasts):
    """A torque in space, beside which its steps are superfluous; steps that are real stay."""
    run, found = bumped
    weak = tuple(
        PossibleEvent(start=e.start, end=e.end, joints=(), z=e.z, reason='weak', applied=e.applied)
        for e in found.named
    )
    kind = CATALOGUE['external_torque_inertial' if lasts else 'target_wheel_momentum']
    if lasts:
        torque = kind(name='torque', where=None, values={'x': 0.02, 'y': -0.02, 'z': 0.02})
        known = robot_file('servicer').robot
        record = observed(simulated('servicer', 'default', 3, [torque], 10.0), known)
        run = Run(record, known, (), run.noise, 'held_before')
    steps = Events(possible=weak, limits=found.limits)

    def seen(run, causes=()):
        return (Events() if causes else steps), ()

    monkeypatch.setattr(diagnose, 'steps_beside_usual', seen)
    said, kept = diagnose._in_flight(run, [kind], lambda what, share: None)
    assert said.fit.run.left_out == (() if lasts else spans_of(steps))
    assert [c.id for c in said.fit.causes] == [kind.id]
    assert bool(kept.possible) != lasts
