"""Every tutorial runs as it stands: titled blocks are files, `sh` blocks are typed."""

from __future__ import annotations

import inspect
import os
import re
import shlex
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import spacerobot_ros
from spacerobot_ros.cli import main

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted((ROOT / 'docs' / 'tutorials').glob('*.md'))
BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


def blocks(page):
    return BLOCK.findall(page.read_text(encoding='utf-8'))


def typed(text):
    """Command lines, continued ones joined."""
    return [line for line in text.replace('\\\n', ' ').splitlines() if line.strip()]


def test_there_are_seven_and_each_is_run():
    assert len(PAGES) == 8  # and their list
    assert all(blocks(page) for page in PAGES if page.name != 'index.md')


@pytest.mark.tutorial
@pytest.mark.parametrize('page', [p for p in PAGES if p.name != 'index.md'], ids=lambda p: p.stem)
def test_tutorial(page, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'config').symlink_to(ROOT / 'config')
    for language, name, text in blocks(page):
        if name:
            (tmp_path / name).write_text(text, encoding='utf-8')
        elif language == 'sh':
            for line in typed(text):
                run(line)
    printed = capfd.readouterr().out
    for word in EXPECTED.get(page.stem, ()):
        assert word in printed, word


@pytest.mark.tutorial
def test_the_example_of_the_package(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'config').symlink_to(ROOT / 'config')
    run('spacerobot simulate --robot config/servicer.yaml -o bag --duration 8')
    _, _, example = inspect.getdoc(spacerobot_ros).partition('\n\n    ')
    exec(textwrap.dedent(f'    {example}'), {})
    assert 'explained The data differ' in capsys.readouterr().out
    effects = spacerobot_ros.load_robot_file(tmp_path / 'new.yaml').effects
    assert 'target_wheel_momentum' in {effect.id for effect in effects}


def run(line):
    """A command in this process, which has its kernels; all else in a shell."""
    words = shlex.split(line)
    if words[0] == 'spacerobot':
        assert main.main(words[1:]) in (0, 1), line  # 1: something was found
        return
    if words[0] == 'python':
        subprocess.run([sys.executable, *words[1:]], check=True, env=environment())
        return
    subprocess.run(['sh', '-c', line], check=True)


def environment():
    return {**os.environ, 'PYTHONPATH': f'{ROOT}:{os.environ.get("PYTHONPATH", "")}'}


EXPECTED = {
    'bag_to_cause': ('verdict: good', 'viscous friction in a joint at joint_2', 'effects written'),
    'own_robot': ('wheel momentum of the captured body', 'h_lower_x'),
    'arm_payload': ('verdict: changed', 'at lower (mx +0.4997 +- 0.04 kg m).'),
    'own_effect': ('drag (a formula) at joint_2',),
    'next_motion': ('told apart',),
    'watch_flight': (
        '8.4 s: ok: the model explains the data\n',
        '13.4 s: error: joint_2 torque: unexplained 1.2 N m\n',
    ),
    'fleet_cluster': ('joint_2   flights/day_2     ',),
}
