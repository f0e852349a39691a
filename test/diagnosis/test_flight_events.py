"""Events in flight: raised within a second, none in quiet flight, answered by the controller."""

from dataclasses import replace

import numpy as np
import pytest
from support.models import random_tree, robot_of

from spacerobot_ros.diagnosis.flight.block_innovations import Block
from spacerobot_ros.diagnosis.flight.event_watch import EventWatch
from spacerobot_ros.diagnosis.flight.monitor import Monitor
from spacerobot_ros.effects.catalogue import bind_effects
from spacerobot_ros.errors import MessageRejectedError
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from spacerobot_ros.simulation.plant import Plant
from validation.hidden.monitor_flights import Flight, in_flight, monitor_of

ONSET = 7.0
SHORT = {'learn': 4.0}
PUSH = {'effect': 'external_joint_torque', 'where': 'joint_2', 'start': 0.0, 'end': 0.8}


def raised(flight, samples):
    """Times at which an event is first said [s], with it; and the monitor."""
    monitor, out, count = monitor_of(flight, **SHORT), [], 0
    for step in samples:
        step.feed(monitor)
        state = monitor.step()
        if state.events > count:
            out.append((step.stamp_ns * 1e-9, state.event))
            count = state.events
    return out, monitor


@pytest.mark.parametrize(
    ('effect', 'kind', 'size'),
    [
        ({**PUSH, 'torque': 3.0}, 'external_joint_torque', {'joint_2': 3.0}),
        (
            {'effect': 'angular_impulse', 'start': 0.0, 'end': 0.3, 'x': 0.5, 'y': -0.3, 'z': 0.2},
            'angular_impulse',
            {'x': 0.5, 'y': -0.3, 'z': 0.2},
        ),
    ],
)
def test_what_acts_from_outside_is_raised_within_a_second(effect, kind, size):
    flight = Flight(seed=2, effects={'push': effect}, onset=ONSET, end=ONSET + 1.0)
    found, monitor = raised(flight, flight.samples(ONSET + 3.0))
    (when, first), event = found[0], monitor.state.event
    assert ONSET < when <= ONSET + 1.0
    assert abs(first.start - ONSET) <= 0.3  # parts of a quarter of a second
    assert len(found) == 1
    assert event.effect == kind
    assert not event.ongoing
    for name, value in size.items():
        # a bell's mean is half its peak; parts hold some of what is beside it
        expected = value if kind == 'angular_impulse' else 0.5 * value
        assert event.peak[name] == pytest.approx(expected, abs=0.4 * abs(max(size.values())))


@pytest.fixture(scope='module')
def quiet():
    """Return 11 s without a fault."""
    return list(Flight(seed=4).samples(11.0))


def test_none_in_quiet_flight_with_messages_lost_late_or_repeated(quiet, rng):
    monitor, waiting = monitor_of(Flight(seed=4), **SHORT), []
    for step in quiet:
        names = ('joints', 'omega', 'attitude_xyzw')
        gone = {n: None for n in names if rng.random() < 0.01}
        kept = replace(step, measured=replace(step.measured, **gone))
        waiting.append((step.stamp_ns + 50_000_000 * (rng.random() < 0.01), kept))
        due = [each for each in waiting if each[0] <= step.stamp_ns]
        waiting = [each for each in waiting if each[0] > step.stamp_ns]
        for _, late in due:
            late.feed(monitor)
            if rng.random() < 0.01 and late.measured.omega is not None:
                with pytest.raises(MessageRejectedError, match='duplicate stamp'):
                    monitor.add_rate(late.stamp_ns, late.measured.omega)
        monitor.step()
    assert monitor.state.events == 0, monitor.state.event
    assert monitor.state.alarms == 0, monitor.state.reason


@pytest.mark.parametrize(('name', 'size'), [('gyro_bias', 2e-4), ('star_turned', 1e-3)])
def test_a_fault_of_a_sensor_is_no_event(quiet, name, size):
    change = in_flight(name, size, Flight()).changed
    samples = [change(s) if s.stamp_ns * 1e-9 >= ONSET else s for s in quiet]
    found, monitor = raised(Flight(seed=4), samples[:1000])
    assert found == []
    assert monitor.state.alarms == 1


@pytest.mark.parametrize('answer', ['damp', 'hold'])
def test_the_controller_damps_or_holds_and_goes_on(answer):
    file = Flight(seed=4).file
    settings = file.settings.changed({'monitor.on_event': answer, 'controller.damping': 1.0})
    loop = ClosedLoop(file.robot, settings)
    push = {**PUSH, 'torque': 3.0, 'start': ONSET, 'end': ONSET + 0.8}
    effects = bind_effects({'push': push}, loop.plant.robot)
    plant = loop.plant
    loop.plant = Plant(plant.robot, plant.state, plant.period, plant.substeps, tuple(effects))
    monitor = Monitor(file.robot, replace(settings.monitor, **SHORT), file.effects)
    times, words, rates, efforts = [], [], [], []
    for step in loop.run(1300):
        step.feed(monitor)
        event = monitor.step().event
        said = event.in_words() if event is not None and event.ongoing else ''
        loop.controller.event.hear(said, step.stamp_ns)
        times.append(step.stamp_ns * 1e-9)
        words.append(step.command.reason)
        rates.append(np.max(np.abs(step.state.qd)))
        efforts.append(step.command.tau)
    answered = np.array([bool(said) for said in words])
    times, rates = np.array(times), np.array(rates)
    assert ONSET < times[answered][0] <= ONSET + 1.0
    assert times[answered][-1] < ONSET + 4.0
    assert rates[answered][-1] < 0.25 * rates[answered][0]
    assert rates[times > times[answered][-1]].max() > 1.5 * rates[answered][-1]  # it goes on
    steps = np.max(np.abs(np.diff(efforts, axis=0)), axis=1)
    # easing from 160 N m over a quarter of a second makes 7 N m a sample; a step at once, 120
    taken = np.flatnonzero(answered)[0]
    assert np.max(steps[taken - 5 : taken + 100]) < 25.0


def test_joints_that_hardly_differ_have_an_event_all_the_same(rng):
    """Only together they explain it: by the usual scatter none stands out beside the other."""
    robot = robot_of(random_tree(rng, [0, 1]), base='fixed')
    watch, scatter = EventWatch(robot, (), 1), 8.0
    own = np.repeat([1.0, 0.0], 20)
    columns = np.stack([own, own + rng.normal(0.0, 0.05, 40)], axis=-1)
    index, none = np.zeros(40, dtype=int), np.zeros((40, 0))

    def add(start, data):
        watch.add(Block(index, index, own, data, none, none, columns[:, None]), start, start + 0.1)

    for k in range(40):
        add(0.1 * k, scatter * rng.normal(size=40))
    assert watch.event is None
    add(4.0, columns @ [550.0, -520.0])
    assert watch.event.effect == 'external_joint_torque'
    assert watch.event.in_words().startswith('external_joint_torque at ')
