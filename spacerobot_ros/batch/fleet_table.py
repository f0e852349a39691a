"""What was said of recordings: a table, a row each, values against time, and what of them drifts.

A table is two files, each complete or not at all: Parquet for programs, CSV for people.

A quantity drifts where a straight line through its values is surely not flat:

    value_k = a + b t_k + e_k,   var(e_k) = s^2 std_k^2,   s^2 = max(1, chi^2 / (N - 2)),

fitted by least squares; b / std(b) is compared with Student's t of N - 2 degrees of freedom.
Values scatter more than their standard deviations say where the machine itself varies: s covers
that (Birge 1932). Without standard deviations all are alike, and s is free.
"""

from __future__ import annotations

import csv
import importlib.util
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student

from ..model.files import write_text
from ..types import Array
from .runner import TrialRecord as Row

COLUMNS = (
    *('recording', 'machine', 'path', 'time', 'duration [s]', 'verdict', 'error', 'causes'),
    *('health', 'told [1]', 'numbers [1]', 'run time [s]', 'version', 'report'),
)
_SOURCES = {
    'recording': 'name',
    **{'duration [s]': 'duration', 'told [1]': 'told', 'numbers [1]': 'numbers'},
    'run time [s]': 'run_time',
}
_AXES = 'xyz'
_DAY = 86400.0  # s


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """A quantity of one machine along its recordings.

    Args:
        machine: Which. quantity: What, where. unit: SI.
        time: (N,) days since the first recording of the fleet, or the recordings' numbers.
        value: (N,). std: (N,) standard deviations, NaN where none is known.
    """

    machine: str
    quantity: str
    unit: str
    time: Array
    value: Array
    std: Array


def table_rows(answers: Sequence[Row]) -> list[dict[str, Any]]:
    """The table's rows, one a recording."""
    return [_row(one) for one in answers]


def in_order(answers: Sequence[Row]) -> tuple[list[Row], Array, str]:
    """Recordings by time.

    Returns:
        Them; (N,) their times, and what those are: days where all recordings have a date, else
        numbers in the order of their names.
    """
    usable = [one for one in answers if not one['error']]
    if usable and all(one['time'] for one in usable):
        usable.sort(key=lambda one: (one['time'], one['name']))
        seconds = np.array([_seconds(one['time']) for one in usable])
        return usable, (seconds - seconds[0]) / _DAY, f'days since {usable[0]["time"][:10]}'
    return usable, np.arange(1.0, 1.0 + len(usable)), 'number of the recording, by name'


def courses(answers: Sequence[Row]) -> list[Course]:
    """Every quantity of every machine that several recordings give, in the order of time."""
    ordered, time, _ = in_order(answers)
    found: dict[tuple[str, str, str], list[tuple[float, ...]]] = {}
    for one, t in zip(ordered, time.tolist(), strict=True):
        residuals = ((f'residual {r["channel"]}', r['unit'], r['rms_before'], None)
                     for r in one['residuals'])  # fmt: skip
        for quantity, unit, value, std in (*_estimates(one), *residuals):
            if value is not None and np.isfinite(value):
                row = t, value, np.nan if std is None else std
                found.setdefault((one['machine'], quantity, unit), []).append(row)
    return [Course(*key, *np.array(rows).T) for key, rows in sorted(found.items())]


def cause_name(cause: Row) -> str:
    """An effect at its place."""
    return cause['effect'] + (f'@{cause["where"]}' if cause['where'] else '')


def _estimates(one: Row) -> Iterator[tuple[str, str, float | None, float | None]]:
    """Name, unit, value and standard deviation of what was estimated."""
    for cause in one['causes']:
        for name, p in cause['parameters'].items():
            yield f'{cause_name(cause)}.{name}', p['unit'] or '1', p['value'], p['std']
    for link, axes in one['momentum'].items():
        for axis, p in zip(_AXES, axes, strict=True):
            yield f'wheel_momentum@{link}.{axis}', 'N m s', p['value'], p['std']


