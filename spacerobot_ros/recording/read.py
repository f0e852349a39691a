"""One way into every recording: rosbag2, record files, and CSV, JSON or npz with a mapping."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import ConfigurationError, RecordingError
from ..formats import counted
from ..model.robot import Robot
from ..model.urdf import parse_urdf
from .bags.bag import Topics, read_bag
from .faults.data_faults import with_known_faults
from .faults.even_stamps import with_even_stamps
from .faults.extras import bridged_extras, without_extra_spikes
from .faults.gaps import split_at_gaps, with_gaps_noted
from .faults.held_readings import without_repeats
from .faults.joint_limits import with_stops
from .faults.motion_faults import unlike_positions
from .faults.spikes import without_spikes
from .faults.thresholds import FEWEST_SAMPLES, SHORTEST, is_short
from .faults.wrapped_angles import with_turns_counted
from .npz import load_npz
from .record import JointSeries, Record
from .robot_inputs import ignored_wheels, in_robot_order, with_inputs
from .tables.mapped_table import read_mapped
from .tables.mapping import load_mapping
from .tables.table import FORMATS, kind_of


def read_record(
    path: str | Path,
    robot: Robot | None,
    map_path: str | Path | None = None,
    topics: Topics | None = None,
    *,
    is_joined: bool = False,
) -> Record:
    """Read a recording of any supported kind.

    Args:
        path: A rosbag2 folder (or one mcap or db3 file), an npz written by `save_npz`, or with a
            mapping any CSV, JSON or npz file.
        robot: Gives the joints' names and order, what their efforts are, and the base's frame;
            without it they are taken as the recording has them.
        map_path: Column mapping YAML (docs/data.md); None for a bag or a record file.
        topics: Where the sensors are found in a bag; those of the simulator by default.
        is_joined: Whether it may be several runs: a table's clock may begin anew, gaps are not
            noted.

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
    if map_path is not None:
        record = _read_table(path, robot, map_path, is_joined=is_joined)
    else:
        record = _read(path, robot, topics)
    if robot is not None:
        record = with_stops(with_turns_counted(in_robot_order(record, robot), robot), robot)
    record = with_even_stamps(without_spikes(without_repeats(record)))
    record = without_extra_spikes(record)
    if robot is not None:
        record = _usable(record, robot)
        with_inputs(robot, record)  # refuses what is not this robot's
        record = replace(record, notes=(*record.notes, *ignored_wheels(robot, record)))
    return record if is_joined else _with_holes_noted(record)


def read_records(
    paths: Sequence[str | Path],
    robot: Robot,
    map_path: str | Path | None = None,
    *,
    split_gaps: bool = False,
) -> tuple[Record, ...]:
    """Read recordings of one robot that shall be judged together.

    Args:
        paths: As `read_record` takes them, each once.
        robot: The robot of them all.
        map_path: One column mapping for all of them.
        split_gaps: Whether each is taken as several, split at its long pauses and, in a table,
            where its clock begins anew.

    Raises:
        RecordingError: as `read_record`, the file named; one given twice, or too short.
        ConfigurationError: the mapping can't be read as YAML.
    """
    (records,) = read_groups([paths], robot, map_path, split_gaps=split_gaps)
    return records


def read_groups(
    groups: Sequence[Sequence[str | Path]],
    robot: Robot,
    map_path: str | Path | None = None,
    *,
    split_gaps: bool = False,
    force_data: bool = False,
) -> list[tuple[Record, ...]]:
    """Several groups of recordings, as `read_records` has one; no recording is in two.

    With `force_data` their faults are notes.
    """
    every = [path for group in groups for path in group]
    files = [Path(path).resolve() for path in every]
    for i, path in enumerate(every):
        if files[i] in files[:i]:
            raise RecordingError(str(path), 'is given twice')
    out = []
    for group in groups:
        records: list[Record] = []
        for path in group:
            with _naming(path, every[0], has_map=map_path is not None):
                record = read_record(path, robot, map_path, is_joined=split_gaps)
            _refuse_short(record, path)
            own = map(_with_holes_noted, split_at_gaps(record)) if split_gaps else (record,)
            records += (with_known_faults(r, robot) if force_data else r for r in own)
        _refuse_other_bodies(records, robot)
        out.append(tuple(records))
    return out


def _with_holes_noted(record: Record) -> Record:
    record = with_gaps_noted(record)
    return replace(record, notes=(*record.notes, *bridged_extras(record)))


def _refuse_other_bodies(records: Sequence[Record], robot: Robot) -> None:
    """Refuse recordings whose own descriptions have other bodies, such as another tool."""
    declared = [(r, own) for r in records if (own := _bodies(r.description, not robot.is_free))]
    for record, own in declared[1:]:
        first, others = declared[0]
        if differing := sorted(own.items() ^ others.items()):
            link = differing[0][0]
            raise RecordingError(
                record.source,
                f'{link} is another body here than in {first.source} (/robot_description): '
                'recordings of one machine with one tool are judged together',
            )


