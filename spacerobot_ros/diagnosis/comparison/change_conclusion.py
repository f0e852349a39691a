"""From a comparison to an answer: what changed, how surely, and what would have been seen."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np
from scipy.special import expit

from ...estimation.balance.arm_candidates import GAIN
from ...estimation.balance.arm_priors import torque_tolerance
from ...estimation.columns import Candidate
from ...formats import either
from ...inference.inferred import InferredCause
from ...json_values import json_as, json_fields
from ..answer.cause import Estimated, Rival
from ..answer.result import Series
from ..answer.words import at, first_few, telling, value_in_words
from ..arms.arm_conclusion import rivals_of
from ..arms.arm_verdict import doubts
from ..limits import EXPLAINED
from .changes import Changes
from .detectable import Detection

_UNSEEN = 1e3  # plausible sizes: what must change by more is not seen at all


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A change from one group of recordings to another.

    Args:
        effect: Its id. where: Its place. title: What it is, in words.
        parameters: What was added to each parameter.
        log_evidence: For it over what any machine changes by itself, by the scatter of blocks.
        log_odds: Against the best set of changes without it.
        held_out_gain: Log predictive density that it adds to each part of the recordings.
        indistinguishable_from: What these motions can not tell from it.
    """

    effect: str
    where: str | None
    title: str
    parameters: Mapping[str, Estimated]
    log_evidence: float
    log_odds: float
    held_out_gain: tuple[float, ...]
    indistinguishable_from: tuple[Rival, ...]

    json_too: ClassVar[tuple[str, ...]] = ('probability', 'elpd_gain')

    @property
    def probability(self) -> float:
        """That it is one, were there only the best set with it and the best one without."""
        return float(expit(self.log_odds))

    @property
    def elpd_gain(self) -> float:
        """Log predictive density that it adds to all parts."""
        return float(np.sum(self.held_out_gain))


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
        verdict: `unchanged`, `changed`, or `changed, cause not identified` where nothing is named
            and more is left afterwards than the recordings before leave.
        sentence: The same in words, which say that no change is ruled out where too much is left
            at half of the joints and more.
        changes: By evidence.
        detectable: Of every cause the change that would have been seen; infinite where the motion
            shows nothing of it.
        left: Rms of what is missed of each joint's torque in the group where it is more.
        unjudged: Joints of whose torques too much is left for a change to be seen.
        unidentified: Joints at which something changed that no change that is named explains.
        notes: What else a user should know.
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
    unidentified: tuple[str, ...]
    notes: tuple[str, ...]
    units: Mapping[str, str] = json_as()
    is_repeated: bool = json_as('repeats')
    series: tuple[Series, ...] = json_as()

    def to_json(self) -> dict[str, Any]:
        """Plain values; `causes` as in diagnosis.json."""
        left = {'unit': either(self.units.values()), 'units': self.units, 'joints': self.left}
        return {'schema': 3, **json_fields(self), 'left_unexplained': left}


def conclude_changes(found: Changes) -> Comparison:
    """What a comparison says."""
    rows, joints = found.groups.rows, np.array(found.groups.rows.robot.joints)
    changes = tuple(_change(found, cause) for cause in found.named)
    left = np.max(np.where(np.isnan(found.rms), -math.inf, found.rms), axis=0)
    left = np.where(np.isfinite(left), left, math.nan)
    # of no cause in either group: what changed may be of none, either
    unjudged = joints[left**2 > (1.0 - EXPLAINED) * rows.judged_by**2].tolist()
    different = joints[found.different].tolist()
    is_conclusive = 2 * len(unjudged) < np.sum(np.isfinite(left))
    unidentified = 'changed, cause not identified' if different else 'unchanged'
    return Comparison(
        verdict='changed' if changes else unidentified,
        sentence=_sentence(found, changes, unjudged, is_conclusive=is_conclusive),
        changes=changes,
        detectable=tuple(_detectable(found)),
        left=dict(zip(joints.tolist(), left.tolist(), strict=True)),
        unjudged=tuple(unjudged),
        unidentified=tuple(different),
        notes=tuple(doubts((c, _candidate(found, c).key) for c in found.named)),
        units={joint: rows.robot.unit_of('N m', joint) for joint in rows.robot.joints},
        is_repeated=found.groups.is_repeated,
        series=_series(found),
    )


