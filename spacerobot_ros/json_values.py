"""Results as JSON, and as plain maps and lists."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import field, fields, is_dataclass
from typing import Any

import numpy as np


def json_text(value: Any) -> str:
    """A result as JSON text, its last line ended; see `json_value`."""
    return json.dumps(json_value(value), indent=2, allow_nan=False) + '\n'


def json_value(value: Any) -> Any:
    """Nested maps, lists and arrays as JSON knows them; infinity and NaN as null.

    A dataclass is its `json_fields`; what has a method `to_json` says itself what it is.
    """
    return plain(value, _json_leaf)


def json_as(name: str = '', **given: Any) -> Any:
    """A field of a result under another name in JSON; without a name it is not in it."""
    return field(metadata={'json': name}, **given)


def json_fields(result: Any) -> dict[str, Any]:
    """Fields of a dataclass as JSON names them, then the properties in its `json_too`."""
    names = {f.metadata.get('json', f.name): f.name for f in fields(result)}
    names |= {name: name for name in getattr(result, 'json_too', ())}
    return {shown: getattr(result, name) for shown, name in names.items() if shown}


def plain(value: Any, leaf: Callable[[Any], Any] = lambda value: value) -> Any:
    """Dicts and lists of the same content, every other value as `leaf` makes it."""
    if isinstance(value, Mapping):
        return {key: plain(entry, leaf) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry, leaf) for entry in value]
    return leaf(value)


def _json_leaf(value: Any) -> Any:
    if hasattr(value, 'to_json'):
        return json_value(value.to_json())
    if is_dataclass(value):
        return json_value(json_fields(value))
    if isinstance(value, np.ndarray | np.generic):
        return json_value(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
