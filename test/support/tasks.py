"""Tasks that go well, fail, die and hang, for workers of other processes."""

import os
import signal
import threading
from pathlib import Path

import numpy as np


def draw(key):
    """Numbers that depend on the key alone."""
    return {'values': np.random.default_rng(abs(int(key))).normal(size=3).tolist()}


def misbehave(key, folder):
    """Draw, unless the key says what else; `folder` remembers who began."""
    kind, _, number = key.rpartition(' ')
    with open(Path(folder) / 'begun', 'a', encoding='utf-8') as file:
        file.write(f'{key}\n')
    if kind == 'dies':
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == 'hangs':
        threading.Event().wait()
    if kind == 'raises':
        raise ValueError('no such number')
    return draw(number)


def killing(key, folder, victims):
    """Draw; some keys end their process, the first time only."""
    mark = Path(folder) / f'killed-{key}'
    if key in victims and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return draw(key)
