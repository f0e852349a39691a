"""`spacerobot fleet`: what is found below folders, one table, what drifts, going on, bad input."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import linregress
from support.diagnosis import hand_made

from spacerobot_ros.batch import single, workers
from spacerobot_ros.batch.fleet_table import Course, trends
from spacerobot_ros.batch.runner import Kept
from spacerobot_ros.batch.single import find_recordings, without_duplicates
from spacerobot_ros.cli.main import main
from spacerobot_ros.diagnosis.findings import Findings
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.recording.npz import save_npz
from spacerobot_ros.recording.read import read_records
from spacerobot_ros.recording.record import AttitudeSeries, JointSeries, RateSeries, Record

ROBOT = str(Path(__file__).resolve().parents[2] / 'config' / 'servicer.yaml')
START, WEEK = 1_700_000_000_000_000_000, 7 * 86_400_000_000_000
SLOPE = 0.5  # N m s/rad a week


def recorded(path, week):
    """Three seconds of a robot that hardly moves; the content tells the week."""
    stamps = START + int(week * WEEK) + np.arange(0, 3_000_000_000, 20_000_000)
    wave = 1e-3 * np.sin(np.arange(len(stamps)))[:, None] * np.ones(3)
    still = np.tile([0.0, 0.0, 0.0, 1.0], (len(stamps), 1))
    joints = JointSeries(('joint_1', 'joint_2', 'joint_3'), stamps, wave, wave, wave)
    path.parent.mkdir(parents=True, exist_ok=True)
    save_npz(Record(joints, RateSeries(stamps, wave), AttitudeSeries(stamps, still)), path)


def swung(path, amplitude, rng):
    """Ten seconds of joints that swing [rad] on a base that the sensors see at rest."""
    stamps = START + np.arange(0, 10_000_000_000, 20_000_000)
    rates = np.array([2.0, 3.0, 4.0])
    phase = np.outer((stamps - START) * 1e-9, rates)
    noise = rng.standard_normal((5, len(stamps), 3))
    joints = JointSeries(
        ('joint_1', 'joint_2', 'joint_3'),
        stamps,
        amplitude * np.sin(phase) + 2e-5 * noise[0],
        amplitude * np.cos(phase) * rates + 2e-4 * noise[1],
        0.05 * noise[2],
    )
    turned = np.column_stack((1.5e-5 * noise[3], np.ones(len(stamps))))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    gyro = RateSeries(stamps, 2e-5 * noise[4])
    save_npz(Record(joints, gyro, AttitudeSeries(stamps, turned)), path)


@pytest.fixture
def data(tmp_path):
    """Two machines: six weeks of one, one recording of the other, and much else."""
    folder = tmp_path / 'data'
    for week in range(6):
        recorded(folder / 'arm_1' / f'run_{5 - week}.npz', week)
    recorded(folder / 'arm_2' / 'run.npz', 0.5)
    shutil.copy(folder / 'arm_2' / 'run.npz', folder / 'arm_2' / 'same.npz')
    (folder / 'arm_2' / 'empty').mkdir()
    (folder / 'arm_2' / 'empty' / 'metadata.yaml').write_text('')
    whole = (folder / 'arm_2' / 'run.npz').read_bytes()
    (folder / 'arm_2' / 'cut.npz').write_bytes(whole[: len(whole) // 2])
    (folder / 'arm_2' / 'zero.mcap').write_bytes(b'')
    (folder / 'arm_1' / 'table.csv').write_text('t,q\n')
    (folder / 'notes.txt').write_text('rainy')
    return folder


@pytest.fixture
def asked(monkeypatch):
    """Diagnoses by hand, in this process: joint_2 has more friction each week."""
    seen = []

    def findings(question, command):
        file = load_robot_file(question.robot)
        records = read_records(question.data, file.robot)
        seen.append(Path(question.data[0]).name)
        week = (records[0].span_ns[0] - START) / WEEK
        diagnosis = hand_made()
        (cause,) = diagnosis.causes
        value = replace(cause.parameters['coefficient'], value=3.0 + SLOPE * week)
        cause = replace(cause, parameters={'coefficient': value})
        return Findings(
            diagnosis=replace(diagnosis, causes=(cause,) * (week > 0)),
            file=file,
            records=records,
            added=(cause.applied,) * (week > 0),
            calibration=(),
            closed_loop=None,
            why_open='',
            command=command,
        )

    monkeypatch.setattr(workers, 'has_dask', lambda: False)
    monkeypatch.setattr(single, 'findings', findings)
    monkeypatch.setattr(
        single, 'write_answer', lambda answer, robot, out: out.mkdir(parents=True, exist_ok=True)
    )
    return seen


def fleet(data, out, *more):
    return main(['fleet', str(data), '--robot', ROBOT, '--out', str(out), *more])


def rows(out):
    with (out / 'fleet.csv').open(encoding='utf-8', newline='') as file:
        return {row['recording']: row for row in csv.DictReader(file)}


def test_one_table_that_goes_on(data, asked, tmp_path, capsys):
    out = data / 'out'  # among the recordings, and none of them
    assert fleet(data, out) == 1
    said = capsys.readouterr()
    assert '1 table left out' in said.err
    assert '--map' in said.err
    assert 'one process' in said.err
    table = rows(out)
    assert len(table) == 11
    found = table['arm_1/run_0.npz']
    assert found['time'] == '2023-12-19T22:13:20.000000Z'
    assert float(found['joint_viscous_friction@joint_2.coefficient [N m s/rad]']) == 5.5
    assert float(found['joint_viscous_friction@joint_2.coefficient std']) == 0.05
    assert found['machine'] == 'arm_1'
    assert table['arm_1/run_5.npz']['causes'] == ''
    why = {name: row['error'] for name, row in table.items() if row['error']}
    assert set(why) == {f'arm_2/{n}' for n in ('same.npz', 'empty', 'cut.npz', 'zero.mcap')}
    assert why['arm_2/same.npz'] == 'has the same content as arm_2/run.npz'
    assert all(text.count('\n') == 0 for text in why.values())
    page = (out / 'report.html').read_text(encoding='utf-8')
    assert 'joint_viscous_friction@joint_2.coefficient' in page.split('What appeared when')[0]

    before = (out / 'fleet.csv').read_text(encoding='utf-8')
    count = len(asked)
    recorded(data / 'arm_2' / 'later.npz', 7)
    assert fleet(data, out) == 1
    assert asked[count:] == ['later.npz']
    after = (out / 'fleet.csv').read_text(encoding='utf-8').splitlines()
    assert set(before.splitlines()) < set(after)


def test_a_machine_that_holds_still_is_seen_to_tell_less(asked, tmp_path, rng):
    data = tmp_path / 'data'
    swung(data / 'moves' / 'run.npz', 0.5, rng)
    swung(data / 'holds' / 'run.npz', 0.0, rng)
    fleet(data, tmp_path / 'out')
    table = rows(tmp_path / 'out')
    moves, holds = (int(table[f'{name}/run.npz']['told [1]']) for name in ('moves', 'holds'))
    assert holds < moves / 2 < int(table['moves/run.npz']['numbers [1]'])
    page = (tmp_path / 'out' / 'report.html').read_text(encoding='utf-8')
    assert f'{holds} of {table["holds/run.npz"]["numbers [1]"]}' in page


def test_parquet_holds_the_same(data, asked, tmp_path):
    parquet = pytest.importorskip('pyarrow.parquet')
    fleet(data, tmp_path / 'out')
    table = parquet.read_table(tmp_path / 'out' / 'fleet.parquet').to_pylist()
    for row in table:
        kept = rows(tmp_path / 'out')[row['recording']]
        for name, value in row.items():
            assert kept[name] == ('' if value is None else str(value))


def test_the_first_recording_of_a_cause_and_the_drift_are_printed(data, asked, tmp_path, capsys):
    fleet(data / 'arm_1', tmp_path / 'out')
    text = capsys.readouterr().out
    assert 'arm_1/run_4.npz' in text.split('where each appears first')[1]
    assert 'run_5.npz' not in text
    drift = text.split('causes, and where')[0]
    assert 'joint_viscous_friction@joint_2.coefficient' in drift
    assert f'{SLOPE / 7:.4f}'[:5] in drift  # a day
    assert 'residual' not in drift


def test_a_full_disk_keeps_what_is_finished(data, asked, tmp_path, capsys, monkeypatch):
    from spacerobot_ros.model import files

    full = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    with monkeypatch.context() as patch:
        patch.setattr(files.os, 'replace', lambda *_: (_ for _ in ()).throw(full))
        assert fleet(data, tmp_path / 'out') == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].endswith('fleet.csv: can not be written: No space left on device')
    count = len(asked)
    assert fleet(data, tmp_path / 'out') == 1
    assert len(asked) == count
    assert len(rows(tmp_path / 'out')) == 11


def test_a_fault_of_ours_costs_its_recording_only(data, asked, tmp_path, monkeypatch):
    by_hand = single.findings

    def findings(question, command):
        if question.data[0].endswith('run_3.npz'):
            raise RuntimeError('not foreseen')
        return by_hand(question, command)

    with monkeypatch.context() as patch:
        patch.setattr(single, 'findings', findings)
        assert fleet(data, tmp_path / 'out') == 1
    assert rows(tmp_path / 'out')['arm_1/run_3.npz']['error'] == 'RuntimeError: not foreseen'
    fleet(data, tmp_path / 'out')
    assert rows(tmp_path / 'out')['arm_1/run_3.npz']['error'] == ''


def test_another_robot_file_asks_again(data, asked, tmp_path):
    fleet(data / 'arm_1', tmp_path / 'out')
    robot = tmp_path / 'other.yaml'
    shutil.copy(Path(ROBOT).with_suffix('.urdf'), tmp_path)
    text = Path(ROBOT).read_text(encoding='utf-8')
    robot.write_text(
        text.replace('package://spacerobot_ros/config/', '').replace(
            'gyro_std: 2.0e-5', 'gyro_std: 4.0e-5'
        ),
        encoding='utf-8',
    )
    count = len(asked)
    assert main(['fleet', str(data / 'arm_1'), '--robot', str(robot), '-o', str(tmp_path / 'out')])
    assert len(asked) == 2 * count


EFFECT = '''
from spacerobot_ros.effects.joint import JointTorque
from spacerobot_ros.effects.parameter import amount


class Grease(JointTorque):
    """tau = -c."""

    id = 'fleet_grease'
    title = 'grease'
    parameters = (amount('coefficient', 'N m', 1.0),)

    def torque(self, q, qd, effort):
        return -self['coefficient'] + 0.0 * qd
'''


def test_a_changed_module_of_effects_asks_again(data, asked, tmp_path):
    text = Path(ROBOT).read_text(encoding='utf-8')
    named = text.replace(
        '      base: free\n', '      base: free\n      effect_modules: [own.py]\n'
    )
    robot, module = tmp_path / 'own.yaml', tmp_path / 'own.py'
    robot.write_text(named, encoding='utf-8')
    module.write_text(EFFECT)
    again = ['fleet', str(data / 'arm_1'), '--robot', str(robot), '-o', str(tmp_path / 'out')]
    counts = []
    for written in (EFFECT, EFFECT, EFFECT.replace('0.0 *', '0.1 *')):
        module.write_text(written)
        assert main(again) == 1
        counts.append(len(asked))
    assert counts[1] == counts[0]
    assert counts[2] == 2 * counts[0]


def test_a_disk_that_fills_meanwhile_keeps_what_was_finished(data, asked, tmp_path, capsys):
    out = tmp_path / 'out'

    class Full(io.RawIOBase):
        """A file on a disk with room for a record and a half."""

        def __init__(self, path):
            self.file, self.room = path.open('ab', buffering=0), None

        def write(self, some):
            if self.room is None:
                self.room = 3 * len(some) // 2
            if not self.room:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            some = bytes(some)[: self.room]
            self.room -= len(some)
            return self.file.write(some)

        def close(self):
            self.file.close()
            super().close()

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Kept, 'appending', lambda kept: Full(kept.path))
        assert fleet(data, out) == 2
    captured = capsys.readouterr()
    why = (
        'fleet.jsonl: can not be written: No space left on device; what was finished before stays'
    )
    assert captured.err.splitlines()[-1].endswith(why)
    count = len(asked)
    assert fleet(data, out) == 1
    assert len(asked) == count + 7 - 1  # seven recordings can be read, one stayed
    assert len(rows(out)) == 11


def test_what_was_found_is_said_where_no_page_can_be_written(data, asked, tmp_path, capsys):
    (tmp_path / 'out' / 'report.html').mkdir(parents=True)
    assert fleet(data, tmp_path / 'out') == 2
    captured = capsys.readouterr()
    assert 'recordings' in captured.out
    assert captured.err.splitlines()[-1].endswith(
        'report.html: can not be written: Is a directory'
    )
    assert len(rows(tmp_path / 'out')) == 11


@pytest.mark.parametrize('name', ['nothing', 'arm_1/table.csv/none', 'none'])
def test_no_recording_at_all(data, name, tmp_path, capsys):
    (data / 'nothing').mkdir()
    assert fleet(data / name, tmp_path / 'out') == 2
    assert capsys.readouterr().err.count('\n') == 1


def test_what_is_a_recording_and_of_which_machine(tmp_path):
    for name in ('a/b/bag/bag_0.mcap', 'a/b/bag/bag_1.mcap', 'a/one.mcap', 'a/two.mcap', 'c.npz'):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    found, _ = find_recordings([str(tmp_path)], False, tmp_path / 'out')
    assert {r.name: r.machine for r in found} == {
        'a/b/bag': 'a',
        'a/one.mcap': 'a',
        'a/two.mcap': 'a',
        f'{tmp_path.name}/c.npz': tmp_path.name,
    }
    twice = [str(tmp_path / 'a'), str(tmp_path / 'a' / 'one.mcap')]
    assert len(find_recordings(twice, False, tmp_path / 'out')[0]) == 3
    assert not any(r.fault for r in without_duplicates(found))


# ---------------------------------------------------------------- trends


def history(value, std, time=None):
    time = np.arange(float(len(value))) if time is None else time
    return Course('arm', 'q', '1', time, np.asarray(value), np.asarray(std))


def test_a_line_through_values_alike_is_that_of_scipy(rng):
    t = np.sort(rng.uniform(0.0, 9.0, 12))
    y = 2.0 + 0.1 * t + rng.normal(size=12)
    expected = linregress(t, y)
    (line,) = trends([history(y, np.full(12, np.nan), t)])
    assert line.slope == pytest.approx(expected.slope, rel=1e-9)
    assert line.std == pytest.approx(expected.stderr, rel=1e-9)
    assert line.p_value == pytest.approx(expected.pvalue, rel=1e-6)
    (wide,) = trends([history(y, np.full(12, 100.0), t)])  # less scatter than stated
    spread = 100.0 / np.sqrt(np.sum((t - t.mean()) ** 2))
    assert wide.std == pytest.approx(spread, rel=1e-9)


def test_drifts_are_rarely_called_where_none_is(rng):
    """Of 200 reports of 20 trends each, a drift in at most 1 % is wanted; 7 would be 1 in 3e3."""
    reports = 200
    wrong = sum(
        any(line.is_drift for line in trends([history(v, np.ones(8)) for v in values]))
        for values in rng.normal(size=(reports, 20, 8))
    )
    assert wrong < 7
    (drift,) = trends([history(np.arange(8.0), np.ones(8))])
    assert drift.is_drift


def test_what_never_changes_does_not_drift():
    for value in (
        np.zeros(6),
        np.full(6, 42.0),
        np.full(6, 0.1) * np.array([1, 1, 1, 1, 1, 1 + 1e-15]),
    ):
        (line,) = trends([history(value, np.full(6, np.nan))])
        assert not line.is_drift
        assert json.dumps(line.p_value) != 'NaN'
