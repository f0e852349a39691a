"""One recording of a fleet: diagnosed, its report written, what the table says of it."""

from __future__ import annotations

import json
import time
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from .. import __version__
from ..diagnosis.answer.findings import Findings, Question, findings
from ..diagnosis.quality.quality import quality_of
from ..effects.catalogue import changed_robot
from ..errors import SpaceRobotError
from ..recording.record import Record
from ..report.diagnosis_files import write_answer

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
        return {'error': ' '.join(str(error).split()), 'run_time': _since(started)}
    write_answer(answer, question.robot, Path(asked['out']))
    return {**_said(answer), 'error': None, 'run_time': _since(started)}


def _since(started: float) -> float:
    return round(time.perf_counter() - started, 3)


def _said(answer: Findings) -> dict[str, Any]:
    record, diagnosis = answer.records[0], answer.diagnosis
    return {
        'time': _date(record.span_ns[0]),
        'duration': sum((b - a) / 1e9 for a, b in (r.span_ns for r in answer.records)),
        'verdict': diagnosis.verdict,
        'sentence': diagnosis.sentence,
        'causes': [
            {
                'effect': cause.applied.id,
                'where': cause.applied.where,
                'title': cause.applied.title,
                'parameters': {
                    name: {'value': p.value, 'std': p.std, 'unit': p.unit}
                    for name, p in cause.parameters.items()
                },
            }
            for cause in diagnosis.causes
        ],
        'momentum': _momentum(answer),
        'residuals': [
            {
                'channel': r.channel,
                'unit': r.unit,
                'rms_before': r.rms_before,
                'rms_after': r.rms_after,
                'noise_floor': r.noise_floor,
            }
            for r in diagnosis.residuals
        ],
        'gain': {'before': diagnosis.gain.before, 'after': diagnosis.gain.after},
        'health': _health(record, answer),
        'version': __version__,
    }


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


def _health(record: Record, answer: Findings) -> list[str]:
    """What should be looked at in the recording, a line each."""
    try:
        return list(quality_of(record, answer.file).findings)
    except SpaceRobotError as error:
        return [str(error)]
