"""Which machine a URDF is of: its joints by name, place and axis, however the file is written.

Masses, limits and shapes are left out: a file that corrects one of them is of the same machine.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from .urdf import parse_urdf

_DECIMALS = 4  # m, and of directions: calibrated placements of one machine differ by more
_DIGITS = 12


@lru_cache(maxsize=8)
def machine_of(urdf: str) -> str:
    """Fingerprint of a URDF's joints: 12 hexadecimal digits behind a letter, no number to YAML.

    Args:
        urdf: Its text, checked before.
    """
    lines = '\n'.join(sorted(_joints(urdf)))
    return f'm{hashlib.sha256(lines.encode()).hexdigest()[:_DIGITS]}'


def _joints(urdf: str) -> Iterator[str]:
    """A line a joint."""
    for joint in parse_urdf(urdf, is_on_ground=True).joints.values():
        numbers = np.concatenate([joint.translation, joint.rotation.ravel(), joint.axis])
        rounded = np.round(numbers, _DECIMALS) + 0.0  # no negative zero
        yield f'{joint.name} {joint.kind} {joint.parent} {joint.child} {rounded.tolist()}'
