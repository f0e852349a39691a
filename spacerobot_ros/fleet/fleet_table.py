"""What was said of recordings as one table, a row each, and as values against time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from ..campaign.description import Record as Row
from ..types import Array

COLUMNS = (
    *('recording', 'machine', 'path', 'time', 'duration [s]', 'verdict', 'error', 'causes'),
    *('health', 'run time [s]', 'version', 'report'),
)
_AXES = 'xyz'
_DAY = 86400.0  # s


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A quantity of one machine along its recordings.

    Args:
        machine: Which. quantity: What, where. unit: SI.
        names: Of the N recordings.
        time: (N,) days since the first recording of the fleet, or the recordings' numbers.
        value: (N,). std: (N,) standard deviations, NaN where none is known.
    """

    machine: str
    quantity: str
    unit: str
    names: tuple[str, ...]
    time: Array
    value: Array
    std: Array


def table_rows(said: Sequence[Row]) -> list[dict[str, Any]]:
    """The table's rows, one a recording."""
    return [_row(one) for one in said]


def in_order(said: Sequence[Row]) -> tuple[list[Row], Array, str]:
    """Recordings by time.

    Returns:
        Them; (N,) their times, and what those are: days where all recordings have a date, else
        numbers in the order of their names.
    """
    usable = [one for one in said if not one['error']]
    if usable and all(one['time'] for one in usable):
        usable.sort(key=lambda one: (one['time'], one['name']))
        seconds = np.array([_seconds(one['time']) for one in usable])
        return usable, (seconds - seconds[0]) / _DAY, f'days since {usable[0]["time"][:10]}'
    return usable, np.arange(1.0, 1.0 + len(usable)), 'number of the recording, by name'


def courses(said: Sequence[Row]) -> list[Course]:
    """Every quantity of every machine that several recordings give, in the order of time."""
    ordered, time, _ = in_order(said)
    found: dict[tuple[str, str, str], list[tuple[str, float, float, float]]] = {}
    for one, t in zip(ordered, time.tolist(), strict=True):
        for quantity, unit, value, std in _quantities(one):
            if value is not None and np.isfinite(value):
                row = one['name'], t, value, np.nan if std is None else std
                found.setdefault((one['machine'], quantity, unit), []).append(row)
    return [
        Course(*key, tuple(row[0] for row in rows), *np.array([row[1:] for row in rows]).T)
        for key, rows in sorted(found.items())
    ]


def cause_name(cause: Row) -> str:
    """An effect at its place."""
    return cause['effect'] + (f'@{cause["where"]}' if cause['where'] else '')


def _quantities(one: Row) -> Iterator[tuple[str, str, float | None, float | None]]:
    """Name, unit, value and standard deviation of all that may drift."""
    for cause in one['causes']:
        for name, p in cause['parameters'].items():
            yield f'{cause_name(cause)}.{name}', p['unit'] or '1', p['value'], p['std']
    for link, axes in one['momentum'].items():
        for axis, p in zip(_AXES, axes, strict=True):
            yield f'wheel_momentum@{link}.{axis}', 'N m s', p['value'], p['std']
    for r in one['residuals']:
        yield f'residual {r["channel"]}', r['unit'], r['rms_before'], None


def _row(one: Row) -> dict[str, Any]:
    row = {
        'recording': one['name'],
        'machine': one['machine'],
        'path': one['path'],
        'time': one.get('time'),
        'duration [s]': one.get('duration'),
        'verdict': one.get('verdict'),
        'error': one['error'],
        'causes': None if one['error'] else '; '.join(map(cause_name, one['causes'])),
        'health': None if one['error'] else '; '.join(one['health']) or 'good',
        'run time [s]': one.get('run_time'),
        'version': one.get('version'),
        'report': one.get('report'),
    }
    if one['error']:
        return row
    gain = one['gain']
    row |= {'held out before [1]': gain['before'], 'held out after [1]': gain['after']}
    for cause in one['causes']:
        for name, p in cause['parameters'].items():
            row[f'{cause_name(cause)}.{name} [{p["unit"] or "1"}]'] = p['value']
            row[f'{cause_name(cause)}.{name} std'] = p['std']
    for link, axes in one['momentum'].items():
        for axis, p in zip(_AXES, axes, strict=True):
            row[f'wheel_momentum@{link}.{axis} [N m s]'] = p['value']
            row[f'wheel_momentum@{link}.{axis} std'] = p['std']
    for r in one['residuals']:
        for name in ('rms_before', 'rms_after', 'noise_floor'):
            row[f'{r["channel"]} {name} [{r["unit"]}]'] = r[name]
    return row


def _seconds(date: str) -> float:
    return datetime.fromisoformat(date.replace('Z', '+00:00')).timestamp()
