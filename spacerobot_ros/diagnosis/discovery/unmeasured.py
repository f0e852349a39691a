"""What a recording lacks that laws depend on, of a robot file or those that may be found."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from ...effects.effect import Effect
from ...effects.laws.learned_torque import LearnedTorque
from ...recording.record import Record
from ...recording.robot_inputs import EXTRA


def unmeasured_inputs(effects: Iterable[Effect], records: Sequence[Record]) -> tuple[str, ...]:
    """A note on every law that lacks an input.

    Args:
        effects: Of the robot file.
        records: What was measured.
    """
    laws = (e for e in effects if isinstance(e, LearnedTorque))
    return tuple(
        f'effects.{law.name}: the recording has no {name}, on which this law depends: it is taken '
        f'to be in the middle of its range all along (`extra` of a mapping names its column)'
        for law in laws
        for name in law.inputs
        if name.startswith(EXTRA) and not all(name in record.inputs for record in records)
    )


def unshared_extras(records: Sequence[Record]) -> tuple[str, ...]:
    """A note on every column of a mapping's `extra` that some of several recordings lack."""
    names = dict.fromkeys(n for r in records for n in r.inputs if n.startswith(EXTRA))
    return tuple(
        f'{name}: not in every recording, so that no law is asked of it'
        for name in names
        if not all(name in record.inputs for record in records)
    )
