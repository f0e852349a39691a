"""A field of a settings section: value, unit, bounds and meaning."""

from __future__ import annotations

from dataclasses import MISSING, field
from typing import Any


def param(
    default: Any = MISSING,
    *,
    doc: str,
    unit: str = '',
    minimum: float | None = None,
    above: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    length: int | None = None,
) -> Any:
    """A dataclass field with what a user must know of the parameter.

    Args:
        default: Value where the file is silent; without one the parameter is required.
        doc: One sentence.
        unit: SI unit; empty for a pure number or text.
        minimum: Smallest allowed value (inclusive), also of each entry of a list.
        above: Exclusive lower bound, also of each entry of a list.
        maximum: Largest allowed value (inclusive), also of each entry of a list.
        choices: Allowed texts.
        length: Required number of entries of a list.
    """
    metadata = {
        'doc': doc,
        'unit': unit,
        'minimum': minimum,
        'above': above,
        'maximum': maximum,
        'choices': choices,
        'length': length,
    }
    return field(default=default, metadata=metadata)
