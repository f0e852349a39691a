"""`spacerobot excite` from the outside."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.contracts import keeps

from spacerobot_ros.cli.main import main
from spacerobot_ros.control.joint_reference import build_reference
from spacerobot_ros.effects.robot_file import load_robot_file

CONFIG = Path(__file__).parents[2] / 'config'


@pytest.fixture
def robot(tmp_path):
    """The usable servicer beside its URDF, searched briefly."""
    content = yaml.safe_load((CONFIG / 'servicer_excite.yaml').read_text())
    values = content['/**']['ros__parameters']
    values['robot']['urdf'] = 'servicer.urdf'
    values['excitation'].update(starts=1, iterations=3)
    path = tmp_path / 'robot' / 'servicer.yaml'
    path.parent.mkdir()
    shutil.copy(CONFIG / 'servicer.urdf', path.parent)
    path.write_text(yaml.safe_dump(content))
    return path


def test_writes_a_robot_file_that_keeps_the_limits(robot, tmp_path, capsys):
    out, page = tmp_path / 'elsewhere' / 'trajectory.yaml', tmp_path / 'report.html'
    arguments = ['excite', '--robot', str(robot), '-o', str(out), '--report', str(page)]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert 'advice:' in printed
    assert 'base rate' in printed
    file = load_robot_file(out)
    assert file.settings.reference.kind == 'fourier'
    assert file.settings.initial.angular_velocity == (0.0, 0.0, 0.0)
    motion = build_reference(file.settings.reference, np.zeros(3))
    q = np.array([motion.at(t).q for t in np.linspace(0.0, 20.0, 2001)])
    assert np.max(np.abs(q)) <= np.pi / 3
    text = page.read_text()
    assert text.count('<div class="live"') == 2
    assert main(arguments) == 2  # never over what is there
    assert '--force replaces it' in capsys.readouterr().err


def test_json_and_reproducibility(robot, tmp_path, capsys):
    texts = []
    for name in ('a.yaml', 'b.yaml'):
        out = tmp_path / name
        assert main(['excite', '--robot', str(robot), '-o', str(out), '--json']) == 0
        texts.append((capsys.readouterr().out, out.read_bytes()))
    assert texts[0] == texts[1]
    result = keeps('excite', texts[0][0])
    assert result['schema'] == 1
    assert {u['name'] for u in result['limits']} >= {'joint_range', 'base_rate', 'joint_torque'}
    assert all(u['margin'] >= 0.0 for u in result['limits'])
    assert len(result['design']['std']) == 22
    assert [o['factor'] for o in result['own_wheels']] == [1.0, 2.0, 5.0]


def test_bad_input_is_one_line(robot, tmp_path, capsys):
    content = yaml.safe_load(robot.read_text())
    content['/**']['ros__parameters']['excitation'].update(start='initial')
    robot.write_text(yaml.safe_dump(content))
    out = tmp_path / 'out.yaml'
    assert main(['excite', '--robot', str(robot), '-o', str(out)]) == 2
    error = capsys.readouterr().err
    assert error.count('\n') == 1
    assert 'no motion can keep the limits' in error
    assert not out.exists()
    assert main(['excite', '--robot', str(robot), '-o', str(robot)]) == 2
    assert 'is the robot file itself' in capsys.readouterr().err


@pytest.mark.parametrize(
    'option', [['--criterion', 'best'], ['--duration', '0'], ['--starts', '0']]
)
def test_bad_options(robot, tmp_path, option, capsys):
    assert main(['excite', '--robot', str(robot), '-o', str(tmp_path / 'x.yaml'), *option]) == 2
    assert option[0] in capsys.readouterr().err
