"""Progress where stderr is no terminal: lines now and then, none of a quick command."""

from __future__ import annotations

import pytest

from spacerobot_ros.cli import terminal


@pytest.fixture
def clock(monkeypatch):
    """Seconds that a test sets, as a list of one."""
    now = [100.0]
    monkeypatch.setattr(terminal.time, 'monotonic', lambda: now[0])
    return now


def test_a_quick_command_says_nothing(clock, capsys):
    with terminal.progress() as stage:
        advance = stage('simulating', 100.0)
        for done in range(101):
            clock[0] = 100.0 + 0.049 * done
            advance(done)
    assert capsys.readouterr() == ('', '')


def test_a_long_stage_says_every_tenth_on_stderr(clock, capsys):
    with terminal.progress() as stage:
        advance = stage('simulating', 200.0)
        for done in range(1, 201):
            clock[0] += 1.0
            advance(done)
    printed = capsys.readouterr()
    assert printed.out == ''
    shares = (2, *range(10, 101, 10))
    assert printed.err.splitlines() == [f'simulating: {share} %' for share in shares]


def test_what_is_new_is_said_and_what_lasts_at_least_every_minute(clock, capsys):
    with terminal.progress() as stage:
        advance = stage('reading', 1.0)
        clock[0] += 6.0
        advance(0.02, 'judging')
        clock[0] += 0.5
        advance(0.03, 'fitting')  # too soon after a line, and not forgotten
        clock[0] += 1.0
        advance(0.04)
        for _ in range(70):
            clock[0] += 1.0
            advance(0.05)
    assert capsys.readouterr().err.splitlines() == ['judging: 2 %', 'fitting: 4 %', 'fitting: 5 %']
