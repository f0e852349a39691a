"""A diagnosis in tables and sentences, the same on the page and in the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from ..diagnosis.answer.cause import Cause, Estimated, Rival
from ..diagnosis.answer.closed_loop_gain import ClosedLoopGain, RmsErrors
from ..diagnosis.answer.output import relevance
from ..diagnosis.answer.result import Diagnosis, FreeMotion, Ratio, Residual
from ..diagnosis.answer.words import at, in_recordings
from ..diagnosis.events.event import Events
from ..diagnosis.findings import Findings
from ..diagnosis.score_on import BAND, JointScore, total
from ..display import Section, Table, table_of
from ..effects.effect import Effect
from ..formats import counted, estimate, number, percent, probability, value_with
from ..model.robot import Robot
from .event_tables import event_table, limit_table, possible_lines
from .leftover_tables import leftover_lines
from .sentences import WORDS

RATIOS = 'ratios, which hold for any scale of the torques'
ABOVE_NOISE = 1.05
"""Of the noise floor: what an error may have and still be called noise."""
_SCATTER = 4.0  # standard deviations
_IMPROBABLE = 1e-3  # of whiteness, over all channels


def summary(answer: Findings) -> Iterator[Section]:
    """What is printed for people."""
    diagnosis, closed, free = answer.diagnosis, answer.closed_loop, answer.diagnosis.free_motion
    causes = diagnosis.causes
    yield Section('', [f'verdict: {diagnosis.verdict}', diagnosis.sentence])
    if causes:
        yield Section('causes', [parameter_table(causes)])
        yield Section('evidence', [evidence_table(causes)])
    if diagnosis.friction:
        yield Section('friction of each joint, all laws together', [friction_table(diagnosis)])
    if diagnosis.ratios:
        yield Section(RATIOS, [ratio_table(diagnosis)])
    yield from event_sections(diagnosis.events)
    yield Section('rivals:', rival_lines(causes))
    yield Section('found, but too small to matter:', minor_lines(diagnosis.minor))
    yield Section('in the extended model without a name:', unnamed_lines(answer))
    title = 'residuals before and after (white p: probability of as much structure in white noise)'
    if diagnosis.residuals:
        yield Section(title, [residual_table(diagnosis)])
    worth = [
        *([gain_line(diagnosis)] if diagnosis.residuals else []),
        *map(free_motion_line, free),
        *([score_line(answer.score)] if answer.score else []),
        *(f'there: {free_motion_line(one.free)}' for one in answer.score if one.free),
        *([closed_loop_line(closed)] if closed else []),
    ]
    yield Section('', worth)
    yield Section('what remains:', remaining(diagnosis))
    yield Section('what the leftover depends on:', leftover_lines(diagnosis))
    yield Section('what to fly next:', diagnosis.next_motion)
    yield Section('', [f'note: {note}' for note in diagnosis.notes])


def event_sections(events: Events | None) -> Iterator[Section]:
    """What came from outside, what may have, and from where on it is named."""
    if events is None:
        return
    if events.named:
        yield Section('events', [event_table(events)])
    yield Section('possible events, not named:', list(possible_lines(events)))
    if any(events.limits.values()):
        title = 'events that are named 19 times of 20, by their duration'
        yield Section(title, [limit_table(events)])


def parameter_table(causes: Sequence[Cause], caption: str = '') -> Table:
    """One row a parameter of each cause."""
    rows = []
    for cause in causes:
        place = cause.applied.title, f'{cause.applied.where or ""}{in_recordings(cause.applied)}'
        for name, found in cause.parameters.items():
            threshold = relevance(cause.thresholds[name])
            matters = '' if threshold is None else number(threshold)
            rows.append((*place, name, *value_cells(found), matters))
            place = '', ''
    head = ('cause', 'where', 'parameter', 'value', '+- std', 'unit', 'matters from')
    return Table(head, rows, caption)


def value_cells(found: Estimated | Ratio) -> tuple[str, str, str]:
    """Value, standard deviation and unit."""
    return value_with(found.value, found.std), number(found.std, 2), found.unit or '1'


def evidence_table(causes: Sequence[Cause], caption: str = '') -> Table:
    """One row a cause."""
    rows = [{'label': label(c), 'of': c.evidence, 'constant': c.constant_p} for c in causes]
    if has_odds(causes):
        return table_of(
            rows,
            'cause | log odds | probability | held-out gain [nats] | held out',
            '{label} | {of.log_odds:number} | {of.probability:number} | {of.elpd_gain:number} | '
            '{of.held_out_gain:tested}',
            caption,
        )
    return table_of(
        rows,
        'cause | log L gain | BIC gain | p | held out | placebo | constant p',
        '{label} | {of.log_likelihood_gain:number} | {of.bic_gain:number} | '
        '{of.p_value:probability} | {of.held_out_gain:tested} | {of.placebo_gain:tested} | '
        '{constant:probability}',
        caption,
    )


def has_odds(causes: Sequence[Cause]) -> bool:
    """Whether odds are known of any of some causes."""
    return any(math.isfinite(c.evidence.log_odds) for c in causes)


def friction_table(diagnosis: Diagnosis, caption: str = '') -> Table:
    """One row a joint."""
    return table_of(
        diagnosis.friction,
        'joint | Coulomb | forward | backward | unit | viscous | unit',
        '{joint} | {coulomb:number 3} | {coulomb_forward:number 3} | '
        '{coulomb_backward:number 3} | {unit} | {viscous:number 3} | {viscous_unit}',
        caption,
    )


def ratio_table(diagnosis: Diagnosis, caption: str = '') -> Table:
    """One row a ratio."""
    rows = [
        (r.joint, r.ratio.replace('_', ' ') + (f' ({r.of})' if r.of else ''), *value_cells(r))
        for r in diagnosis.ratios
    ]
    return Table(('joint', 'ratio', 'value', '+- std', 'unit'), rows, caption)


def free_motion_line(free: FreeMotion) -> str:
    """How far a joint without a motor is predicted, in a line."""
    return (
        f'{free.joint}, free, predicted over {free.horizon:g} s '
        f'({counted(free.windows, "time")}): {number(free.rms_before, 3)} {free.unit} rms before, '
        f'{number(free.rms_after, 3)} after '
        f'(median {number(free.median_before, 3)}, {number(free.median_after, 3)})'
    )


def residual_table(diagnosis: Diagnosis, caption: str = '') -> Table:
    """One row a channel."""
    return table_of(
        [
            {'r': r, 'floors': f'{_floors(r):.2f}' if r.noise_floor > 0.0 else ''}
            for r in diagnosis.residuals
        ],
        'channel | unit | rms before | rms after | noise floor | after/floor | white p',
        '{r.channel} | {r.unit} | {r.rms_before:number 3} | {r.rms_after:number 3} | '
        '{r.noise_floor:number 3} | {floors} | {r.whiteness_p:probability}',
        caption,
    )


def closed_loop_table(closed: ClosedLoopGain) -> Table:
    """One row a joint, and all of them."""
    every: dict[str, RmsErrors | ClosedLoopGain] = {**closed.joints, 'all': closed}
    rows = [
        (joint, own.unit, number(own.rms_before, 3), number(own.rms_after, 3),
         percent(own.rms_after / own.rms_before) if own.rms_before else '')
        for joint, own in every.items()
    ]  # fmt: skip
    head = ('joint', 'unit', 'rms error before', 'rms error after', 'of it left')
    return Table(head, rows)


def rival_lines(causes: Sequence[Cause]) -> list[str]:
    """What this motion can't tell from the named causes, and the motion that can."""
    return [
        f'{label(cause)} can not be told from {rival.effect}{at(rival.where)} with this motion '
        f'({rival_gap(rival)})' + f'; to separate them: {rival.motion}' * bool(rival.motion)
        for cause in causes
        for rival in cause.rivals
    ]


