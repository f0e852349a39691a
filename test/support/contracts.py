"""What commands print as JSON against the schemas that the package publishes."""

from __future__ import annotations

import json
from importlib import resources
from typing import Any

import jsonschema


def schema_of(name: str) -> dict[str, Any]:
    """A published schema."""
    return json.loads((resources.files('spacerobot_ros') / 'schemas' / f'{name}.json').read_text())


def keeps(name: str, text: str) -> Any:
    """Parse JSON, and fail where it breaks its schema or has a key that the schema lacks."""
    value = json.loads(text)
    closed = _closed(schema_of(name))
    jsonschema.Draft202012Validator(closed).validate(value)
    return value


def _closed(schema: Any) -> Any:
    """The schema with no other keys allowed: readers must bear new ones, we must write them up."""
    if isinstance(schema, list):
        return [_closed(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    out = {key: _closed(entry) for key, entry in schema.items()}
    if out.get('type') == 'object' and isinstance(out.get('properties'), dict):
        out.setdefault('additionalProperties', False)
    return out
