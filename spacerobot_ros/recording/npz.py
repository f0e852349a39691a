"""Records as npz files: small, exact, and readable with numpy alone."""

from __future__ import annotations

import json
import zipfile
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import RecordingError
from ..model.files import written_whole
from .record import SENSORS, Record
from .series import InputSeries

FORMAT = 'spacerobot_ros record 1'
_INPUT = 'inputs.'
_TEXTS = ('names', 'units', 'rate_only', 'in_amperes')


def save_npz(record: Record, path: str | Path) -> None:
    """Write a record; the same record gives the same bytes.

    Raises:
        RecordingError: the file can't be written.
    """
    content: dict[str, Any] = {'format': np.array(FORMAT), 'source': np.array(record.source)}
    content['notes'] = np.array(json.dumps(record.notes))
    if record.zero_ns is not None:
        content['zero_ns'] = np.array(record.zero_ns)
    every = {key: getattr(record, key) for key in SENSORS}
    every |= {f'{_INPUT}{key}': series for key, series in record.inputs.items()}
    for key, series in every.items():
        for field in fields(series) if series is not None else ():
            value = getattr(series, field.name)
            if field.name in _TEXTS and value:
                value = np.array(json.dumps(value))
            if value is not None and (isinstance(value, np.ndarray) or value):
                content[f'{key}.{field.name}'] = value
    with written_whole(path, RecordingError) as partial, partial.open('wb') as file:
        np.savez_compressed(file, **content)


def read_arrays(path: str | Path) -> dict[str, Any]:
    """All arrays of an npz file by name.

    Raises:
        RecordingError: not readable.
    """
    try:
        with Path(path).open('rb') as opened:  # numpy leaves a broken one open
            file = np.load(opened, allow_pickle=False)
            if isinstance(file, np.ndarray):
                raise ValueError('it holds one array without a name')
            with file:
                return {name: file[name] for name in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        reason = ' '.join(str(error).split())
        raise RecordingError(str(path), f'not a readable npz file: {reason}') from error


def load_npz(path: str | Path) -> Record:
    """Read a record written by `save_npz`.

    Raises:
        RecordingError: not readable, not such a file, or content that a `Record` refuses.
    """
    content = read_arrays(path)
    if str(content.get('format', '')) != FORMAT:
        raise RecordingError(str(path), f'not a record: its format is not {FORMAT!r}')
    try:
        return Record(
            **{key: _series(content, key, kind) for key, kind in SENSORS.items()},
            source=str(content['source']),
            notes=tuple(json.loads(str(content['notes']))),
            zero_ns=int(content['zero_ns']) if 'zero_ns' in content else None,
            inputs={
                key.removeprefix(_INPUT): _series(content, key, InputSeries)
                for key in sorted({k.rpartition('.')[0] for k in content if k.startswith(_INPUT)})
            },
        )
    except KeyError as error:
        raise RecordingError(str(path), f'lacks {error}') from error
    except RecordingError as error:
        raise RecordingError(f'{path}: {error.place}', error.reason) from error


def _series(content: dict[str, Any], key: str, kind: Any) -> Any:
    """One sensor's or input's samples; None where the file has none."""
    if not any(name.startswith(f'{key}.') for name in content):
        return None
    given = {
        f.name: content[f'{key}.{f.name}']
        for f in fields(kind)
        if f.default is MISSING or f'{key}.{f.name}' in content
    }
    for name in _TEXTS:
        if name in given:
            given[name] = tuple(json.loads(str(given[name])))
    return kind(**given)
