"""The page of `spacerobot diagnose` for a review."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from .. import __version__
from ..display import Item, KeyFigure, KeyFigures, Plot, Report, Section, Status, Table, Text
from .diagnose_plots import error_plots, ranking_plot, signal_plots, spectrum_plot
from .diagnose_tables import (
    APPEARANCE_HEAD,
    EVIDENCE_HEAD,
    PARAMETER_HEAD,
    RANKING_HEAD,
    RESIDUAL_HEAD,
    appearance_rows,
    evidence_rows,
    minor_lines,
    number,
    parameter_rows,
    percent,
    probability,
    ranking_rows,
    remaining,
    residual_rows,
    rival_lines,
)

if TYPE_CHECKING:
    from ..diagnosis.answer.closed_loop_gain import ClosedLoopGain
    from ..diagnosis.answer.result import Diagnosis
    from .diagnose_answer import Answer

_SHORT = 20  # characters of a cell that stays on one line
_NEAR_NOISE = 1.05  # held-out error from which on something is left

_METHOD = (
    'An error-state filter predicts every sample of every sensor from the model and the measured '
    'joint torques, one step ahead, with the noise of the sensors carried through. Every effect '
    'of the catalogue at every place is one column of such predictions; which columns the errors '
    'want is asked on the first 60 % of the record by evidence, the rest is held out to score '
    'the answer. A placebo is the same column with its seconds shuffled: what it explains, any '
    'extension of that size would. A cause counts when it beats chance over the whole catalogue '
    'and its price in parameters, and improves the held-out part; it is named when it is also '
    'large enough to matter. See docs/diagnosis.md.'
)


def report_of(answer: Answer) -> Report:
    """The report of a diagnosis."""
    return Report(
        title=f'Diagnosis: {answer.diagnosis.verdict.replace("_", " ")}',
        subtitle=f'robot {answer.file.robot.name}, {_data_in_words(answer)}',
        sections=tuple(_sections(answer)),
    )


def _sections(answer: Answer) -> Iterator[Section]:
    diagnosis = answer.diagnosis
    yield Section('Verdict', tuple(_verdict(answer)))
    if diagnosis.causes or diagnosis.minor:
        yield Section('Causes', tuple(_causes(diagnosis)))
    yield Section('Measured against simulated', tuple(_signals(answer)))
    yield Section('Prediction errors, channel by channel', tuple(_errors(answer)))
    yield Section('Which effects the data want', tuple(_ranking(diagnosis)))
    yield Section('In closed loop', tuple(_closed_loop(answer)))
    yield Section('What remains', tuple(_remains(diagnosis)))
    yield Section('What to fly next', tuple(_next(diagnosis)))
    yield Section('How it was done', tuple(_how(answer)))


def _verdict(answer: Answer) -> Iterator[Item]:
    diagnosis, gain = answer.diagnosis, answer.diagnosis.gain
    yield Text(diagnosis.sentence)
    status: Status = 'good' if gain.after < _NEAR_NOISE else 'bad'
    figures = [
        KeyFigure('held-out error, model as it stands', number(gain.before, 3), 'noise std'),
        KeyFigure(
            'held-out error, extended model',
            number(gain.after, 3),
            'noise std',
            f'1 is perfect; best placebo: {number(gain.placebo, 3)}',
            status,
        ),
        KeyFigure(
            'a right model fits as badly',
            probability(diagnosis.fit_p),
            '',
            f'probability; model as it stands: {probability(diagnosis.null_p)}',
        ),
    ]
    if answer.closed_loop is not None:
        figures.append(_closed_loop_figure(answer.closed_loop))
    yield KeyFigures(figures)


def _closed_loop_figure(closed: ClosedLoopGain) -> KeyFigure:
    return KeyFigure(
        'rms joint error in closed loop',
        number(closed.rms_after, 2),
        'rad',
        f'with the old model: {number(closed.rms_before, 2)} rad',
    )


def _causes(diagnosis: Diagnosis) -> Iterator[Item]:
    if diagnosis.causes:
        yield Table(
            PARAMETER_HEAD,
            _tied(parameter_rows(diagnosis.causes)),
            'Values with standard deviations; below `matters from` an effect is not named.',
        )
        yield Table(
            EVIDENCE_HEAD,
            evidence_rows(diagnosis.causes),
            'Gains in log likelihood on the first part; p: of such a gain by chance; shares of '
            'the held-out misfit removed by the cause and by its best placebo; probability that '
            'its values are the same all along the record.',
        )
    for line in rival_lines(diagnosis.causes):
        yield Text(line)
    for line in minor_lines(diagnosis.minor):
        yield Text(f'Significant, but too small to matter: {line}.')


def _tied(rows: Sequence[Sequence[str]]) -> list[list[str]]:
    """Rows whose short cells do not break at their spaces."""
    return [[c.replace(' ', '\u00a0') if len(c) < _SHORT else c for c in row] for row in rows]


def _signals(answer: Answer) -> Iterator[Item]:
    yield Text(
        'The channels whose errors stand out most. Simulated means predicted one step ahead; '
        'the errors below each show on their own scale what the curves hide. Before: the model as '
        'it stands; after: the extended one.'
    )
    for svg, caption in signal_plots(answer.diagnosis):
        yield Plot(svg, caption)


def _errors(answer: Answer) -> Iterator[Item]:
    diagnosis = answer.diagnosis
    yield Table(
        RESIDUAL_HEAD,
        residual_rows(diagnosis),
        'Noise floor: what a right model has; p: probability that what is left is white noise.',
    )
    rows = appearance_rows(answer.appearances)
    if rows:
        yield Table(
            APPEARANCE_HEAD,
            rows,
            'Where the errors of the model as it stands appear: a hint for people, no evidence.',
        )
    for svg, caption in error_plots(diagnosis):
        yield Plot(svg, caption)
    svg = spectrum_plot(diagnosis)
    if svg:
        yield Plot(svg, 'Spectra of the errors that stand out most; dashed: the noise floor.')


def _ranking(diagnosis: Diagnosis) -> Iterator[Item]:
    yield Text(
        'Every effect at every place alone against the model as it stands, on the first part of '
        'the record. The second best is often the shadow of the best: what counts is what the '
        'data still want once a cause is in.'
    )
    svg = ranking_plot(diagnosis)
    if svg:
        yield Plot(svg, 'Twice the gain in log likelihood; dark: named causes.')
    yield Table(RANKING_HEAD, ranking_rows(diagnosis))


def _closed_loop(answer: Answer) -> Iterator[Item]:
    closed = answer.closed_loop
    if closed is None:
        yield Text(f'Not simulated: {answer.why_open}.')
        return
    yield Text(
        f'The plant is simulated with everything that was found; it follows {closed.task} for '
        f'{closed.duration:g} s under a controller that knows the old model, then the extended '
        'one. Same start, same noise.'
    )
    rows = [
        (joint, number(before, 3), number(after, 3), percent(after / before) if before else '')
        for joint, (before, after) in closed.joints.items()
    ]
    total = (number(closed.rms_before, 3), number(closed.rms_after, 3), percent(closed.ratio))
    rows.append(('all', *total))
    yield Table(('joint', 'rms error before [rad]', 'rms error after [rad]', 'of it left'), rows)


def _remains(diagnosis: Diagnosis) -> Iterator[Item]:
    lines = remaining(diagnosis)
    if not lines:
        yield Text('Nothing: every channel is down to its noise floor and white.')
    for line in lines:
        yield Text(line)


def _next(diagnosis: Diagnosis) -> Iterator[Item]:
    if not diagnosis.next_motion:
        yield Text('Nothing asks for another flight.')
    for line in diagnosis.next_motion:
        yield Text(line)


def _how(answer: Answer) -> Iterator[Item]:
    yield Text(f'{answer.command}   (spacerobot {__version__})')
    yield Text(_METHOD)
    for note in answer.diagnosis.notes:
        yield Text(f'Note: {note}.')


def _data_in_words(answer: Answer) -> str:
    record = answer.record
    first, last = record.span_ns
    counts = [
        f'{len(series.stamp_ns)} {name}'
        for name, series in (
            ('joint samples', record.joints),
            ('gyro samples', record.rates),
            ('attitudes', record.attitudes),
        )
        if series is not None
    ]
    return f'{(last - first) / 1e9:.1f} s of data: {", ".join(counts)}'
