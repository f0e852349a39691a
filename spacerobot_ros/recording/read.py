"""One way into every recording: rosbag2, record files, and CSV, JSON or npz with a mapping."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import RecordingError
from ..model.robot import Robot
from ..types import IntArray
from .bag import Topics, read_bag
from .mapped_table import in_robot_order, read_mapped
from .mapping import load_mapping
from .npz import load_npz
from .record import Record
from .table import FORMATS

GAP_PERIODS = 10.0  # a longer pause between two samples is worth a note


def read_record(
    path: str | Path,
    robot: Robot,
    map_path: str | Path | None = None,
    topics: Topics | None = None,
) -> Record:
    """Read a recording of any supported kind.

    Args:
        path: A rosbag2 folder (or one mcap or db3 file), an npz written by `save_npz`, or with a
            mapping any CSV, JSON or npz file.
        robot: Gives the joints' names and order, and the base's frame.
        map_path: Column mapping YAML (docs/data.md); None for a bag or a record file.
        topics: Where the sensors are found in a bag; those of the simulator by default.

    Returns:
        The record, joints in the robot's order. A sensor that is absent is None; what was left
        out and every long gap stands in the notes.

    Raises:
        RecordingError: unreadable, not the robot's, or faulty; one line that names the place.
        ConfigurationError: the mapping can't be read as YAML.
    """
    path = Path(path)
    if not path.exists():
        raise RecordingError(str(path), 'no such file or folder')
    record = _read(path, robot, map_path, topics)
    return replace(record, notes=(*record.notes, *gaps(record)))


def _read(path: Path, robot: Robot, map_path: str | Path | None, topics: Topics | None) -> Record:
    suffix = path.suffix.lower().removeprefix('.')
    if map_path is not None:
        mapping = load_mapping(map_path)
        if path.is_dir() or suffix in ('mcap', 'db3'):
            raise RecordingError(str(path), 'is a bag, which needs no column mapping')
        return read_mapped(path, robot, mapping)
    if suffix == 'npz' and path.is_file():
        return in_robot_order(load_npz(path), robot)
    if suffix in FORMATS and path.is_file():
        raise RecordingError(str(path), 'needs a column mapping (--map YAML; docs/data.md)')
    return read_bag(path, robot, topics)


def gaps(record: Record) -> tuple[str, ...]:
    """A note for each sensor with its longest pause, where that is long.

    A pause is long above `GAP_PERIODS` times the median period of the sensor.
    """
    notes = []
    for name in ('joints', 'rates', 'attitudes', 'wheels'):
        series = getattr(record, name)
        if series is not None and len(series.stamp_ns) > 2:
            notes += _gap(name, series.stamp_ns)
    return tuple(notes)


def _gap(name: str, stamps: IntArray) -> list[str]:
    steps = np.diff(stamps)
    long = steps > GAP_PERIODS * np.median(steps)
    if not long.any():
        return []
    worst = int(np.argmax(steps))
    return [
        f'{name}: {int(long.sum())} gaps, the longest {steps[worst] / 1e9:.3g} s '
        f'after {(stamps[worst] - stamps[0]) / 1e9:.6g} s'
    ]
