"""What the set-up makes again and when, with tools that only say that they were called."""

import os
import shutil
import signal

import pytest

ALL = {'venv', 'packages', 'build'}


def append(path, text='\n# changed\n'):
    path.parent.mkdir(exist_ok=True)
    with path.open('a', encoding='utf-8') as file:
        file.write(text)


def ended(process):
    """Wait for a set-up; return its exit status."""
    process.communicate(timeout=60)
    return process.returncode


def test_finished_set_up_needs_nothing(ready):
    assert ready.made() == set()
    assert not ready.calls_file.exists()  # not even Python was started


@pytest.mark.parametrize(
    ('changed', 'expected'),
    [
        ('requirements/wheels.txt', {'packages', 'build'}),
        ('requirements/sourced.txt', set()),
        ('scripts/mend_cmake_exports.py', {'packages', 'build'}),
        ('msg_defs/msg/Estimate.msg', {'build'}),
        ('msg_defs/msg/New.msg', {'build'}),
        ('setup.py', {'build'}),
        ('pyproject.toml', {'build'}),
        ('package.xml', {'build'}),
        ('programs/simulator', {'build'}),
        ('config/servicer.yaml', set()),
        ('config/new.yaml', {'build'}),
        ('launch/new.launch.py', {'build'}),
        ('spacerobot_ros/new.py', set()),
    ],
)
def test_only_changed_inputs_count(ready, changed, expected):
    append(ready.checkout / changed)
    assert ready.made() == expected
    assert ready.made() == set()


def test_build_is_kept_unless_messages_come_or_go(ready):
    kept = ready.checkout / 'build' / 'kept'
    kept.touch()
    append(ready.checkout / 'msg_defs' / 'msg' / 'Estimate.msg')
    assert ready.made() == {'build'}
    assert kept.exists()
    append(ready.checkout / 'msg_defs' / 'msg' / 'New.msg')
    assert ready.made() == {'build'}
    assert not kept.exists()


def test_rebuild_builds_what_is_current(ready):
    assert ready.made('--rebuild') == {'build'}


def test_lost_build_folder_is_noticed(ready):
    shutil.rmtree(ready.checkout / 'build')
    assert ready.made() == {'build'}


def test_moved_checkout_needs_everything(ready):
    moved = ready.checkout.with_name('moved')
    ready.checkout.rename(moved)
    ready.checkout = moved
    assert ready.made() == ALL


@pytest.mark.parametrize('stamp', ['.venv/spacerobot-stamp', 'install/spacerobot-stamp'])
@pytest.mark.parametrize('content', ['', 'x\ny\n', '\0'])
def test_broken_stamp_counts_as_none(ready, stamp, content):
    (ready.checkout / stamp).write_text(content, encoding='utf-8')
    assert ready.made() == (ALL if '.venv' in stamp else {'build'})


def test_another_python_is_made_only_when_asked_for(ready):
    shutil.copy(ready.programs / 'python3', ready.programs / 'python3.12')
    assert ready.made(PYTHON='python3') == set()
    assert ready.made(PYTHON='python3.12') == ALL
    assert ready.made() == set()


def test_another_ros_needs_another_venv(ready, ros):
    assert ready.made(**ros) == ALL
    assert any('--system-site-packages' in call for call in ready.calls())
    assert any(call.endswith('requirements/sourced.txt') for call in ready.calls())
    assert ready.made(**ros) == set()
    assert ready.made() == ALL


def test_a_sourced_ros_without_colcon_gets_one(machine, ros):
    machine.put_all()
    assert machine.made(NO_COLCON='1', **ros) == ALL
    assert any('sourced.txt requirements/colcon.txt' in call for call in machine.calls())


def test_a_ros_counts_as_sourced_when_it_has_rclpy_and_is_not_ours(ready, ros):
    ours = f'{ready.checkout}/.venv:{ready.checkout}/install/spacerobot_msgs'
    (ready.checkout / '.venv' / 'share' / 'rclpy').mkdir(parents=True)
    (ready.checkout / '.venv' / 'share' / 'rclpy' / 'package.xml').touch()
    assert ready.made(ROS_DISTRO='jazzy', AMENT_PREFIX_PATH=ours) == set()
    assert ready.made(ROS_DISTRO='jazzy', AMENT_PREFIX_PATH='/overlay') == set()
    assert ready.made(AMENT_PREFIX_PATH=ros['AMENT_PREFIX_PATH']) == set()
    overlaid = f'{ours}:/overlay:{ros["AMENT_PREFIX_PATH"]}'
    assert ready.made(**{**ros, 'AMENT_PREFIX_PATH': overlaid}) == ALL
    assert (
        ready.made(**{**ros, 'AMENT_PREFIX_PATH': f'/overlay:{ros["AMENT_PREFIX_PATH"]}'}) == set()
    )


