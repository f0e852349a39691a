"""Results as JSON values."""

from __future__ import annotations

import math
from typing import Any


def json_value(value: Any) -> Any:
    """Nested dicts, lists and numbers with what JSON lacks, infinity and NaN, as null."""
    if isinstance(value, dict):
        return {key: json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
