"""The two other ways in: pip in a clean environment, and a ROS 2 workspace as README has it."""

import os
import re
import shutil
import subprocess
import sys
from importlib.metadata import requires
from pathlib import Path

import pytest

from spacerobot_ros import requirements
from spacerobot_ros.requirements import BUILD, LIBRARIES, why_missing

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / 'README.md').read_text(encoding='utf-8')
LOCK = ROOT / 'requirements' / 'wheels.txt'


@pytest.fixture
def checkout(tmp_path):
    """Return a copy of what the repository holds, in the place of a workspace."""
    folder = tmp_path / 'src' / 'spacerobot_ros'
    skipped = shutil.ignore_patterns(
        '.git', '.venv', 'build', 'install', 'log', 'out', '*.egg-info', '__pycache__', '.*_cache'
    )
    shutil.copytree(ROOT, folder, ignore=skipped, symlinks=True)
    return folder


def run(command, folder, **environ):
    """Type a command, with no more than what reaches package indexes; return what it prints."""
    kept = {
        name: value
        for name, value in os.environ.items()
        if name in ('PATH', 'HOME') or name.startswith(('UV_', 'PIP_', 'SSL_', 'http', 'HTTP'))
    }
    done = subprocess.run(
        ['bash', '-c', command], cwd=folder, env={**kept, **environ}, capture_output=True,
        text=True, check=False, timeout=500,
    )  # fmt: skip
    assert done.returncode in (0, 1), done.stdout + done.stderr  # 1: something was found
    return done.stdout


@pytest.mark.installation
def test_pip_alone_gives_every_command_that_needs_no_ros(checkout, tmp_path):
    uv, clean = ROOT / '.venv' / 'bin' / 'uv', tmp_path / 'clean'
    run(f'{uv} venv -q --python {sys.executable} {clean}', tmp_path)
    pinned = f'-c {LOCK} -b {LOCK}'  # what the set-up has fetched
    run(f'{uv} pip install -q --python {clean}/bin/python {pinned} .', checkout)
    shutil.rmtree(checkout)
    (tmp_path / 'config').symlink_to(clean / 'share' / 'spacerobot_ros' / 'config')
    page = (ROOT / 'docs' / 'tutorials' / 'arm_payload.md').read_text(encoding='utf-8')
    for name, text in re.findall(r'^```yaml title="([^"]+)"\n(.*?)^```$', page, re.M | re.S):
        (tmp_path / name).write_text(text, encoding='utf-8')
    robot = '--robot config/servicer.yaml'
    for line in (
        f'spacerobot simulate {robot} -o run --duration 5',
        f'spacerobot check run {robot}',
        f'spacerobot identify run {robot}',
        f'spacerobot diagnose run {robot} --out diagnosis',
        f'spacerobot show run {robot} -o replay.html',
        f'spacerobot export {robot} --to urdf -o exported.urdf',
        f'spacerobot excite {robot} -o excite.yaml --starts 1',
        *re.findall(r'^```sh\n(.*?)^```$', page, re.M | re.S),  # compares an arm
    ):
        run(line, tmp_path, PATH=f'{clean}/bin:{os.environ["PATH"]}')
    for written in ('diagnosis', 'replay.html', 'exported.urdf', 'excite.yaml', 'out/week'):
        assert (tmp_path / written).exists(), written
    assert (clean / 'bin' / 'spacerobot').exists()
    assert any(clean.glob('lib/python3.*/site-packages/spacerobot_ros/py.typed'))


@pytest.mark.ros
@pytest.mark.installation
@pytest.mark.parametrize('option', ['', ' --symlink-install'])
def test_workspace_is_built_as_readme_says(checkout, tmp_path, option):
    command = re.search(r'^colcon build --base-paths .*$', README, re.M)[0]
    environ = ros_environment()
    run(command + option, tmp_path, **environ)
    programs = tmp_path / 'install' / 'spacerobot_ros' / 'lib' / 'spacerobot_ros'
    folder = tmp_path / 'elsewhere'
    folder.mkdir()
    enter = f'source {tmp_path}/install/setup.bash'
    assert run(f'{enter} && {programs}/spacerobot --version', folder, **environ)
    show = (
        'import spacerobot_ros.nodes.program as program, spacerobot_msgs;'
        '[program.node_class(node) for node in program.NODES];'
        'print(program.__file__, spacerobot_msgs.__file__, sep="\\n")'
    )
    seen = run(f"{enter} && python3 -c '{show}'", folder, **environ)
    assert all(line.startswith(str(tmp_path)) for line in seen.splitlines())
    assert set(os.listdir(programs)) == {path.name for path in (ROOT / 'programs').iterdir()}


def ros_environment():
    """Return a shell's environment with ROS 2 and without this checkout's own workspace."""
    environ = {name: os.environ.get(name, '') for name in ('LD_LIBRARY_PATH', 'PYTHONPATH')}
    if os.environ.get('ROS_DISTRO'):
        prefixes = os.environ['AMENT_PREFIX_PATH'].split(':')
        kept = ':'.join(prefix for prefix in prefixes if not prefix.startswith(str(ROOT)))
    else:
        kept, environ['PYTHONPATH'] = str(ROOT / '.venv'), ''
    return {
        **environ, 'AMENT_PREFIX_PATH': kept, 'CMAKE_PREFIX_PATH': kept,
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'OFF',
    }  # fmt: skip


def test_readme_has_the_commands_that_errors_name():
    assert BUILD in README
    assert LIBRARIES in README


def missing(name):
    return ModuleNotFoundError(f'No module named {name!r}', name=name)


@pytest.mark.parametrize(
    ('error', 'line'),
    [
        (missing('spacerobot_msgs.msg'), f'spacerobot_msgs is not built: .*{BUILD}'),
        (missing('rclpy'), 'rclpy is not installed: source your ROS 2, or make setup.*'),
        (missing('pinocchio'), f'pinocchio is not installed: make setup.*{LIBRARIES}'),
        (ImportError('no Field in it', name='pydantic'), f'no Field in it: .*{LIBRARIES}'),
    ],
)
def test_what_is_missing_is_one_line_with_the_command(error, line):
    assert re.fullmatch(line, why_missing(error))


def test_too_old_a_library_is_named(monkeypatch):
    monkeypatch.setattr(requirements, '_needed', lambda: ['numpy>=1.26', 'rich>=999.1', 'none>=1'])
    said = why_missing(ImportError('cannot import name', name='rich'))
    assert re.match(r'rich [\d.]+ is too old, rich>=999.1 is needed: ', said)


def test_what_is_needed_is_told_by_what_is_installed():
    assert any(needed.startswith('numpy>=') for needed in requires('spacerobot_ros'))


@pytest.mark.ros
@pytest.mark.parametrize('program', ['simulator', 'spacerobot demo'])
def test_a_program_without_messages_says_what_to_do(tmp_path, program):
    (tmp_path / 'spacerobot_msgs.py').write_text(
        "raise ModuleNotFoundError('no messages', name='spacerobot_msgs')", encoding='utf-8'
    )
    paths = f'{tmp_path}:{ROOT}:{os.environ.get("PYTHONPATH", "")}'
    done = subprocess.run(
        [sys.executable, *f'{ROOT}/programs/{program}'.split()], cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': paths}, capture_output=True, text=True, check=False,
        timeout=120,
    )  # fmt: skip
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert BUILD in done.stderr
