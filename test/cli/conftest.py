"""What tests of the command line share."""

import math

import pytest

from spacerobot_ros.cli import terminal


@pytest.fixture
def no_progress(monkeypatch):
    """No lines of progress, however slow the machine is."""
    monkeypatch.setattr(terminal, '_QUIET', math.inf)
