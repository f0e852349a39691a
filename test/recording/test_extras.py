"""User-named columns beside a motion: read, held against the motion's times, refused."""

from __future__ import annotations

import re

import numpy as np
import pytest
from support.models import Part, robot_of

from spacerobot_ros.effects.motion import Motion
from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.faults.extras import (
    bridged_extras,
    extra_faults,
    without_extra_spikes,
)
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps
from spacerobot_ros.recording.robot_inputs import with_inputs
from spacerobot_ros.recording.series import InputSeries
from spacerobot_ros.recording.tables.mapping import load_mapping

TIMES = np.linspace(0.0, 10.0, 101)
MAP = """
time: {columns: t, unit: s}
joints: {names: [a], position: {columns: q, unit: rad}, effort: {columns: u, unit: N m}}
extra: {motor_temp: {columns: temp, unit: degC}}
"""


def table(tmp_path, temperature):
    rows = [f'{t},{np.sin(t)},{np.cos(t)},{x}' for t, x in zip(TIMES, temperature, strict=True)]
    path = tmp_path / 'run.csv'
    path.write_text('\n'.join(['t,q,u,temp', *rows]))
    (tmp_path / 'map.yaml').write_text(MAP)
    return path, tmp_path / 'map.yaml'


def robot():
    return robot_of([Part('base_link', -1, 'base', 10.0, np.zeros(3), np.eye(3))], base='free')


def with_extra(stamps, values):
    joints = JointSeries(('a',), to_stamps(TIMES), np.sin(TIMES)[:, None])
    series = InputSeries(('temp',), to_stamps(np.asarray(stamps)), np.asarray(values)[:, None])
    return Record(joints=joints, inputs={'extra/temp': series}, source='run')


def test_a_column_is_read_in_the_unit_that_is_written(tmp_path):
    temperature = ['' if i % 10 else str(20.0 + i) for i in range(101)]
    path, mapping = table(tmp_path, temperature)
    assert dict(load_mapping(mapping).extra)['motor_temp'].unit == ('degC',)
    record = read_record(path, None, mapping)
    series = record.inputs['extra/motor_temp']
    assert series.units == ('degC',)
    np.testing.assert_array_equal(series.values[:, 0], np.arange(20.0, 121.0, 10.0))
    still = np.zeros((len(TIMES), 0))
    motion = Motion(with_inputs(robot(), record), TIMES, still, still, still)
    found = motion.extra['motor_temp']  # straight between its samples
    np.testing.assert_allclose(found, 20.0 + np.arange(101), rtol=0, atol=1e-9)


def test_a_column_that_never_changes_is_refused(tmp_path):
    path, mapping = table(tmp_path, [20.0] * 101)
    with pytest.raises(RecordingError, match='motor_temp: never changes: leave out an input'):
        read_record(path, None, mapping)


@pytest.mark.parametrize(
    ('stamps', 'message'),
    [
        (TIMES + 7.0, 'extra/temp: has samples from 7 s to 17 s, the joints .*: another clock'),
        (np.delete(TIMES, np.arange(40, 80)), 'extra/temp: lacks samples after 3.9 s'),
    ],
)
def test_another_clock_and_a_missing_part_are_refused(stamps, message):
    record = with_extra(stamps, np.linspace(20.0, 40.0, len(stamps)))
    (fault,) = extra_faults(record)
    assert re.match(message, f'{fault.place}: {fault.message}')
    # a slow one that covers the motion is none
    assert not list(extra_faults(with_extra(np.linspace(0.0, 9.9, 6), np.arange(6.0))))


def test_a_hole_that_is_bridged_is_said(tmp_path):
    """Of four periods, which lost samples may leave, nothing is said."""
    lacking = [str(20.0 + 0.1 * i) for i in range(101)]
    path, mapping = table(tmp_path, lacking[:40] + [''] * 12 + lacking[52:])
    (note,) = (n for n in read_record(path, None, mapping).notes if ': a hole' in n)
    assert note.startswith('extra/motor_temp: a hole of 1.3 s, 3.9 s after the start')
    values = np.linspace(20.0, 40.0, 98)
    assert not bridged_extras(with_extra(np.delete(TIMES, [40, 41, 42]), values))


def test_a_spike_is_left_out_and_said(tmp_path):
    temperature = 20.0 + TIMES
    temperature[30] = 850.0
    path, mapping = table(tmp_path, temperature)
    record = read_record(path, None, mapping)
    assert len(record.inputs['extra/motor_temp']) == 100
    said = 'extra/motor_temp: 1 sample of 101 left out, nowhere near its neighbours, the first 3 s'
    assert any(note.startswith(said) for note in record.notes)


def test_a_spike_of_few_samples_is_one_beyond_all_that_they_differ_by():
    times = np.linspace(0.0, 10.0, 11)
    slow = np.linspace(20.0, 25.0, 11)
    for at, value, kept in [(4, 85.0, 10), (10, -40.0, 10), (4, 22.5, 11)]:
        values = slow.copy()
        values[at] = value
        record = without_extra_spikes(with_extra(times, values))
        assert len(record.inputs['extra/temp']) == kept
    steps = np.where(times < 5.0, 0.0, 1.0)  # a switch, and a phase that begins anew
    phases = np.mod(0.9 * times, 2.0 * np.pi)
    for values in (steps, phases, np.eye(11)[3]):  # of one pulse nothing else is left
        assert len(without_extra_spikes(with_extra(times, values)).inputs['extra/temp']) == 11
