"""The page of a diagnosis for a review: verdict, causes, signals, errors, spectra, what to do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import groupby

from .. import __version__
from ..diagnosis.answer.result import Diagnosis
from ..diagnosis.answer.words import cause_in_words
from ..diagnosis.findings import Findings
from ..display import Item, KeyFigure, KeyFigures, Plot, Replay, Report, Section, Table
from ..formats import counted, number, probability
from ..simulation.replay.scene import scene_of
from ..simulation.replay.tracks import RESTART
from . import diagnosis_plots as curves
from . import diagnosis_tables as tables
from .event_tables import event_table, limit_table, possible_lines
from .leftover_tables import leftover_items
from .method_words import WORDS

_SHORT = 20  # characters of a cell that stays on one line
_SIGNALS, _SPECTRA = 3, 3
_FEWEST = 128  # samples, of the same

_KINDS = {
    'joint_torque': 'Torque on each joint that the model does not explain, half second by half '
    'second.',
    'angular_momentum': 'Torque on the whole robot that the model does not explain: the rate at '
    'which its angular momentum seems to change.',
    'joint_position': 'Joint positions against their prediction one step ahead.',
    'joint_rate': 'Joint rates against their prediction one step ahead.',
    'gyro': 'Body rates against their prediction one step ahead.',
    'attitude': 'Attitude against its prediction from the last one.',
}


def diagnosis_page(answer: Findings) -> Report:
    """The report of a diagnosis."""
    diagnosis = answer.diagnosis
    applied = diagnosis.causes or diagnosis.minor or answer.calibration
    causes = [('Causes', _causes)] if applied else []
    asked = [('What the leftover depends on', _leftover)] if diagnosis.leftover else []
    events = [('Events', _events)] if diagnosis.events else []
    sections: list[tuple[str, Callable[[Findings], Iterator[Item]]]] = [
        ('Verdict', _verdict),
        *causes,
        *events,
        ('In motion', _replay),
        ('Measured against simulated', _signals),
        ('Prediction errors, channel by channel', _errors),
        ('Which effects the data want', _ranking),
        ('In closed loop', _closed_loop),
        ('What remains', _remains),
        *asked,
        ('What to fly next', _next),
        ('How it was done', _how),
    ]
    return Report(
        title=_title(diagnosis),
        subtitle=f'diagnosis of robot {answer.file.robot.name}, {_data_in_words(answer)}: '
        f'{diagnosis.verdict.replace("_", " ")}',
        sections=[Section(title, list(items(answer))) for title, items in sections],
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
    yield Replay(
        scene,
        'The first recording, causes where they are. The orange ghost is what the model as it '
        'stands makes of the measured efforts, beginning again from the measured state every '
        f'{RESTART:g} s or where it has gone astray.',
    )


def _verdict(answer: Findings) -> Iterator[Item]:
    diagnosis, gain, closed = answer.diagnosis, answer.diagnosis.gain, answer.closed_loop
    yield diagnosis.sentence
    unit = f'std of {WORDS[diagnosis.method].unit}'
    figures = [
        KeyFigure('held-out error, model as it stands', number(gain.before, 3), unit),
        KeyFigure(
            'held-out error, extended model',
            number(gain.after, 3),
            unit,
            f'1 is perfect; {tables.placebo_words(gain.placebo)}',
            'good' if gain.after < tables.ABOVE_NOISE else 'bad',
        ),
        KeyFigure(
            'a right model fits as badly',
            probability(diagnosis.fit_p),
            '',
            f'probability; model as it stands: {probability(diagnosis.null_p)}',
        ),
    ]
    if closed is not None:
        remark = f'with the old model: {number(closed.rms_before, 2)} {closed.unit}'
        rms = number(closed.rms_after, 2)
        figures.append(KeyFigure('rms joint error in closed loop', rms, closed.unit, remark))
    yield KeyFigures(figures)


def _causes(answer: Findings) -> Iterator[Item]:
    causes, minor = answer.diagnosis.causes, answer.diagnosis.minor
    if causes:
        caption = 'Values with standard deviations; below `matters from` an effect is not named.'
        yield _tied(tables.parameter_table(causes, caption))
        yield tables.evidence_table(
            causes,
            'Gains in log likelihood and BIC; p: of such a gain by chance; held out: share of '
            'the held-out excess misfit that it removes, placebo: the best of its placebos; '
            'constant p: probability that its values are the same all along the record.',
        )
    if answer.diagnosis.friction:
        yield tables.friction_table(
            answer.diagnosis,
            'Friction of each joint as one law: the straight line that comes closest to all its '
            'named frictions over the rates of the record; an offset of the torque makes its two '
            'directions differ.',
        )
    if answer.diagnosis.ratios:
        yield tables.ratio_table(answer.diagnosis, tables.RATIOS)
    for line in tables.rival_lines(causes):
        yield line
    for line in tables.minor_lines(minor):
        yield f'Significant, but too small to matter: {line}.'
    for line in tables.unnamed_lines(answer):
        yield f'In the extended model without a name: {line}.'


def _events(answer: Findings) -> Iterator[Item]:
    events = answer.diagnosis.events
    if events is None:
        return
    if events.named:
        yield event_table(
            events,
            'What acts from outside for a while, the joints that feel it, and the largest torque '
            'there; a contact lies on the link or beyond it. Nothing else is estimated from these '
            'times.',
        )
    else:
        yield 'Nothing is named.'
    yield from (f'Possible: {line}.' for line in possible_lines(events))
    if any(events.limits.values()):
        yield limit_table(
            events,
            'Largest value, by duration, from which 19 of 20 events are named; limits are made '
            'for one false name an hour.',
        )


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
        yield (
            'The channels whose errors stand out most; the errors below each show on their own '
            'scale what the curves hide. Before: the model as it stands; after: the extended one.'
        )
    for series in worst:
        yield Plot(partial(curves.signal_panels, series), abscissa=words.time)


def _errors(answer: Findings) -> Iterator[Item]:
    diagnosis, words = answer.diagnosis, WORDS[answer.diagnosis.method]
    yield tables.residual_table(
        diagnosis,
        f'Noise floor: {words.floor}; white p: probability of as much structure in white noise.',
    )
    for kind, group in groupby(diagnosis.series, key=lambda s: s.channel.split('/')[0]):
        panels = partial(curves.error_panels, list(group), curves.spans(diagnosis))
        yield Plot(panels, words.errors or _KINDS.get(kind, kind), words.time, height=180)
    sampled = [s for s in diagnosis.series if len(s.measured) >= _FEWEST]
    if sampled and diagnosis.method == 'prediction':
        caption = 'Spectra of the errors that stand out most; dashed: the noise floor.'
        spectra = partial(curves.spectra, curves.worst(sampled, _SPECTRA))
        yield Plot(spectra, caption, 'frequency [Hz]', 200)


def _ranking(answer: Findings) -> Iterator[Item]:
    words = WORDS[answer.diagnosis.method]
    yield f'Effects at their places, {words.ranked}. {words.remark}'.rstrip()
    if any(r.log_likelihood_gain > 0.0 for r in answer.diagnosis.ranking[: curves.RANKED]):
        caption = 'Twice the gain in log likelihood; dark: named causes.'
        yield Plot(partial(curves.ranking_bars, answer.diagnosis), caption)
    yield tables.ranking_table(answer.diagnosis)


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


def _leftover(answer: Findings) -> Iterator[Item]:
    yield from leftover_items(answer.diagnosis)


def _next(answer: Findings) -> Iterator[Item]:
    yield from answer.diagnosis.next_motion or ('Nothing asks for another flight.',)


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
