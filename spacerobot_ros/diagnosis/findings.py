"""A question about recordings, and all that is printed, written and reported in answer to it."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from ..effects.believed_friction import extended
from ..effects.effect import Effect
from ..effects.robot_file import RobotFile, load_robot_file
from ..estimation.balance.motor_constants import as_recorded
from ..model.robot import Robot
from ..recording.read import read_groups, read_record
from ..recording.record import Record
from .answer.closed_loop_gain import ClosedLoopGain, closed_loop_gain
from .answer.extended_model import named
from .answer.next_motion import with_motions
from .answer.output import to_dict
from .answer.result import Diagnosis
from .diagnose import diagnose
from .discovery.other_recording import judged_on
from .score_on import JointScore, check_scored, score_on
from .score_on import to_dict as score_to_dict


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What `spacerobot diagnose` is asked.

    Args:
        data: Recordings of one machine.
        payload: Further ones, with the same load at its last link.
        robot: Robot file.
        map: Column mapping of tables; empty for none.
        split_gaps: Whether a recording is taken as several, split at its pauses.
        has_closed_loop: Whether a controller is simulated with the extended model.
        score: Another recording, on which the extended model is measured; empty for none.
        force_data: Whether recordings are taken with their faults.
    """

    data: tuple[str, ...]
    robot: str
    payload: tuple[str, ...] = ()
    map: str = ''
    split_gaps: bool = False
    has_closed_loop: bool = True
    score: str = ''
    force_data: bool = False

    def command(self, out: str) -> str:
        """The command line that asks it and writes to a folder."""
        words = ['spacerobot', 'diagnose', *self.data, '--robot', self.robot, '--out', out]
        words += ['--payload', *self.payload] * bool(self.payload)
        words += ['--map', self.map] * bool(self.map)
        words += ['--split-gaps'] * self.split_gaps
        words += ['--score', self.score] * bool(self.score)
        words += ['--no-closed-loop'] * (not self.has_closed_loop)
        words += ['--force-data'] * self.force_data
        return shlex.join(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class Findings:
    """What is printed, written and reported.

    Args:
        diagnosis: The diagnosis, its rivals with the motions that separate them.
        file: The robot file.
        records: The data.
        added: The causes of the machine as they stand in the extended model.
        calibration: What else stands there: corrections within the tolerance of any file.
        learned: And laws that nobody has named.
        closed_loop: Worth of the extended model to a controller; None where it was not measured.
        why_open: Why it was not.
        command: The command line that did it.
        score: Torques that the model misses on another record; empty without one.
        events: Events of a single recording, which stand in the extended model, too; controllers
            do not feed them forward.
    """

    diagnosis: Diagnosis
    file: RobotFile
    records: tuple[Record, ...]
    added: tuple[Effect, ...]
    calibration: tuple[Effect, ...]
    closed_loop: ClosedLoopGain | None
    why_open: str
    command: str
    score: tuple[JointScore, ...] = ()
    events: tuple[Effect, ...] = ()
    learned: tuple[Effect, ...] = ()

    @property
    def extension(self) -> tuple[Effect, ...]:
        """All that the extended model adds."""
        return (*self.added, *self.calibration, *self.learned)

    def to_dict(self) -> dict[str, Any]:
        """Content of diagnosis.json."""
        found = to_dict(self.diagnosis, self.added, self.closed_loop)
        return {**found, 'score': score_to_dict(self.score)} if self.score else found


def _uncontrolled(machine: Robot) -> str:
    """Why no controller is simulated; empty where one can be."""
    if not machine.joints:
        return 'left out (the robot has no joints)'
    if machine.passive_joints or machine.without_constant:
        return 'a joint without a motor, or without a motor constant, follows no command'
    return ''


def findings(
    asked: Question, command: str, report: Callable[[float, str], None] = lambda share, what: None
) -> Findings:
    """Read, diagnose, and measure what that is worth.

    Args:
        asked: The question.
        command: The command line that asks it.
        report: Called with the share done, from 0 to 1, and what is being done.

    Raises:
        RecordingError, ConfigurationError: what can't be used, as `read_records`, `diagnose` and
            `load_robot_file`.
    """
    file = load_robot_file(asked.robot)
    without, loaded = read_groups(
        [asked.data, asked.payload],
        file.robot,
        asked.map or None,
        split_gaps=asked.split_gaps,
        force_data=asked.force_data,
    )
    records = (*without, *loaded)
    other = read_record(asked.score, file.robot, asked.map or None) if asked.score else None
    if other is not None:
        check_scored(other, file.robot)
    diagnosis = diagnose(
        records,
        file.robot,
        file.effects,
        report=lambda what, share: report(share, what),
        loaded=range(len(without), len(records)),
    )
    notes = dict.fromkeys(note for record in records for note in record.notes)
    diagnosis = replace(diagnosis, notes=(*notes, *diagnosis.notes))
    if file.robot.joints:  # without any there is no motion to design
        diagnosis = with_motions(diagnosis, asked.robot)
    lasting, corrections = (
        [effect for effect in some if effect.recordings is None]
        for some in ((cause.applied for cause in diagnosis.causes), diagnosis.calibration)
    )
    added = named(lasting, file.effects)
    calibration = named(corrections, (*file.effects, *added))
    diagnosis = _with_names(diagnosis, other, file, (*added, *calibration))
    learned = tuple(e.applied for e in diagnosis.leftover or () if e.applied is not None)
    extension = (*added, *calibration, *learned)
    found = diagnosis.events.named if diagnosis.events and len(records) == 1 else ()
    events = named((e for event in found for e in event.applied), (*file.effects, *extension))
    closed, why = None, 'left out (--no-closed-loop)'
    if lacking := _uncontrolled(as_recorded(file.robot, records)):
        why = lacking
    elif not (added or learned):
        why = 'nothing was named that a controller could use'
    elif asked.has_closed_loop:
        report(0.95, 'simulating a controller with the old and the extended model')
        closed, why = closed_loop_gain(file, extension)
    return Findings(
        diagnosis=diagnosis,
        file=file,
        records=records,
        added=added,
        calibration=calibration,
        events=events,
        closed_loop=closed,
        why_open=why,
        command=command,
        learned=learned,
        score=() if other is None else score_on(other, file.robot, extension, file.effects),
    )


def _with_names(
    diagnosis: Diagnosis, other: Record | None, file: RobotFile, added: tuple[Effect, ...]
) -> Diagnosis:
    """The laws under names of the extended model, those that another recording confirms."""
    leftover = diagnosis.leftover
    if not leftover:
        return diagnosis
    if other is not None:
        leftover = judged_on(other, file.robot, extended(file.effects, added), leftover)
    laws = [entry.applied for entry in leftover if entry.applied is not None]
    names = iter(named(laws, (*file.effects, *added)))
    return replace(
        diagnosis,
        leftover=tuple(
            entry if entry.applied is None else replace(entry, applied=next(names))
            for entry in leftover
        ),
    )
