"""Effects of others: Python modules that a robot file names, and entry points of packages."""

from __future__ import annotations

import importlib
import importlib.util
import sys
import traceback
from collections.abc import Callable, Iterator, MutableMapping, Sequence
from functools import partial, wraps
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from ..errors import ConfigurationError, SpaceRobotError
from ..model.files import is_file
from .effect import Effect

GROUP = 'spacerobot.effects'
"""Entry points of packages whose value is a module with effects."""
_ACTIONS = ('change', 'force', 'sense', 'delay', 'joint_delays')


def add_installed(known: MutableMapping[str, type[Effect]]) -> None:
    """Add the kinds of every installed package that says so."""
    for point in entry_points(group=GROUP):
        place = f'entry point {point.name} of {GROUP}'
        add_module(known, _loaded(point.load, place), place)


def add_named(
    known: MutableMapping[str, type[Effect]], names: Sequence[str], folder: Path | None
) -> None:
    """Add the kinds of modules.

    Args:
        known: Kinds by id.
        names: Modules that can be imported, or files ending in `.py`.
        folder: Of the robot file, for relative names of files; None where it is unknown.

    Raises:
        ConfigurationError: a module that is not there, raises, has no effect, or one whose id is
            taken; with the line where it raised.
    """
    for i, name in enumerate(names):
        place = f'robot.effect_modules[{i}] ({name})'
        load = partial(importlib.import_module, name)
        if name.endswith('.py'):
            load = partial(_from_file, name, folder, place)
        add_module(known, _loaded(load, place), place)


def add_module(known: MutableMapping[str, type[Effect]], module: ModuleType, place: str) -> None:
    """Add the kinds of a module: its subclasses of `Effect` that have an `id` of their own."""
    kinds = [kind for kind in vars(module).values() if _is_kind(kind, module)]
    if not kinds:
        raise ConfigurationError(place, 'has no effect: no subclass of Effect with an id')
    for kind in kinds:
        for why in _faults(kind):
            raise ConfigurationError(f'{place}: {kind.__name__}', why)
        other = known.get(kind.id)
        if other is not None and not _is_same(other, kind):
            raise ConfigurationError(f'{place}: {kind.__name__}', f'its id {kind.id!r} is taken')
        if not vars(kind).get('is_own', False):
            _guard(kind, f'{place}: {kind.__name__}', module)
        kind.is_own = True
        known[kind.id] = kind


def _is_kind(value: Any, module: ModuleType) -> bool:
    is_effect = isinstance(value, type) and issubclass(value, Effect) and 'id' in vars(value)
    return is_effect and value.__module__ == module.__name__


def _is_same(one: type[Effect], other: type[Effect]) -> bool:
    """Whether a module was only read again."""
    return (one.__module__, one.__qualname__) == (other.__module__, other.__qualname__)


def _faults(kind: type[Effect]) -> Iterator[str]:
    for name in ('title', 'group', 'parameters'):
        if not hasattr(kind, name):
            yield f'lacks {name}'
    if not any(kind.acts(action) for action in _ACTIONS):
        yield f'does nothing: it overrides none of {", ".join(_ACTIONS)}'


def _guard(kind: type[Effect], place: str, module: ModuleType) -> None:
    """Make what its actions raise, or what of theirs is no force or signal, name the kind."""
    for action in filter(kind.acts, _ACTIONS):
        setattr(kind, action, _naming(getattr(kind, action), f'{place}.{action}', module))


def _naming(method: Callable[..., Any], place: str, module: ModuleType) -> Callable[..., Any]:
    @wraps(method)
    def answer(*args: Any, **named: Any) -> Any:
        try:
            return method(*args, **named)
        except SpaceRobotError:
            raise
        except Exception as error:
            raise ConfigurationError(place, _raised(error, module.__file__)) from error

    return answer


def _loaded(load: Callable[[], ModuleType], place: str) -> ModuleType:
    """A module; what it raises becomes one line with its place."""
    try:
        return load()
    except ConfigurationError:
        raise
    except (Exception, SystemExit) as error:
        raise ConfigurationError(place, _raised(error)) from error


def _raised(error: BaseException, path: str | None = None) -> str:
    """What was raised and where: in a file, if it went through that, else at its end."""
    if isinstance(error, SyntaxError) and error.filename:  # it has no frame of its own
        where = f'{Path(error.filename).name}:{error.lineno}'
        return f'raises {type(error).__name__}: {error.msg} ({where})'
    frames = traceback.extract_tb(error.__traceback__)
    at = ([frame for frame in frames if frame.filename == path] or frames)[-1]
    return f'raises {type(error).__name__}: {error} ({Path(at.filename).name}:{at.lineno})'


def source_files(names: Sequence[str]) -> Iterator[Path]:
    """Files of modules as `add_named` takes them, and of the installed ones.

    Of a package every module, of a module its file alone; none of what has no file.
    """
    installed = (point.module for point in entry_points(group=GROUP))
    for name in (*names, *sorted(installed)):
        if name.endswith('.py'):
            yield Path(name)
            continue
        spec = importlib.util.find_spec(name)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            yield from sorted(Path(folder).rglob('*.py'))
        if spec and spec.origin and spec.has_location:
            yield Path(spec.origin)


def _from_file(name: str, folder: Path | None, place: str) -> ModuleType:
    path = Path(name)
    if not path.is_absolute():
        if folder is None:
            why = 'is relative, and a node does not know where its parameter file lies'
            raise ConfigurationError(place, f'{why}: give an absolute path, or a module')
        path = folder / path
    if not is_file(path):
        raise ConfigurationError(place, f'no such file: {path}')
    own = f'spacerobot_own_{path.stem}'
    loaded = sys.modules.get(own)
    if loaded is not None and getattr(loaded, '__file__', None) == str(path):
        return loaded
    spec = importlib.util.spec_from_file_location(own, path)
    if spec is None or spec.loader is None:
        raise ConfigurationError(place, f'can not be imported: {path}')
    module = importlib.util.module_from_spec(spec)
    sys.modules[own] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[own]
        raise
    return module