def _series(found: Changes) -> tuple[Series, ...]:
    """Of every joint where it moves in the first recording afterwards."""
    groups, run = found.groups, found.groups.count
    rows, robot, balance = groups.rows, groups.rows.robot, groups.rows.balances[run]
    before, after = (part.torques[0] for _, part in (groups.left(found.mean(())), found.left))
    seen = [(j, rows.rows_at(balance, j)) for j in range(robot.n_joints)]
    return tuple(
        Series(
            channel=f'joint_torque/{robot.joints[j]}',
            unit=robot.unit_of('N m', robot.joints[j]),
            time=balance.row_times[own],
            measured=np.zeros(0),
            before=before[own, j],
            after=after[own, j],
            noise_floor=float(np.sqrt(np.sum(groups.levels[1][j]))),
        )
        for j, own in seen
        if len(own)
    )


def _change(found: Changes, cause: InferredCause) -> Change:
    candidate = _candidate(found, cause)
    kind, robot, values = candidate.kind, found.groups.rows.robot, cause.values
    # what a machine that nobody touched changes by is in it, too
    spike = cause.hypothesis.spike
    usual = np.diag(spike) if spike.ndim > 1 else spike**2
    spread = np.sqrt(np.diag(found.covariance(cause)) + usual)
    is_body = kind.id == 'inertial_parameters'
    scale = float(np.max(torque_tolerance(robot))) if is_body else 0.0
    if kind.id == GAIN:  # columns of measured torques: 1 - 1 / gain
        gain = 1.0 / (1.0 - np.minimum(values, 0.9))
        values, spread = gain - 1.0, gain**2 * spread
    linear = [p for p in kind.parameters if p.role in ('linear', 'reciprocal', 'square')]
    return Change(
        effect=kind.id,
        where=candidate.where,
        title=kind.title,
        parameters={
            p.name: Estimated(
                value=float(value),
                std=math.hypot(std, scale * value),
                unit=kind.unit_at(robot, candidate.where, p),
            )
            for p, value, std in zip(linear, values.tolist(), spread.tolist(), strict=True)
        },
        log_evidence=found.log_evidence(cause),
        log_odds=cause.log_odds,
        held_out_gain=tuple(cause.gains.tolist()),
        indistinguishable_from=rivals_of(found.groups.rows, cause),
    )


def _candidate(found: Changes, cause: InferredCause) -> Candidate:
    return found.groups.rows.candidates[cast(int, cause.key)]


def _detectable(found: Changes) -> Iterator[Detectable]:
    """Of the first parameter of every hypothesis that the rows say anything of."""
    every, robot = found.undisturbed, found.groups.rows.robot
    detection = Detection(every, found.chosen)
    for i in sorted(every.open):
        candidate = found.groups.rows.candidates[cast(int, every.every[i].key)]
        first, value = candidate.kind.parameters[0], detection.limit(i)
        value = value if value < _UNSEEN * first.size else math.inf
        if candidate.kind.id == GAIN:  # columns of measured torques: 1 - 1 / gain
            value = value / (1.0 - value) if value < 0.5 else math.inf  # none loses more than all
        yield Detectable(
            effect=candidate.kind.id,
            where=candidate.where,
            parameter=first.name,
            value=value,
            unit=candidate.kind.unit_at(robot, candidate.where, first),
        )


def _sentence(
    found: Changes,
    changes: tuple[Change, ...],
    unjudged: list[str],
    *,
    is_conclusive: bool,
) -> str:
    words, joints = 'Nothing changed by more than would have been seen (detectable).', ''
    robot, (before, after) = found.groups.rows.robot, found.rms
    if found.different:
        where = [
            f'{robot.joints[j]}: {after[j]:.3g} {robot.unit_of("N m", robot.joints[j])} rms after '
            f'{before[j]:.3g} before'
            for j in found.different
        ]
        joints = first_few(where)
    if changes:
        words = f'What changed: {first_few([_in_words(change) for change in changes])}.'
        words += f' More is left than before, of no known cause ({joints}).' if joints else ''
    elif joints:
        words = f'Something changed that no known cause explains ({joints}).'
    elif not is_conclusive:
        words = 'No change is named, and none is ruled out.'
    if not unjudged:
        return words
    of, most = ', '.join(unjudged), 1.0 - EXPLAINED
    return f'{words} Of {of} over {most:.0%} of the torques squared are left unexplained.'


def _in_words(change: Change) -> str:
    shown = telling(change.parameters)
    values = ', '.join(value_in_words(*item, sign='+') for item in shown.items())
    rivals = [f', or {r.effect}{at(r.where)}' for r in change.indistinguishable_from]
    return f'{change.title}{at(change.where)} ({values}){"".join(rivals)}'
