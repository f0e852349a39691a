"""Data inside a page."""

from __future__ import annotations

import base64
import json
from typing import Any

import numpy as np

from ..types import Array


def packed(values: Array) -> str:
    """Numbers in order, as base64 of little-endian float32."""
    return base64.b64encode(np.ascontiguousarray(values, dtype='<f4').tobytes()).decode()


def inline_json(value: Any) -> str:
    """A `<script>` that holds data; nothing in it can end it."""
    text = json.dumps(value, allow_nan=False, separators=(',', ':')).replace('<', '\\u003c')
    return f'<script type="application/json">{text}</script>'
