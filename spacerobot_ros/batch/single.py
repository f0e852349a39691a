"""The recordings of a fleet: which there are, of which machine, which are there twice.

One of them is diagnosed, its report written, and what the table says of it.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from .. import __version__
from ..diagnosis.findings import Findings, Question, findings
from ..diagnosis.quality.excited import count_told
from ..diagnosis.quality.quality import check_record
from ..effects.catalogue import changed_robot
from ..effects.own_kinds import source_files
from ..effects.robot_file import load_robot_file
from ..errors import SpaceRobotError
from ..model.files import read_text
from ..recording.record import Record
from ..recording.tables.table import FORMATS, kind_of
from ..report.diagnosis_page import write_answer

_BAGS = ('mcap', 'db3')
_BLOCK = 1 << 20  # bytes


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording to be diagnosed.

    Args:
        path: File or bag folder.
        machine: The folder that holds the machine's recordings.
        name: Machine and place below, unlike all others.
        fault: Why it can't be used, known without reading it; empty for none.
    """

    path: Path
    machine: str
    name: str
    fault: str = ''

    @property
    def files(self) -> list[Path]:
        """The files with its samples."""
        if not self.path.is_dir():
            return [self.path]
        return sorted(p for p in self.path.rglob('*') if kind_of(p) in _BAGS)

    def stamp(self) -> list[tuple[str, int, int]]:
        """Name, size and time of change of each file: other data have another."""
        found = ((p.name, p.stat()) for p in self.files)
        return [(name, s.st_size, s.st_mtime_ns) for name, s in found]

    def key(self, question: Question, folder: Path, asked: str) -> str:
        """All that its answer depends on, as `diagnose_one` takes it.

        Args:
            question: What is asked of every recording.
            folder: The fleet's, which its report goes below.
            asked: `digest` of the question.
        """
        own = replace(question, data=(str(self.path.absolute()),))
        out = str((folder / 'reports' / self.name).absolute())
        return json.dumps(
            {'question': asdict(own), 'out': out, 'stamp': self.stamp(), 'asked': asked}
        )

    def about(self, folder: Path) -> dict[str, Any]:
        """Where it comes from, and its report below the fleet's folder."""
        report = Path('reports') / self.name / 'report.html'
        has_report = not self.fault and (folder / report).exists()
        return {
            'name': self.name,
            'machine': self.machine,
            'path': str(self.path),
            'report': str(report) if has_report else None,
        }


def digest(question: Question) -> str:
    """What answers depend on beside the recordings.

    Robot, effects of one's own, mapping, options and version.
    """
    file = load_robot_file(question.robot)
    parts = [__version__, Path(question.robot).read_text(encoding='utf-8'), file.robot.urdf]
    parts += [read_text(Path(question.map), 'mapping')] if question.map else []
    parts += [str(question.split_gaps), str(question.has_closed_loop)]
    own = [path.read_bytes() for path in source_files(file.settings.robot.effect_modules)]
    return hashlib.sha256(b'\0'.join([*(p.encode() for p in parts), *own])).hexdigest()[:16]


def find_recordings(
    data: Sequence[str], has_map: bool, out: Path
) -> tuple[list[Recording], list[Path]]:
    """Recordings below folders, each once, in the order of their names.

    A bag is a folder with `metadata.yaml`, or whose mcap files bear its name; every other mcap,
    db3 or npz file is a recording, and with a mapping every table. The machine is the first folder
    below the one that is given, or that one itself.

    Args:
        data: Recordings and folders of them.
        has_map: Whether there is a column mapping.
        out: Folder that is written to, not looked into.

    Returns:
        Recordings, those that can't be used with a fault; and tables that lack a mapping.
    """
    kinds = (*_BAGS, 'npz', *(FORMATS if has_map else ()))
    found: dict[Path, Recording] = {}
    tables: list[Path] = []
    for text in data:
        root, several = Path(text), len(data) > 1
        paths = list(_below(root, out.resolve())) if root.is_dir() else [root]
        own = [p for p in paths if p.is_dir() or kind_of(p) in kinds or p == root]
        tables += [p for p in paths if p not in own and kind_of(p) in FORMATS]
        for path in own:
            found.setdefault(path.resolve(), _recording(path, root, several))
        if not own:
            fault = 'holds no recording'
            found.setdefault(root.resolve(), Recording(root, root.name, root.name, fault))
    return _unlike(sorted(found.values(), key=lambda r: (r.name, str(r.path)))), tables


def without_duplicates(recordings: Sequence[Recording]) -> list[Recording]:
    """Recordings, those whose samples another one before them has with that as their fault."""
    sizes: dict[tuple[int, ...], list[Recording]] = {}
    for recording in recordings:
        if not recording.fault:
            size = tuple(p.stat().st_size for p in recording.files)
            sizes.setdefault(size, []).append(recording)
    first: dict[str, Recording] = {}
    copies: dict[Path, str] = {}
    for same in sizes.values():
        for recording in same if len(same) > 1 else ():
            original = first.setdefault(_digest(recording.files), recording)
            if original is not recording and any(p.stat().st_size for p in recording.files):
                copies[recording.path] = f'has the same content as {original.name}'
    return [replace(r, fault=r.fault or copies.get(r.path, '')) for r in recordings]


