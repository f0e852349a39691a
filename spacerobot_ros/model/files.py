"""Files in and out: YAML as ROS 2 reads it, nothing silently overwritten; text."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml

from ..errors import ConfigurationError
from ..json_values import plain


class _Loader(yaml.SafeLoader):  # type: ignore[misc]  # yaml is untyped
    """YAML as ROS 2 reads it (`1e-5` is a number), refusing a key that is given twice."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        """Build a map, refusing duplicate keys."""
        mapping: dict[Any, Any] = super().construct_mapping(node, deep)
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if key in seen:
                problem = f'key {key!r} is given twice'
                raise yaml.constructor.ConstructorError(None, None, problem, key_node.start_mark)
            seen.add(key)
        return mapping


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
    try:
        return yaml.load(read_text(path, what), _Loader)
    except yaml.YAMLError as error:
        why = f'not valid YAML: {" ".join(str(error).split())}'
        raise ConfigurationError(str(path), why) from error


def read_text(path: Path, what: str) -> str:
    """Text of a UTF-8 file; `what` it is, for the error message."""
    try:
        return path.read_text(encoding='utf-8')
    except OSError as error:
        why = error.strerror or str(error)
        raise ConfigurationError(str(path), f'{what} can not be read: {why}') from error
    except UnicodeDecodeError as error:
        raise ConfigurationError(str(path), f'{what} can not be read: {error}') from error


def write_text(path: str | Path, text: str) -> Path:
    """Write a file, complete or not at all, making its folder; returns its path.

    Raises:
        ConfigurationError: it can't be written.
    """
    path = Path(path)
    partial = path.with_name(f'.{path.name}.partial')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        partial.write_text(text, encoding='utf-8')
        os.replace(partial, path)
    except OSError as error:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        raise ConfigurationError(str(path), f'can not be written: {error.strerror}') from error
    return path


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
