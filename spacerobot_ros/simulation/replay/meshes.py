"""Triangles of mesh files: STL, binary or text, and the faces of OBJ."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ...errors import ConfigurationError
from ...types import Array

MOST = 20_000
"""Triangles of one mesh that are kept: a page of twenty links is then 14 MB at the most."""
_STL = np.dtype([('normal', '<f4', 3), ('corners', '<f4', (3, 3)), ('attribute', '<u2')])
_HEAD = 84  # bytes before the triangles: a comment and their number


def read_mesh(path: Path) -> Array:
    """(K, 3, 3) corners of the triangles; every so-manieth of more than `MOST`.

    Raises:
        ConfigurationError: another format, or damaged.
    """
    readers = {'.stl': _stl, '.obj': _obj}
    kind = path.suffix.lower()
    if kind not in readers:
        why = f'{kind or "no suffix"} is not read (STL and OBJ are): convert it'
        raise ConfigurationError(f'mesh {path.name}', why)
    try:
        corners = readers[kind](path.read_bytes())
    except (ValueError, IndexError, OSError) as error:
        raise ConfigurationError(f'mesh {path.name}', f'is damaged: {error}') from error
    if not len(corners) or not np.all(np.isfinite(corners)):
        raise ConfigurationError(f'mesh {path.name}', 'has no triangles, or not finite ones')
    return corners[:: 1 + (len(corners) - 1) // MOST]


def _stl(data: bytes) -> Array:
    count = int.from_bytes(data[80:_HEAD], 'little')
    if len(data) == _HEAD + _STL.itemsize * count:
        return np.frombuffer(data, _STL, offset=_HEAD)['corners'].astype(float)
    words = data.decode('ascii').split()
    at = [k for k, word in enumerate(words) if word == 'vertex']
    return np.array([[float(x) for x in words[k + 1 : k + 4]] for k in at]).reshape(-1, 3, 3)


def _obj(data: bytes) -> Array:
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    for line in data.decode('utf-8', 'replace').splitlines():
        kind, *words = line.split() or ['']
        if kind == 'v':
            vertices.append([float(x) for x in words[:3]])
        elif kind == 'f':
            at = [int(word.partition('/')[0]) for word in words]
            at = [k - 1 if k > 0 else len(vertices) + k for k in at]
            faces += [[at[0], at[k], at[k + 1]] for k in range(1, len(at) - 1)]
    return np.array(vertices).reshape(-1, 3)[np.array(faces, dtype=int).reshape(-1, 3)]
