"""Recordings of an arm whose noise nobody knows: level of what is left, causes, values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..effects.effect import Effect
from ..errors import ConfigurationError, RecordingError
from ..estimation.arm_fit import ArmFit
from ..estimation.arm_priors import DRY, is_kind_of
from ..estimation.arm_rows import ArmRows
from ..estimation.balance import Balance, balance_of
from ..estimation.evidence import Gram, sum_of
from ..estimation.motor_constants import first_constants, scaled_constant
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array
from .answer.result import Evidence
from .arm_evidence import evidence_of
from .events.arm_events import ArmEvents, Spans, arm_events
from .limits import CLEAR
from .selection import Selection

_ROUNDS = 4
_SETTLED = 1e-3  # of a motor constant, from round to round
_WORSE = 1.02
"""Of a joint's rms as it is: the most that an extended model may leave of it."""


@dataclass(frozen=True, eq=False)
class ArmFound:
    """What a search says.

    Args:
        records: The recordings.
        robot: The robot file's robot.
        believed: Its own effects.
        first: The search before anything was chosen, whose ranking is shown.
        selection: Its end.
        fit: The chosen causes with values.
        evidence: Of every chosen cause.
        levels: (2 n, 6) variances of every joint's leftover, see `ArmRows.joints` [N^2 m^2].
        constants: Motor constants of currents that nobody made torques, estimated beside all.
        clear: Numbers of the causes that are named. named: The same as they are applied.
        calibration: What is applied beside them without a name: causes that are not clear of
            their own spread, and corrections of the file within its tolerance.
        learned: Laws that nobody has named, see `discovery`.
        events: What came from outside; all else is found without those times.
    """

    records: tuple[Record, ...]
    robot: Robot
    believed: tuple[Effect, ...]
    first: Selection
    selection: Selection
    fit: ArmFit
    evidence: Mapping[int, Evidence]
    levels: Array
    clear: tuple[int, ...]
    named: tuple[Effect, ...]
    calibration: tuple[Effect, ...]
    constants: tuple[Effect, ...] = ()
    learned: tuple[Effect, ...] = ()
    events: ArmEvents = field(default_factory=ArmEvents)

    @cached_property
    def extended(self) -> tuple[Balance, ...]:
        """The recordings under the extended model."""
        effects = (*self.believed, *self.constants, *self.named, *self.calibration)
        effects += self.learned
        return tuple(_balances(self.records, self.robot, effects, self.events.left_out))


