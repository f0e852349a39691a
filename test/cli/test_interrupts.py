"""Ctrl-C: raised at once, but for what must not be left in the middle."""

import importlib
import signal
import subprocess
import sys

import numba
import pytest
from numba.core import event

from spacerobot_ros.interrupts import held_back, interruptible, noted


def interrupt(*_):
    signal.raise_signal(signal.SIGINT)


def test_it_is_raised_where_it_is_met():
    went_on = []
    with pytest.raises(KeyboardInterrupt), interruptible():
        went_on.append(interrupt())
    assert went_on == []


class Interrupted(event.Listener):
    """Interrupts every compilation when it begins."""

    on_start = interrupt

    def on_end(self, _):
        """Let it end."""


def test_a_kernel_is_compiled_to_its_end():
    """An exception in one of llvmlite's callbacks is lost, or crashes the process."""
    kernel, went_on = numba.njit(lambda x: 2.0 * x), []
    with (
        pytest.raises(KeyboardInterrupt),
        interruptible(),
        event.install_listener('numba:compile', Interrupted()),
    ):
        went_on.append([kernel(k) for k in (1.0, 2.0)])
    assert went_on == []
    assert len(kernel.signatures) == 1
    assert kernel(3.0) == 6.0


@pytest.mark.parametrize('more', ['', 'raise ImportError\n'])
def test_a_module_is_loaded_to_its_end(tmp_path, monkeypatch, more):
    text = f'from signal import *\nraise_signal(SIGINT)\nimport sys\nsys.loaded = True\n{more}'
    (tmp_path / 'loaded_whole.py').write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, 'loaded', False, raising=False)
    with pytest.raises(KeyboardInterrupt), interruptible():
        importlib.import_module('loaded_whole')
    assert sys.loaded
    assert ('loaded_whole' in sys.modules) is not bool(more)
    sys.modules.pop('loaded_whole', None)


def test_nothing_is_raised_where_somebody_else_answers():
    with noted(signal.SIGINT) as came:
        interrupt()
    assert came == [signal.SIGINT]
    heard = []
    signal.signal(signal.SIGINT, lambda *_: heard.append(True))
    with interruptible():
        interrupt()
    assert heard == [True]


def test_what_is_held_back_is_raised_where_it_is_let_through():
    with held_back() as let_through:
        let_through()
        interrupt()
        with pytest.raises(KeyboardInterrupt):
            let_through()
    went_on = []
    with pytest.raises(KeyboardInterrupt), interruptible(), held_back():
        went_on.append(interrupt())
    assert went_on == [None]


_WAITS = """
import sys
from spacerobot_ros.cli import identify, main
def run(**_):
    print('ready', flush=True)
    sys.stdin.read()
identify.run.callback = run
sys.exit(main.main(['identify', 'x', '--robot', 'y']))
"""


def test_a_command_ends_with_one_line():
    with subprocess.Popen(
        [sys.executable, '-c', _WAITS],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as command:
        assert command.stdout.readline() == 'ready\n'
        command.send_signal(signal.SIGINT)
        assert command.wait() == 130
        assert command.stderr.read() == 'spacerobot identify: interrupted\n'
