"""The monitor: silent where the model is right, quick and right about the channel where not."""

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.diagnosis.flight.block_innovations import BlockInnovations
from spacerobot_ros.diagnosis.flight.observed import Observations
from spacerobot_ros.errors import MessageRejectedError
from validation.hidden.monitor_flights import (
    FAULTS,
    Flight,
    in_flight,
    monitor_of,
    watch,
)

ONSET = 6.0
SHORT = {'learn': 5.0}


@pytest.fixture(scope='module')
def nominal():
    """Return 30 s without a fault."""
    return list(Flight(seed=4).samples(30.0))


def alarms(monitor, samples):
    """Raised and cleared: (time, what spoke first, reason) and times."""
    raised, cleared, was = [], [], None
    for state in watch(monitor, samples):
        if state.raised_ns is not None and was is None:
            raised.append((state.raised_ns * 1e-9, state.first, state.reason))
        if state.raised_ns is None and was is not None:
            cleared.append(state.judged_ns * 1e-9)
        was = state.raised_ns
    return raised, cleared


def test_silent_where_the_model_is_right_and_the_momentum_is_found(nominal):
    flight = Flight(seed=4)
    monitor = monitor_of(flight, **SHORT)
    assert alarms(monitor, nominal) == ([], [])
    state = monitor.state
    assert state.level == 'ok', state.reason
    assert 'held torque' in state.notes[0]  # a sampled controller holds its torque
    truth = np.array(flight.file.settings.truth.target_momentum)
    # 4 standard deviations: one in 5000 seeds fails
    assert np.all(np.abs(np.array(state.momentum) - truth) < 4 * np.array(state.momentum_std))
    assert max(state.momentum_std) < 0.05  # of 76 N m s, after half a minute
    floors = [c.rms for c in state.channels if np.isfinite(c.rms)]
    assert min(floors) > 0.8  # few samples of the tracker
    assert max(floors) < 1.2


def test_samples_that_are_left_out_at_an_end_are_a_gap(nominal):
    # a reference beyond its samples is off by any amount, and so is all that is judged about it
    robot = Flight(seed=4).file.robot
    observed = Observations(robot, ())
    observed.has_gyro = True
    for k, sample in enumerate(nominal[:301]):
        is_off = k > 288
        sample.feed(observed.samples if not is_off else Moved(observed.samples, 0.01))
    last_ns = nominal[300].stamp_ns
    record = observed.record(0, last_ns, robot, None)
    assert record.joint_time[-1] < 1e-9 * last_ns - 0.1
    assert observed.gap_end is not None


class Moved:
    """Who takes samples, with joints moved by a little [rad]."""

    def __init__(self, taker, by):
        self._taker, self._by = taker, by
        self.add_rate, self.add_attitude = taker.add_rate, taker.add_attitude

    def add_joints(self, stamp_ns, q, qd, effort):
        self._taker.add_joints(stamp_ns, q + self._by, qd, effort)


@pytest.mark.parametrize(('name', 'size'), [('gyro_bias', 5e-5), ('star_turned', 1e-3)])
def test_sensor_fault_is_raised_and_named(nominal, name, size):
    change = in_flight(name, size, Flight()).changed
    samples = [change(s) if s.stamp_ns * 1e-9 >= ONSET else s for s in nominal[:900]]
    raised, _ = alarms(monitor_of(Flight(seed=4), **SHORT), samples)
    when, first, reason = raised[0]
    assert ONSET <= when <= ONSET + 2.0
    assert first.startswith(FAULTS[name].channels), first
    assert 'unexplained' in reason or 'a jump of' in reason
    assert len(raised) == 1


@pytest.mark.parametrize(
    ('name', 'size', 'within'),
    [
        ('coulomb_friction', 0.3, 2.0),
        ('payload', 10.0, 2.0),
        ('thruster_leak', 0.1, 2.0),
        ('wheel_drag', 3e-3, 4.0),
    ],
)
def test_fault_of_the_machine_is_raised_and_named(name, size, within):
    flight = in_flight(name, size, Flight(seed=2, onset=ONSET))
    states = watch(monitor_of(flight, **SHORT), flight.samples(ONSET + 0.5 + within))
    alarm = next((s for s in states if s.raised_ns is not None), None)  # flown no further
    assert alarm, 'no alarm'
    assert ONSET <= alarm.raised_ns * 1e-9 <= ONSET + within
    assert alarm.first.startswith(FAULTS[name].channels), alarm.first


