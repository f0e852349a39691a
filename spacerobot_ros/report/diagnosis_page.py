"""The page of a diagnosis for a review: verdict, causes, signals, errors, spectra, what to do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import groupby

from .. import __version__
from ..diagnosis.findings import Findings
from ..diagnosis.score_on import BAND
from ..display import Item, KeyFigure, KeyFigures, Plot, Replay, Report, Section, Table
from ..formats import number, probability
from ..simulation.replay.scene import scene_of
from . import diagnosis_plots as curves
from . import diagnosis_tables as tables
from .diagnosis_tables import is_balance
from .event_tables import event_table, limit_table, possible_lines
from .leftover_tables import leftover_items

_SHORT = 20  # characters of a cell that stays on one line
_SIGNALS, _SPECTRA = 3, 3
_FEWEST = 128  # samples, of the same

_PREDICTION = (
    'An error-state filter predicts every sample of every sensor from the model and the measured '
    'joint torques, one step ahead, with the noise of the sensors taken through. Every effect '
    'of the catalogue at every place is one column of such predictions; which columns the errors '
    'want is asked of the whole record by evidence, and each fifth of it must agree with what the '
    'other four say. '
)
_BALANCE = (
    'The torques that the model needs along the smoothed motion are compared with the measured '
    f'ones below {BAND:g} Hz, joint by joint where it moves; a joint at rest says nothing, since '
    'its friction holds any torque. Every effect of the catalogue at every place adds its own '
    'torques to the balance. What no cause explains has a level against frequency, estimated '
    'along, and a tolerance stands for what the file of any machine misses. A cause is named '
    'where its evidence exceeds the price of looking at all of them, where the parts of the data '
    '(recordings, or quarters of the only one) are better predicted with it from each other, by '
    'more than with columns without meaning, and where it lowers the rms error, too. Standard '
    'deviations are widened as far as the parts scatter. No fit was tested against sensor noise: '
    'explained is where no joint is left with more than tolerances alone make. '
)
_HELD_OUT = (
    'Held-out errors are those of each fifth of the record with the values that the other four '
    'give. A placebo is the same column with its seconds shuffled: what it explains, any '
    'extension of that size would. A cause counts when it beats chance over the whole catalogue '
    'and its price in parameters, improves what is held out by more than its placebos, and stays '
    'the same along the record as far as the errors let that be seen; it is named when it is '
    'also large enough to matter. '
)
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
        title=f'Diagnosis: {diagnosis.verdict.replace("_", " ")}',
        subtitle=f'robot {answer.file.robot.name}, {_data_in_words(answer)}',
        sections=[Section(title, list(items(answer))) for title, items in sections],
    )


def _replay(answer: Findings) -> Iterator[Item]:
    """The first recording, causes at their places, and what the model as it stands predicts."""
    marks = [(cause.applied.where, cause.applied.title) for cause in answer.diagnosis.causes]
    scene = partial(scene_of, answer.records[0], answer.file, marks)
    yield Replay(
        scene,
        'The first recording, causes where they are. The orange ghost is what the model as it '
        'stands makes of the measured efforts, beginning again from the measured state every two '
        'seconds or where it has gone astray.',
    )


def _verdict(answer: Findings) -> Iterator[Item]:
    diagnosis, gain, closed = answer.diagnosis, answer.diagnosis.gain, answer.closed_loop
    yield diagnosis.sentence
    figures = [
        KeyFigure('held-out error, model as it stands', number(gain.before, 3), 'noise std'),
        KeyFigure(
            'held-out error, extended model',
            number(gain.after, 3),
            'noise std',
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
    worst = curves.worst([s for s in answer.diagnosis.series if len(s.measured)], _SIGNALS)
    if not worst:
        yield 'No sensor was predicted: torques were balanced along the measured motion.'
        return
    yield (
        'The channels whose errors stand out most. Simulated means predicted one step ahead; '
        'the errors below each show on their own scale what the curves hide. Before: the model as '
        'it stands; after: the extended one.'
    )
    for series in worst:
        yield Plot(partial(curves.signal_panels, series))


def _errors(answer: Findings) -> Iterator[Item]:
    diagnosis = answer.diagnosis
    floor = (
        'the level of what no cause explains'
        if is_balance(diagnosis)
        else 'what a right model has'
    )
    yield tables.residual_table(
        diagnosis,
        f'Noise floor: {floor}; white p: probability of as much structure in white noise.',
    )
    if answer.appearances:
        yield tables.appearance_table(
            answer.appearances,
            'Where the errors of the model as it stands appear: a hint for people, no evidence.',
        )
    for kind, group in groupby(diagnosis.series, key=lambda s: s.channel.split('/')[0]):
        caption = _KINDS.get(kind, kind)
        if is_balance(diagnosis):
            caption = f'Torque on each joint that the model does not explain, below {BAND:g} Hz.'
        panels = partial(curves.error_panels, list(group), curves.spans(diagnosis))
        yield Plot(panels, caption, height=1.5)
    sampled = [s for s in diagnosis.series if len(s.measured) >= _FEWEST]
    if sampled:
        caption = 'Spectra of the errors that stand out most; dashed: the noise floor.'
        spectra = partial(curves.spectra, curves.worst(sampled, _SPECTRA))
        yield Plot(spectra, caption, 'frequency [Hz]', 1.9)


def _ranking(answer: Findings) -> Iterator[Item]:
    yield (
        'Every effect at every place alone against the model as it stands. The second best is '
        'often the shadow of the best: what counts is what the data still want once a cause is in.'
    )
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
        f'The plant is simulated with the named causes; it follows {closed.task} for '
        f'{closed.duration:g} s under a controller that knows the old model, then the extended '
        'one. Same start, same noise.'
    )
    yield tables.closed_loop_table(closed)


def _remains(answer: Findings) -> Iterator[Item]:
    lines = tables.remaining(answer.diagnosis)
    if not lines and is_balance(answer.diagnosis):
        yield 'Not tested: the level of what no cause explains comes from the data.'
    elif not lines:
        yield 'Nothing: every channel is down to its noise floor and white.'
    yield from lines
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
    way = _BALANCE if is_balance(answer.diagnosis) else _PREDICTION + _HELD_OUT
    yield f'{way}See docs/diagnosis.md.'
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
