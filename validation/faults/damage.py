"""Files that are damaged at random, and what becomes of who reads them."""

from __future__ import annotations

import resource
import tempfile
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from spacerobot_ros.effects.robot_file import load_robot_file
from spacerobot_ros.errors import SpaceRobotError
from spacerobot_ros.model.loader import package_folder
from spacerobot_ros.recording.bags.bag import read_bag
from spacerobot_ros.recording.bags.bag_writer import BagWriter
from spacerobot_ros.recording.read import read_record
from spacerobot_ros.recording.record import Record
from spacerobot_ros.simulation.closed_loop import ClosedLoop
from spacerobot_ros.simulation.truth import sample_messages

from ..hidden.diagnosis_scenario import packaged

_STEPS = 300  # of the bag that is damaged: 3 s in three chunks
_ODD = (
    'nan', '-.inf', '1e999', '-1', '0', '[]', '{}', '~', '!!int abc', '!!python/object:os.system',
    '"', "'", '\x00', '\u200b', '\t', '&a', '*a', '<<: *a', '- ' * 80, '[' * 300, '9' * 5000,
    '2024-99-99', 'true', '<', '<!ENTITY x "y">', '</link>', '\ufeff', '\n\n',
)  # fmt: skip
LONGEST, LARGEST, MOST_CHARACTERS = 2.0, 500.0, 1000
"""Time [s] and memory [MB] to refuse a file, and length of the line that says why."""
_MAPPING = """\
time: {columns: t, unit: s}
joints:
  names: [joint_1, joint_2, joint_3]
  position: {columns: [a, b, c], unit: rad}
  velocity: {columns: [va, vb, vc], unit: rad/s}
gyro: {columns: [x, y, z], unit: rad/s}
"""


@cache
def whole_bag() -> tuple[str, bytes, bytes, Record]:
    """Name and content of the mcap file of a good bag, its metadata, and what is in it."""
    with tempfile.TemporaryDirectory() as folder:
        path, plant_file = Path(folder) / 'bag', packaged('servicer')
        loop = ClosedLoop(plant_file.robot, plant_file.settings)
        with BagWriter(path) as bag:
            for step in loop.run(_STEPS):
                for topic, message in sample_messages(bag.compose, loop.plant, step.measured):
                    bag.add(topic, message)
        mcap, meta = next(path.glob('*.mcap')), (path / 'metadata.yaml').read_bytes()
        return mcap.name, mcap.read_bytes(), meta, read_bag(path, plant_file.robot)


def damaged_bag(kind: str, seed: int) -> str:
    """What becomes of a bag that is cut or has flipped bits.

    Returns:
        `refused`, `whole`, `in part` (and said), `in silence` (less than was written, unsaid),
        `wrong` (numbers that nobody wrote), or the name of an exception that is no refusal.
    """
    rng = np.random.default_rng(seed)
    name, data, meta, whole = whole_bag()
    if kind == 'cut':
        data = data[: rng.integers(len(data))]
    else:
        spoilt = bytearray(data)
        for place in rng.integers(len(data), size=rng.integers(1, 4)):
            spoilt[place] ^= 1 << rng.integers(8)
        data = bytes(spoilt)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'bag'
        path.mkdir()
        (path / name).write_bytes(data)
        (path / 'metadata.yaml').write_bytes(meta)
        try:
            read = read_bag(path, packaged('servicer').robot)
        except SpaceRobotError:
            return 'refused'
        except Exception as error:  # noqa: BLE001  what it is, the table says
            return type(error).__name__
        return _compared(read, whole)


def _compared(read: Record, whole: Record) -> str:
    missing = 0
    for name, values in (('joints', 'position'), ('rates', 'omega'), ('attitudes', 'q_xyzw')):
        part, all_of_it = getattr(read, name), getattr(whole, name)
        stamps = np.zeros(0, dtype=np.int64) if part is None else part.stamp_ns
        at = np.searchsorted(all_of_it.stamp_ns, stamps)
        known = at < len(all_of_it)
        if not known.all() or np.any(all_of_it.stamp_ns[at] != stamps):
            return 'wrong'
        if part is not None and np.any(getattr(part, values) != getattr(all_of_it, values)[at]):
            return 'wrong'
        missing += len(all_of_it) - len(stamps)
    if not missing:
        return 'whole'
    return 'in part' if len(read.notes) > len(whole.notes) else 'in silence'