def test_alarm_ends_when_the_fault_does(nominal):
    change = in_flight('gyro_bias', 2e-4, Flight()).changed
    end = ONSET + 1.0
    samples = [change(s) if ONSET <= s.stamp_ns * 1e-9 < end else s for s in nominal]
    monitor = monitor_of(Flight(seed=4), clear_after=2.0, **SHORT)
    raised, cleared = alarms(monitor, samples)
    assert len(raised) == len(cleared) == 1
    assert cleared[0] - end < 20.0  # 8 s of window, 2 nats at half a nat a second, and chance
    assert monitor.state.level != 'error'


@pytest.mark.parametrize('size', [0.01, 1e200])
def test_outliers_are_no_alarm_and_counted(nominal, size):
    monitor, bad = monitor_of(Flight(seed=4), **SHORT), {'joints': 0, 'imu': 0}
    rng = np.random.default_rng(1)

    def spoilt(step):
        measured = step.measured
        if step.stamp_ns > 2e9 and rng.random() < 0.01:
            bad['imu'] += 1
            measured = replace(measured, omega=measured.omega + size * np.array([1.0, -1.0, 0.0]))
        if step.stamp_ns > 2e9 and rng.random() < 0.01:
            bad['joints'] += 1
            position = measured.joints.position + np.array([0.0, size, 0.0])
            measured = replace(measured, joints=replace(measured.joints, position=position))
        return replace(step, measured=measured)

    assert alarms(monitor, map(spoilt, nominal[:1500])) == ([], [])
    # those of the last blocks are not judged yet; 30 neighbours of 3000 at most are taken along
    for sensor, count in bad.items():
        assert count - 3 <= monitor.left_out[sensor] <= count + 15, sensor


@pytest.mark.parametrize('size', [1e155, 1e308])
@pytest.mark.parametrize('at', [2.0, 8.0], ids=['learning', 'judging'])
def test_efforts_near_the_largest_number_end_nothing_where_no_limit_is_known(nominal, size, at):
    flight = Flight(seed=4)
    monitor = monitor_of(flight, **SHORT)
    monitor._largest_efforts = np.full(3, np.inf)  # as of a URDF without limits
    k = next(k for k, s in enumerate(nominal) if s.stamp_ns * 1e-9 >= at and s.measured.joints)
    joints = replace(nominal[k].measured.joints, effort=np.array([0.0, size, 0.0]))
    odd = replace(nominal[k], measured=replace(nominal[k].measured, joints=joints))
    alarms(monitor, [*nominal[:k], odd, *nominal[k + 1 : 1400]])
    assert monitor.state.level == 'ok', monitor.state.reason
    assert np.all(np.isfinite(monitor.state.momentum))


def test_predictions_that_are_no_numbers_spoil_nothing(nominal, monkeypatch):
    run, calls = BlockInnovations.run, []

    def lost_once(self, *columns):
        calls.append(self)
        return run(self, *columns) * (np.nan if len(calls) == 40 else 1.0)

    monkeypatch.setattr(BlockInnovations, 'run', lost_once)
    monitor = monitor_of(Flight(seed=4), **SHORT)
    states = list(watch(monitor, nominal[:1400]))
    assert any('not finite' in s.reason for s in states)
    assert monitor.state.level == 'ok', monitor.state.reason
    off = np.array(monitor.state.momentum) - Flight().file.settings.truth.target_momentum
    assert np.all(np.abs(off) < 4 * np.array(monitor.state.momentum_std))


