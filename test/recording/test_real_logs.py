"""Logs as real arms give them: no names, compressed, currents, joints without sensors, pauses."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace

import numpy as np
import pytest
import yaml
from support.models import robot_of, table_one

from spacerobot_ros.errors import SpaceRobotError
from spacerobot_ros.recording.bags.bag_writer import BagWriter
from spacerobot_ros.recording.faults.data_faults import data_faults
from spacerobot_ros.recording.faults.gaps import split_at_gaps
from spacerobot_ros.recording.faults.motion_faults import find_faults
from spacerobot_ros.recording.npz import load_npz, save_npz
from spacerobot_ros.recording.read import read_groups, read_record, read_records
from spacerobot_ros.recording.record import JointSeries, Record, to_stamps

CONSTANTS = (10.0, 20.0, 30.0)
ARM = robot_of(table_one(), base='fixed')
AMPERES = robot_of(table_one(), base='fixed', effort_kind='current', motor_constant=CONSTANTS)
JOINTS = list(ARM.joints)
N = 300
TIME = 0.01 * np.arange(N)
PHASES = np.array([0.1, 0.2, 0.3]) + np.outer(TIME, [2.0, 3.0, 4.0])
Q, QD = 0.5 * np.sin(PHASES), 0.5 * np.cos(PHASES) * [2.0, 3.0, 4.0]
CURRENT = np.cos(0.7 * PHASES)
TABLE = np.column_stack([1579660000.0 + TIME, Q, QD, CURRENT])
SECTIONS = {
    'position': {'columns': [1, 2, 3], 'unit': 'rad'},
    'velocity': {'columns': [4, 5, 6], 'unit': 'rad/s'},
    'effort': {'columns': [7, 8, 9], 'unit': 'A'},
}


def written(tmp_path, table=TABLE, name='run.csv.gz', separator=',', header='none', **sections):
    """A log without a line of names and its mapping."""
    path, map_path = tmp_path / name, tmp_path / 'map.yaml'
    body = '\n'.join(separator.join(format(x, '.17g') for x in row) for row in table).encode()
    path.write_bytes(gzip.compress(body) if name.lower().endswith('.gz') else body)
    mapping = {
        'header': header,
        'delimiter': separator[0],
        'time': {'columns': 0, 'unit': 's'},
        'joints': {'names': JOINTS, **SECTIONS, **sections},
    }
    map_path.write_text(yaml.safe_dump(mapping))
    return path, map_path


def one_line(match, call, *args, **options):
    with pytest.raises(SpaceRobotError, match=match) as error:
        call(*args, **options)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize(
    ('name', 'separator'),
    [('run.csv', ','), ('run.csv.gz', ','), ('RUN.CSV.GZ', ';'), ('a.csv', '\t'), ('b.csv', '  ')],
)
def test_a_log_without_names_and_currents(tmp_path, name, separator):
    path, map_path = written(tmp_path, name=name, separator=separator)
    record = read_record(path, AMPERES, map_path)
    # 17 digits of the file are exact; a time of 1.6e9 s is a double of 2.4e-7 s
    np.testing.assert_array_equal(record.q, Q)
    np.testing.assert_array_equal(record.qd, QD)
    np.testing.assert_allclose(record.joint_time, TIME, rtol=0, atol=5e-7)
    np.testing.assert_allclose(record.effort, CURRENT * CONSTANTS, rtol=1e-15, atol=0)
    assert any('currents times robot.motor_constant' in note for note in record.notes)


def test_a_factor_for_every_column(tmp_path):
    effort = {**SECTIONS['effort'], 'unit': 'N m', 'scale': [10, 20, 30], 'sign': [1, -1, 1]}
    record = read_record(*swap(written(tmp_path, effort=effort), ARM))
    expected = CURRENT * CONSTANTS * [1.0, -1.0, 1.0]
    np.testing.assert_allclose(record.effort, expected, rtol=1e-15, atol=0)


def swap(pair, robot):
    path, map_path = pair
    return path, robot, map_path


def test_compressed_json(tmp_path):
    path, map_path = written(tmp_path, name='unused.csv', header='names')
    path = tmp_path / 'run.json.gz'
    columns = {str(i): TABLE[:, i].tolist() for i in range(10)}
    path.write_bytes(gzip.compress(json.dumps(columns).encode()))
    np.testing.assert_array_equal(read_record(path, AMPERES, map_path).q, Q)


UNKNOWN = robot_of(table_one(), effort_kind=['motor', 'current', 'motor'])  # on a free base
PASSIVE = robot_of(
    table_one(),
    base='fixed',
    effort_kind='current',
    motor_constant=CONSTANTS,
    passive_joints=['j_link_2'],
)
REFUSED = {
    'kind': (ARM, {'effort': {**SECTIONS['effort'], 'unit': 'N m', 'kind': 'link'}},
             r'effort.kind: j_link_1: link, but robot.effort_kind of the robot file says motor'),
    'unknown kind': (ARM, {'effort': {**SECTIONS['effort'], 'kind': 'torque'}},
                     "expected motor or link or current or .*got 'torque'"),
    'amperes': (ARM, {}, "unit: j_link_1: 'A' is a current, but .* says motor: state current"),
    'torques': (AMPERES, {'effort': {**SECTIONS['effort'], 'unit': 'N m'}},
                "unit: j_link_1: 'N m' is no current, but .* says current: give the column in A"),
    'no motor': (PASSIVE, {}, 'effort.columns: j_link_2 has an effort, but is one of robot'),
    'constants': (UNKNOWN, {'effort': {**SECTIONS['effort'], 'unit': ['N m', 'A', 'N m']}},
                  'robot.motor_constant: is missing: efforts of j_link_2 are currents, state N m'),
    'no position': (AMPERES, {'position': {'columns': [1, None, 3], 'unit': 'rad'},
                              'velocity': {'columns': [4, None, 6], 'unit': 'rad/s'}},
                    r'joints.position \(j_link_2\): is missing, and so is its rate'),
    'column': (AMPERES, {'effort': {**SECTIONS['effort'], 'columns': [7, 8, 12]}},
               r"has no column '12' \(it has 0, 1, 2, .*9\)"),
    'negative': (AMPERES, {'effort': {**SECTIONS['effort'], 'columns': [7, 8, -1]}},
                 'expected text, got -1'),
    'scales': (AMPERES, {'effort': {**SECTIONS['effort'], 'scale': [1, 2]}},
               'effort.scale: has 2 entries, expected 1 or 3'),
}  # fmt: skip


@pytest.mark.parametrize(('robot', 'sections', 'match'), REFUSED.values(), ids=REFUSED)
def test_what_contradicts_the_robot_file_is_one_line(tmp_path, robot, sections, match):
    one_line(match, read_record, *swap(written(tmp_path, **sections), robot))


def test_damaged_and_empty_logs_are_one_line(tmp_path):
    path, map_path = written(tmp_path)
    path.write_bytes(path.read_bytes()[:200])
    one_line('can not be read', read_record, path, AMPERES, map_path)
    path.write_bytes(b'no gzip')
    one_line('can not be read', read_record, path, AMPERES, map_path)
    path, map_path = written(tmp_path, TABLE[:0], name='run.csv')
    one_line('has no sample: expected numbers', read_record, path, AMPERES, map_path)


def test_times_are_printed_in_full(tmp_path):
    table = TABLE.copy()
    table[200, 0] = table[199, 0] - 0.25
    match = r'line 201: the clock jumps back by 0.25 s at 1579660001.74 s, 1.74 s after the first'
    one_line(match, read_record, *swap(written(tmp_path, table), AMPERES))


# ------------------------------------------------------------ joints without a sensor


def missing(column):
    """The table with a column of NaN."""
    table = TABLE.copy()
    table[:, column] = np.nan
    return table


@pytest.mark.parametrize('how', ['null', 'nan'])
def test_a_joint_without_rate(tmp_path, how):
    columns = [4, None, 6] if how == 'null' else [4, 5, 6]
    velocity = {**SECTIONS['velocity'], 'columns': columns}
    table = missing(5) if how == 'nan' else TABLE
    record = read_record(*swap(written(tmp_path, table, velocity=velocity), AMPERES))
    assert record.qd is None
    assert 'no rates of j_link_2: no rates are used' in record.notes


def test_a_joint_whose_effort_nobody_logged(tmp_path):
    path, map_path = written(tmp_path, missing(8))
    record = read_record(path, AMPERES, map_path)
    assert record.joints.without_effort == ('j_link_2',)
    assert 'no efforts of j_link_2' in record.notes
    np.testing.assert_array_equal(np.isnan(record.effort).any(axis=0), [False, True, False])
    assert data_faults(record, AMPERES) == ()  # the other joints are diagnosed
    save_npz(record, tmp_path / 'run.npz')
    assert load_npz(tmp_path / 'run.npz').joints.without_effort == ('j_link_2',)
    free = robot_of(table_one(), effort_kind='current', motor_constant=CONSTANTS)
    record = read_record(path, free, map_path)  # momentum tells without efforts
    assert record.effort is None
    assert 'no efforts of j_link_2: none are used' in record.notes


NULL_EFFORT = {'columns': [7, None, 9], 'unit': ['A', None, 'A']}


@pytest.mark.parametrize('said', ['mapping', 'robot file', 'both'])
def test_a_joint_without_a_motor(tmp_path, said):
    """Null in the mapping, or named by the robot file where a log lacks the column."""
    sections = {} if said == 'robot file' else {'effort': NULL_EFFORT}
    robot = AMPERES if said == 'mapping' else PASSIVE
    if said == 'robot file':
        record = read_record(*swap(written(tmp_path, **sections), AMPERES))
        lacking = replace(record.joints, effort=record.effort * [1.0, np.nan, 1.0])
        save_npz(replace(record, joints=lacking), tmp_path / 'log.npz')
        record = read_record(tmp_path / 'log.npz', robot)
    else:
        record = read_record(*swap(written(tmp_path, **sections), robot))
    assert record.joints.passive == ('j_link_2',)
    np.testing.assert_array_equal(record.effort[:, 1], 0.0)
    assert record.effort[:, [0, 2]].all()
    save_npz(record, tmp_path / 'run.npz')
    assert load_npz(tmp_path / 'run.npz').joints.passive == ('j_link_2',)
    assert data_faults(record, robot) == ()  # a torque that never changes is no dead sensor


def test_motors_that_are_off_for_a_while(tmp_path):
    on = np.column_stack([TABLE, (TIME < 1.0).astype(float)])
    effort = {**SECTIONS['effort'], 'enabled': [None, 10, None]}
    record = read_record(*swap(written(tmp_path, on, effort=effort), AMPERES))
    assert record.joints.passive == ()
    np.testing.assert_array_equal(record.joints.unpowered[:, 1], TIME >= 1.0)
    np.testing.assert_array_equal(record.effort[TIME >= 1.0, 1], 0.0)
    np.testing.assert_array_equal(record.joints.unpowered[:, [0, 2]], False)


def test_currents_that_nobody_makes_torques_stay_in_amperes(tmp_path):
    fixed = robot_of(table_one(), base='fixed', effort_kind='current')
    record = read_record(*swap(written(tmp_path), fixed))
    np.testing.assert_array_equal(record.effort, CURRENT)
    assert record.joints.in_amperes == fixed.joints
    assert f'{", ".join(JOINTS)}: efforts are currents in A' in record.notes


def test_the_angle_of_a_wheel_is_the_integral_of_its_rate(tmp_path):
    """By trapezoids: h^2 / 12 of the second derivative, 4^2 * 2 * 0.01^2 / 12 rad."""
    position = {'columns': [1, None, 3], 'unit': ['rad', None, 'rad']}
    record = read_record(*swap(written(tmp_path, position=position), AMPERES))
    assert record.joints.rate_only == ('j_link_2',)
    np.testing.assert_allclose(record.q[:, 1], Q[:, 1] - Q[0, 1], rtol=0, atol=1e-4)
    np.testing.assert_array_equal(record.q[:, 0], Q[:, 0])


def test_some_empty_cells_of_a_column_are_refused(tmp_path):
    table = TABLE.copy()
    table[7, 8] = np.nan
    one_line("line 8: column '8': nan", read_record, *swap(written(tmp_path, table), AMPERES))


def test_a_bag_of_an_arm_that_measures_some_joints_in_amperes(tmp_path):
    nothing, some = np.full(3, np.nan), np.array([np.nan, 2.0, 3.0])
    with BagWriter(tmp_path / 'bag') as bag:
        for k in range(60):
            bag.add(
                '/joint_states', bag.compose.joint_state(k * 10**8, JOINTS, Q[k], nothing, some)
            )
    record = read_record(tmp_path / 'bag', AMPERES)
    assert record.qd is None
    np.testing.assert_array_equal(record.effort, np.tile([np.nan, 40.0, 90.0], (60, 1)))
    assert any('60 of 60 messages have no effort of j_link_1' in note for note in record.notes)


def test_recordings_with_another_tool_declared_are_refused(tmp_path):
    """By the descriptions in them, of which one may lack or be no URDF; groups may differ."""
    tool = '<robot name="r"><link name="flange"><inertial><mass value="{}"/>'
    tool += '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>'
    texts = {'bare': tool.format(1.0), 'same': tool.format('1.00'), 'loaded': tool.format(3.0)}
    for name, text in {**texts, 'none': '', 'odd': '<robot'}.items():
        with BagWriter(tmp_path / name) as bag:
            bag.text('/robot_description', 0, text)
            for k in range(60):
                bag.add('/joint_states', bag.compose.joint_state(k * 10**8, JOINTS, *[Q[k]] * 3))
    paths = {name: tmp_path / name for name in (*texts, 'none', 'odd')}
    loaded = [paths['loaded']]
    read_groups([[paths[n] for n in ('bare', 'same', 'none', 'odd')], loaded], ARM)
    match = 'loaded: flange is another body here than in .*bare'
    one_line(match, read_records, [paths['bare'], *loaded], ARM)


def record_of(q=Q, qd=QD):
    return Record(JointSeries(tuple(JOINTS), to_stamps(TIME), q, qd, 100.0 * CURRENT), source='r')


def test_rates_that_are_no_derivative_of_the_positions_are_not_used(tmp_path):
    foreign = QD.copy()
    foreign[:, 1] = np.sin(7.0 * TIME)
    save_npz(record_of(qd=foreign), tmp_path / 'run.npz')
    record = read_record(tmp_path / 'run.npz', ARM)
    assert record.qd is None
    assert record.notes[0].startswith('the rates are not the derivative of the positions of j_li')
    free = read_record(tmp_path / 'run.npz', robot_of(table_one()))
    assert free.qd is not None  # there the identifier refuses them
    exchanged = QD[:, [1, 0, 2]]
    save_npz(record_of(qd=exchanged), tmp_path / 'run.npz')
    assert read_record(tmp_path / 'run.npz', ARM).qd is not None  # a slip, which is named


# ------------------------------------------------------------ joints at rest


def standing(flicker, rate_noise=0.0):
    """The third joint stands; its encoder flickers, its rate says nothing or noise."""
    rng = np.random.default_rng(3)
    q, qd = Q.copy(), np.round(QD, 4)
    q[:, 2] = 0.3 + flicker * rng.integers(-1, 2, N)
    qd[:, 2] = rate_noise * rng.standard_normal(N)
    return record_of(np.round(q, 4), qd)


def test_a_joint_that_flickers_at_rest_is_no_fault():
    assert find_faults(standing(1e-4)) == ()  # 0.2 mrad: two steps of the encoder


def test_a_standing_joint_whose_rate_is_noisy_is_no_fault():
    assert find_faults(standing(0.0, 1e-3)) == ()


def test_a_joint_at_rest_says_the_same_where_encoders_have_steps():
    record = standing(0.0)
    coarse = replace(record, joints=replace(record.joints, position=np.round(record.q, 2)))
    assert data_faults(coarse, ARM) == ()
    noise = 1e-5 * np.random.default_rng(4).standard_normal(record.q.shape)
    noise[:, 2] = 0.0
    fine = replace(record, joints=replace(record.joints, position=record.q + noise))
    assert data_faults(fine, ARM) == (
        'joint_position/j_link_3: never changes: a dead sensor, or a joint to be made fixed in '
        'the URDF',
    )


def test_a_dead_rate_is_a_fault_however_slow_the_joint():
    record = standing(1e-4)
    q = record.q.copy()
    q[:, 2] += 0.01 * TIME  # 2 mrad in a window of 0.2 s, against steps of 0.1 mrad
    (fault,) = find_faults(replace(record, joints=replace(record.joints, position=q)))
    assert (fault.place, fault.kind) == ('joint_rate/j_link_3', 'constant')


# ------------------------------------------------------------ several recordings


def paused(*pauses):
    """The record with pauses [s] after each third."""
    stamps = to_stamps(np.arange(3 * N) * 0.01)
    for k, pause in enumerate(pauses, 1):
        stamps = stamps + np.where(np.arange(3 * N) >= k * N, round(pause * 1e9), 0)
    q, qd, effort = (np.tile(x, (3, 1)) for x in (Q, QD, CURRENT))
    return Record(JointSeries(tuple(JOINTS), stamps, q, qd, effort), source='run')


def test_a_record_is_split_at_its_pauses():
    parts = split_at_gaps(paused(5.0, 0.1))  # 0.1 s: lost samples
    assert [len(part.joint_time) for part in parts] == [N, 2 * N]
    assert [part.joint_time[0] for part in parts] == [0.0, 0.0]
    assert [part.source for part in parts] == ['run (stretch 1 of 2)', 'run (stretch 2 of 2)']
    assert parts[1].notes[0] == 'stretch 2 of 2, 8 s after the first sample'
    np.testing.assert_array_equal(np.vstack([part.q for part in parts]), np.tile(Q, (3, 1)))


def test_a_short_stretch_is_left_out():
    record = paused(5.0, 5.0)
    cut = replace(record, joints=record.joints.at(slice(0, 2 * N + 50)))
    parts = split_at_gaps(cut)
    assert [part.source for part in parts] == ['run (stretch 1 of 3)', 'run (stretch 2 of 3)']
    assert '1 stretch between gaps left out: too short' in parts[0].notes
    few = replace(record, joints=record.joints.at(slice(N - 50, N + 50)))
    one_line('run: its 2 stretches between gaps are all too short', split_at_gaps, few)
    one_line('it has no joints', split_at_gaps, Record(source='run'))
    whole = paused()
    assert split_at_gaps(whole) == (whole,)


def test_runs_whose_clock_begins_anew_are_recordings(tmp_path):
    table = np.vstack([TABLE, TABLE, TABLE])
    path, map_path = written(tmp_path, table)
    parts = read_records([path], AMPERES, map_path, split_gaps=True)
    assert len(parts) == 3
    for part in parts:
        np.testing.assert_allclose(part.joint_time, TIME, rtol=0, atol=1e-6)
        np.testing.assert_array_equal(part.q, Q)
        assert not any('gaps' in note for note in part.notes)
    one_line('jumps back by 2.99 s', read_records, [path], AMPERES, map_path)


def test_several_recordings(tmp_path):
    path, map_path = written(tmp_path)
    save_npz(paused(5.0), tmp_path / 'b.npz')
    (first,) = read_records([path], AMPERES, map_path)
    assert first.source == str(path)
    assert len(read_records([tmp_path / 'b.npz'], ARM, split_gaps=True)) == 2


def test_recordings_that_do_not_go_together_are_one_line(tmp_path):
    path, map_path = written(tmp_path)
    one_line('run.csv.gz: is given twice', read_records, [path, path], AMPERES, map_path)
    one_line('run.csv.gz: is given twice', read_groups, [[path], [path]], AMPERES, map_path)
    other = tmp_path / 'other.csv'
    other.write_text('0,1\n1,2\n')
    match = r'other.csv: has no column .*\(the mapping fits .*run.csv.gz\)'
    one_line(match, read_records, [path, other], AMPERES, map_path)
    short = tmp_path / 'short.csv.gz'
    short.write_bytes(gzip.compress(b'\n'.join(gzip.decompress(path.read_bytes()).split()[:60])))
    match = r'short.csv.gz: is too short: 60 samples of the joints in 0.59 s, at least 50 in 2 s'
    one_line(match, read_records, [path, short], AMPERES, map_path)
    joints = JointSeries(('a', 'b', 'c'), to_stamps(TIME), Q, QD)
    save_npz(Record(joints, source='else'), tmp_path / 'else.npz')
    save_npz(record_of(), tmp_path / 'run.npz')
    match = r'else.npz: .*lacks j_link_1.* has foreign a, b, c \(the robot has'
    one_line(match, read_records, [tmp_path / 'run.npz', tmp_path / 'else.npz'], ARM)
