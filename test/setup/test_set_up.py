"""Stamps, refusals and the lock of the set-up, without installing anything."""

import fcntl
import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import probe_python
import pytest
import setup_tools
import setup_workspace
from set_up import only_one
from setup_workspace import SetupError, Workspace

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def work(tmp_path):
    """Return a workspace with the files that stamps are made from."""
    for folder in ('scripts', 'requirements', 'msg_defs', 'config'):
        shutil.copytree(ROOT / folder, tmp_path / folder)
    for name in ('setup.py', 'setup.cfg', 'package.xml'):
        shutil.copy(ROOT / name, tmp_path)
    return Workspace(tmp_path, environ={'PATH': os.defpath})


def make_current(work):
    """Write what a finished set-up leaves behind."""
    work.python.parent.mkdir(parents=True)
    work.python.touch()
    setup_workspace.write_stamp(work.venv_stamp, {**setup_workspace.wanted_venv(work), 'made': 1})
    for package in setup_workspace.PACKAGES:
        (work.root / 'build' / package).mkdir(parents=True)
    work.build_stamp.parent.mkdir()
    setup_workspace.write_stamp(work.build_stamp, setup_workspace.wanted_build(work))


def is_current(work):
    return setup_workspace.is_venv_current(work), setup_workspace.is_build_current(work)


def append(path, text='\n# changed\n'):
    path.parent.mkdir(exist_ok=True)
    with path.open('a', encoding='utf-8') as file:
        file.write(text)


def test_fresh_checkout_needs_everything(work):
    assert is_current(work) == (False, False)


def test_finished_set_up_needs_nothing(work):
    make_current(work)
    assert is_current(work) == (True, True)


@pytest.mark.parametrize(
    ('changed', 'expected'),
    [
        ('requirements/wheels.txt', (False, True)),
        ('requirements/sourced.txt', (True, True)),
        ('scripts/mend_cmake_exports.py', (False, True)),
        ('msg_defs/msg/Estimate.msg', (True, False)),
        ('msg_defs/msg/New.msg', (True, False)),
        ('setup.py', (True, False)),
        ('package.xml', (True, False)),
        ('config/servicer.yaml', (True, True)),
        ('config/new.yaml', (True, False)),
        ('launch/new.launch.py', (True, False)),
        ('spacerobot_ros/new.py', (True, True)),
    ],
)
def test_only_changed_inputs_count(work, changed, expected):
    make_current(work)
    append(work.root / changed)
    assert is_current(work) == expected


def test_new_venv_needs_a_new_build(work):
    make_current(work)
    setup_workspace.write_stamp(work.venv_stamp, {**setup_workspace.wanted_venv(work), 'made': 2})
    assert is_current(work) == (True, False)


def test_lost_build_folder_is_noticed(work):
    make_current(work)
    shutil.rmtree(work.root / 'build')
    assert is_current(work) == (True, False)


def test_moved_checkout_needs_everything(work, tmp_path):
    make_current(work)
    moved = tmp_path / 'moved'
    moved.mkdir()
    for child in tmp_path.iterdir():
        if child != moved:
            child.rename(moved / child.name)
    assert is_current(Workspace(moved, environ=work.environ)) == (False, True)


def test_another_ros_needs_another_venv(work, tmp_path):
    make_current(work)
    ros = make_ros(tmp_path / 'ros')
    assert not setup_workspace.is_venv_current(Workspace(work.root, (ros,), work.environ))


@pytest.mark.parametrize('content', ['', '{"inp', '[]', '\x00'])
def test_broken_stamp_counts_as_none(work, content):
    make_current(work)
    work.venv_stamp.write_text(content, encoding='utf-8')
    assert not setup_workspace.is_venv_current(work)


def test_another_python_is_made_only_when_asked_for(work):
    make_current(work)
    asked = Workspace(work.root, environ={**work.environ, 'PYTHON': sys.executable})
    assert not setup_workspace.is_venv_current(asked)


def make_ros(prefix):
    """Return the prefix of something that looks like a ROS 2 installation."""
    (prefix / 'share' / 'rclpy').mkdir(parents=True)
    (prefix / 'share' / 'rclpy' / 'package.xml').touch()
    return str(prefix)


