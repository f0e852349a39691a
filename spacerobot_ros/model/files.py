"""Files in and out: YAML as ROS 2 reads it, nothing silently overwritten; text."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import yaml
from yaml import composer, constructor, cyaml, resolver

from ..errors import ConfigurationError, PlacedError, shortened
from ..json_values import plain

# Text that makes a robot in 2 s on a slow core, measured: 0.5 MB of YAML a second, and 2 MB of a
# URDF, which are 6000 links; robots have a tenth of it.
MOST_YAML = 1_000_000  # bytes
MOST_URDF = 4_000_000
_DEEPEST = 50  # levels; a robot file has six, the interpreter's stack ends at some 300


class _Loader(  # yaml is untyped
    composer.Composer,  # type: ignore[misc]
    cyaml.CParser,  # type: ignore[misc]
    constructor.SafeConstructor,  # type: ignore[misc]
    resolver.Resolver,  # type: ignore[misc]
):
    """YAML as ROS 2 reads it: `1e-5` is a number; no aliases, and no key that is given twice."""

    def __init__(self, text: str) -> None:
        cyaml.CParser.__init__(self, text)
        composer.Composer.__init__(self)
        constructor.SafeConstructor.__init__(self)
        resolver.Resolver.__init__(self)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node:
        """One value, unless it is an alias or too deep below others."""
        event = self.peek_event()
        if isinstance(event, yaml.AliasEvent):
            raise _refused(f'alias *{event.anchor}: not known in ROS 2, write it out', event)
        if self._depth >= _DEEPEST:
            raise _refused(f'more than {_DEEPEST} levels of lists or maps', event)
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        """The value of a node; what its tag can not mean is refused."""
        try:
            value = super().construct_object(node, deep)
            repr(value)  # which a number of too many digits has not
        except yaml.YAMLError:
            raise
        except Exception as error:  # a text that is no date or number raises nearly anything
            kind = node.tag.rpartition(':')[2]
            raise _refused(f'{shortened(str(node.value), 60)!r} is no {kind}', node) from error
        return value

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Build a map, refusing duplicate keys."""
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                raise _refused(f'key {shortened(repr(key), 60)} is given twice', key_node)
            seen.add(key)
        return mapping


def _refused(why: str, where: yaml.Node | yaml.Event) -> yaml.YAMLError:
    return constructor.ConstructorError(None, None, why, where.start_mark)


_Loader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(r'^[-+]?(\d+(\.\d*)?|\.\d+)[eE][-+]?\d+$'),
    list('-+.0123456789'),
)


def read_parameters(path: Path) -> Mapping[str, Any]:
    """Content of `ros__parameters` of a robot file.

    Raises:
        ConfigurationError: unreadable, not YAML, or not of the form `/**: ros__parameters: ...`.
    """
    content = read_yaml(path, 'robot file')
    if not isinstance(content, Mapping) or len(content) != 1:
        why = "expected one entry '/**' with ros__parameters below it"
        raise ConfigurationError(str(path), why)
    node, parameters = next(iter(content.items()))
    if not isinstance(parameters, Mapping) or list(parameters) != ['ros__parameters']:
        why = 'expected ros__parameters, and nothing else, below it'
        raise ConfigurationError(f'{path}: {node}', why)
    values = parameters['ros__parameters']
    if not isinstance(values, Mapping):
        why = f'expected a map of parameters, got {values!r}'
        raise ConfigurationError(f'{path}: {node}: ros__parameters', why)
    return values


def read_yaml(path: Path, what: str) -> Any:
    """Content of a YAML file; `what` it is, for the error message.

    Raises:
        ConfigurationError: unreadable, or not YAML.
    """
    loader = None
    try:
        loader = _Loader(read_text(path, what, MOST_YAML))
        return loader.get_single_data()
    except yaml.YAMLError as error:
        problem = ' '.join(str(error).split()).replace('in "<unicode string>", ', 'at ')
        why = f'not valid YAML: {problem}'
        raise ConfigurationError(str(path), why) from error
    finally:
        if loader is not None:
            loader.dispose()