def rival_gap(rival: Rival) -> str:
    """How far behind a rival is."""
    if math.isfinite(rival.log_odds):
        return f'log odds {number(rival.log_odds, 2)}'
    return f'BIC gap {number(rival.bic_gap, 2)}'


def minor_lines(causes: Sequence[Cause]) -> list[str]:
    """What is significant, but too small to matter."""
    return [f'{label(cause)}: {_values(cause)}' for cause in causes]


def unnamed_lines(answer: Findings) -> list[str]:
    """What predicts without being clear, and corrections of the file within its tolerance."""
    minor = [c.applied.key for c in answer.diagnosis.minor]
    rest = [e for e in answer.calibration if e.key not in minor]
    bodies = [str(e.where) for e in rest if e.id == 'inertial_parameters']
    lines = [
        f'{e.id}{at(e.where)}: {_applied(e, answer.file.robot)}'
        for e in rest
        if e.id != 'inertial_parameters'
    ]
    if bodies:
        lines.append(f'bodies, within the tolerance of any file: {", ".join(bodies)}')
    return lines


def _applied(effect: Effect, robot: Robot) -> str:
    each = (
        (p.name, number(effect.values[p.name], 3), effect.unit_at(robot, effect.where, p))
        for p in effect.parameters
    )
    return ', '.join(' '.join(words).rstrip() for words in each)