def test_sourced_ros_is_recognized(tmp_path):
    ros = make_ros(tmp_path / 'ros')
    own = make_ros(tmp_path / 'checkout' / '.venv')
    overlay = str(tmp_path / 'overlay')

    def sourced(**environ):
        return probe_python.sourced_ros(environ, str(tmp_path / 'checkout'))

    assert sourced(ROS_DISTRO='kilted', AMENT_PREFIX_PATH=f'{overlay}:{ros}') == [overlay, ros]
    assert sourced(ROS_DISTRO='kilted', AMENT_PREFIX_PATH=f'{own}:{ros}') == [ros]
    assert sourced(ROS_DISTRO='kilted', AMENT_PREFIX_PATH=own) == []
    assert sourced(ROS_DISTRO='kilted', AMENT_PREFIX_PATH=overlay) == []
    assert sourced(AMENT_PREFIX_PATH=ros) == []
    assert sourced() == []


def test_tools_do_not_see_this_workspace_nor_make(work):
    inside, outside = f'{work.root}/install/x', '/opt/other'
    environ = {
        'PATH': f'{work.root}/.venv/bin:/usr/bin',
        'CMAKE_PREFIX_PATH': f'{inside}:{outside}',
        'AMENT_PREFIX_PATH': f'{inside}:{outside}',
        'MAKEFLAGS': 'j',
        'PYTHONPATH': outside,
        'PYTHONDONTWRITEBYTECODE': '1',
    }
    env = setup_tools.tool_environment(Workspace(work.root, environ=environ))
    assert env['AMENT_PREFIX_PATH'] == env['CMAKE_PREFIX_PATH'] == str(work.venv)
    assert env['PATH'] == f'{work.venv}/bin:/usr/bin'
    assert 'MAKEFLAGS' not in env
    assert 'PYTHONDONTWRITEBYTECODE' not in env  # what the set-up imports stays compiled
    assert 'PYTHONPATH' not in env
    sourced = setup_tools.tool_environment(Workspace(work.root, (outside,), environ))
    assert sourced['AMENT_PREFIX_PATH'] == sourced['CMAKE_PREFIX_PATH'] == outside
    assert sourced['PYTHONPATH'] == outside


def test_other_machines_are_refused(work, monkeypatch):
    monkeypatch.setattr(platform, 'machine', lambda: 'aarch64')
    with pytest.raises(SetupError, match='no ROS 2 wheels for Linux on aarch64'):
        setup_tools.require_platform(work)
    setup_tools.require_platform(Workspace(work.root, ('/opt/ros/kilted',)))


@pytest.mark.parametrize('name', ['my robot', 'a:b', "it's"])
def test_paths_that_colcon_cannot_build_in_are_refused(tmp_path, name):
    with pytest.raises(SetupError, match='move the checkout'):
        setup_tools.require_platform(Workspace(tmp_path / name))


def test_cause_is_read_from_the_log(work):
    append_log(work, 'ERROR: [Errno 28] No space left on device')
    assert 'the disk is full; see' in str(
        setup_tools.failure(work, 'x.log', 'installing', 'other')
    )
    append_log(work, 'something else')
    assert 'installing failed: other; see' in str(
        setup_tools.failure(work, 'x.log', 'installing', 'other')
    )


def append_log(work, text):
    path = setup_tools.log_path(work, 'x.log')
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding='utf-8')


def test_lock_keeps_others_out_and_outlives_a_killed_parent(work):
    with only_one(work.root) as lock:
        other = os.open(work.root / '.setup.lock', os.O_RDWR)
        with pytest.raises(BlockingIOError):
            fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
        child = subprocess.Popen(
            ['/bin/sh', '-c', 'read line'], stdin=subprocess.PIPE, pass_fds=(lock,)
        )
    with pytest.raises(BlockingIOError):  # the child of a set-up that ended still works
        fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    child.communicate(b'\n')
    fcntl.flock(other, fcntl.LOCK_EX | fcntl.LOCK_NB)
    os.close(other)


def test_what_is_shown_does_not_go_to_the_log(work, capfd):
    said = [sys.executable, '-c', 'import sys; print("shown"); sys.stderr.write("kept")']
    with only_one(work.root) as lock:
        shown = setup_tools.start(work, 'a.log', said, work.environ, lock, is_shown=True)
        assert shown.wait() == 0
        assert setup_tools.run(work, 'b.log', said, work.environ, lock)
    assert capfd.readouterr().out == 'shown\n'
    assert setup_tools.log_path(work, 'a.log').read_text(encoding='utf-8').endswith('kept')
    assert 'shown' in setup_tools.log_path(work, 'b.log').read_text(encoding='utf-8')
