"""Records too long for memory: sums over stretches are those of the whole, and name the same."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from spacerobot_ros.diagnosis.arms.arm_hypotheses import add_blocks, no_blocks
from spacerobot_ros.diagnosis.arms.long_arm import Stretches
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.diagnosis.search.linear_rows import CandidateColumns, LinearRows
from spacerobot_ros.diagnosis.search.long_flight import Flight
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.estimation import stretches
from spacerobot_ros.estimation.balance.arm_levels import leftover_levels
from spacerobot_ros.estimation.balance.arm_rows import ArmRows
from spacerobot_ros.estimation.balance.balance import balance_of
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.stretches import MOST_MEMORY, PER_SAMPLE, LongRecord
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.inference.gram import sum_of
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / 'validation' / 'bench'))
import scaling

KINDS = [CATALOGUE[name] for name in (*scaling.FEW, 'inertial_parameters')]


@pytest.fixture
def small_memory(monkeypatch):
    """Any record is too long; stretches are as long as is asked, 20 s at first."""
    monkeypatch.setattr(stretches, 'MOST_MEMORY', 1e3)
    monkeypatch.setattr(stretches, 'STRETCH_MEMORY', 1e3)
    return lambda least: monkeypatch.setattr(stretches, '_LEAST', least)


@pytest.fixture
def arm(tmp_path):
    return load_robot_file(scaling.robot_file(2, False, tmp_path))


@pytest.fixture
def flyer(tmp_path):
    return load_robot_file(scaling.robot_file(2, True, tmp_path, 'free'))


def two_hours(n=7, duration=7200.0, rate=100.0):
    stamps = (1e9 / rate * np.arange(round(duration * rate))).astype(np.int64)
    joints = JointSeries(tuple(f'j{k}' for k in range(n)), stamps, np.zeros((len(stamps), n)))
    return Record(joints, RateSeries(stamps - 5_000_000, np.zeros((len(stamps), 3))))


def named(found):
    return {c.applied.key: c for c in (*found.causes, *found.minor)}


def coefficient(found):
    (cause,) = named(found).values()
    assert cause.applied.key == ('joint_viscous_friction', 'joint_2')
    return cause.parameters['coefficient']


def test_every_sample_is_in_one_stretch_and_stretches_are_small():
    record = two_hours()
    every = LongRecord.of(record).every
    assert sum(len(p.rate_time) for p in every) == len(record.rate_time)
    times = np.concatenate([p.joint_time for p in every])
    np.testing.assert_array_equal(times, record.joint_time)
    need = PER_SAMPLE * max(len(p.joint_time) for p in every) * 7**2
    assert need < 0.2 * MOST_MEMORY
    assert all(LongRecord.of(short) is None for short in (every[0], two_hours(3, 60.0)))


def test_the_sample_is_spread_and_has_every_joint_that_moves(small_memory):
    stamps = (1e7 * np.arange(40_000)).astype(np.int64)
    q = np.zeros((len(stamps), 2))
    q[:, 0] = np.sin(1e-2 * np.arange(len(stamps)))
    q[8_500:9_500, 1] = np.sin(1e-2 * np.arange(1_000))  # in the fifth of 20 stretches alone
    long = LongRecord.of(Record(JointSeries(('a', 'b'), stamps, q)))
    assert len(long.every) == 19
    fifths = [own.tolist() for own in np.array_split(np.arange(19), 5)]
    assert all(set(own) & set(long.sample) for own in fifths)
    at = int(np.argmax([np.ptp(own.q[:, 1]) for own in long.every]))
    assert at in long.sample


def test_sums_of_an_arm_are_those_of_the_whole(arm, small_memory):
    """Exactly, as recordings; of an uncut record up to the ends, and slow errors that go on."""
    record = observed(scaling.record_of(arm.robot, 80.0), arm.robot)
    rows = ArmRows.of([balance_of(record, arm.robot, ())], KINDS)
    levels = leftover_levels(rows, rows.deviations(range(len(rows.candidates))), rows.friction)
    cut = Stretches.of(LongRecord.of(record).every, arm.robot)
    blocks = no_blocks(rows)
    for own in cut.rows(rows, (), lambda own, records, spans: own):
        add_blocks(blocks, own.clusters(cut.blocks_of_each), levels)
    together = sum_of(rows.along([*cut.balances(())]).parts(levels))
    np.testing.assert_allclose(blocks.whole.matrix, together.matrix, rtol=1e-9)
    np.testing.assert_allclose(blocks.whole.vector, together.vector, rtol=1e-9)
    whole = sum_of(rows.parts(levels))
    assert 0.95 < blocks.whole.rows / whole.rows < 1.0
    weak = np.diag(rows.sizes**-2.0)
    one, other = (np.linalg.solve(g.matrix + weak, g.vector) for g in (whole, blocks.whole))
    deviations = np.sqrt(np.diag(np.linalg.inv(whole.matrix + weak)))
    assert np.max(np.abs(one - other) / deviations) < 1.0


def test_sums_of_a_flight_are_those_of_the_whole(flyer, small_memory):
    """But for what each stretch needs to find its own state."""
    record = observed(scaling.record_of(flyer.robot, 80.0), flyer.robot)
    noise, _ = noise_levels(flyer.robot.sensors, record)
    fit = Fit(Run(record, flyer.robot, (), noise), ())
    columns = CandidateColumns.of(fit, KINDS)
    whole = LinearRows(fit, columns).blocks(fit.data).whole
    flight = Flight.of(LongRecord.of(record).every, fit.run)
    rows, blocks = flight.summed((), columns.candidates)
    assert [h.key for h in rows.hypotheses] == [h.key for h in LinearRows(fit, columns).hypotheses]
    assert len(blocks.grams(np.arange(1))) >= 30
    sizes = np.concatenate([c.sizes for c in columns.candidates])
    told = np.sqrt(np.diag(whole.matrix)) * sizes > 30.0
    ratios = np.diag(blocks.whole.matrix)[told] / np.diag(whole.matrix)[told]
    assert np.all((ratios > 0.9) & (ratios < 1.03))
    assert blocks.whole.rows == pytest.approx(whole.rows, rel=1e-3)


@pytest.mark.parametrize('base', ['fixed', 'free'])
def test_just_above_the_limit_the_answer_is_that_of_just_below(base, tmp_path, small_memory):
    file = load_robot_file(scaling.robot_file(2, True, tmp_path, base))
    record = scaling.record_of(file.robot, 60.02)
    small_memory(40.0)  # two stretches would be shorter
    below = diagnose(record, file.robot, file.effects, KINDS)
    small_memory(20.0)
    above = diagnose(record, file.robot, file.effects, KINDS)
    assert not any('too long' in note for note in below.notes)
    assert any('3 stretches of 20 s were summed' in note for note in above.notes)
    assert above.verdict == below.verdict == 'explained'
    one, other = coefficient(below), coefficient(above)
    assert abs(one.value - other.value) < max(one.std, other.std)
    assert abs(other.value - scaling.HIDDEN) < 4.0 * other.std
    if base == 'free':  # the same rows: no less is known but for what finds each state
        assert other.std == pytest.approx(one.std, rel=0.3)
        assert other.std > 0.8 * one.std
        assert above.fit_p > 1e-3
    for series in above.series:
        assert series.time[-1] - series.time[0] > 50.0


@pytest.mark.parametrize(('base', 'std', 'hidden'), [('fixed', 1.0, 0.15), ('free', 0.5, 0.06)])
def test_what_no_stretch_shows_all_of_them_do(
    base, std, hidden, tmp_path, small_memory, monkeypatch
):
    monkeypatch.setattr(scaling, 'HIDDEN', hidden)
    monkeypatch.setitem(scaling.STD, 'joint_effort_std', std)
    file = load_robot_file(scaling.robot_file(2, base == 'free', tmp_path, base))
    record = scaling.record_of(file.robot, 165.0)
    small_memory(20.0)
    for own in LongRecord.of(record).every[::5]:
        small_memory(100.0)
        assert not named(diagnose(own, file.robot, file.effects, KINDS))
    small_memory(20.0)
    found = coefficient(diagnose(record, file.robot, file.effects, KINDS))
    assert abs(found.value - hidden) < 4.0 * found.std
    assert found.value > 4.0 * found.std


def test_a_long_rest_is_refused(arm, small_memory):
    record = scaling.record_of(arm.robot, 60.0)
    noise = scaling.STD['joint_position_std'] * np.random.default_rng(1).normal(
        size=record.q.shape
    )
    effort = 0.05 * np.random.default_rng(2).normal(size=record.q.shape)
    joints = JointSeries(arm.robot.joints, record.joints.stamp_ns, noise, None, effort)
    with pytest.raises(RecordingError, match='no joint moves'):
        diagnose(Record(joints), arm.robot, (), KINDS)


def test_a_push_in_a_stretch_is_named_and_its_time_left_out(arm, small_memory):
    record = scaling.record_of(arm.robot, 100.0)
    time = record.joint_time
    pulse = 20.0 * np.sin(np.pi * np.clip((time - 70.0) / 0.5, 0.0, 1.0)) ** 2
    effort = record.effort + pulse[:, None] * [0.0, 1.0]
    joints = JointSeries(arm.robot.joints, record.joints.stamp_ns, record.q, None, effort)
    found = diagnose(Record(joints), arm.robot, (), KINDS)
    (event,) = found.events.named
    assert 69.5 < event.start < event.end < 71.0
    assert abs(coefficient(found).value - scaling.HIDDEN) < 4.0 * coefficient(found).std


def test_noise_of_a_light_joints_efforts_is_no_gain(tmp_path, small_memory):
    """Its columns alone promise 20 nats of a gain of 0.8; a model that has it loses 40."""
    file = load_robot_file(scaling.robot_file(7, True, tmp_path, 'free'))
    kinds = [CATALOGUE[name] for name in ('joint_viscous_friction', 'joint_torque_constant')]
    found = diagnose(scaling.record_of(file.robot, 82.0), file.robot, (), kinds)
    assert abs(coefficient(found).value - scaling.HIDDEN) < 4.0 * coefficient(found).std


def test_currents_of_a_long_record_tell_their_constants(arm, small_memory):
    record = scaling.record_of(arm.robot, 60.02)
    names = arm.robot.joints
    stamps, currents = record.joints.stamp_ns, record.effort / 0.5
    joints = JointSeries(names, stamps, record.q, None, currents, in_amperes=names)
    kinds = [*KINDS, CATALOGUE['joint_torque_constant']]
    found = diagnose(Record(joints), arm.robot, (), kinds)
    assert 'too long' in ''.join(found.notes)
    constants = [c for c in found.causes if c.applied.id == 'motor_constant']
    assert [c.applied['constant'] for c in constants] == pytest.approx([0.5, 0.5], rel=0.05)