def _below(folder: Path, out: Path) -> Iterator[Path]:
    """Files and bags below a folder, or the folder itself where it is a bag."""
    if folder.resolve() == out:
        return
    if _is_bag(folder):
        yield folder
        return
    for entry in sorted(folder.iterdir(), key=lambda path: path.name):
        if entry.name.startswith('.'):
            continue
        if entry.is_dir():
            yield from _below(entry, out)
        elif entry.is_file():
            yield entry


def _is_bag(folder: Path) -> bool:
    parts = [p.stem for p in folder.glob('*.mcap')]
    named = [s for s in parts if s.removeprefix(f'{folder.name}_').isdigit()]
    return (folder / 'metadata.yaml').is_file() or bool(parts and len(named) == len(parts))


def _recording(path: Path, root: Path, several: bool) -> Recording:
    below = path.relative_to(root).parts if path != root else ()
    if not below:  # given by itself
        above = path.absolute().parent.name
        name, machine = (f'{above}/{path.name}' if several else path.name), above
    else:
        machine = below[0] if len(below) > 1 else root.absolute().name
        parts = (root.absolute().name, *below) if several or len(below) == 1 else below
        name = '/'.join(parts)
    fault = '' if path.exists() else 'no such file or folder'
    return Recording(path, machine, name, fault)


def _unlike(recordings: Sequence[Recording]) -> list[Recording]:
    """The recordings, names that are taken numbered."""
    seen: Counter[str] = Counter()
    out = []
    for r in recordings:
        seen[r.name] += 1
        count = seen[r.name]
        out.append(r if count == 1 else replace(r, name=f'{r.name} ({count})'))
    return out


def _digest(files: Sequence[Path]) -> str:
    total = hashlib.sha256()
    for path in files:
        with path.open('rb') as file:
            while block := file.read(_BLOCK):
                total.update(block)
    return total.hexdigest()


_CLOCK = 10**18
"""Stamp from which it is one of the calendar, September 2001 [ns]; others count from a start."""
_WHEELS = 'target_wheel_momentum'
_AXES = 'xyz'


def diagnose_one(key: str) -> dict[str, Any]:
    """Diagnose a recording, all by itself.

    Args:
        key: JSON of a map: `question` (of `Question`), `out`, where its report belongs, and what
            else the answer depends on.

    Returns:
        What the table says of it: `error` alone where it can't be used.

    Raises:
        ConfigurationError: its report can't be written.
    """
    asked, started = json.loads(key), time.perf_counter()
    question = Question(**{**asked['question'], 'data': tuple(asked['question']['data'])})
    try:
        answer = findings(question, question.command(asked['out']))
    except SpaceRobotError as error:
        found: dict[str, Any] = {'error': ' '.join(str(error).split())}
    else:
        write_answer(answer, question.robot, Path(asked['out']))
        found = {**_answer_columns(answer), 'error': None}
    return {**found, 'run_time': round(time.perf_counter() - started, 3)}


def _answer_columns(answer: Findings) -> dict[str, Any]:
    record, diagnosis = answer.records[0], answer.diagnosis
    return {
        'time': _date(record.span_ns[0]),
        'duration': sum((b - a) / 1e9 for a, b in (r.span_ns for r in answer.records)),
        'verdict': diagnosis.verdict,
        'sentence': diagnosis.sentence,
        'causes': [
            {
                'effect': cause.applied.id,
                **_values(cause.applied, 'where title'),
                'parameters': {
                    n: _values(p, 'value std unit') for n, p in cause.parameters.items()
                },
            }
            for cause in diagnosis.causes
        ],
        'momentum': _momentum(answer),
        'residuals': [
            _values(r, 'channel unit rms_before rms_after noise_floor')
            for r in diagnosis.residuals
        ],
        'gain': _values(diagnosis.gain, 'before after'),
        **_looked_at(record, answer),
        'version': __version__,
    }


def _values(of: object, names: str) -> dict[str, Any]:
    """Some attributes by their names."""
    return {name: getattr(of, name) for name in names.split()}


def _date(stamp_ns: int) -> str | None:
    """A stamp as a date, where it is one."""
    if stamp_ns < _CLOCK:
        return None
    seconds, rest = divmod(stamp_ns, 10**9)
    date = datetime.fromtimestamp(seconds, tz=timezone.utc)
    return f'{date:%Y-%m-%dT%H:%M:%S}.{rest // 1000:06d}Z'


def _momentum(answer: Findings) -> dict[str, list[dict[str, float | None]]]:
    """Momentum of the captured wheels [N m s] by link, as the extended model has it."""
    added = (*answer.file.effects, *answer.extension)
    robot = changed_robot(answer.file.robot, added)
    spread = {
        (cause.applied.where, name): p.std
        for cause in answer.diagnosis.causes
        if cause.applied.id == _WHEELS
        for name, p in cause.parameters.items()
    }
    values = robot.target_momentum.reshape(-1, 3).tolist()
    links = [wheels.link for wheels in robot.target_wheels]
    return {
        link: [
            {'value': value, 'std': spread.get((link, axis))}
            for axis, value in zip(_AXES, row, strict=True)
        ]
        for link, row in zip(links, values, strict=True)
    }


def _looked_at(record: Record, answer: Findings) -> dict[str, Any]:
    """What should be looked at in the recording, a line each; how many numbers of all it tells."""
    told: dict[str, int | None] = {'told': None, 'numbers': None}
    try:
        quality = check_record(record, answer.file)
    except SpaceRobotError as error:
        return {'health': [str(error)], **told}
    if (found := quality.excitation) is not None:
        told = {'told': count_told(found), 'numbers': len(found)}
    return {'health': list(quality.findings), **told}