def _bodies(description: str, is_on_ground: bool) -> dict[str, tuple[float, ...]]:
    """Mass, centre of mass and inertia of every link; none where the text is no URDF."""
    try:
        links = parse_urdf(description, is_on_ground=is_on_ground).links if description else {}
    except ConfigurationError:
        return {}
    return {n: (x.mass, *x.com.tolist(), *x.inertia.ravel().tolist()) for n, x in links.items()}


def _refuse_short(record: Record, path: str | Path) -> None:
    if record.joints is not None and is_short(record.joint_time):
        raise RecordingError(
            str(path),
            f'is too short: {counted(len(record.joint_time), "sample")} of the joints in '
            f'{np.ptp(record.joint_time):.3g} s, at least {FEWEST_SAMPLES} in '
            f'{SHORTEST:g} s are needed',
        )


@contextmanager
def _naming(path: str | Path, first: str | Path, *, has_map: bool) -> Iterator[None]:
    """Make errors name the file, and another that the mapping did fit."""
    try:
        yield
    except RecordingError as error:
        place = error.place if str(path) in error.place else f'{path}: {error.place}'
        fits = f' (the mapping fits {first})' if has_map and path != first else ''
        raise RecordingError(place, f'{error.reason}{fits}') from error


def _read_table(
    path: Path, robot: Robot | None, map_path: str | Path, *, is_joined: bool
) -> Record:
    mapping = load_mapping(map_path)
    if path.is_dir() or kind_of(path) in ('mcap', 'db3'):
        raise RecordingError(str(path), 'is a bag, which needs no column mapping')
    return read_mapped(path, robot, mapping, is_joined=is_joined)


def _read(path: Path, robot: Robot | None, topics: Topics | None) -> Record:
    kind = kind_of(path)
    if kind == 'npz' and path.is_file():
        return load_npz(path)
    if kind in FORMATS and path.is_file():
        raise RecordingError(str(path), 'needs a column mapping (--map YAML; docs/data.md)')
    return read_bag(path, robot, topics)


def _usable(record: Record, robot: Robot) -> Record:
    """The record without columns that can't be used, which its notes say.

    Rates of some joints only, as whoever takes rates takes them of all; on a fixed base also rates
    that are not the derivative of the positions, as its positions alone tell the motion; efforts
    of some joints only where the base is free, as its momentum tells the motion without.
    """
    if record.joints is None:
        return record
    record, notes = _with_motors(record, record.joints, robot)
    joints = record.joints
    if joints is None:
        return record
    why, wrong = _unusable_rates(record, robot)
    if wrong.any():
        notes.append(f'{why} of {", ".join(np.array(joints.names)[wrong])}: no rates are used')
        joints = replace(joints, velocity=None)
    lacking = joints.without_effort
    if joints.effort is not None and lacking:
        unused = robot.is_free or len(lacking) == len(joints.names)
        notes.append(f'no efforts of {", ".join(lacking)}' + (': none are used' if unused else ''))
        joints = replace(joints, effort=None) if unused else joints
    return replace(record, joints=joints, notes=(*record.notes, *notes))


def _with_motors(record: Record, joints: JointSeries, robot: Robot) -> tuple[Record, list[str]]:
    """The record whose passive joints have a torque of zero; currents are said to be such.

    Raises:
        RecordingError: an effort at a joint that has no motor.
        ConfigurationError: currents on a free base, whose momentum tells no motor constant.
    """
    notes = [f'{", ".join(joints.rate_only)}: rates integrated'] if joints.rate_only else []
    off = np.isin(joints.names, robot.passive_joints)
    given = off & ~np.isin(joints.names, joints.passive)
    if joints.effort is not None:
        driven = given & (np.nan_to_num(joints.effort) != 0.0).any(axis=0)
        for name in np.array(joints.names)[driven]:
            raise RecordingError(
                f'{record.source}: effort of {name}',
                'is not zero, but robot.passive_joints of the robot file names it',
            )
    if given.any():
        where = np.tile(off, (len(joints), 1))
        where |= False if joints.unpowered is None else joints.unpowered
        joints = replace(joints, unpowered=where)
    if joints.in_amperes and robot.is_free:
        robot.check_constants()
    return replace(record, joints=joints), notes


def _unusable_rates(record: Record, robot: Robot) -> tuple[str, NDArray[np.bool_]]:
    """What is wrong with rates, and (n,) of which joints."""
    rates = record.qd
    if rates is None:
        return '', np.zeros(0, dtype=bool)
    absent = np.asarray(np.isnan(rates).any(axis=0))
    if absent.any() or robot.is_free:
        return 'no rates', absent
    return 'the rates are not the derivative of the positions', unlike_positions(record)
