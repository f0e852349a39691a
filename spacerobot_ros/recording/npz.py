"""Records as npz files: small, exact, and readable with numpy alone."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import RecordingError
from ..types import Array
from .record import AttitudeSeries, JointSeries, RateSeries, Record

FORMAT = 'spacerobot_ros record 1'


def save_npz(record: Record, path: str | Path) -> None:
    """Write a record; the same record gives the same bytes.

    Raises:
        RecordingError: the file can't be written.
    """
    content: dict[str, Any] = {'format': np.array(FORMAT), 'source': np.array(record.source)}
    content['notes'] = np.array(json.dumps(record.notes))
    for key, series in (('joints', record.joints), ('wheels', record.wheels)):
        if series is not None:
            content[f'{key}.names'] = np.array(json.dumps(series.names))
            for name in ('stamp_ns', 'position', 'velocity', 'effort'):
                if getattr(series, name) is not None:
                    content[f'{key}.{name}'] = getattr(series, name)
    if record.rates is not None:
        content |= {'rates.stamp_ns': record.rates.stamp_ns, 'rates.omega': record.rates.omega}
    if record.attitudes is not None:
        content['attitudes.stamp_ns'] = record.attitudes.stamp_ns
        content['attitudes.q_xyzw'] = record.attitudes.q_xyzw
    try:
        with Path(path).open('wb') as file:
            np.savez_compressed(file, **content)
    except OSError as error:
        raise RecordingError(str(path), f'can not be written: {error.strerror}') from error


def load_npz(path: str | Path) -> Record:
    """Read a record written by `save_npz`.

    Raises:
        RecordingError: not readable, not such a file, or content that a `Record` refuses.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            content = {key: file[key] for key in file.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise RecordingError(
            str(path), f'not a readable npz file: {" ".join(str(error).split())}'
        ) from error
    if str(content.get('format', '')) != FORMAT:
        raise RecordingError(str(path), f'not a record: its format is not {FORMAT!r}')
    try:
        return Record(
            joints=_joints(content, 'joints'),
            rates=RateSeries(content['rates.stamp_ns'], content['rates.omega'])
            if 'rates.omega' in content
            else None,
            attitudes=AttitudeSeries(content['attitudes.stamp_ns'], content['attitudes.q_xyzw'])
            if 'attitudes.q_xyzw' in content
            else None,
            wheels=_joints(content, 'wheels'),
            source=str(content['source']),
            notes=tuple(json.loads(str(content['notes']))),
        )
    except KeyError as error:
        raise RecordingError(str(path), f'lacks {error}') from error
    except RecordingError as error:
        raise RecordingError(f'{path}: {error.place}', error.reason) from error


def _joints(content: dict[str, Array], key: str) -> JointSeries | None:
    if f'{key}.names' not in content:
        return None
    names = tuple(json.loads(str(content[f'{key}.names'])))
    velocity, effort = content.get(f'{key}.velocity'), content.get(f'{key}.effort')
    stamps: Any = content[f'{key}.stamp_ns']
    return JointSeries(names, stamps, content[f'{key}.position'], velocity, effort)
