"""The command line: answers, exit statuses, one-line errors."""

from __future__ import annotations

import errno
import gzip
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from support.contracts import keeps

from spacerobot_ros import __version__
from spacerobot_ros.cli import compare, identify, main, simulate
from spacerobot_ros.cli.commands import COMMANDS
from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import SpaceRobotError
from spacerobot_ros.formats import decimals
from spacerobot_ros.recording.bags.bag import read_bag
from spacerobot_ros.recording.npz import save_npz
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.simulation.closed_loop import RunSummary

ROOT = Path(__file__).resolve().parents[2]
ROBOT = str(ROOT / 'config' / 'servicer.yaml')
TRUTH = np.array([42.0, 49.0, 41.0])  # N m s, of the robot file


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return one pass of the exciting motion, as a bag."""
    path = tmp_path_factory.mktemp('cli') / 'run'
    assert main.main(['simulate', '--robot', ROBOT, '-o', str(path)]) == 0
    return str(path)


def run(capsys, *arguments):
    status = main.main([str(a) for a in arguments])
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def fails(capsys, status, *arguments):
    """Exit status of a run that must fail with one line on stderr and nothing on stdout."""
    got, out, err = run(capsys, *arguments)
    assert got == status
    assert out == ''
    assert err.count('\n') == 1
    assert err.startswith(f'spacerobot {arguments[0]}: ')
    return err


# ---------------------------------------------------------------- simulate


@pytest.mark.usefixtures('no_progress')
def test_simulate_says_in_one_line_what_it_did(capsys, tmp_path):
    status, out, err = run(
        capsys, 'simulate', '--robot', ROBOT, '-o', tmp_path / 'run', '--duration', '0.5'
    )
    assert status == 0
    assert err == ''
    assert out.count('\n') == 1
    assert out.startswith(f'{tmp_path}/run: 0.5 s in ')
    assert 'momentum drift' in out


@pytest.mark.parametrize(('wall', 'said'), [(0.1, '200'), (40.0, '0.5'), (5000.0, '0.004')])
def test_slow_simulations_are_not_said_to_stand(wall, said):
    summary = RunSummary(
        steps=2000, duration=20.0, messages=9, max_joint_error=0.1, max_slide_error=None,
        momentum_drift=1e-15, energy_drift=0.0, saturated=0, max_attitude_error=None,
    )  # fmt: skip
    assert simulate._line('run', summary, wall).endswith(f', {said} times real time')


def test_simulate_warns_of_a_motion_beyond_the_limits(capsys, tmp_path):
    text, fast = Path(ROBOT).read_text(), tmp_path / 'fast.yaml'
    fast.write_text(text.replace('cosine: [0.1600, -0.3808', 'cosine: [0.1600, -3.808'))
    status, _, err = run(
        capsys, 'simulate', '--robot', fast, '-o', tmp_path / 'run', '--duration', '0.1'
    )
    assert status == 0
    assert err.startswith('warning: reference: joint_1 would move at ')
    assert err.count('\n') == 1


def test_simulate_options_reach_the_run(capsys, tmp_path):
    def rates(name, *options):
        base = ('simulate', '--robot', ROBOT, '-o', tmp_path / name, '--duration', '0.3')
        assert run(capsys, *base, *options)[0] == 0
        return read_bag(tmp_path / name, load_robot_file(ROBOT).robot)

    plain = rates('plain')
    assert len(plain.joints.stamp_ns) == 31
    np.testing.assert_array_equal(rates('same').rates.omega, plain.rates.omega)
    assert np.any(rates('seed', '--seed', '9').rates.omega != plain.rates.omega)
    exact = rates('exact', '--no-noise').rates.omega
    np.testing.assert_array_equal(exact, rates('exact2', '--no-noise', '--seed', '9').rates.omega)
    hold = rates('hold', '--reference', 'hold', '--no-noise')
    assert np.any(hold.joints.effort != rates('move', '--no-noise').joints.effort)
    paper = rates('paper', '--law', 'computed_torque_paper', '--no-noise')
    assert np.any(paper.joints.effort != hold.joints.effort)


def test_simulate_does_not_overwrite_unless_told(capsys, tmp_path):
    arguments = ('simulate', '--robot', ROBOT, '-o', tmp_path / 'run', '--duration', '0.1')
    assert run(capsys, *arguments)[0] == 0
    before = (tmp_path / 'run' / 'metadata.yaml').read_bytes()
    assert 'exists already (--force replaces it)' in fails(capsys, 2, *arguments, '--seed', '5')
    assert (tmp_path / 'run' / 'metadata.yaml').read_bytes() == before
    assert run(capsys, *arguments, '--force')[0] == 0
    (tmp_path / 'mine').mkdir()
    err = fails(capsys, 2, 'simulate', '--robot', ROBOT, '-o', tmp_path / 'mine', '--force')
    assert 'is not a bag, so it is not replaced' in err


def test_simulate_refuses_a_bad_robot_file_in_one_line(capsys, tmp_path):
    missing = fails(capsys, 2, 'simulate', '--robot', tmp_path / 'no.yaml', '-o', tmp_path / 'run')
    assert 'no.yaml' in missing
    bad = tmp_path / 'bad.yaml'
    bad.write_text('/**:\n  ros__parameters:\n    robot: {jonts: [a]}\n')
    err = fails(capsys, 2, 'simulate', '--robot', bad, '-o', tmp_path / 'run')
    assert "did you mean 'joints'?" in err
    assert not (tmp_path / 'run').exists()


@pytest.mark.parametrize(
    ('options', 'message'),
    [
        (['--duration', '0'], "value for '--duration': 0 must be finite and above zero"),
        (['--duration', 'nan'], "value for '--duration': nan must be finite and above zero"),
        (['--duration', 'inf'], "value for '--duration': inf must be finite and above zero"),
        (['--duration', 'soon'], "value for '--duration': 'soon' is not a valid float"),
        (['--seed', '-1'], "value for '--seed': -1 is not in the range x>=0"),
        (['--seed', '1.5'], "value for '--seed': '1.5' is not a valid whole number"),
        (['--law', 'pid'], "value for '--law': 'pid' is not one of 'computed_torque', "),
        (['--reference', 'topic'], "value for '--reference': 'topic' is not one of 'fourier', "),
        (['--what'], 'No such option'),
        (['--seed'], "'--seed' requires an argument"),
        (['run'], 'unexpected extra argument (run)'),
    ],
)
def test_usage_errors_exit_with_2(capsys, tmp_path, options, message):
    line = fails(capsys, 2, 'simulate', '--robot', ROBOT, '-o', tmp_path / 'run', *options)
    assert message in line
    assert line.endswith('(spacerobot simulate --help says more)\n')
    assert not (tmp_path / 'run').exists()


@pytest.mark.parametrize(
    ('words', 'message'),
    [
        ([], 'spacerobot: Missing command. (spacerobot --help says more)'),
        (['simulat'], "spacerobot simulat: no such command: simulat (did you mean 'simulate'?)"),
        (['--what'], 'spacerobot: No such option'),
        (['compare', 'a', '--robot', 'b', '-o', 'c'], "compare: Missing argument 'AFTER'"),
        (['diagnose', '--robot', 'b', '-o', 'c'], "diagnose: Missing argument 'DATA...'"),
        (
            ['export', '--robot', 'b', '-o', 'c'],
            "Missing option '--to'. Choose from: mjcf, urdf",
        ),
        (['excite', '--separate', 'a'], "excite: Option '--separate' requires 2 arguments"),
        (['completion', 'fish'], "completion: Invalid value for '{bash|zsh}': 'fish' is not"),
    ],
)
def test_words_that_no_command_takes_are_one_line(capsys, words, message):
    status, out, err = run(capsys, *words)
    assert (status, out, err.count('\n')) == (2, '', 1)
    assert message in err


def test_an_option_of_many_values_ends_at_the_next_option(capsys, monkeypatch):
    got = {}
    monkeypatch.setattr(compare.run, 'callback', lambda **given: got.update(given) or 0)
    words = ('a', '--after', 'x', 'y', '--robot', 'r', '--before', 'u', '-o', 'o', 'b')
    assert run(capsys, 'compare', *words) == (0, '', '')
    assert (got['first'], got['second']) == ('a', 'b')
    assert (got['before'], got['after']) == (('u',), ('x', 'y'))


# ---------------------------------------------------------------- identify


@pytest.mark.usefixtures('no_progress')
def test_identify_json_is_the_only_output_and_has_the_promised_shape(capsys, bag):
    status, out, err = run(capsys, 'identify', bag, '--robot', ROBOT, '--json')
    assert status == 0
    assert err == ''
    result = keeps('identify', out)
    aam = result['aam']
    assert aam['unit'] == 'N m s'
    error = np.abs(np.array(aam['value']) - TRUTH)
    assert np.all(error < 0.01 * TRUTH)
    assert np.all(error < 5.0 * np.array(aam['std']))  # seeded, so no chance involved
    assert {'name', 'value', 'std', 'unit'} <= set(result['parameters'][0])
    assert 0 < result['rank'] <= result['unknowns']
    assert aam['source'] == ['data'] * 3
    assert result['condition'] > 1.0
    assert 0.8 < result['chi2_per_dof'] < 1.25
    assert result['method'] == 'ml'
    assert {'value', 'std', 'unit'} <= set(result['momentum'])


def test_identify_prints_a_table_for_people(capsys, bag):
    status, out, _ = run(capsys, 'identify', bag, '--robot', ROBOT)
    assert status == 0
    for text in (
        'wheel momentum of the captured body',
        'h_link_3_x',
        'N m s',
        'kg m^2',
        'method ml',
    ):
        assert text in out
    assert 'note: sample times are header stamps' in out
    assert '\x1b' not in out  # no colors where it is no terminal


@pytest.mark.parametrize('method', ['ls', 'recursive'])
def test_identify_by_the_other_methods(capsys, bag, method):
    status, out, _ = run(capsys, 'identify', bag, '--robot', ROBOT, '--json', '--method', method)
    result = keeps('identify', out)
    assert status == (0 if result['valid'] else 1)
    assert result['method'] == method


def test_identify_takes_npz(capsys, bag, tmp_path):
    save_npz(read_bag(bag, load_robot_file(ROBOT).robot), tmp_path / 'run.npz')
    _, from_bag, _ = run(capsys, 'identify', bag, '--robot', ROBOT, '--json', '--method', 'ls')
    _, from_npz, _ = run(
        capsys, 'identify', tmp_path / 'run.npz', '--robot', ROBOT, '--json', '--method', 'ls'
    )
    assert json.loads(from_npz) == json.loads(from_bag)


def test_identify_takes_a_compressed_log_without_names(capsys, bag, tmp_path):
    """Every sensor at its own times, what it does not sample empty; exact but for the times."""
    record = read_bag(bag, load_robot_file(ROBOT).robot)
    parts = (
        (record.joint_time, np.hstack([record.q, record.qd])),
        (record.rate_time, record.omega),
        (record.attitude_time, record.attitude_xyzw),
    )
    times = np.unique(np.concatenate([time for time, _ in parts]))
    cells = [np.char.mod('%.17g', times)[:, None]]
    for time, values in parts:
        column = np.full((len(times), values.shape[1]), '', dtype='U30')
        column[np.searchsorted(times, time)] = np.char.mod('%.17g', values)
        cells.append(column)
    log = tmp_path / 'run.csv.gz'
    log.write_bytes(gzip.compress('\n'.join(map(','.join, np.hstack(cells))).encode()))
    mapping = {
        'header': 'none',
        'time': {'columns': 0, 'unit': 's'},
        'joints': {
            'names': ['joint_1', 'joint_2', 'joint_3'],
            'position': {'columns': [1, 2, 3], 'unit': 'rad'},
            'velocity': {'columns': [4, 5, 6], 'unit': 'rad/s'},
        },
        'gyro': {'columns': [7, 8, 9], 'unit': 'rad/s'},
        'attitude': {'columns': [10, 11, 12, 13], 'order': 'xyzw'},
    }
    (tmp_path / 'map.yaml').write_text(json.dumps(mapping))
    common = ('--robot', ROBOT, '--json', '--method', 'ls')
    _, from_bag, _ = run(capsys, 'identify', bag, *common)
    mapped = ('--map', tmp_path / 'map.yaml', '--split-gaps')
    _, from_log, _ = run(capsys, 'identify', log, *common, *mapped)
    aam = [json.loads(out)['aam']['value'] for out in (from_bag, from_log)]
    # times of the log are rounded to 1e-9 s
    np.testing.assert_allclose(aam[1], aam[0], rtol=1e-6, atol=0)


def test_a_simulated_machine_that_says_currents_is_read_in_newton_metres(capsys, tmp_path):
    text = Path(ROBOT).read_text()
    amperes = tmp_path / 'amperes.yaml'
    stated = 'effort_kind: current\n      motor_constant: [8.0, 16.0, 32.0]\n      urdf: '
    amperes.write_text(text.replace('urdf: ', stated, 1))
    efforts = []
    for name, robot in (('torque', ROBOT), ('current', amperes)):
        options = ('-o', tmp_path / name, '--duration', '0.5')
        assert run(capsys, 'simulate', '--robot', robot, *options)[0] == 0
        record = read_record(tmp_path / name, load_robot_file(robot).robot)
        efforts.append(record.effort)
    np.testing.assert_array_equal(*efforts)  # powers of two divide and multiply exactly
    raw = read_record(tmp_path / 'current', load_robot_file(ROBOT).robot).effort
    np.testing.assert_array_equal(raw * [8.0, 16.0, 32.0], efforts[0])
    mute = tmp_path / 'mute.yaml'
    mute.write_text(text.replace('urdf: ', 'effort_kind: current\n      urdf: ', 1))
    command = ('identify', tmp_path / 'current', '--robot', mute)
    assert 'robot.motor_constant: is missing: efforts of joint_1' in fails(capsys, 2, *command)


def test_identify_without_excitation_exits_with_1_and_says_why(capsys, tmp_path):
    still = ['--reference', 'hold', '--duration', '5', '--law', 'computed_torque']
    assert run(capsys, 'simulate', '--robot', ROBOT, '-o', tmp_path / 'still', *still)[0] == 0
    arguments = ('identify', tmp_path / 'still', '--robot', ROBOT)
    status, out, _ = run(capsys, *arguments)
    assert status == 1
    assert 'not valid: ' in out
    status, out, _ = run(capsys, *arguments, '--json')
    assert status == 1
    result = json.loads(out, parse_constant=lambda name: pytest.fail(f'{name} is no JSON'))
    assert result['valid'] is False
    assert result['reason']


def test_identify_refusals(capsys, bag, tmp_path):
    identify_it = ('identify', '--robot', ROBOT)
    assert 'no such file' in fails(capsys, 2, *identify_it, tmp_path / 'nothing')
    assert 'no metadata.yaml' in fails(capsys, 2, *identify_it, tmp_path)
    assert 'no such file' in fails(capsys, 2, *identify_it, tmp_path / 'x.npz')
    (tmp_path / 'x.npz').write_text('x')
    assert 'not a readable npz' in fails(capsys, 2, *identify_it, tmp_path / 'x.npz')
    (tmp_path / 'x.csv').write_text('t,q\n0,1\n')
    assert '--map' in fails(capsys, 2, *identify_it, tmp_path / 'x.csv')
    other = Path(ROBOT).read_text().replace('urdf: package://spacerobot_ros/config/', 'urdf: ')
    (tmp_path / 'other.yaml').write_text(other)
    urdf = (ROOT / 'config' / 'servicer.urdf').read_text().replace('joint_3', 'wrist')
    (tmp_path / 'servicer.urdf').write_text(urdf)
    (tmp_path / 'other.yaml').write_text(other.replace('joint_3', 'wrist'))
    err = fails(capsys, 2, 'identify', bag, '--robot', tmp_path / 'other.yaml')
    assert 'lacks wrist and has foreign joint_3' in err
    fixed = Path(ROBOT).read_text().replace('base: free', 'base: fixed')
    (tmp_path / 'fixed.yaml').write_text(fixed)
    err = fails(capsys, 2, 'identify', bag, '--robot', tmp_path / 'fixed.yaml')
    assert 'robot.base: momentum-based identification needs a free base' in err
    assert 'use `diagnose`' in err


@pytest.mark.parametrize(
    ('std', 'expected'), [(0.0097, 4), (0.22, 2), (1.3, 1), (25.0, 0), (0.0, 6), (np.nan, 6)]
)
def test_decimals_show_two_digits_of_the_standard_deviation(std, expected):
    assert decimals(std) == expected


# ---------------------------------------------------------------- the frame around


@pytest.mark.parametrize('command', ['', *COMMANDS])
def test_help_teaches_by_examples(capsys, command):
    status, out, err = run(capsys, *filter(None, [command]), '--help')
    assert (status, err) == (0, '')
    assert f'\n  examples:\n    {"source <(" * (command == "completion")}spacerobot ' in out
    assert '\n  exit status: 0 ' in out


def test_version(capsys):
    status, out, err = run(capsys, '--version')
    assert (status, out, err) == (0, f'spacerobot {__version__}\n', '')


@pytest.mark.parametrize(
    ('error', 'status', 'message'),
    [
        (SpaceRobotError('two\n  lines'), 2, 'spacerobot identify: two lines\n'),
        (KeyboardInterrupt(), 130, 'spacerobot identify: interrupted\n'),
        (
            OSError(errno.ENOSPC, 'No space left on device', 'out/a'),
            2,
            'spacerobot identify: out/a: No space left on device\n',
        ),
        (
            OSError(errno.ENAMETOOLONG, 'File name too long', 'x/below'),  # x is an argument
            2,
            'spacerobot identify: x/below: File name too long\n',
        ),
        (
            ModuleNotFoundError(name='rclpy'),
            2,
            'spacerobot identify: rclpy is not installed: source your ROS 2, or make setup, then '
            'source env.sh\n',
        ),
    ],
)
def test_errors_become_statuses(capsys, monkeypatch, error, status, message):
    def stop(**_):
        raise error

    monkeypatch.setattr(identify.run, 'callback', stop)
    assert fails(capsys, status, 'identify', 'x', '--robot', 'y') == message


@pytest.mark.parametrize(
    ('duration', 'why'),
    [('1e30', 'stamps end at 2147483647 s'), ('2e9', 'a bag of 2e+09 s needs 100,000 GB')],
)
def test_a_run_that_never_ends_is_not_begun(capsys, tmp_path, duration, why):
    why = why.replace('100,000', '1e+05')  # 500 bytes a period of 0.01 s
    target = tmp_path / 'new' / 'bag'
    args = ['simulate', '--robot', 'config/servicer.yaml', '-o', str(target)]
    assert f'--duration: {"" if "bag" in why else "1e+30 s: "}{why}' in fails(
        capsys, 2, *args, '--duration', duration
    )
    assert not list(tmp_path.iterdir())


def test_what_can_not_be_written_is_refused_before_the_work(capsys, tmp_path):
    (tmp_path / 'file').write_text('')
    target = str(tmp_path / 'file' / 'page')
    for words in (
        ['export', '--robot', 'none.yaml', '--to', 'urdf', '-o', target],
        ['excite', '--robot', 'none.yaml', '-o', target],
        ['check', 'none', '--report', target],
        ['fleet', 'none', '--robot', 'none.yaml', '--out', target],
    ):
        assert 'file is a file, not a folder' in fails(capsys, 2, *words)


def test_a_fault_of_ours_is_status_3_and_says_what_to_send(capsys, monkeypatch, tmp_path):
    def stop(**_):
        raise ZeroDivisionError('by\nzero')

    monkeypatch.setattr(simulate.run, 'callback', stop)
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    line = fails(capsys, 3, 'simulate', '--robot', 'x', '-o', 'y')
    assert 'a fault of ours (ZeroDivisionError: by zero)' in line
    (sent,) = tmp_path.iterdir()
    assert f'please send {sent}' in line
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'none'))
    assert 'a fault of ours' in fails(capsys, 3, 'simulate', '--robot', 'x', '-o', 'y')
    text = sent.read_text()
    assert 'simulate --robot x -o y' in text
    assert 'Traceback' in text


def spacerobot(*arguments, **options):
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    return subprocess.run(
        [sys.executable, '-m', 'spacerobot_ros.cli.main', *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        **options,
    )


def test_as_a_process(tmp_path):
    done = spacerobot('simulate', '--robot', ROBOT, '-o', tmp_path / 'run', '--duration', '0.1')
    assert (done.returncode, done.stderr) == (0, '')
    again = spacerobot('simulate', '--robot', ROBOT, '-o', tmp_path / 'run', '--duration', '0.1')
    assert again.returncode == 2
    assert again.stdout == ''
    assert 'Traceback' not in again.stderr


def test_help_imports_nothing_heavy():
    code = (
        'import sys\n'
        'from spacerobot_ros.cli.main import main\n'
        'main(["--help"])\n'
        'heavy = {"numpy", "scipy", "pinocchio", "matplotlib", "rosbags", "rich", "rclpy"}\n'
        'print(sorted(heavy & set(sys.modules)), file=sys.stderr)\n'
    )
    done = subprocess.run(
        [sys.executable, '-c', code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr.strip() == '[]'


def test_a_reader_that_goes_away_is_no_traceback(bag):
    program = f'{sys.executable} -m spacerobot_ros.cli.main'
    command = f'{program} identify {bag} --robot {ROBOT} --method ls --json'
    done = subprocess.run(
        ['bash', '-c', f'set -o pipefail; {command} | true'],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert 'Traceback' not in done.stderr
    assert 'BrokenPipe' not in done.stderr
    assert done.returncode in (0, 1, 141)  # 0 or 1 where the pipe took it all before it closed