def spoilt_text(text: str, rng: np.random.Generator) -> str:
    """A text with a few odd things in it, or less than there was."""
    lines = text.splitlines()
    for _ in range(rng.integers(1, 4)):
        k, odd = rng.integers(len(lines)), _ODD[rng.integers(len(_ODD))]
        line, change = lines[k], rng.integers(6)
        words = line.split(' ')
        if change == 0:
            words[rng.integers(len(words))] = odd
            lines[k] = ' '.join(words)
        elif change == 1:
            lines[k] = line[: rng.integers(len(line) + 1)] + odd
        elif change == 2:
            lines.insert(k, lines[rng.integers(len(lines))])
        elif change == 3 and len(lines) > 1:
            del lines[k]
        elif change == 4:
            lines[k] = ' ' * rng.integers(8) + line.lstrip()
        else:
            lines = lines[: k + 1]
    return '\n'.join(lines)


def malformed_file(kind: str, seed: int) -> str:
    """What becomes of a robot file, URDF or mapping with odd things in it.

    Returns:
        `refused`, `loaded`, `long` (a refusal that is not one line), `slow`, `large`, or the name
        of an exception that is no refusal.
    """
    rng = np.random.default_rng(seed)
    folder = package_folder('spacerobot_ros') / 'config'
    texts = {
        'robot file': (folder / 'servicer.yaml').read_text(encoding='utf-8'),
        'URDF': (folder / 'servicer.urdf').read_text(encoding='utf-8'),
        'mapping': _MAPPING,
    }
    texts[kind] = spoilt_text(texts[kind], rng)
    if kind == 'URDF':
        where = 'package://spacerobot_ros/config/servicer.urdf'
        texts['robot file'] = texts['robot file'].replace(where, 'servicer.urdf')
    with tempfile.TemporaryDirectory() as place:
        files = {'robot file': 'robot.yaml', 'URDF': 'servicer.urdf', 'mapping': 'map.yaml'}
        for name, file in files.items():
            (Path(place) / file).write_text(texts[name], encoding='utf-8')
        table = Path(place) / 'table.csv'
        table.write_text(_table(), encoding='utf-8')
        if kind == 'mapping':
            robot = packaged('servicer').robot
            return _refusal(lambda: read_record(table, robot, Path(place) / files[kind]))
        return _refusal(lambda: load_robot_file(Path(place) / files['robot file']))


@cache
def _table() -> str:
    """Two seconds of three joints that move, and their gyro, as CSV."""
    t = np.arange(200) * 0.01
    q = np.sin(np.outer(t, [1.0, 2.0, 3.0]))
    qd = np.cos(np.outer(t, [1.0, 2.0, 3.0])) * [1.0, 2.0, 3.0]
    rows = np.column_stack([t, q, qd, 0.1 * q])
    lines = [','.join(f'{value:.9g}' for value in row) for row in rows]
    return '\n'.join(['t,a,b,c,va,vb,vc,x,y,z', *lines]) + '\n'


def _refusal(read: Callable[[], Any]) -> str:
    begun, before = time.process_time(), megabytes()
    try:
        read()
        refusal = ''
    except SpaceRobotError as error:
        refusal = str(error)
    except Exception as error:  # noqa: BLE001  what it is, the table says
        return type(error).__name__
    if time.process_time() - begun > LONGEST:
        return 'slow'
    if megabytes() - before > LARGEST:
        return 'large'
    if '\n' in refusal or len(refusal) > MOST_CHARACTERS:
        return 'long'
    return 'refused' if refusal else 'loaded'


def megabytes() -> float:
    """The most memory that this process ever had [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
