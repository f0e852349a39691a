"""One table in two files: Parquet for programs, CSV for people; each complete or not at all."""

from __future__ import annotations

import csv
import importlib.util
import io
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import ConfigurationError
from ..model.files import write_text

Rows = Sequence[Mapping[str, Any]]


def write_table(rows: Rows, stem: Path, columns: Sequence[str] = ()) -> list[Path]:
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


def _write_parquet(rows: Rows, names: Sequence[str], path: Path) -> Path:
    import pyarrow as pa
    from pyarrow import parquet

    arrays = [_array([row.get(name) for row in rows]) for name in names]
    partial = path.with_name(f'.{path.name}.partial')
    try:
        parquet.write_table(pa.Table.from_arrays(arrays, names=list(names)), partial)
        os.replace(partial, path)
    except OSError as error:
        with suppress(OSError):
            partial.unlink(missing_ok=True)
        why = error.strerror or str(error)
        raise ConfigurationError(str(path), f'can not be written: {why}') from error
    return path


def _array(values: Sequence[Any]) -> Any:
    """A column; whole numbers beside others are numbers."""
    import pyarrow as pa

    if any(isinstance(value, float) for value in values):
        return pa.array([None if v is None else float(v) for v in values], pa.float64())
    return pa.array(values)
