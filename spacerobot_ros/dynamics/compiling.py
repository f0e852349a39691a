"""How functions are compiled: what Python calls is `compiled` (or `summed`), the rest `inner`.

Numba keeps what it compiled beside the source, and tells from the file of the function alone
whether that changed. A function holds the code of those that it calls, too: here the files of all
of them count, and the constants that it takes from other files.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Callable, Iterator
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import IndexDataCacheFile
from numba.core.dispatcher import Dispatcher


class _CacheFile(IndexDataCacheFile):  # type: ignore[misc]  # numba is untyped
    """What is kept of a function, for several processes at a time.

    Numba's own numbers the files without a lock, and names one in the index before it is there:
    two processes that compile for different types could be given each other's code.
    """

    def save(self, key: Any, data: Any) -> None:
        """Keep the code for the types of a key."""
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


def _keeping(**options: Any) -> Any:
    """A decorator that compiles what Python calls, and keeps the result for other processes."""

    def decorate(function: Callable[..., Any]) -> Any:
        made = numba.njit(cache=True, nogil=True, **options)(function)
        if hasattr(made, '_cache'):  # with NUMBA_DISABLE_JIT it is the function itself
            sources = sorted(set(_sources(made.py_func, set())))
            stamp = hashlib.sha256(repr(sources).encode()).hexdigest()
            # numba has no public way but one for all functions of the process
            made._cache._cache_file = _CacheFile(
                made._cache.cache_path, made._cache._impl.filename_base, stamp
            )
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
