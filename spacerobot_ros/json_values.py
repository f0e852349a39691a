"""Results as JSON, and as plain maps and lists."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np


def json_text(value: Any) -> str:
    """A result as JSON text, its last line ended; see `json_value`."""
    return json.dumps(json_value(value), indent=2, allow_nan=False) + '\n'


def json_value(value: Any) -> Any:
    """Nested maps, lists and arrays as JSON knows them; infinity and NaN as null.

    What has a method `to_json` says itself what it is.
    """
    return plain(value, _json_leaf)


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
    if isinstance(value, np.ndarray | np.generic):
        return json_value(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
