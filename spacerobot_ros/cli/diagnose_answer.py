"""A diagnosis with all that `spacerobot diagnose` says about it."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..diagnosis.answer.appearance import Appearance, appearances
from ..diagnosis.answer.closed_loop_gain import ClosedLoopGain, closed_loop_gain
from ..diagnosis.answer.extended_model import named
from ..diagnosis.answer.next_motion import with_motions
from ..diagnosis.answer.output import to_dict
from ..diagnosis.answer.result import Diagnosis
from ..diagnosis.answer.score_on import JointScore, score_on
from ..diagnosis.answer.score_on import to_dict as score_to_dict
from ..diagnosis.diagnose import diagnose
from ..effects.effect import AppliedEffect
from ..model.loader import RobotFile, load_robot_file
from ..recording.read import read_record
from ..recording.record import Record


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What is printed, written and reported.

    Args:
        diagnosis: The diagnosis, its rivals with the motions that separate them.
        file: The robot file.
        record: The data.
        added: The causes as they stand in the extended model.
        closed_loop: Worth of the extended model to a controller; None where it was not measured.
        why_open: Why it was not.
        appearances: Where in the motion each channel's error appears, by channel.
        command: The command line that did it.
        score: Torques that the model misses on another record; empty without one.
    """

    diagnosis: Diagnosis
    file: RobotFile
    record: Record
    added: tuple[AppliedEffect, ...]
    closed_loop: ClosedLoopGain | None
    why_open: str
    appearances: Mapping[str, Appearance]
    command: str
    score: tuple[JointScore, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Content of diagnosis.json."""
        found = to_dict(self.diagnosis, self.added, self.closed_loop, self.appearances)
        return {**found, 'score': score_to_dict(self.score)} if self.score else found


def answer_of(
    args: argparse.Namespace, command: str, report: Callable[[str, float], None]
) -> Answer:
    """Read, diagnose, and measure what that is worth.

    Args:
        args: Of the command line.
        command: The command line as text.
        report: Called with what is being done and the share done, from 0 to 1.
    """
    file = load_robot_file(args.robot)
    record = read_record(args.data, file.robot, args.map)
    diagnosis = diagnose(record, file.robot, file.effects, report=report)
    diagnosis = replace(diagnosis, notes=(*record.notes, *diagnosis.notes))
    diagnosis = with_motions(diagnosis, args.robot)
    added = named((cause.applied for cause in diagnosis.causes), file.effects)
    closed, why = None, 'left out (--no-closed-loop)'
    if not args.no_closed_loop:
        report('simulating a controller with the old and the extended model', 0.95)
        closed, why = closed_loop_gain(file, added)
    score: tuple[JointScore, ...] = ()
    if args.score:
        other = read_record(args.score, file.robot, args.map)
        score = score_on(other, file.robot, added, file.effects)
    return Answer(
        diagnosis=diagnosis,
        file=file,
        record=record,
        added=added,
        closed_loop=closed,
        why_open=why,
        appearances=appearances(diagnosis.series, record),
        command=command,
        score=score,
    )
