"""`spacerobot check` from the outside."""

from __future__ import annotations

import numpy as np
import pytest
from support.contracts import keeps

from spacerobot_ros.cli import main
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.recording.npz import save_npz
from spacerobot_ros.recording.record import RateSeries, Record
from spacerobot_ros.report import html


@pytest.fixture
def gyro(tmp_path, rng):
    """A minute of a gyro at rest."""
    stamps = np.arange(6000) * 10_000_000
    rates = RateSeries(stamps, 1e-4 * rng.standard_normal((6000, 3)))
    save_npz(Record(rates=rates), tmp_path / 'gyro.npz')
    return str(tmp_path / 'gyro.npz')


def test_a_recording_without_a_robot(gyro, tmp_path, capsys):
    page = tmp_path / 'page.html'
    assert main.main(['check', gyro, '--report', str(page)]) == 0
    printed = capsys.readouterr().out
    assert 'verdict: good' in printed
    assert 'gyro/z' in printed
    assert 'no robot file was given' in printed
    text = page.read_text()
    assert 'Allan deviation of gyro' in text
    assert '<div class="live"' in text


def test_json_alone_and_findings(gyro, tmp_path, capsys):
    assert main.main(['check', gyro, '--robot', 'config/servicer.yaml', '--json']) == 1
    said = keeps('check', capsys.readouterr().out)
    assert said['verdict'] == 'findings'
    assert said['faults'][0].startswith('/joint_states: is missing')
    assert said['excitation'] is None
    assert said['sensors'][0]['rate'] == pytest.approx(100.0)


def test_what_was_found_is_said_even_where_no_page_can_be_written(
    gyro, tmp_path, capsys, monkeypatch
):
    def full(*_):
        raise ConfigurationError('page.html', 'can not be written: No space left on device')

    monkeypatch.setattr(html, 'write_report', full)
    assert main.main(['check', gyro, '--report', str(tmp_path / 'page.html')]) == 2
    printed = capsys.readouterr()
    assert 'verdict: good' in printed.out
    assert printed.err.count('\n') == 1


def test_unusable_input(tmp_path, capsys):
    assert main.main(['check', str(tmp_path / 'nothing')]) == 2
    assert 'no such file or folder' in capsys.readouterr().err