def _row(one: Row) -> dict[str, Any]:
    row = {name: one.get(_SOURCES.get(name, name)) for name in COLUMNS}
    if one['error']:
        return row
    gain = one['gain']
    row |= {
        'causes': '; '.join(map(cause_name, one['causes'])),
        'health': '; '.join(one['health']) or 'good',
        'held out before [1]': gain['before'],
        'held out after [1]': gain['after'],
    }
    for name, unit, value, std in _estimates(one):
        row |= {f'{name} [{unit}]': value, f'{name} std': std}
    for r in one['residuals']:
        for name in ('rms_before', 'rms_after', 'noise_floor'):
            row[f'{r["channel"]} {name} [{r["unit"]}]'] = r[name]
    return row


def _seconds(date: str) -> float:
    return datetime.fromisoformat(date.replace('Z', '+00:00')).timestamp()


FEWEST = 4
"""Recordings of a trend: with three a line has one degree of freedom, and its t no tails' end."""
SIGNIFICANT = 0.01
"""Probability that any of all trends of a report is called a drift where none is (Holm 1979)."""


@dataclass(frozen=True, slots=True, eq=False)
class Trend:
    """A line through a course.

    Args:
        course: The values.
        fitted: (N,) of the line. slope: By a unit of time. std: Of the slope.
        p_value: Probability of such a slope without a drift, this quantity alone.
        is_drift: Whether it is significant among all that were asked.
    """

    course: Course
    fitted: Array
    slope: float
    std: float
    p_value: float
    is_drift: bool = False


def trends(courses: Sequence[Course]) -> list[Trend]:
    """Lines through all courses that are long enough, surest first."""
    found = [_line(h) for h in courses if len(h.time) >= FEWEST and np.ptp(h.time) > 0.0]
    found.sort(key=lambda line: (line.p_value, line.course.machine, line.course.quantity))
    out, is_drift = [], True
    for i, line in enumerate(found):
        is_drift = is_drift and line.p_value * (len(found) - i) < SIGNIFICANT
        out.append(replace(line, is_drift=is_drift))
    return out


def _line(course: Course) -> Trend:
    is_known = bool(np.all(course.std > 0.0))
    weight = course.std**-2.0 if is_known else np.ones(len(course.time))
    t = course.time - np.average(course.time, weights=weight)
    information = weight @ t**2
    slope = float(weight @ (t * course.value) / information)
    fitted = np.average(course.value, weights=weight) + slope * t
    freedom = len(t) - 2
    scatter = float(weight @ (course.value - fitted) ** 2) / freedom
    scatter = max(1.0, scatter) if is_known else scatter
    std = float(np.sqrt(scatter / information))
    # of values that lie on their line to rounding, such as none at all, nothing is sure
    rounding = 1e-12 * float(np.max(np.abs(course.value))) / float(np.ptp(t))
    ratio = abs(slope) / max(std, rounding) if slope else 0.0
    p_value = float(2.0 * student.sf(ratio, freedom))
    return Trend(course, fitted, slope, std, p_value)


TableRows = Sequence[Mapping[str, Any]]


def write_table(rows: TableRows, stem: Path, columns: Sequence[str] = ()) -> list[Path]:
    """Write `STEM.csv` and, where pyarrow is installed, `STEM.parquet`.

    Args:
        rows: Numbers, texts, truths or None by column; what a row lacks is None.
        stem: Of the files' names.
        columns: That come first, in this order; the rest as they first appear.

    Returns:
        What was written.

    Raises:
        ConfigurationError: they can't be written.
    """
    names = list(dict.fromkeys([*columns, *(name for row in rows for name in row)]))
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(names)
    writer.writerows([_cell(row.get(name)) for name in names] for row in rows)
    written = [write_text(stem.with_suffix('.csv'), text.getvalue())]
    if importlib.util.find_spec('pyarrow') is not None:
        written.append(_write_parquet(rows, names, stem.with_suffix('.parquet')))
    return written


def _cell(value: Any) -> Any:
    """A number with all its digits, an empty cell for None."""
    return '' if value is None else repr(value) if isinstance(value, float) else value


def _write_parquet(rows: TableRows, names: Sequence[str], path: Path) -> Path:
    import pyarrow as pa
    from pyarrow import parquet

    table = {}
    for name in names:
        values = [row.get(name) for row in rows]
        # whole numbers beside others are numbers
        is_float = any(isinstance(value, float) for value in values)
        table[name] = pa.array(values, pa.float64() if is_float else None)
    content = io.BytesIO()
    parquet.write_table(pa.table(table), content)
    return write_text(path, content.getvalue())
