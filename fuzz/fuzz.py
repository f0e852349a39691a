"""Coverage-guided fuzzing of what reads files, by atheris.

    make fuzz ARGS="robot_file -max_total_time=60"

The rest of the arguments goes to libFuzzer. An input that raises anything but a refusal in one
line is kept as `crash-*`.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

try:
    import atheris
except ImportError:
    sys.exit('atheris is not installed: .venv/bin/pip install atheris')

with atheris.instrument_imports(include=['spacerobot_ros', 'yaml', 'rosbags', 'mcap']):
    from spacerobot_ros.effects.robot_file import load_robot_file
    from spacerobot_ros.errors import SpaceRobotError
    from spacerobot_ros.model.urdf import parse_urdf
    from spacerobot_ros.recording.bags.bag import read_bag
    from spacerobot_ros.recording.read import read_record
    from validation.faults.damage import MOST_CHARACTERS
    from validation.hidden.diagnosis_scenario import packaged

PLACE = Path(tempfile.mkdtemp(prefix='spacerobot-fuzz-'))


def robot_file(data: bytes) -> None:
    """A robot file."""
    (PLACE / 'robot.yaml').write_bytes(data)
    load_robot_file(PLACE / 'robot.yaml')


def urdf(data: bytes) -> None:
    """A URDF."""
    parse_urdf(data.decode('utf-8', errors='replace'), 'URDF')


def mcap(data: bytes) -> None:
    """A bag without metadata."""
    (PLACE / 'bag').mkdir(exist_ok=True)
    (PLACE / 'bag' / 'bag_0.mcap').write_bytes(data)
    read_bag(PLACE / 'bag', packaged('servicer').robot)


def table(data: bytes) -> None:
    """A mapping and a CSV, one behind the other."""
    mapping, _, rows = data.partition(b'\0')
    (PLACE / 'map.yaml').write_bytes(mapping)
    (PLACE / 'table.csv').write_bytes(rows)
    read_record(PLACE / 'table.csv', packaged('servicer').robot, PLACE / 'map.yaml')


TARGETS = {target.__name__: target for target in (robot_file, urdf, mcap, table)}


def judged(target: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """The target, whose refusals must be one line."""

    def one(data: bytes) -> None:
        try:
            target(data)
        except SpaceRobotError as error:
            said = str(error)
            if '\n' in said or len(said) > MOST_CHARACTERS:
                raise AssertionError(f'not one line: {said!r}') from error

    return one


if __name__ == '__main__':
    if len(sys.argv) < 2 or sys.argv[1] not in TARGETS:
        sys.exit(f'which of {", ".join(TARGETS)}?')
    atheris.Setup([sys.argv[0], *sys.argv[2:]], judged(TARGETS[sys.argv[1]]))
    atheris.Fuzz()