def test_gaps_and_absent_sensors_are_no_alarm(nominal):
    def without(step, **sensors):
        return replace(step, measured=replace(step.measured, **sensors))

    def drop(step):
        t = step.stamp_ns * 1e-9
        if 6.0 < t < 9.5:  # everything is silent
            return without(step, joints=None, omega=None, attitude_xyzw=None)
        if 11.0 < t < 14.0:
            return without(step, omega=None)
        if 16.0 < t < 18.0:
            return without(step, attitude_xyzw=None)
        return without(step, joints=None) if step.stamp_ns % 70_000_000 == 0 else step

    monitor = monitor_of(Flight(seed=4), **SHORT)
    assert alarms(monitor, [drop(s) for s in nominal[:2000]]) == ([], [])
    assert monitor.state.level in ('ok', 'warn'), monitor.state.reason


@pytest.mark.parametrize(
    ('sensors', 'share'),
    [
        (('joints',), 1.0),  # pause for less than is thought a new segment
        (('omega',), 1.0),
        (('joints', 'omega', 'attitude_xyzw'), 0.9),
    ],
)
def test_messages_that_are_lost_for_a_second_are_no_alarm(nominal, rng, sensors, share):
    def starved(step):
        lost = share if 7.3 < step.stamp_ns * 1e-9 < 8.5 else 0.05
        gone = {s: None for s in sensors if rng.random() < lost}
        return replace(step, measured=replace(step.measured, **gone))

    monitor = monitor_of(Flight(seed=4), **SHORT)
    states = list(watch(monitor, [starved(s) for s in nominal[:1400]]))
    assert states[-1].alarms == 0, states[-1].reason
    assert states[-1].level in ('ok', 'warn'), states[-1].reason
    assert any('silent for a while' in state.reason for state in states)


def test_a_gyro_that_starts_late_is_waited_for(nominal):
    late = [
        replace(s, measured=replace(s.measured, omega=None)) if s.stamp_ns < 3.4e9 else s
        for s in nominal[:1200]
    ]
    monitor = monitor_of(Flight(seed=4), **SHORT)
    assert alarms(monitor, late) == ([], [])
    assert monitor.state.level in ('ok', 'warn'), monitor.state.reason


def test_order_within_what_is_not_yet_judged_does_not_matter(nominal):
    first, second = (monitor_of(Flight(seed=4), **SHORT) for _ in range(2))
    part = nominal[:700]
    shuffled = [s for k in range(0, len(part), 10) for s in reversed(part[k : k + 10])]
    states = [list(watch(m, s))[-1] for m, s in ((first, part), (second, shuffled))]
    for a, b in zip(states[0].channels, states[1].channels, strict=True):
        assert a == b or np.isnan(a.rms)


@pytest.mark.parametrize(
    ('give', 'reason'),
    [
        (lambda m: m.add_rate(5, np.array([np.nan, 0, 0])), 'not finite'),
        (lambda m: m.add_rate(5, np.zeros(2)), 'has 2 entries, expected 3'),
        (lambda m: m.add_rate(0, np.zeros(3)), 'duplicate stamp'),
        (lambda m: m.add_attitude(5, np.array([0, 0, 0, 1.1])), 'norm 1.1'),
        (lambda m: m.add_joints(5, np.zeros(2), np.zeros(3), None), 'position has 2 entries'),
        (lambda m: m.add_joints(5, np.zeros(3), np.zeros(3), np.full(3, np.inf)), 'effort is not'),
        (lambda m: m.add_joints(5, np.zeros(3), np.zeros(3), np.zeros(2)), 'effort has 2 entries'),
        (lambda m: m.add_joints(5, *np.zeros((2, 3)), np.array([0, 0, -3e4 - 1])), '10 times its'),
    ],
)
def test_bad_samples_are_refused(give, reason):
    monitor = monitor_of(Flight())
    monitor.add_rate(0, np.zeros(3))
    with pytest.raises(MessageRejectedError, match=reason):
        give(monitor)


def test_what_is_judged_already_is_too_late(nominal):
    monitor = monitor_of(Flight(seed=4), **SHORT)
    for _ in watch(monitor, nominal[:700]):
        pass
    with pytest.raises(MessageRejectedError, match='too late'):
        monitor.add_rate(1_005_000_000, np.zeros(3))
