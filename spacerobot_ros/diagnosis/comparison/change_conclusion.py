"""From a comparison to an answer: what changed, how surely, and what would have been seen."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...estimation.balance.arm_priors import torque_tolerance
from ...estimation.inference.evidence import Gram, log_evidence
from ...formats import either
from ...json_values import json_as, json_fields
from ...types import Array
from ..answer.cause import Estimated, Rival
from ..answer.result import Series
from ..answer.words import at, first_few, telling, value_in_words
from ..arms.arm_evidence import rivals_of
from ..arms.held_out_checks import holds
from ..arms.least_size import deviation_along
from ..arms.selection import Selection
from ..events.event_limits import EXPLAINED
from .changes import Changes

_UNSEEN = 1e3  # plausible sizes: what must change by more is not seen at all


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A change from one group of recordings to another.

    Args:
        effect: Its id. where: Its place. title: What it is, in words.
        parameters: What was added to each parameter.
        log_evidence: For it over what any machine changes by itself.
        held_out_gain: The same for each part of the second group, predicted from the others.
        indistinguishable_from: What these motions can not tell from it.
    """

    effect: str
    where: str | None
    title: str
    parameters: Mapping[str, Estimated]
    log_evidence: float
    held_out_gain: tuple[float, ...]
    indistinguishable_from: tuple[Rival, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Detectable:
    """The smallest change of one parameter that would have been named."""

    effect: str
    where: str | None
    parameter: str
    value: float
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The whole answer.

    Args:
        verdict: changed, or unchanged where nothing is named.
        sentence: The same in words, which say that no change is ruled out where too much is left
            at half of the joints and more.
        changes: By evidence.
        detectable: Of every cause the change that would have been seen; infinite where the motion
            shows nothing of it.
        left: Rms of what is missed of each joint's torque in the group where it is more.
        unjudged: Joints of whose torques too much is left for a change to be seen.
        units: Of each joint's torque.
        is_repeated: Whether all recordings are of one motion, judged by the scatter between
            the reference runs.
        series: What is missed of the torques of the first recording afterwards, with what both
            groups share and with the changes, too: for plots.
    """

    verdict: str
    sentence: str
    changes: tuple[Change, ...] = json_as('causes')
    detectable: tuple[Detectable, ...]
    left: Mapping[str, float] = json_as()
    unjudged: tuple[str, ...]
    units: Mapping[str, str] = json_as()
    is_repeated: bool = json_as('repeats')
    series: tuple[Series, ...] = json_as()

    def to_json(self) -> dict[str, Any]:
        """Plain values; `causes` as in diagnosis.json."""
        left = {'unit': either(self.units.values()), 'units': self.units, 'joints': self.left}
        return {'schema': 2, **json_fields(self), 'left_unexplained': left}


def conclude_changes(found: Changes) -> Comparison:
    """What a comparison says."""
    selection = found.selection
    order = sorted(selection.chosen, key=lambda i: -selection.gain(i))
    changes = tuple(_change(found, i) for i in order)
    left, usual = _left(found), found.selection.rows.judged_by
    # of no cause in either group: what changed may be of none, either
    is_poor = left**2 > (1.0 - EXPLAINED) * usual**2
    unjudged = tuple(np.array(found.robot.joints)[is_poor].tolist())
    is_conclusive = 2 * len(unjudged) < np.sum(np.isfinite(left))
    return Comparison(
        verdict='changed' if changes else 'unchanged',
        sentence=_sentence(changes, unjudged, is_conclusive=is_conclusive),
        changes=changes,
        detectable=tuple(_detectable(found, i) for i in selection.live),
        left=dict(zip(found.robot.joints, left.tolist(), strict=True)),
        unjudged=unjudged,
        units={joint: found.robot.unit_of('N m', joint) for joint in found.robot.joints},
        is_repeated=found.is_repeated,
        series=_series(found, np.sqrt(np.sum(found.levels, axis=1))),
    )


def _left(found: Changes) -> Array:
    """(n,) rms of what is missed of each joint's torque, in the group where it is more.

    NaN of a joint that does not move.
    """
    rows, n = found.selection.rows, len(found.robot.joints)
    squares, count = np.zeros((2, 2, n))
    for run, balance in enumerate(rows.balances):
        left, group = _missed(found, run)[1], int(run >= found.after)
        for j in range(n):
            own = left[rows.rows_at(balance, j), j]
            squares[group, j] += np.sum(own**2)
            count[group, j] += len(own)
    mean = np.max(squares / np.maximum(count, 1), axis=0)
    return np.where(np.any(count, axis=0), np.sqrt(mean), np.nan)


def _missed(found: Changes, run: int) -> tuple[Array, Array]:
    """(M, n) of the torques of a recording beside what both groups share, and the changes, too."""
    rows = found.fit.rows
    columns, mean = rows.columns[run], found.fit.posterior.mean
    count = columns.shape[2]
    changed = np.zeros(len(mean))
    for i in found.fit.chosen:
        changed[rows.places[i]] = found.change(i)[0]
    shared = mean[:-count] if len(mean) > count else np.zeros(count)
    before = rows.torque(run) - columns @ shared
    return before, before - columns @ changed[-count:] if run >= found.after else before


def _series(found: Changes, levels: Array) -> tuple[Series, ...]:
    """Of every joint where it moves.

    Args:
        found: The comparison.
        levels: Rms of what no cause explains, of every joint first [N m].
    """
    rows, run = found.fit.rows, found.after
    before, after = _missed(found, run)
    balance = rows.balances[run]
    seen = [(j, rows.rows_at(balance, j)) for j in range(len(found.robot.joints))]
    return tuple(
        Series(
            channel=f'joint_torque/{found.robot.joints[j]}',
            unit=found.robot.unit_of('N m', found.robot.joints[j]),
            time=balance.row_times[at],
            measured=np.zeros(0),
            before=before[at, j],
            after=after[at, j],
            noise_floor=float(levels[j]),
        )
        for j, at in seen
        if len(at)
    )


def _change(found: Changes, i: int) -> Change:
    selection = found.selection
    candidate, own = selection.rows.candidates[i], selection.rows.places[i]
    values, spread = found.change(i)
    # what a machine that nobody touched changes by itself is in it, too
    spread = np.hypot(spread, selection.rows.tolerances[own])
    names = [p for p in candidate.kind.parameters if p.role in ('linear', 'reciprocal', 'square')]
    is_body = candidate.kind.id == 'inertial_parameters'
    scale = float(np.max(torque_tolerance(found.robot))) if is_body else 0.0
    if candidate.kind.id == 'joint_torque_constant':  # columns of measured torques: 1 - 1 / gain
        gain = 1.0 / (1.0 - np.minimum(values, 0.9))
        values, spread = gain - 1.0, gain**2 * spread
    return Change(
        effect=candidate.kind.id,
        where=candidate.where,
        title=candidate.kind.title,
        parameters={
            p.name: Estimated(
                value=float(value),
                std=math.hypot(std, scale * value),
                unit=candidate.kind.unit_at(found.robot, candidate.where, p),
            )
            for p, value, std in zip(names, values.tolist(), spread.tolist(), strict=True)
        },
        log_evidence=selection.gain(i),
        held_out_gain=tuple(selection.held_out(i).tolist()),
        indistinguishable_from=rivals_of(selection, i),
    )


def _detectable(found: Changes, i: int) -> Detectable:
    """Of the first parameter alone.

    One deviation beyond what is named half of the time: it is in five of six. Where nothing is
    named it would have been in these very recordings, too, whichever sign it has.
    """
    selection = found.selection
    candidate, own = selection.rows.candidates[i], selection.rows.places[i]
    first = candidate.kind.parameters[0]
    direction = np.eye(len(candidate.sizes))[0]
    limit = selection.limit(i, direction, 0.5 * found.unexplained)
    deviation = deviation_along(selection.posterior(()).group(own), direction)
    if found.moments:
        judged = found.moments.judge(i, direction)
        limit, deviation = max(limit, judged.limit), judged.wider * deviation
    limit += deviation
    if not selection.chosen and limit < _UNSEEN * first.size:
        limit = named_from(selection, i, limit * direction, found.unexplained)
    value = limit if limit < _UNSEEN * first.size else math.inf
    if candidate.kind.id == 'joint_torque_constant':  # columns of measured torques: 1 - 1 / gain
        value = value / (1.0 - value) if value < 0.5 else math.inf  # no motor loses more than all
    return Detectable(
        effect=candidate.kind.id,
        where=candidate.where,
        parameter=first.name,
        value=value,
        unit=candidate.kind.unit_at(found.robot, candidate.where, first),
    )


def _sentence(
    changes: tuple[Change, ...], unjudged: tuple[str, ...], *, is_conclusive: bool
) -> str:
    words = 'Nothing changed by more than would have been seen (detectable).'
    if changes:
        words = f'What changed: {first_few([_in_words(change) for change in changes])}.'
    elif not is_conclusive:
        words = 'No change is named, and none is ruled out.'
    if not unjudged:
        return words
    joints, most = ', '.join(unjudged), 1.0 - EXPLAINED
    return f'{words} Of {joints} over {most:.0%} of the torques squared are left unexplained.'


def _in_words(change: Change) -> str:
    shown = telling(change.parameters)
    values = ', '.join(value_in_words(*item, sign='+') for item in shown.items())
    rivals = [f', or {r.effect}{at(r.where)}' for r in change.indistinguishable_from]
    return f'{change.title}{at(change.where)} ({values}){"".join(rivals)}'


_STEP, _STEPS = 1.25, 12  # up to 14 times the least size


def named_from(selection: Selection, i: int, least: Array, unexplained: float) -> float:
    """Size of a change along one parameter from which it holds, whichever sign it has.

    What every part of the second group must say of a change, beside what it misses anyway, is no
    multiple of what the rows can tell. A change of x adds S x to the sums for its coefficients, S
    their information, in the whole and in all parts but one; so each size is tried.

    Args:
        selection: In which nothing is chosen.
        i: The change.
        least: (K,) of its coefficients, along one of them: what the rows can tell.
        unexplained: Squares of whitened rows of which it must explain half.

    Returns:
        The size; infinite where none is named.
    """
    own, need = selection.rows.places[i], selection.need(i)
    rests = [selection.posterior((), fold.rest).group(own) for fold in selection.parts.folds(i)]
    grams = [selection.posterior(()).group(own), *rests]
    for size in np.linalg.norm(least) * _STEP ** np.arange(_STEPS):
        change = size * least / np.linalg.norm(least)
        if all(_is_named(selection, i, grams, x, need, unexplained) for x in (change, -change)):
            return float(size)
    return np.inf


def _is_named(
    selection: Selection, i: int, grams: list[Gram], change: Array, need: float, unexplained: float
) -> bool:
    candidate = selection.rows.candidates[i]
    added = [replace(g, vector=g.vector + g.matrix @ change) for g in grams]
    bounds = candidate.lower, candidate.upper
    whole, *rests = (log_evidence(g, candidate.sizes, bounds) for g in added)
    usual = log_evidence(added[0], selection.rows.tolerances[selection.rows.places[i]], bounds)
    gains = whole - np.array(rests)
    return bool(whole - usual > need and holds(gains) and 2.0 * np.sum(gains) > unexplained)
