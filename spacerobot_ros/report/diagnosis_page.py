"""The page of a diagnosis for a review: verdict, causes, signals, errors, spectra, what to do."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path

from .. import __version__
from ..diagnosis.answer.extended_model import write_extended_model
from ..diagnosis.answer.output import EXTENDED_MODEL
from ..diagnosis.answer.result import Diagnosis
from ..diagnosis.answer.words import cause_in_words
from ..diagnosis.findings import Findings
from ..display import GoodOrBad, Item, KeyFigure, KeyFigures, Plot, Replay, Report, Section, Table
from ..formats import counted, number, probability
from ..json_values import json_text
from ..model.files import write_text
from ..simulation.replay.scene import scene_of
from ..simulation.replay.tracks import RESTART
from . import diagnosis_plots as curves
from . import diagnosis_tables as tables
from .event_tables import event_table, limit_table, possible_lines
from .html import write_report
from .leftover_tables import leftover_items
from .sentences import KINDS, SAID, WORDS

JSON_NAME, REPORT_NAME = 'diagnosis.json', 'report.html'
_SHORT = 20  # characters of a cell that stays on one line
_SIGNALS, _SPECTRA = 3, 3
_FEWEST = 128  # samples, of the same


def write_answer(answer: Findings, robot_file: str, folder: Path) -> None:
    """Write what was found, the extended model and the page.

    Args:
        answer: What was found.
        robot_file: The file that the model extends.
        folder: Where they belong; made where it is missing.

    Raises:
        ConfigurationError: they can't be written.
    """
    write_text(folder / JSON_NAME, json_text(answer.to_dict()))
    extension = (*answer.extension, *answer.events)
    write_extended_model(robot_file, extension, folder / EXTENDED_MODEL)
    write_report(diagnosis_page(answer), folder / REPORT_NAME)


def diagnosis_page(answer: Findings) -> Report:
    """The report of a diagnosis; what has nothing to say is left out."""
    diagnosis = answer.diagnosis
    makers: dict[str, Callable[[Findings], Iterable[Item]]] = {
        'Verdict': _verdict,
        'Causes': _causes,
        'Events': _events,
        'In motion': _replay,
        'Measured against simulated': _signals,
        'Prediction errors, channel by channel': _errors,
        'In closed loop': _closed_loop,
        'What remains': _remains,
        'What the leftover depends on': lambda _: leftover_items(diagnosis),
        'What to fly next': lambda _: diagnosis.next_motion or (SAID['no next motion'],),
        'How it was done': _how,
    }
    sections = [Section(title, list(items(answer))) for title, items in makers.items()]
    return Report(
        title=_title(diagnosis),
        subtitle=f'diagnosis of robot {answer.file.robot.name}, {_data_in_words(answer)}: '
        f'{diagnosis.verdict.replace("_", " ")}',
        sections=[section for section in sections if section.items],
    )


def _title(diagnosis: Diagnosis) -> str:
    """The first cause with its value, and how many more there are; else the verdict."""
    causes = diagnosis.causes
    if not causes:
        return f'Diagnosis: {diagnosis.verdict}'
    first, more = cause_in_words(causes[0], is_short=True), len(causes) - 1
    return first[0].upper() + first[1:] + f', and {counted(more, "more cause")}' * bool(more)


def _replay(answer: Findings) -> Iterator[Item]:
    """The first recording, causes at their places, and what the model as it stands predicts."""
    marks = [(cause.applied.where, cause.applied.title) for cause in answer.diagnosis.causes]
    scene = partial(scene_of, answer.records[0], answer.file, marks)
    yield Replay(scene, SAID['replay'].replace('{restart}', f'{RESTART:g}'))


def _verdict(answer: Findings) -> Iterator[Item]:
    diagnosis, gain, closed = answer.diagnosis, answer.diagnosis.gain, answer.closed_loop
    yield diagnosis.sentence
    unit = f'std of {WORDS[diagnosis.method].unit}'
    placebo = f'1 is perfect; {tables.placebo_words(gain.placebo)}'
    status: GoodOrBad = 'good' if gain.after < tables.ABOVE_NOISE else 'bad'
    chance = f'probability; model as it stands: {probability(diagnosis.null_p)}'
    figures = [
        KeyFigure('held-out error, model as it stands', number(gain.before, 3), unit),
        KeyFigure('held-out error, extended model', number(gain.after, 3), unit, placebo, status),
        KeyFigure('a right model fits as badly', probability(diagnosis.fit_p), '', chance),
    ]
    if closed is not None:
        remark = f'with the old model: {number(closed.rms_before, 2)} {closed.unit}'
        rms = number(closed.rms_after, 2)
        figures.append(KeyFigure('rms joint error in closed loop', rms, closed.unit, remark))
    yield KeyFigures(figures)


def _causes(answer: Findings) -> Iterator[Item]:
    diagnosis, causes = answer.diagnosis, answer.diagnosis.causes
    if not (causes or diagnosis.minor or answer.calibration):
        return
    if causes:
        yield _tied(tables.parameter_table(causes, SAID['parameters']))
        caption = SAID['odds' if tables.has_odds(causes) else 'evidence']
        yield tables.evidence_table(causes, caption)
    if diagnosis.friction:
        yield tables.friction_table(diagnosis, SAID['friction'])
    if diagnosis.ratios:
        yield tables.ratio_table(diagnosis, tables.RATIOS)
    yield from tables.rival_lines(causes)
    for line in tables.minor_lines(diagnosis.minor):
        yield f'Significant, but too small to matter: {line}.'
    for line in tables.unnamed_lines(answer):
        yield f'In the extended model without a name: {line}.'


def _events(answer: Findings) -> Iterator[Item]:
    events = answer.diagnosis.events
    if events is None:
        return
    yield event_table(events, SAID['events']) if events.named else 'Nothing is named.'
    yield from (f'Possible: {line}.' for line in possible_lines(events))
    if any(events.limits.values()):
        yield limit_table(events, SAID['limits'])


def _tied(shown: Table) -> Table:
    """A table whose short cells do not break at their spaces."""
    rows = [
        [c.replace(' ', '\u00a0') if len(c) < _SHORT else c for c in row] for row in shown.rows
    ]
    return replace(shown, rows=rows)


def _signals(answer: Findings) -> Iterator[Item]:
    words = WORDS[answer.diagnosis.method]
    yield words.signals
    worst = curves.worst([s for s in answer.diagnosis.series if len(s.measured)], _SIGNALS)
    if worst:
        yield SAID['signals']
    for series in worst:
        yield Plot(partial(curves.signal_panels, series), abscissa=words.time)


def _errors(answer: Findings) -> Iterator[Item]:
    diagnosis, words = answer.diagnosis, WORDS[answer.diagnosis.method]
    yield tables.residual_table(diagnosis, f'Noise floor: {words.floor}; {SAID["white"]}')
    for kind, group in groupby(diagnosis.series, key=lambda s: s.channel.split('/')[0]):
        panels = partial(curves.error_panels, list(group), curves.spans(diagnosis))
        yield Plot(panels, words.errors or KINDS.get(kind, kind), words.time, height=180)
    sampled = [s for s in diagnosis.series if len(s.measured) >= _FEWEST]
    if sampled and diagnosis.method == 'prediction':
        spectra = partial(curves.spectra, curves.worst(sampled, _SPECTRA))
        yield Plot(spectra, SAID['spectra'], 'frequency [Hz]', 200)


def _closed_loop(answer: Findings) -> Iterator[Item]:
    closed = answer.closed_loop
    if closed is None:
        yield f'Not simulated: {answer.why_open}.'
        return
    yield (
        f'The plant is simulated as the extended model; it follows {closed.task} for '
        f'{closed.duration:g} s under a controller that knows the old model, then the extended '
        'one. Same start, same noise.'
    )
    yield tables.closed_loop_table(closed)


def _remains(answer: Findings) -> Iterator[Item]:
    yield from tables.remaining(answer.diagnosis) or (WORDS[answer.diagnosis.method].nothing_left,)
    if answer.score:
        yield f'Also: {tables.score_line(answer.score)}.'
    for one in (*answer.diagnosis.free_motion, *(s.free for s in answer.score if s.free)):
        yield f'{tables.free_motion_line(one)}.'


def _how(answer: Findings) -> Iterator[Item]:
    yield f'{answer.command}   (spacerobot {__version__})'
    yield f'{WORDS[answer.diagnosis.method].how} See docs/diagnosis.md.'
    for note in answer.diagnosis.notes:
        yield f'Note: {note}.'


def _data_in_words(answer: Findings) -> str:
    counts = {'joint samples': 0, 'gyro samples': 0, 'attitudes': 0}
    seconds = 0.0
    for record in answer.records:
        first, last = record.span_ns
        seconds += (last - first) / 1e9
        series = (record.joints, record.rates, record.attitudes)
        for name, samples in zip(counts, series, strict=True):
            counts[name] += 0 if samples is None else len(samples)
    several = f' in {len(answer.records)} recordings' if len(answer.records) > 1 else ''
    what = ', '.join(f'{count} {name}' for name, count in counts.items() if count)
    return f'{seconds:.1f} s of data{several}: {what}'
