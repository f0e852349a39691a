"""CSV, JSON and npz with a column mapping: units, signs, orders; every fault is one line."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import yaml
from support.models import robot_of, table_one, with_wheels

from spacerobot_ros.errors import SpaceRobotError
from spacerobot_ros.recording.bags.bag_writer import BagWriter
from spacerobot_ros.recording.npz import save_npz
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import JointSeries, RateSeries, Record

ROBOT = robot_of(table_one())
JOINTS = list(ROBOT.joints)
N = 5
TIME = np.arange(N) * 0.25
ROUND = {'rtol': 1e-14, 'atol': 1e-14}  # a handful of roundings on values of order one

# Raw numbers of the file, in the file's units.
DEGREES = 10.0 + np.arange(3 * N).reshape(N, 3)
RPM = 2.0 + np.arange(3 * N).reshape(N, 3)
MILLI = 500.0 + np.arange(3 * N).reshape(N, 3)
GYRO = 1.0 + 0.5 * np.arange(3 * N).reshape(N, 3)
WXYZ = np.tile([0.5, 0.1, -0.7, 0.5], (N, 1))
WXYZ[:, 1] = np.sqrt(0.01)
WXYZ /= np.linalg.norm(WXYZ, axis=1, keepdims=True)

MAPPING = {
    'time': {'columns': 't', 'unit': 'ms'},
    'joints': {
        'names': JOINTS[::-1],  # the file's order is not the robot's
        'position': {
            'columns': ['q3', 'q2', 'q1'],
            'unit': 'deg',
            'sign': [-1, 1, 1],
            'offset': [0.0, 0.0, 90.0],
        },
        'velocity': {'columns': ['v3', 'v2', 'v1'], 'unit': 'rpm'},
        'effort': {'columns': ['u3', 'u2', 'u1'], 'unit': 'mN m'},
    },
    'gyro': {'columns': ['wx', 'wy', 'wz'], 'unit': 'deg/s'},
    'attitude': {'columns': ['a0', 'a1', 'a2', 'a3'], 'order': 'wxyz'},
}
ALL = np.column_stack([1e3 * TIME, DEGREES, RPM, MILLI, GYRO, WXYZ])
NAMES = ['t', 'q1', 'q2', 'q3', 'v1', 'v2', 'v3', 'u1', 'u2', 'u3', 'wx', 'wy', 'wz',
         'a0', 'a1', 'a2', 'a3']  # fmt: skip


def text(cells):
    return '\n'.join(','.join(str(c) for c in row) for row in cells) + '\n'


def table(values=ALL, names=NAMES):
    return [list(names), *[list(map(float, row)) for row in values]]


def written(tmp_path, mapping=MAPPING, cells=None, name='run.csv'):
    """A file and its mapping."""
    path, map_path = tmp_path / name, tmp_path / 'map.yaml'
    map_path.write_text(yaml.safe_dump(mapping))
    if name.endswith('.csv'):
        path.write_text(text(table() if cells is None else cells))
    return path, map_path


def changed(**sections):
    """The mapping with entries replaced; `joints__position={...}` reaches inside."""
    mapping = json.loads(json.dumps(MAPPING))
    for key, value in sections.items():
        *parents, last = key.split('__')
        place = mapping
        for parent in parents:
            place = place[parent]
        if value is None:
            del place[last]
        else:
            place[last] = value
    return mapping


def check(record):
    np.testing.assert_array_equal(record.joints.stamp_ns, np.arange(N) * 250_000_000)
    assert record.joints.names == tuple(JOINTS)
    turn = math.pi / 180.0
    expected = np.column_stack([(DEGREES[:, 0] + 90.0), DEGREES[:, 1], -DEGREES[:, 2]]) * turn
    np.testing.assert_allclose(record.joints.position, expected, **ROUND)
    np.testing.assert_allclose(record.joints.velocity, RPM * math.pi / 30.0, **ROUND)
    np.testing.assert_allclose(record.joints.effort, MILLI / 1000.0, **ROUND)
    np.testing.assert_allclose(record.rates.omega, GYRO * turn, **ROUND)
    np.testing.assert_allclose(record.attitudes.q_xyzw, WXYZ[:, [1, 2, 3, 0]], **ROUND)


def test_csv_in_foreign_units_signs_and_orders(tmp_path):
    path, map_path = written(tmp_path)
    record = read_record(path, ROBOT, map_path)
    check(record)
    assert record.source == str(path)
    assert record.wheels is None


def test_a_log_of_a_fixed_rate_without_a_clock(tmp_path):
    """Rows every 0.25 s; with a clock of that name it is that clock."""
    clock = {'columns': 'row', 'scale': 0.25, 'unit': 's'}
    cells = [line[1:] for line in table()]
    path, map_path = written(tmp_path, changed(time=clock), cells)
    record = read_record(path, ROBOT, map_path)
    check(record)
    assert 'times are those of a fixed rate, by the number of the row' in record.notes
    cells = [['row', *NAMES[1:]], *table()[1:]]
    path, map_path = written(tmp_path, changed(time={'columns': 'row', 'unit': 'ms'}), cells)
    check(read_record(path, ROBOT, map_path))


def test_csv_of_a_spreadsheet(tmp_path):
    """Byte order mark, semicolons, spaces, quotes, blank lines, columns of text."""
    rows = [[f' "{name}" ' if name == 't' else f' {name}' for name in NAMES] + ['note']]
    rows += [[*row, 'a "word"'.replace('"', '')] for row in table()[1:]]
    body = '\r\n\r\n'.join(';'.join(str(c) for c in row) for row in rows)
    path, map_path = written(tmp_path, {**MAPPING, 'delimiter': ';'}, name='run.CSV')
    path.write_bytes(b'\xef\xbb\xbf' + body.replace(' "t" ', '"t"').encode())
    check(read_record(path, ROBOT, map_path))


@pytest.mark.parametrize(
    ('head', 'delimiter'),
    [
        (['# of the arm, "Monday', '#', ','.join(NAMES)], ','),
        (['# of the arm', '# ' + ','.join(NAMES)], ','),  # as `np.savetxt` names columns
        (['# of the arm', '# ' + ' '.join(NAMES)], ' '),
        (['#' + ';'.join(NAMES)], ';'),
    ],
)
def test_csv_that_begins_with_comments(tmp_path, head, delimiter):
    path, map_path = written(tmp_path, {**MAPPING, 'delimiter': delimiter})
    rows = [delimiter.join(map(str, row)) for row in table()[1:]]
    path.write_text('\n'.join([*head, *rows]) + '\n')
    check(read_record(path, ROBOT, map_path))


def test_json_of_samples_and_of_columns(tmp_path):
    entries = [dict(zip(NAMES, row, strict=True)) for row in ALL.tolist()]
    for name, content, extra in (
        ('a.json', {'robot': 'x', 'entries': entries}, {'rows': 'entries'}),
        ('b.json', entries, {}),
        ('c.json', {k: ALL[:, i].tolist() for i, k in enumerate(NAMES)}, {}),
    ):
        path, map_path = written(tmp_path, {**MAPPING, **extra}, name=name)
        path.write_text(json.dumps(content))
        check(read_record(path, ROBOT, map_path))


@pytest.mark.parametrize('suffix', ['npz', 'json'])
def test_arrays_with_one_column_a_joint_and_their_own_times(tmp_path, suffix):
    mapping = {
        'time': {'columns': 't', 'unit': 's'},
        'joints': {'names': JOINTS, 'position': {'columns': 'q', 'unit': 'mrad'}},
        'attitude': {
            'columns': 'att',
            'order': 'xyzw',
            'maps': 'inertial_to_base',
            'time': {'columns': 't_att', 'unit': 'us'},
        },
    }
    xyzw = np.array([[0.6, 0.0, 0.0, 0.8], [0.0, 0.6, 0.0, 0.8]])
    content = {'t': TIME, 'q': DEGREES, 'att': xyzw, 't_att': np.array([0, 100_000])}
    path, map_path = written(tmp_path, mapping, name=f'run.{suffix}')
    if suffix == 'npz':
        np.savez(path, **content)
    else:
        path.write_text(json.dumps({k: v.tolist() for k, v in content.items()}))
    record = read_record(path, ROBOT, map_path)
    np.testing.assert_allclose(record.joints.position, DEGREES * 1e-3, **ROUND)
    np.testing.assert_array_equal(record.attitudes.stamp_ns, [0, 100_000_000])
    np.testing.assert_array_equal(record.attitudes.q_xyzw, xyzw * [-1, -1, -1, 1])
    assert (record.joints.velocity, record.joints.effort, record.rates) == (None, None, None)


def test_angles_are_fixed_axis_roll_pitch_yaw(tmp_path):
    angles = {'columns': ['wx', 'wy', 'wz'], 'order': 'rpy', 'unit': 'deg'}
    record = read_record(*swap(written(tmp_path, changed(attitude=angles))))
    for (r, p, y), q in zip(np.radians(GYRO), record.attitudes.q_xyzw, strict=True):
        half = [
            np.array([math.cos(a / 2), *(math.sin(a / 2) * axis)])
            for a, axis in zip((y, p, r), np.eye(3)[::-1], strict=True)
        ]
        w, *xyz = product(product(half[0], half[1]), half[2])
        np.testing.assert_allclose(q, [*xyz, w], **ROUND)
    yaw = {'columns': 'wz', 'order': 'yaw', 'unit': 'deg'}
    record = read_record(*swap(written(tmp_path, changed(attitude=yaw))))
    np.testing.assert_allclose(
        record.attitudes.q_xyzw[:, 2], np.sin(np.radians(GYRO[:, 2]) / 2), **ROUND
    )


def product(a, b):
    """Hamilton product, wxyz."""
    return np.array(
        [a[0] * b[0] - a[1:] @ b[1:], *(a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:]))]
    )


def swap(pair):
    path, map_path = pair
    return path, ROBOT, map_path


def test_sensors_that_were_sampled_in_some_rows(tmp_path):
    cells = table()
    for row in (2, 3, 5):
        cells[row][-4:] = [''] * 4
    record = read_record(*swap(written(tmp_path, cells=cells)))
    np.testing.assert_array_equal(record.attitudes.stamp_ns, [0, 750_000_000])
    assert len(record.joints.stamp_ns) == N
    assert any('attitude: sampled in 2 of 5 rows' in note for note in record.notes)


WHEELS = [f'j_wheel_0_{axis}' for axis in 'xyz']
WHEELED = robot_of(with_wheels(table_one(), (0,)), servicer_wheels={'joints': WHEELS})


def test_wheels_rows_signed_integers_and_derived_columns(tmp_path):
    mapping = {
        **changed(gyro=None, attitude=None),
        'select': {'sheet': 'b'},
        'twos_complement': {'raw': 16},
        'derived': {'u1': [{'column': 'raw', 'times': 'v1', 'scale': 0.5}, {'column': 'q1'}]},
        'wheels': {'names': WHEELS, 'velocity': {'columns': ['wx', 'wy', 'wz'], 'unit': 'turn/s'}},
    }
    raw = np.array([1, 2, 65535, 32768, 32767])
    cells = [[*row, r, s] for row, r, s in zip(table()[1:], raw, 'abbba', strict=True)]
    pair = written(tmp_path, mapping, [[*NAMES, 'raw', 'sheet'], *cells])
    record = read_record(pair[0], WHEELED, pair[1])
    np.testing.assert_array_equal(record.joints.stamp_ns, np.array([1, 2, 3]) * 250_000_000)
    signed = np.array([2.0, -1.0, -32768.0])
    expected = (0.5 * signed * RPM[1:4, 0] + DEGREES[1:4, 0]) / 1000.0
    np.testing.assert_allclose(record.joints.effort[:, 0], expected, **ROUND)
    np.testing.assert_allclose(record.wheels.velocity, GYRO[1:4] * 2.0 * math.pi, **ROUND)
    np.testing.assert_array_equal(record.wheels.position, np.zeros((3, 3)))


def test_a_record_file_and_a_bag_come_in_the_robots_order(tmp_path):
    joints = JointSeries(tuple(JOINTS[::-1]), np.arange(3), np.arange(9.0).reshape(3, 3))
    save_npz(Record(joints, RateSeries(np.arange(3), np.ones((3, 3)))), tmp_path / 'run.npz')
    with BagWriter(tmp_path / 'bag') as bag:
        for k in range(3):
            sample = bag.compose.joint_state(k, JOINTS[::-1], joints.position[k])
            bag.add('/joint_states', sample)
    for name in ('run.npz', 'bag'):
        record = read_record(tmp_path / name, ROBOT)
        assert record.joints.names == tuple(JOINTS)
        np.testing.assert_array_equal(record.joints.position, joints.position[:, ::-1])


def test_a_long_gap_is_noted_with_its_place(tmp_path):
    time = np.concatenate([np.arange(50), np.arange(50) + 400.0]) * 0.01
    rates = RateSeries(np.round(time * 1e9).astype(np.int64), np.ones((100, 3)))
    save_npz(Record(rates=rates), tmp_path / 'run.npz')
    notes = read_record(tmp_path / 'run.npz', ROBOT).notes
    assert notes == ('rates: 1 gap, the longest 3.51 s after 0.49 s',)


def cell(row, name, value):
    cells = table()
    cells[row][NAMES.index(name)] = value
    return cells


FAULTY_FILES = {
    'words': (cell(2, 'q1', 'high'), r"line 3: column 'q1': 'high' is not a number"),
    'decimal comma': (cell(2, 'q1', '"1,5"'), r"line 3: column 'q1': '1,5' is not .*with a point"),
    'nan': (cell(4, 'wx', 'nan'), r"line 5: column 'wx': nan is not finite"),
    'infinite': (cell(1, 'u3', '-inf'), r"line 2: column 'u3': -inf is not finite"),
    'half empty': (cell(3, 'wy', ''), r'line 4: .*gyro: some of its columns are empty'),
    'no time': (cell(3, 't', ''), r'line 4: .*time: the time is empty'),
    'clock back': (cell(3, 't', 100.0), r'line 4: the clock jumps back by 0.15 s at 0.1 s'),
    'clock stands': (cell(3, 't', 250.0), r'line 4: the clock stands still at 0.25 s'),
    'no such time': (cell(5, 't', 1e300), r'line 6: .*is no time: is its unit right\?'),
    'of no machine': (cell(2, 'q1', 1e300), r"line 3: column 'q1': .*is its unit right\?"),
    'another delimiter': ([[';'.join(NAMES)], *table()[1:]], r"line 1: .*`delimiter: ';'`"),
    'no names': (table()[1:], r'line 1: holds numbers, no names: write `header: none`'),
    'no quaternion': (cell(2, 'a1', 3.0), r'attitude, sample 1: not a unit quaternion'),
    'cut': ([*table()[:3], [1.0, 2.0]], r'line 4: has 2 cells, expected 17'),
    'one name twice': ([['t', *NAMES[:-1]], *table()[1:]], r"names column 't' twice"),
    'names only': (table()[:1], r'has no sample'),
    'empty': ([], r'has no sample'),
    'no column': ([[*NAMES[:-1], 'b'], *table()[1:]], r"has no column 'a3' \(it has .*wz\)"),
}  # fmt: skip


@pytest.mark.parametrize(('cells', 'match'), FAULTY_FILES.values(), ids=FAULTY_FILES.keys())
def test_a_faulty_file_is_one_line(tmp_path, cells, match):
    one_line(*swap(written(tmp_path, cells=cells)), match)


def test_a_file_that_ends_in_the_middle_of_a_line_is_read_without_it(tmp_path):
    """As a recorder leaves it that is killed."""
    path, map_path = written(tmp_path)
    whole, lines = read_record(path, ROBOT, map_path), path.read_text().splitlines()
    path.write_text('\n'.join(lines)[:-20])
    cut = read_record(path, ROBOT, map_path)
    np.testing.assert_array_equal(cut.rates.omega, whole.rates.omega[:-1])
    said = f'run.csv ends in the middle of line {N + 1}, which is left out'
    assert set(cut.notes) - set(whole.notes) == {said}


def one_line(path, robot, map_path, match):
    with pytest.raises(SpaceRobotError, match=match) as error:
        read_record(path, robot, map_path)
    assert '\n' not in str(error.value)


POSITION = MAPPING['joints']['position']
FAULTY_MAPPINGS = {
    'unknown unit': ({'gyro__unit': 'deg/sec'}, r"unknown unit 'deg/sec' .*'deg/s'\?"),
    'wrong unit': ({'joints__velocity__unit': 'rad'}, r"'rad' is a unit of angle, expected"),
    'no unit': ({'gyro__unit': None},
                r'gyro.unit: required parameter is missing \(To be written down'),
    'unit of a quaternion': ({'attitude__unit': 'rad'}, 'a quaternion has no unit'),
    'no order': ({'attitude__order': None},
                 r'attitude.order: required parameter is missing \(One of xyzw, wxyz'),
    'wrong order': ({'attitude__order': 'xywz'}, r"'xywz' is not one of xyzw, wxyz"),
    'wrong direction': ({'attitude__maps': 'up'}, r"'up' is not one of base_to_inertial"),
    'no time': ({'time': None}, r'time: is missing'),
    'no sensor': ({'joints': None, 'gyro': None, 'attitude': None}, 'maps no sensor of a motion'),
    'foreign joint': ({'joints__names': ['a', *JOINTS[:2]]},
                      r'joints.names: lacks j_link_3 and has foreign a \(the robot has'),
    'joint twice': ({'joints__names': [*JOINTS[:2], JOINTS[1]]},
                    'joints.names: j_link_2 stands there twice'),
    'wheels of none': (
        {'wheels': {'names': ['w'], 'velocity': {'columns': 'wx', 'unit': 'rad/s'}}},
        'wheels: robot.servicer_wheels.joints of the robot file names no wheels: name them there',
    ),
    'two columns': ({'joints__position__columns': ['q1', 'q2']}, 'has 2 columns, expected 3'),
    'two signs': ({'joints__position__sign': [1, 1]}, 'has 2 entries, expected 1 or 3'),
    'sign of two': ({'joints__position__sign': 2}, 'expected 1 or -1, got 2'),
    'offset': ({'joints__position__offset': 'x'}, "expected a number, got 'x'"),
    'no position': ({'joints__position': None}, r'joints.position: is missing'),
    'unknown entry': ({'gyros': {}}, r"gyros: unknown parameter \(did you mean 'gyro'\?\)"),
    'list': ({'gyro': [1]}, r'gyro: expected a map'),
    'select': ({'select': {'t': 'x'}}, r"no line has 'x' in 't'"),
    'bits': ({'twos_complement': {'t': 7}}, r'twos_complement.t: expected 8 or 16 or 32, got 7'),
    'derived': ({'derived': {'x': 3}}, r'derived.x: expected a list of terms'),
    'format': ({'format': 'xls'}, r"'xls' is not one of csv, npz, json"),
    'delimiter': ({'delimiter': ', '}, 'expected one character'),
}  # fmt: skip


@pytest.mark.parametrize(
    ('changes', 'match'), FAULTY_MAPPINGS.values(), ids=FAULTY_MAPPINGS.keys()
)
def test_a_faulty_mapping_is_one_line(tmp_path, changes, match):
    one_line(*swap(written(tmp_path, changed(**changes))), match)


def test_other_refusals(tmp_path):
    path, map_path = written(tmp_path)
    one_line(tmp_path / 'no.csv', ROBOT, map_path, 'no such file or folder')
    one_line(path, ROBOT, tmp_path / 'no.yaml', 'column mapping can not be read')
    one_line(path, ROBOT, None, r'needs a column mapping \(--map YAML')
    one_line(tmp_path, ROBOT, map_path, 'is a bag, which needs no column mapping')
    path.write_bytes(b'\xff\xfe\x00')
    one_line(path, ROBOT, map_path, 'is not UTF-8 .byte 0.: save it')
    path.write_text('t,"q\n')
    one_line(path, ROBOT, map_path, 'line 1')
    map_path.write_text('a: [')
    one_line(path, ROBOT, map_path, 'not valid YAML')
    path, map_path = written(tmp_path, name='run.dat')
    path.write_text('x')
    one_line(path, ROBOT, map_path, "format: is missing, and 'run.dat' does not tell it")


@pytest.mark.parametrize(
    ('content', 'match'),
    [
        ('{', 'not valid JSON'),
        ('[]', 'expected a list of samples'),
        ('[1]', 'entry 0: expected a map'),
        ('{"t": [0, 1]}', "has no column 'q3'"),
    ],
)
def test_faulty_json(tmp_path, content, match):
    path, map_path = written(tmp_path, name='run.json')
    path.write_text(content)
    one_line(path, ROBOT, map_path, match)


def test_faulty_npz(tmp_path):
    path, map_path = written(tmp_path, name='run.npz')
    path.write_bytes(b'PK nonsense')
    one_line(path, ROBOT, map_path, 'not a readable npz file')
    columns = {name: ALL[:, i] for i, name in enumerate(NAMES)}
    np.savez(path, **{**columns, 'q2': np.array(['a'] * N)})
    one_line(path, ROBOT, map_path, 'q2: expected a number')
    np.savez(path, **{**columns, 'wz': np.full(N, np.nan)})
    one_line(path, ROBOT, map_path, 'row 0: .*gyro: some of its columns are empty')
    np.savez(path, **{**columns, 'wz': np.where(np.arange(N) == 2, np.nan, 1.0)})
    one_line(path, ROBOT, map_path, r"row 2: 'wz' is not finite")
    np.savez(path, **{**columns, 'wz': np.ones(N - 1)})
    one_line(path, ROBOT, map_path, 'columns of different lengths')
    np.savez(path, **{k: v[:3] if k == 't' else v for k, v in columns.items()})
    one_line(path, ROBOT, map_path, '5 samples, but 3 sample times')
