"""How functions are compiled: what Python calls is `compiled` (or `summed`), the rest `inner`.

Numba keeps what it compiled, and tells from the file of the function alone whether that changed. A
function holds the code of those that it calls, too: here the files of all of them count, and the
constants that it takes from other files. It is kept beside the source, as an installation brings
it, and in the user's cache, where other checkouts of the same source find it.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    InTreeCacheLocator,
)
from numba.core.dispatcher import Dispatcher

_DIGITS = 16  # of a digest, in the name of a file


class _CacheFile(IndexDataCacheFile):  # type: ignore[misc]  # numba is untyped
    """What is kept of a function in a folder, for several processes at a time.

    Numba's own numbers the files without a lock, and names one in the index before it is there:
    two processes that compile for different types could be given each other's code.
    """

    def save(self, key: Any, data: Any) -> None:
        """Keep the code for the types of a key."""
        os.makedirs(self._cache_path, exist_ok=True)
        folder = os.open(self._cache_path, os.O_RDONLY)
        try:
            fcntl.flock(folder, fcntl.LOCK_EX)
            names = self._load_index()
            fresh = (self._data_name(i) for i in count(1))
            name = names.get(key) or next(n for n in fresh if n not in names.values())
            self._save_data(name, data)
            self._save_index({**names, key: name})
        finally:
            os.close(folder)


class _CacheFiles:
    """What is kept of a function in the first of some folders that has it, written to all.

    Args:
        files: Of each folder.
    """

    def __init__(self, *files: _CacheFile) -> None:
        self._files = files

    def load(self, key: Any) -> Any:
        """The code for the types of a key; None where there is none."""
        for file in self._files:
            with suppress(OSError):
                if (found := file.load(key)) is not None:
                    return found
        return None

    def save(self, key: Any, data: Any) -> None:
        """Keep the code for the types of a key wherever one may write."""
        for file in self._files:
            with suppress(OSError):
                file.save(key, data)


class _Beside(InTreeCacheLocator):  # type: ignore[misc]
    """Beside the source, whether one may write there or not."""

    def ensure_cache_path(self) -> None:
        """Done where something is written."""


class _Named(CompileResultCacheImpl):  # type: ignore[misc]
    _locator_classes = (_Beside,)


class _Cache(FunctionCache):  # type: ignore[misc]
    """Numba's cache, on files that are told apart by all that a function depends on."""

    _impl_class = _Named

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        sources = sorted(set(_sources(function, set())))
        stamp = hashlib.sha256(repr(sources).encode()).hexdigest()
        name = self._impl.filename_base
        self._cache_file = _CacheFiles(
            _CacheFile(self.cache_path, name, stamp),
            _CacheFile(_users_cache(), f'{name}-{stamp[:_DIGITS]}', stamp),
        )


def _users_cache() -> str:
    """Folder that any checkout looks into, and that may be deleted at any time."""
    user = os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')
    folder = os.environ.get('NUMBA_CACHE_DIR') or os.path.join(user, 'spacerobot_ros', 'kernels')
    return os.path.join(folder, f'numba-{numba.__version__}')


def _keeping(**options: Any) -> Any:
    """A decorator that compiles what Python calls, and keeps the result for other processes."""

    def decorate(function: Callable[..., Any]) -> Any:
        made = numba.njit(nogil=True, **options)(function)
        if isinstance(made, Dispatcher):  # with NUMBA_DISABLE_JIT it is the function itself
            made._cache = _Cache(made.py_func)  # type: ignore[attr-defined]
        return made

    return decorate


def _sources(function: Callable[..., Any], seen: set[Callable[..., Any]]) -> Iterator[str]:
    """What the code of a function depends on: digests of files, and values of constants."""
    seen.add(function)
    yield _digest(Path(function.__code__.co_filename))
    for name, value in function.__globals__.items():
        if isinstance(value, Dispatcher) and value.py_func not in seen:
            yield from _sources(value.py_func, seen)
        elif isinstance(value, bool | int | float | tuple) and not name.startswith('__'):
            yield f'{name} = {value!r}'


@cache
def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


compiled = _keeping(error_model='numpy')  # singular gives NaN, no error
summed = _keeping(fastmath={'reassoc', 'contract'})
"""For long sums, whose order is free, so that they run on vector units."""
inner = numba.njit(nogil=True, error_model='numpy', no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""For what compiled functions alone call: a quarter less to compile."""
Triple = tuple[float, float, float]
"""Three numbers in compiled code, so that nothing is allocated."""
