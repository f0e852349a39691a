"""How functions are compiled: what Python calls is `compiled` (or `summed`), the rest `inner`.

Numba keeps machine code in files, and tells from the file of a called function alone whether it is
current. The code also holds the `inner` functions below it, and constants: so all of it lies in a
folder that is named by the text of every file that these come from.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba

_ROOM = Path(__file__).parent  # constants of compiled code stand here, or beside a kernel
_UNUSED = 30 * 86400.0  # s, after which the code of another source is removed
_START = time.time()
_edited = set[str]()  # files that changed since, which the name of the folder says nothing of


def _sources() -> Iterator[bytes]:
    """Text of the files that machine code is made from, each after its name."""
    for place, folders, names in os.walk(_ROOM.parent):
        folders[:] = [folder for folder in folders if folder != '__pycache__']
        for name in names:
            if name.endswith('.py'):
                with open(os.path.join(place, name), 'rb', buffering=0) as file:
                    text = file.read()
                if place == str(_ROOM) or b'dynamics.compiling import' in text:
                    yield name.encode() + text


@cache
def _folder() -> str:
    """Where machine code of the source as it is now is kept; empty where one may not write."""
    texts = numba.__version__.encode(), *sorted(_sources())
    name = hashlib.sha256(b'\n'.join(texts)).hexdigest()[:16]
    for place in _places():
        with suppress(OSError):
            folder = place / name
            if not folder.exists():
                folder.mkdir(parents=True)
                _remove_unused(place)
            os.utime(folder)
            tempfile.TemporaryFile(dir=folder).close()
            return str(folder)
    return ''


def _places() -> Iterator[Path]:
    """Folders to keep code in, the first that one may write to: the user's, the package's."""
    if chosen := os.environ.get('NUMBA_CACHE_DIR'):
        yield Path(chosen, 'spacerobot_ros')
        return
    yield _ROOM.parent / '__pycache__' / 'kernels'
    user = os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')
    if not user.startswith('~'):  # a user without an entry
        yield Path(user, 'spacerobot_ros', 'kernels')


def _remove_unused(place: Path) -> None:
    for other in place.iterdir():
        if other.stat().st_mtime < _START - _UNUSED:
            shutil.rmtree(other, ignore_errors=True)


def _compiling(is_kept: bool = True, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """A decorator that compiles, and keeps what Python calls for other processes."""

    def decorate(function: Callable[..., Any]) -> Any:
        path = function.__code__.co_filename
        if os.stat(path).st_mtime > _START:
            _edited.add(path)
        before, folder = numba.config.CACHE_DIR, '' if _edited or not is_kept else _folder()
        numba.config.CACHE_DIR = folder
        try:
            return numba.njit(nogil=True, cache=bool(folder), no_cfunc_wrapper=True, **options)(
                function
            )
        finally:
            numba.config.CACHE_DIR = before

    return decorate


compiled = _compiling(error_model='numpy')  # singular gives NaN, no error
summed = _compiling(fastmath={'reassoc', 'contract'})
"""For long sums, whose order is free, so that they run on vector units."""
inner = _compiling(is_kept=False, error_model='numpy', no_cpython_wrapper=True)
"""For what compiled functions alone call."""
Triple = tuple[float, float, float]
"""Three numbers in compiled code, so that nothing is allocated."""
