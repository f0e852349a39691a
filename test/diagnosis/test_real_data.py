"""Measured arms (docs/data.md): what is named on them, and what that is worth on another run."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from support.contracts import keeps

from spacerobot_ros.cli.main import main

ROOT = Path(__file__).resolve().parents[2]
DATA = Path(os.environ.get('SPACEROBOT_DATA', ROOT.parent / 'shared' / 'data'))
EXAMPLES = ROOT / 'config' / 'examples'


def data_set(name):
    """A folder of measured data, or a skip."""
    if not (DATA / name).is_dir():
        pytest.skip(f'no measured data in {DATA / name} (set SPACEROBOT_DATA)')
    return DATA / name


def diagnosed(capsys, *words):
    """Exit status and diagnosis.json of a command."""
    status = main(['diagnose', *map(str, words), '--no-closed-loop', '--json'])
    return status, keeps('diagnose', capsys.readouterr().out)


def test_kuka_lwr4(tmp_path, capsys):
    folder = data_set('kuka_lwr4')
    for path in (folder / 'kuka_lwr4.urdf', EXAMPLES / 'kuka_lwr4.yaml'):
        shutil.copyfile(path, tmp_path / path.name)
    status, found = diagnosed(
        capsys,
        folder / 'measurements_1.npz',
        '--score',
        folder / 'measurements_2.npz',
        '--map',
        EXAMPLES / 'kuka_lwr4_map.yaml',
        '--robot',
        tmp_path / 'kuka_lwr4.yaml',
        '--out',
        tmp_path / 'out',
    )
    assert (status, found['verdict']) == (1, 'partly_explained')
    causes = {(c['effect'], c['where']): c['parameters'] for c in found['causes']}
    # published for these runs: torque sensors' offsets of 0.86 and -0.65 N m at joints 1 and 5
    assert causes['torque_sensor_bias', 'lwr_0_joint']['bias']['value'] == pytest.approx(
        0.86, abs=0.1
    )
    assert causes['torque_sensor_bias', 'lwr_4_joint']['bias']['value'] == pytest.approx(
        -0.65, abs=0.2
    )
    friction = {where for effect, where in causes if effect.endswith('_friction')}
    assert {'lwr_0_joint', 'lwr_4_joint'} <= friction
    assert (tmp_path / 'out' / 'extended_model.yaml').exists()
    # 1.1 N m without; a fit with all inertial parameters free leaves 0.26 N m
    assert found['score']['rms_before'] == pytest.approx(1.1, abs=0.05)
    assert found['score']['rms_after'] < 0.4


def test_xl330_pendulum_names_nothing_that_it_can_not_carry(tmp_path, capsys):
    folder = data_set('bam_xl330_pendulum')
    status, found = diagnosed(
        capsys,
        sorted(folder.glob('*.json'))[2],
        '--map',
        EXAMPLES / 'xl330_pendulum_map.yaml',
        '--robot',
        EXAMPLES / 'xl330_pendulum.yaml',
        '--out',
        tmp_path / 'out',
    )
    assert status == 1
    assert found['verdict'] in ('partly_explained', 'unexplained')
    assert not {c['effect'] for c in found['causes']} & {'fuel_slosh', 'flexible_appendage'}