def _values(cause: Cause) -> str:
    return ', '.join(
        f'{name} {estimate(e.value, e.std, e.unit)}' for name, e in cause.parameters.items()
    )


def score_line(scores: Sequence[JointScore]) -> str:
    """What the extended model is worth on another record, in a line."""
    before, after, unit = total(scores)
    return (
        f'on the other recording the model misses {before:.3g} {unit} (rms over joints, below '
        f'{BAND:g} Hz), the extended one {after:.3g} {unit}'
    )


def gain_line(diagnosis: Diagnosis) -> str:
    """Held-out error before and after, beside the best placebo's."""
    gain, unit = diagnosis.gain, WORDS[diagnosis.method].unit
    return (
        f'held-out prediction error, in standard deviations of {unit}: {number(gain.before)} '
        f'before, {number(gain.after)} after ({placebo_words(gain.placebo)})'
    )


def placebo_words(error: float | None) -> str:
    """Held-out error of the best placebo."""
    value = number(error)
    return 'no placebo tested' if value == '-' else f'{value} with the best placebo'


def closed_loop_line(closed: ClosedLoopGain) -> str:
    """Tracking error before and after."""
    return (
        f'closed loop in simulation, {closed.task}, {closed.duration:g} s: rms joint error '
        f'{number(closed.rms_before, 3)} {closed.unit} with the old model, '
        f'{number(closed.rms_after, 3)} {closed.unit} with the extended one'
    )


def remaining(diagnosis: Diagnosis) -> list[str]:
    """Channels that even the extended model does not bring down to noise.

    Torques are no sensor's: half seconds share their errors, so only their whiteness counts.
    """
    counts = {series.channel: len(series.measured) for series in diagnosis.series}
    share = _IMPROBABLE / max(1, len(diagnosis.residuals))
    return [
        f'{r.channel}: {number(r.rms_after, 3)} {r.unit} rms, {_floors(r):.2f} noise floors, '
        f'white p {probability(r.whiteness_p)}'
        for r in diagnosis.residuals
        if (r.whiteness_p is not None and r.whiteness_p < share)
        or _is_above_noise(r, counts.get(r.channel, 0))
    ]


def _is_above_noise(residual: Residual, count: int) -> bool:
    """Whether its rms is more than noise and the scatter of an rms of so many samples allow."""
    if not count:
        return False
    allowed = max(ABOVE_NOISE, 1.0 + _SCATTER / math.sqrt(2.0 * count))
    return residual.rms_after > allowed * residual.noise_floor


def _floors(residual: Residual) -> float:
    return residual.rms_after / residual.noise_floor if residual.noise_floor > 0.0 else math.inf


def label(cause: Cause) -> str:
    """A cause in a few words."""
    return f'{cause.applied.id}{at(cause.applied.where)}{in_recordings(cause.applied)}'