def is_file(path: Path) -> bool:
    """Whether there is a file; a name that none can have is no error."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_text(path: Path, what: str, most: int = MOST_URDF) -> str:
    """Text of a UTF-8 file.

    Args:
        path: The file.
        what: What it is, for the error message.
        most: Bytes that it may have.

    Raises:
        ConfigurationError: unreadable, larger, or not UTF-8.
    """
    try:
        if path.exists() and not path.is_file():  # a pipe, a device or a folder
            raise ConfigurationError(str(path), f'{what} can not be read: it is not a file')
        with open(path, 'rb', opener=_without_waiting) as file:
            content = file.read(most + 1)
        if content is None:
            raise ConfigurationError(str(path), f'{what} can not be read: it has no end')
    except OSError as error:
        why = error.strerror or str(error)
        raise ConfigurationError(str(path), f'{what} can not be read: {why}') from error
    if len(content) > most:
        why = f'{what} is larger than {most / 1e6:g} MB, the most that is read'
        raise ConfigurationError(str(path), why)
    try:
        return content.decode()
    except UnicodeDecodeError as error:
        why = f'{what} is not UTF-8 (byte {error.start}): save it as that'
        raise ConfigurationError(str(path), why) from error


def _without_waiting(path: str, flags: int) -> int:
    """Open what may turn out to be a pipe, or a log of the kernel."""
    return os.open(path, flags | os.O_NONBLOCK)


def write_text(path: str | Path, text: str | bytes, replaced: Path | None = None) -> Path:
    """Write a file, complete or not at all, making its folder; returns its path.

    Args:
        path: The file.
        text: Its content.
        replaced: As of `written_whole`.

    Raises:
        ConfigurationError: it can't be written.
    """
    with written_whole(path, replaced=replaced) as partial, open(partial, 'wb') as file:
        file.write(text.encode() if isinstance(text, str) else text)
    return Path(path)


@contextmanager
def written_whole(
    path: str | Path,
    error: type[PlacedError] = ConfigurationError,
    *,
    replaced: Path | None = None,
) -> Iterator[Path]:
    """Where to write a file or folder, which takes its place when the block ends without an error.

    After an error, or when interrupted, the place is as it was. A folder that is there keeps its
    other entries.

    Args:
        path: The place; the folder around it is made where it is missing.
        error: What to raise.
        replaced: Where the file goes whose place is taken; the new one is on the disk itself by
            then. None: nowhere.

    Raises:
        PlacedError: it can't be written.
    """
    place, path = str(path), Path(path).absolute()
    partial = path.with_name(f'.{path.name}.partial')
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):  # it would be replaced
            raise error(place, 'can not be written: it is not a file')
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove(partial)
        yield partial
        if replaced is not None:
            with partial.open('rb') as file:
                os.fsync(file.fileno())
            if path.is_file():
                with suppress(OSError):
                    os.replace(path, replaced)
        if path.is_dir() and partial.is_dir():
            for entry in partial.iterdir():
                shutil.rmtree(path / entry.name, ignore_errors=True)  # not a file
                os.replace(entry, path / entry.name)
        else:
            os.replace(partial, path)
    except OSError as failure:
        raise error(place, f'can not be written: {failure.strerror or failure}') from failure
    finally:
        _remove(partial)


def _remove(path: Path) -> None:
    """Remove a file or folder, where there is one."""
    shutil.rmtree(path, ignore_errors=True)
    with suppress(OSError):
        path.unlink(missing_ok=True)


def write_parameters(path: str | Path, values: Mapping[str, Any], head: str = '') -> Path:
    """Write `ros__parameters` as a robot file.

    Args:
        path: The YAML.
        values: The parameters.
        head: Comment lines before them.

    Raises:
        ConfigurationError: the file can't be written.
    """
    content = {'/**': {'ros__parameters': plain(values)}}
    return write_text(
        path, head + yaml.safe_dump(content, sort_keys=False, default_flow_style=None)
    )
