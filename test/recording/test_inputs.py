"""Measured inputs: read with names and units, kept by every cut, saved, refused when void."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from spacerobot_ros.errors import RecordingError
from spacerobot_ros.recording.faults.gaps import split_at_gaps
from spacerobot_ros.recording.npz import load_npz, save_npz
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record
from spacerobot_ros.recording.series import InputSeries
from spacerobot_ros.recording.tables.sample_clock import rebuilt
from test.support.lone_body import box_file

SECOND = 10**9


def commands(times, columns):
    stamps = np.round(np.array(times) * 1e9).astype(int)
    return InputSeries(('A', 'B'), stamps, np.array(columns, dtype=float), ('', 'N'))


@pytest.fixture
def record():
    """Ten seconds of a gyro at 1 Hz, and commands of which some come before it."""
    rates = RateSeries(np.arange(1, 11) * SECOND, np.ones((10, 3)))
    given = commands([0.0, 2.5, 6.5], [[0, 1], [1, 2], [0, 3]])
    return Record(rates=rates, inputs={'thrusters': given}, source='made')


def test_a_cut_keeps_the_command_that_still_holds(record):
    part = record.between(3.0, 5.0)  # counted from the gyro's first sample at 1 s: 4 s to 6 s

    np.testing.assert_array_equal(part.rates.stamp_ns, np.array([5, 6]) * SECOND)
    kept = part.inputs['thrusters']
    np.testing.assert_array_equal(kept.stamp_ns, [2_500_000_000])
    np.testing.assert_array_equal(kept.column('B'), [2.0])
    assert kept.units == ('', 'N')


def test_npz_gives_back_the_same(record, tmp_path):
    free = InputSeries(
        ('motor temperature',), np.array([4, 9]), np.array([[20.0], [21.5]]), ('K',)
    )
    saved = replace(record, inputs={**record.inputs, 'oven': free})
    save_npz(saved, tmp_path / 'r.npz')

    again = load_npz(tmp_path / 'r.npz')

    assert set(again.inputs) == {'thrusters', 'oven'}
    for key, series in saved.inputs.items():
        assert (again.inputs[key].names, again.inputs[key].units) == (series.names, series.units)
        np.testing.assert_array_equal(again.inputs[key].stamp_ns, series.stamp_ns)
        np.testing.assert_array_equal(again.inputs[key].values, series.values)


def test_a_split_gives_each_stretch_its_own():
    time = np.concatenate([np.arange(0.0, 4.0, 0.01), np.arange(9.0, 13.0, 0.01)])
    stamps = np.round(time * 1e9).astype(int)
    joints = JointSeries(('j',), stamps, np.sin(time)[:, None])
    given = commands([1.0, 8.0, 10.0], [[0, 1], [1, 1], [0, 2]])

    first, second = split_at_gaps(Record(joints=joints, inputs={'thrusters': given}))

    np.testing.assert_array_equal(first.inputs['thrusters'].stamp_ns, [SECOND])
    np.testing.assert_array_equal(
        second.inputs['thrusters'].stamp_ns, np.array([1, 8, 10]) * SECOND
    )


REFUSALS = {
    'shape': (lambda: commands([0.0, 1.0], [[0, 1]]), r'expected shape \(2, 2\), got \(1, 2\)'),
    'not finite': (lambda: commands([0.0], [[0, np.nan]]), r'\[0\] \(B\): nan is not finite'),
    'backwards': (lambda: commands([1.0, 0.0], [[0, 1]] * 2), 'is not after'),
    'no column': (lambda: InputSeries((), np.array([0]), np.zeros((1, 0))), 'not empty'),
    'units': (
        lambda: InputSeries(('a',), np.array([0]), np.ones((1, 1)), ('N', 'N')),
        'has 2 entries, expected 1',
    ),
}


@pytest.mark.parametrize(('make', 'message'), REFUSALS.values(), ids=REFUSALS.keys())
def test_series_that_are_none(make, message):
    with pytest.raises(RecordingError, match=message):
        make()


TABLE = """t,n,wx,u,mx,fx,x
0,10,0.1,"[0, 1]",500,1,1000
1,11,0.2,"[1, 1]",400,2,1001
2,12,0.3,"[1, 0]",300,3,1003
"""
MAPPING = """
time: {columns: t, unit: s}
gyro: {columns: [wx, wx, wx], unit: rad/s}
"""
INPUTS = {
    'thrusters': "thrusters: {names: [A, B], command: {columns: ['u[0]', 'u[1]']}}",
    'wrench': 'base_wrench: {columns: [fx, fx, fx, wx, wx, wx], '
    'unit: [mN, mN, mN, N m, N m, N m]}',
    'field': 'magnetic_field: {columns: [mx, mx, mx], unit: mG}',
    'position': 'base_position: {columns: [x, null, null], unit: mm}',
}


@pytest.fixture(scope='module')
def robot(tmp_path_factory):
    thrusters = {
        name: {'at': [0.1, 0.0, 0.0], 'direction': [0.0, 1.0, 0.0], 'force': 1.0} for name in 'AB'
    }
    return box_file(tmp_path_factory.mktemp('box'), robot={'thrusters': thrusters}).robot


@pytest.fixture
def read(tmp_path, robot):
    def go(*entries, table=TABLE):
        (tmp_path / 'run.csv').write_text(table)
        (tmp_path / 'map.yaml').write_text(MAPPING + '\n'.join(entries))
        return read_record(tmp_path / 'run.csv', robot, tmp_path / 'map.yaml')

    return go


def test_inputs_of_a_table_come_in_si(read):
    inputs = read(*INPUTS.values()).inputs

    np.testing.assert_array_equal(inputs['thrusters'].values, [[0, 1], [1, 1], [1, 0]])
    assert inputs['thrusters'].names == ('A', 'B')
    np.testing.assert_allclose(inputs['base_wrench'].values[1], [2e-3] * 3 + [0.2] * 3, rtol=1e-15)
    assert inputs['base_wrench'].units == ('N',) * 3 + ('N m',) * 3
    np.testing.assert_allclose(inputs['magnetic_field'].values[:, 2], [5e-5, 4e-5, 3e-5])
    assert inputs['base_position'].names == ('x',)
    np.testing.assert_allclose(inputs['base_position'].values[:, 0], [1.0, 1.001, 1.003])


BAD = {
    'never changes': (INPUTS['field'], TABLE.replace('400', '500').replace('300', '500'),
                      'magnetic_field: never changes'),
    'no unit': ('magnetic_field: {columns: [mx, mx, mx]}', TABLE, 'unit: is missing'),
    'wrong unit': ('magnetic_field: {columns: [mx, mx, mx], unit: N}', TABLE,
                   'is a unit of force'),
    'no such entry': (INPUTS['thrusters'].replace('u[1]', 'u[2]'), TABLE,
                      r'line 2: column .u.: .\[0, 1\]. is no list with an entry 2'),
    'no such thruster': (INPUTS['thrusters'].replace('[A, B]', '[A, X]'), TABLE,
                         r'thrusters: lacks B and has foreign X \(the robot has A, B\)'),
    'no share': (INPUTS['thrusters'].replace("'u[1]'", 'mx'), TABLE,
                 'thrusters: B: commands are shares from 0 to 1, got 500 at sample 0'),
    'a stamp twice': ('', TABLE.replace('\n2,', '\n1,'),
                      'the clock stands still at 1 s.*sample_index'),
    'the counter jumps': ('sample_index: {columns: n}',
                          TABLE.replace('\n2,12', '\n1,19'),
                          'line 4: the clock does not go on at 1 s.*it goes from 11 to 19'),
    'a number twice': ('sample_index: {columns: n}', TABLE.replace('\n2,12', '\n1,11'),
                       'line 4: sample_index 11 comes twice'),
}  # fmt: skip


@pytest.mark.parametrize(('entry', 'table', 'message'), BAD.values(), ids=BAD.keys())
def test_bad_inputs_are_one_line(read, entry, table, message):
    with pytest.raises(RecordingError, match=message):
        read(entry, table=table)


def test_a_block_with_one_stamp_is_spread_by_the_counter():
    truth = np.arange(20.0)
    stamps = truth.copy()
    stamps[5:9] = truth[8]  # written at once, when the last of them came

    order, times = rebuilt(stamps, 100.0 + truth, str)

    np.testing.assert_array_equal(order, np.arange(20))
    np.testing.assert_allclose(times, truth, atol=1e-9)  # rounding of the period's product


def test_rows_of_two_blocks_mixed_up_are_sorted(rng):
    truth = np.arange(30.0)
    rows = np.concatenate([np.arange(10), 10 + rng.permutation(6), np.arange(16, 30)])

    order, times = rebuilt(truth[rows], truth[rows] + 7.0, str)

    np.testing.assert_array_equal(rows[order], np.arange(30))
    np.testing.assert_allclose(times, truth, atol=1e-9)