def find_arm_causes(
    records: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> ArmFound:
    """Causes that hold on all recordings, and motor constants where nobody states them.

    Raises:
        RecordingError: no joint moves, or currents that tell no motor constant.
    """
    constants = first_constants(records, robot, believed)
    for _ in range(_ROUNDS if constants else 1):
        found = replace(
            _found(records, robot, (*believed, *constants), kinds, report),
            believed=tuple(believed),
            constants=constants,
        )
        gains = constant_gains(found)
        if all(abs(gain - 1.0) < _SETTLED for gain in gains.values()):
            break
        constants = tuple(scaled_constant(c, gains[str(c.where)]) for c in constants)
    return found


def constant_gains(found: ArmFound) -> dict[str, float]:
    """By joint, what the balance wants of torques by an estimated motor constant, more than 1."""
    rows, mean = found.fit.rows, found.fit.posterior.mean
    gains = {str(c.where): 1.0 for c in found.constants}
    for candidate, at in zip(rows.candidates, rows.places, strict=True):
        if candidate.kind.id == 'joint_torque_constant' and candidate.where in gains:
            gains[candidate.where] = 1.0 / (1.0 - min(float(mean[at[0]]), 0.9))
    return gains


def _found(
    records: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> ArmFound:
    """Causes beside what is believed.

    The level of what is left is found twice: beside the whole catalogue, then beside what was
    chosen, since a catalogue explains some of any leftover.
    """
    report('balancing torques along the motion', 0.1)
    balances = _balances(records, robot, believed, [()] * len(records))
    refuse_rest(balances, records)
    rows = ArmRows.of(balances, kinds)
    report('looking for events', 0.15)
    events = arm_events(balances, rows)
    if any(events.left_out):
        rows = ArmRows.of(_balances(records, robot, believed, events.left_out), kinds)
        refuse_rest(rows.balances, records)
    report('finding the level of what no cause explains', 0.2)
    parts = rows.parts(rows.levels(rows.sizes, rows.friction))
    first, rough = (Selection(rows, parts, rows.recording, rows.held) for _ in range(2))
    report('choosing causes', 0.4)
    rough.run()
    rows = rows.linearized(ArmFit(rows, rough.whole, tuple(rough.chosen)).posterior.mean)
    levels = levels_of(rows, rough)
    report('choosing causes at the level that is left', 0.6)
    selection = Selection(rows, rows.parts(levels), rows.recording, rows.held)
    selection.run()
    selection.check_held_out()
    plain = plain_of(selection, rows.parts(levels, is_white=False))
    selection.check_plain(plain)
    evidence = _beyond_placebos(selection, levels)
    report('fitting all causes together', 0.8)
    spans = events.left_out
    fit, clear, named, calibration = _applicable(selection, plain, records, robot, believed, spans)
    return ArmFound(
        tuple(records),
        robot,
        tuple(believed),
        first,
        selection,
        fit,
        evidence,
        np.array(levels),
        clear,
        named,
        calibration,
        events=events,
    )


def _balances(
    records: Sequence[Record],
    robot: Robot,
    effects: Sequence[Effect],
    left_out: Sequence[Spans],
) -> list[Balance]:
    """Every recording under a robot with effects, without some times."""
    both = zip(records, left_out, strict=True)
    return [balance_of(record, robot, effects, spans) for record, spans in both]


def levels_of(rows: ArmRows, chosen: Selection) -> list[Array]:
    """(6,) variances of each joint, with what is chosen beside the tolerances."""
    fit = ArmFit(rows, chosen.whole, tuple(chosen.chosen))
    friction = rows.friction.copy()
    for i in chosen.chosen:
        candidate = rows.candidates[i]
        if is_kind_of(candidate.kind, DRY):
            value = abs(float(fit.posterior.mean[rows.places[i][0]]))
            friction[rows.robot.joints.index(str(candidate.where))] += value
    return rows.levels(fit.deviations, friction)


def plain_of(selection: Selection, parts: Sequence[Gram]) -> Selection:
    """The same with rows that are not whitened, counted so often that they say as much."""
    chosen = [selection.rows.places[i] for i in selection.chosen or selection.live]
    own = np.concatenate(chosen) if chosen else np.zeros(0, dtype=int)
    white, plain = (np.diag(g.matrix)[own] for g in (selection.whole, sum_of(parts)))
    ratios = white[plain > 0.0] / plain[plain > 0.0]
    factor = float(np.median(ratios)) if len(ratios) else 1.0
    rows = selection.rows
    return Selection(rows, [part.times(factor) for part in parts], rows.recording, rows.held)


def _beyond_placebos(selection: Selection, levels: Sequence[Array]) -> dict[int, Evidence]:
    """Evidence of every cause; what predicts no better than columns without meaning goes."""
    while True:
        evidence = {i: evidence_of(selection, levels, i) for i in selection.chosen}
        excess = {i: e.held_out_gain - e.placebo_gain for i, e in evidence.items()}
        worst = min(excess, key=excess.__getitem__, default=None)
        if worst is None or excess[worst] > 0.0 or math.isnan(excess[worst]):
            return evidence
        selection.drop(worst)


def _applicable(
    selection: Selection,
    plain: Selection,
    records: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    left_out: Sequence[Spans],
) -> tuple[ArmFit, tuple[int, ...], tuple[Effect, ...], tuple[Effect, ...]]:
    """The causes as they are applied: no joint may be worse with them than without.

    Where one is, the cause at that joint with the least evidence goes; what of the file is
    corrected within its tolerance goes before any.
    """
    rows = selection.rows
    before = rms(rows.balances)
    while True:
        fit = ArmFit(rows, selection.whole, tuple(selection.chosen), plain.whole)
        clear = _clear(fit)
        unclear = [i for i in fit.chosen if i not in clear]
        named = fit.effects(clear)
        for calibration in (fit.effects([*unclear, *fit.calibration]), fit.effects(unclear)):
            effects = [*believed, *named, *calibration]
            after = _applied_rms(records, robot, effects, left_out)
            if after is not None and np.all(after <= _WORSE * before, where=np.isfinite(before)):
                return fit, clear, tuple(named), tuple(calibration)
        if not selection.chosen:
            return fit, (), (), ()
        selection.drop(_weakest(selection, before, after))


def _clear(fit: ArmFit) -> tuple[int, ...]:
    """Causes any of whose coefficients is clear of its own spread.

    The others predict, too, and stay in the model without a name.
    """
    return tuple(
        i
        for i in fit.chosen
        if np.max(np.abs(fit.values[fit.rows.places[i]]) / fit.spread(i)) > CLEAR
    )


def _applied_rms(
    records: Sequence[Record],
    robot: Robot,
    effects: Sequence[Effect],
    left_out: Sequence[Spans],
) -> Array | None:
    """(n,) rms that a model leaves; None where there is no such robot."""
    try:
        return rms(_balances(records, robot, effects, left_out))
    except ConfigurationError:
        return None


def _weakest(selection: Selection, before: Array, after: Array | None) -> int:
    """The chosen cause of least evidence, of those at joints that got worse if there are any."""
    rows = selection.rows
    worse = set()
    if after is not None:
        worse = {j for j, b, a in zip(rows.robot.joints, before, after, strict=True) if a > b}
    gains = {i: selection.gain(i) for i in selection.chosen}
    there = {i: gain for i, gain in gains.items() if rows.candidates[i].where in worse}
    return min(there or gains, key=gains.__getitem__)


def refuse_rest(balances: Sequence[Balance], records: Sequence[Record]) -> None:
    """Refuse recordings that say nothing.

    Raises:
        RecordingError: no joint moves in any of them.
    """
    if not any(balance.arm.is_moving.any() for balance in balances):
        raise RecordingError(
            records[0].source or 'recording',
            'no joint moves: at rest friction holds any torque; record a motion',
        )


def rms(balances: Sequence[Balance]) -> Array:
    """(n,) rms of the torques that a model misses in the band where joints move [N m].

    NaN for a joint that never does.
    """
    total, count = 0.0, 0
    for balance in balances:
        moving = balance.arm.is_moving[:: balance.arm.stride]
        total = total + np.sum(balance.torque**2 * moving, axis=0)
        count = count + np.sum(moving, axis=0)
    with np.errstate(invalid='ignore'):
        return np.asarray(np.sqrt(total / np.where(count, count, np.nan)))