def test_tools_do_not_see_this_workspace_nor_make(ready):
    inside, outside = f'{ready.checkout}/install/x', '/opt/other'
    seen = ready.checkout.with_name('seen')
    ready.put('sees', f'env > {seen}')
    environ = {
        'PATH': f'{ready.checkout}/.venv/bin:{ready.programs}',
        'CMAKE_PREFIX_PATH': f'{inside}:{outside}',
        'AMENT_PREFIX_PATH': f'{inside}:{outside}',
        'MAKEFLAGS': 'k',
        'PYTHONPATH': outside,
        'PYTHONDONTWRITEBYTECODE': '1',
        'SLOWLY': 'sees',
    }
    venv = f'{ready.checkout}/.venv'
    assert ready.made('--rebuild', **environ) == {'build'}
    env = dict(line.split('=', 1) for line in seen.read_text().splitlines() if '=' in line)
    assert env['AMENT_PREFIX_PATH'] == env['CMAKE_PREFIX_PATH'] == venv
    assert env['PATH'] == f'{venv}/bin:{ready.programs}'
    assert env['MAKEFLAGS'] == f'-j{len(os.sched_getaffinity(0))}'
    assert 'PYTHONDONTWRITEBYTECODE' not in env  # what is imported stays compiled
    assert 'PYTHONPATH' not in env


def test_pip_where_uv_does_not_work(machine):
    machine.put_all()
    assert machine.made(UV_FAILS='1') == ALL
    assert any(call.endswith('-r requirements/wheels.txt') for call in machine.calls())


def test_uv_on_the_path_serves_unless_it_is_old(ready):
    for version, serves in (('0.4.30', False), ('0.13.9', True)):
        ready.put(
            'uv',
            f'case $1 in --version) echo uv {version} ;; *) echo "own $*" >> "$CALLS" ;; esac',
        )
        shutil.rmtree(ready.checkout / '.venv')
        assert ready.made() == ALL
        assert any(call.startswith('own pip sync') for call in ready.calls()) == serves


@pytest.mark.parametrize('step', [{'PIP_FAILS': '1', 'UV_FAILS': '1'}, {'BUILD_FAILS': '1'}])
def test_a_failed_set_up_goes_on_when_it_can(machine, step):
    machine.put_all()
    assert machine.set_up(**step)[0] == 1
    assert 'build' in machine.made()
    assert machine.made() == set()


def test_two_at_once_wait_for_each_other_and_work_once(ready):
    gate = ready.checkout.with_name('gate')
    ready.put('waits', f'while [ ! -e {gate} ]; do sleep 0.01; done')
    append(ready.checkout / 'msg_defs' / 'msg' / 'Estimate.msg')
    first = ready.start(SLOWLY='waits')
    while ready.made_so_far('colcon_core.command') == 0:
        assert first.poll() is None
    second = ready.start()
    assert 'waiting for another set-up' in second.stdout.readline()
    gate.touch()
    assert ended(first) == ended(second) == 0
    assert ready.made_so_far('colcon_core.command') == 1


def test_what_changes_during_a_build_is_built_again(ready):
    changed = ready.checkout / 'msg_defs' / 'msg' / 'Estimate.msg'
    ready.put('changes', f'echo "# changed" >> {changed}')
    assert ready.made('--rebuild', SLOWLY='changes') == {'build'}
    assert ready.made() == {'build'}


def test_a_killed_set_up_starts_afresh_and_its_tools_keep_the_lock(ready):
    gate = ready.checkout.with_name('gate')
    ready.put('waits', f'while [ ! -e {gate} ]; do sleep 0.01; done')
    killed = ready.start('--rebuild', SLOWLY='waits')
    while ready.made_so_far('colcon_core.command') == 0:
        assert killed.poll() is None
    killed.kill()
    (ready.checkout / 'build' / 'half').mkdir(parents=True)
    second = ready.start()
    assert 'waiting for another set-up' in second.stdout.readline()
    gate.touch()
    assert ended(second) == 0
    assert ended(killed) == -signal.SIGKILL
    assert not (ready.checkout / 'build' / 'half').exists()
    assert ready.made() == set()


def test_interrupted(ready):
    ready.put('interrupts', 'kill -INT $(cat pid); sleep 0.2')
    process = ready.start('--rebuild', SLOWLY='interrupts')
    (ready.checkout / 'pid').write_text(str(process.pid))
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors == 'spacerobot set-up: interrupted; the next run starts afresh\n'
