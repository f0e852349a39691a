"""How functions are compiled: what Python calls is `compiled` (or `summed`), the rest `inner`.

Numba keeps what it compiled, and tells from the file of the function alone whether that changed. A
function holds the code of those that it calls, too: here the files of all of them count, and the
constants that it takes from other files. It is kept beside the source, as an installation brings
it, and in the user's cache, where other checkouts of the same source find it.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any
from uuid import uuid4

import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache, InTreeCacheLocator, dumps
from numba.core.dispatcher import Dispatcher
from numba.core.runtime import rtsys

_BYTES = hashlib.sha256().digest_size


class _Files:
    """What is kept of a function: in several folders a file for each types of its arguments.

    A file begins with a digest of what it was made from and of all that follows: what is stale,
    cut short or damaged is not there. It is put in place whole, so no process waits for another.

    Args:
        stamp: What the code was made from.
        places: Folders, and what names of files begin with there.
    """

    def __init__(self, stamp: str, *places: tuple[Path, str]) -> None:
        self._stamp, self._places = stamp.encode(), places

    def load(self, key: Any) -> Any:
        """The code for the types of a key; None where there is none."""
        for path in self._paths(key):
            with suppress(OSError):
                whole = path.read_bytes()
                if whole[:_BYTES] == self._digest(whole[_BYTES:]):
                    return pickle.loads(whole[_BYTES:])
        return None

    def save(self, key: Any, data: Any) -> None:
        """Keep the code for the types of a key wherever one may write."""
        content = dumps(data)
        for path in self._paths(key):
            with suppress(OSError):
                path.parent.mkdir(parents=True, exist_ok=True)
                part = path.with_name(f'{path.name}.{uuid4().hex}')
                try:
                    part.write_bytes(self._digest(content) + content)
                    part.replace(path)
                finally:
                    part.unlink(missing_ok=True)

    def _paths(self, key: Any) -> Iterator[Path]:
        types = _short(repr(key).encode())
        return (folder / f'{name}-{types}.nbc' for folder, name in self._places)

    def _digest(self, content: bytes) -> bytes:
        return hashlib.sha256(self._stamp + content).digest()


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
        del self._cache_file

    @cached_property
    def _cache_file(self) -> _Files:
        """Found when the function is called first: most that are loaded are not."""
        sources = sorted(set(_sources(self._py_func, set())))
        stamp, name = repr((numba.__version__, sources)), self._impl.filename_base
        places = [(Path(self.cache_path), name)]
        if kept := _users_cache():
            places.append((kept, f'{name}-{_short(stamp.encode())}'))
        return _Files(stamp, *places)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is kept; numba first loads all that it compiles with, which takes 0.1 s."""
        rtsys.initialize(target_context)  # memory of arrays, which kept code needs
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


def _users_cache() -> Path | None:
    """Folder that any checkout looks into, and that may be deleted; None without a home."""
    user = os.environ.get('XDG_CACHE_HOME') or os.path.expanduser('~/.cache')
    folder = os.environ.get('NUMBA_CACHE_DIR') or os.path.join(user, 'spacerobot_ros', 'kernels')
    return None if folder.startswith('~') else Path(folder, f'numba-{numba.__version__}')


def _short(content: bytes) -> str:
    """Digest in the name of a file."""
    return hashlib.sha256(content).hexdigest()[:16]


def _compiling(**options: Any) -> Any:
    """A decorator that compiles, and reads the source as it is while it is loaded."""

    def decorate(function: Callable[..., Any]) -> Any:
        _digest(function.__code__.co_filename)
        return numba.njit(nogil=True, **options)(function)

    return decorate


def _keeping(**options: Any) -> Any:
    """A decorator that compiles what Python calls, and keeps the result for other processes."""
    compiling = _compiling(**options)

    def decorate(function: Callable[..., Any]) -> Any:
        made = compiling(function)
        if isinstance(made, Dispatcher):  # with NUMBA_DISABLE_JIT it is the function itself
            made._cache = _Cache(made.py_func)  # type: ignore[attr-defined]
        return made

    return decorate


def _sources(function: Callable[..., Any], seen: set[Callable[..., Any]]) -> Iterator[str]:
    """What the code of a function depends on: digests of files, and values of constants."""
    seen.add(function)
    yield _digest(function.__code__.co_filename)
    for name, value in function.__globals__.items():
        if isinstance(value, Dispatcher) and value.py_func not in seen:
            yield from _sources(value.py_func, seen)
        elif isinstance(value, bool | int | float | tuple) and not name.startswith('__'):
            yield f'{name} = {value!r}'


@cache
def _digest(path: str) -> str:
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


compiled = _keeping(error_model='numpy')  # singular gives NaN, no error
summed = _keeping(fastmath={'reassoc', 'contract'})
"""For long sums, whose order is free, so that they run on vector units."""
inner = _compiling(error_model='numpy', no_cpython_wrapper=True, no_cfunc_wrapper=True)
"""For what compiled functions alone call: a quarter less to compile."""
Triple = tuple[float, float, float]
"""Three numbers in compiled code, so that nothing is allocated."""
