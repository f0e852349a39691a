"""A diagnosis in tables and sentences, the same on the page and in the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

from ..diagnosis.answer.appearance import Appearance
from ..diagnosis.answer.closed_loop_gain import ClosedLoopGain
from ..diagnosis.answer.findings import Findings
from ..diagnosis.answer.output import relevance
from ..diagnosis.answer.result import Cause, Diagnosis, FreeMotion, Residual
from ..diagnosis.answer.score_on import BAND, JointScore, total
from ..diagnosis.answer.words import at, in_recordings
from ..diagnosis.events.event import Events
from ..display import Section, Table, table
from .event_tables import event_table, leftover_lines, limit_table, possible_lines
from .formats import UNTESTED, number, percent, probability, value_with

RATIOS = 'ratios, which hold for any scale of the torques'
_RANKED = 10  # rows
_CLEAR = 0.5  # correlation from which it is worth a word
ABOVE_NOISE = 1.05
"""Of the noise floor: what an error may have and still be called noise."""
_SCATTER = 4.0  # standard deviations
_IMPROBABLE = 1e-3  # of whiteness, over all channels


def summary(answer: Findings) -> Iterator[Section]:
    """What is printed for people."""
    diagnosis, closed = answer.diagnosis, answer.closed_loop
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
    if diagnosis.verdict != 'consistent' and diagnosis.ranking:
        title = 'best single effects, each against the model as it stands'
        yield Section(title, [ranking_table(diagnosis)])
    title = 'residuals before and after (white p: probability of as much structure in white noise)'
    worth = []
    if diagnosis.residuals:
        yield Section(title, [residual_table(diagnosis)])
        worth = [gain_line(diagnosis)]
    worth += [free_motion_line(one) for one in diagnosis.free_motion]
    worth += [score_line(answer.score)] if answer.score else []
    worth += [f'there: {free_motion_line(one.free)}' for one in answer.score if one.free]
    worth += [] if closed is None else [closed_loop_line(closed)]
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


def is_balance(diagnosis: Diagnosis) -> bool:
    """Whether torques were balanced (noise unknown), so that no fit was tested."""
    return diagnosis.fit_p is None or math.isnan(diagnosis.fit_p)


def parameter_table(causes: Sequence[Cause], caption: str = '') -> Table:
    """One row a parameter of each cause."""
    rows: list[tuple[str, ...]] = []
    for cause in causes:
        place = cause.applied.title, f'{cause.applied.where or ""}{in_recordings(cause.applied)}'
        for name, found in cause.parameters.items():
            value = value_with(found.value, found.std)
            threshold = relevance(cause.thresholds[name])
            matters = '' if threshold is None else number(threshold)
            spread = number(found.std, 2)
            rows.append((*place, name, value, spread, found.unit or '1', matters))
            place = '', ''
    head = ('cause', 'where', 'parameter', 'value', '+- std', 'unit', 'matters from')
    return Table(head, rows, caption)


def evidence_table(causes: Sequence[Cause], caption: str = '') -> Table:
    """One row a cause."""
    columns = {
        'cause': label,
        'log L gain': lambda c: number(c.evidence.log_likelihood_gain),
        'BIC gain': lambda c: number(c.evidence.bic_gain),
        'p': lambda c: probability(c.evidence.p_value),
        'held out': lambda c: percent(c.evidence.held_out_gain, nothing=UNTESTED),
        'placebo': lambda c: percent(c.evidence.placebo_gain, nothing=UNTESTED),
        'constant p': lambda c: probability(c.constant_p),
    }
    return table(causes, columns, caption)


def friction_table(diagnosis: Diagnosis, caption: str = '') -> Table:
    """One row a joint."""
    columns = {
        'joint': lambda law: law.joint,
        'Coulomb [N m]': lambda law: number(law.coulomb, 3),
        'forward': lambda law: number(law.coulomb_forward, 3),
        'backward': lambda law: number(law.coulomb_backward, 3),
        'viscous [N m s/rad]': lambda law: number(law.viscous, 3),
    }
    return table(diagnosis.friction, columns, caption)


def ratio_table(diagnosis: Diagnosis, caption: str = '') -> Table:
    """One row a ratio."""
    columns = {
        'joint': lambda r: r.joint,
        'ratio': lambda r: r.ratio.replace('_', ' ') + (f' ({r.of})' if r.of else ''),
        'value': lambda r: value_with(r.value, r.std),
        '+- std': lambda r: number(r.std, 2),
        'unit': lambda r: r.unit or '1',
    }
    return table(diagnosis.ratios, columns, caption)


def free_motion_line(free: FreeMotion) -> str:
    """How far a joint without a motor is predicted, in a line."""
    return (
        f'{free.joint}, free, predicted over {free.horizon:g} s ({free.windows} times): '
        f'{number(free.rms_before, 3)} {free.unit} rms before, {number(free.rms_after, 3)} after '
        f'(median {number(free.median_before, 3)}, {number(free.median_after, 3)})'
    )


def residual_table(diagnosis: Diagnosis, caption: str = '') -> Table:
    """One row a channel."""
    columns = {
        'channel': lambda r: r.channel,
        'unit': lambda r: r.unit,
        'rms before': lambda r: number(r.rms_before, 3),
        'rms after': lambda r: number(r.rms_after, 3),
        'noise floor': lambda r: number(r.noise_floor, 3),
        'after/floor': lambda r: f'{_floors(r):.2f}' if r.noise_floor > 0.0 else '',
        'white p': lambda r: probability(r.whiteness_p),
    }
    return table(diagnosis.residuals, columns, caption)


def ranking_table(diagnosis: Diagnosis) -> Table:
    """The best candidates, each alone against the model as it stands."""
    columns = {
        'effect': lambda r: r.effect,
        'where': lambda r: r.where or '',
        'log evidence': lambda r: number(r.evidence),
        'log L gain': lambda r: number(r.log_likelihood_gain),
        'p': lambda r: probability(r.p_value),
    }
    return table(diagnosis.ranking[:_RANKED], columns)


def appearance_table(appearances: Mapping[str, Appearance], caption: str) -> Table:
    """One row a channel whose error stands out."""

    def is_clear(seen: Appearance) -> bool:
        return abs(seen.correlation) > _CLEAR

    columns = {
        'channel': lambda item: item[0],
        'largest at [s]': lambda item: f'{item[1].time:.1f}',
        'goes with': lambda item: item[1].motion if is_clear(item[1]) else 'no single motion',
        'correlation': lambda item: f'{item[1].correlation:+.2f}' if is_clear(item[1]) else '',
    }
    return table(appearances.items(), columns, caption)


def closed_loop_table(closed: ClosedLoopGain) -> Table:
    """One row a joint, and all of them."""
    rows = [(joint, *errors) for joint, errors in closed.joints.items()]
    columns = {
        'joint': lambda row: row[0],
        'rms error before [rad]': lambda row: number(row[1], 3),
        'rms error after [rad]': lambda row: number(row[2], 3),
        'of it left': lambda row: percent(row[2] / row[1]) if row[1] else '',
    }
    return table([*rows, ('all', closed.rms_before, closed.rms_after)], columns)


def rival_lines(causes: Sequence[Cause]) -> list[str]:
    """What this motion can't tell from the named causes, and the motion that can."""
    return [
        f'{label(cause)} can not be told from {rival.effect}{at(rival.where)} with this motion '
        f'(BIC gap {number(rival.bic_gap, 2)}); to separate them: {rival.motion}'
        for cause in causes
        for rival in cause.rivals
    ]


def minor_lines(causes: Sequence[Cause]) -> list[str]:
    """What is significant, but too small to matter."""
    return [f'{label(cause)}: {_values(cause)}' for cause in causes]


def _values(cause: Cause) -> str:
    return ', '.join(
        f'{name} {value_with(e.value, e.std)} +- {number(e.std, 2)} {e.unit}'.rstrip()
        for name, e in cause.parameters.items()
    )


def score_line(scores: Sequence[JointScore]) -> str:
    """What the extended model is worth on another record, in a line."""
    before, after = total(scores)
    return (
        f'on the other recording the model misses {before:.3g} N m (rms over joints, below '
        f'{BAND:g} Hz), the extended one {after:.3g} N m'
    )


def gain_line(diagnosis: Diagnosis) -> str:
    """Held-out error before and after, beside the best placebo's."""
    gain = diagnosis.gain
    return (
        f'held-out prediction error, in standard deviations of the noise: {number(gain.before)} '
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
        f'{number(closed.rms_before, 3)} rad with the old model, {number(closed.rms_after, 3)} '
        'rad with the extended one'
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
