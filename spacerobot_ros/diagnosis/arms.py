"""Recordings of an arm whose noise nobody knows: level of what is left, causes, values."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..effects.effect import Effect
from ..errors import ConfigurationError
from ..estimation.arm_fit import ArmFit
from ..estimation.arm_priors import DRY, is_kind_of
from ..estimation.arm_rows import ArmRows
from ..estimation.arm_rows_about import about_delay, about_loads
from ..estimation.evidence import Gram, sum_of
from ..estimation.motor_constants import first_constants, scaled_constant
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array, BoolArray
from .answer.result import Evidence
from .arm_evidence import evidence_of
from .arm_found import WORSE, ArmFound, balances_of, is_clear, refuse_rest
from .events.arm_events import Spans, arm_events
from .held_out_checks import check_bodies, check_held_out, check_plain
from .selection import Selection

_ROUNDS = 4
DELAY = 'effort_delay'
_SETTLED = 1e-3  # of a motor constant, from round to round
_HEAVIEST = 8.0
"""Times that a joint may count for more: values that are then 64 times its own are its alone."""


def find_arm_causes(
    records: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
    loaded: Sequence[int] = (),
) -> ArmFound:
    """Causes that hold on all recordings, and motor constants where nobody states them.

    Args:
        records: Of one machine.
        robot: The robot file's robot.
        believed: Its own effects.
        kinds: Effects that may be causes.
        report: Called with what is being done and the share done, from 0 to 1.
        loaded: Numbers of the recordings with the same load at the last link.

    Raises:
        RecordingError: no joint moves, or currents that tell no motor constant.
    """
    constants = first_constants(records, robot, believed)
    for _ in range(_ROUNDS if constants else 1):
        found = replace(
            _found(records, robot, (*believed, *constants), kinds, report, loaded),
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
    loaded: Sequence[int],
) -> ArmFound:
    """Causes beside what is believed.

    The level of what is left is found twice: beside the whole catalogue, then beside what was
    chosen, since a catalogue explains some of any leftover.
    """
    report('balancing torques along the motion', 0.1)
    balances = balances_of(records, robot, believed, [()] * len(records))
    refuse_rest(balances, records)
    rows = ArmRows.of(balances, kinds).with_own(loaded)
    report('looking for events', 0.15)
    events = arm_events(balances, rows)
    if any(events.left_out):
        rows = ArmRows.of(balances_of(records, robot, believed, events.left_out), kinds)
        rows = rows.with_own(loaded)
        refuse_rest(rows.balances, records)
    report('finding the level of what no cause explains', 0.2)
    zeros = rows.own_zeros
    usual = [i for i in range(len(rows.candidates)) if i not in zeros]
    parts = rows.parts(rows.levels(rows.deviations(usual), rows.friction))
    first, rough = (Selection(rows, parts, rows.recording, rows.held) for _ in range(2))
    report('choosing causes', 0.4)
    rough.run()
    rough = _with_zeros(rough, zeros)
    rows = rows.linearized(ArmFit(rows, rough.whole, tuple(rough.chosen)).posterior.mean)
    rows = _delayed(rows, rough, records, believed, events.left_out)
    levels = levels_of(rows, rough)
    report('choosing causes at the level that is left', 0.6)
    selection = Selection.of(rows, levels)
    selection.run()
    check_held_out(selection)
    check_bodies(selection)
    equal = np.ones((len(records), robot.n_joints))
    check_plain(selection, plain_of(selection, levels, equal))
    selection = _loaded(selection, levels, records, believed, events.left_out)
    evidence = _beyond_placebos(selection, levels)
    report('fitting all causes together', 0.8)
    found = ArmFound(
        tuple(records),
        robot,
        tuple(believed),
        first,
        selection,
        ArmFit(selection.rows, selection.whole, ()),
        evidence,
        np.array(levels),
        equal,
        events=events,
    )
    return _applicable(found)


def _with_zeros(rough: Selection, zeros: Sequence[int]) -> Selection:
    """The choice with zeros of single recordings, where it wants any.

    They are judged at the level that is left beside all of them: they would pass for its slow part
    otherwise, and it for them where none is wanted.
    """
    if not zeros:
        return rough
    rows = rough.rows
    beside = Selection.of(rows, levels_of(rows, rough, zeros))
    beside.chosen = list(rough.chosen)
    if not any(margin > 0.0 and i in zeros for i, margin in beside.ranking()):
        return rough
    beside.run()
    return beside


def _delayed(
    rows: ArmRows,
    rough: Selection,
    records: Sequence[Record],
    believed: Sequence[Effect],
    left_out: Sequence[Spans],
) -> ArmRows:
    """Rows about the delay of efforts that was chosen, if one was, see `about_delay`."""
    kinds = [rows.candidates[i].kind.id for i in rough.chosen]
    if DELAY not in kinds:
        return rows
    i = rough.chosen[kinds.index(DELAY)]
    fit = ArmFit(rows, rough.whole, tuple(rough.chosen))
    (delay,) = fit.effects([i])
    try:
        whole = balances_of(records, rows.robot, (*believed, *fit.effects(fit.chosen)), left_out)
    except ConfigurationError:  # together they are no robot
        return rows
    undone = balances_of(records, rows.robot, (*believed, delay), left_out)
    return about_delay(rows, i, delay['delay'], undone, whole)


def _loaded(
    selection: Selection,
    levels: Sequence[Array],
    records: Sequence[Record],
    believed: Sequence[Effect],
    left_out: Sequence[Spans],
) -> Selection:
    """The choice on rows with friction of the load that all of it makes, see `about_loads`."""
    rows = selection.rows
    fit = ArmFit(rows, selection.whole, tuple(selection.chosen))
    found = fit.effects([*fit.chosen, *fit.calibration])
    if not any(e.follows_load for e in found):
        return selection
    moving = [e for e in found if e.acts('force') or e.acts('change')]
    try:
        balances = balances_of(records, rows.robot, (*believed, *moving), left_out)
    except ConfigurationError:  # together they are no robot
        return selection
    out = Selection.of(about_loads(rows, balances, fit.chosen), levels)
    out.chosen = list(selection.chosen)
    return out


def levels_of(rows: ArmRows, chosen: Selection, more: Sequence[int] = ()) -> list[Array]:
    """(8,) variances of each joint, with what is chosen, and more, beside the tolerances."""
    fit = ArmFit(rows, chosen.whole, tuple(chosen.chosen))
    friction = rows.friction.copy()
    for i in chosen.chosen:
        candidate = rows.candidates[i]
        if is_kind_of(candidate.kind, DRY):
            value = abs(float(fit.posterior.mean[rows.places[i][0]]))
            friction[rows.robot.joints.index(str(candidate.where))] += value
    return rows.levels(rows.deviations([*chosen.chosen, *more]), friction)


def plain_of(selection: Selection, levels: Sequence[Array], weights: Array) -> Selection:
    """The same with rows that are not whitened, counted so often that they say as much.

    Args:
        selection: The choice.
        levels: (8,) variances of every set of `ArmRows.joints`.
        weights: (R, n), see `ArmRows.parts`.
    """
    parts = selection.rows.parts(levels, weights)
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


def _applicable(found: ArmFound) -> ArmFound:
    """The causes as they are applied: no joint of a recording may be worse with them than without.

    Where one is, its rows count more: values that suit all together may cost one of them a little.
    Where that does not help, the cause at that joint goes without which it is best off; what of
    the file is corrected within its tolerance goes before any.
    """
    selection, weights = found.selection, found.weights
    while True:
        plain = plain_of(selection, [*found.levels], weights)
        tried = list(_applied(replace(found, weights=weights), selection.chosen, plain.whole))
        for out in tried:
            worse = _worse(out)
            if worse is not None and not worse.any():
                return out
        if not selection.chosen:
            return replace(tried[0], calibration=())
        best = min(tried, key=lambda out: float(np.max(_extent(out))))
        worse = _worse(best)
        if worse is not None and np.max(weights) < _HEAVIEST:
            weights = np.where(worse, 2.0 * weights, weights)
        else:
            selection.drop(_culprit(best, plain.whole))
            weights = np.ones_like(weights)


def _applied(found: ArmFound, chosen: Sequence[int], plain: Gram) -> Iterator[ArmFound]:
    """What is found with some causes, with all corrections of the file and with none."""
    selection = found.selection
    fit = ArmFit(selection.rows, selection.whole, tuple(chosen), plain)
    clear = tuple(i for i in fit.chosen if is_clear(fit, i))
    out = replace(found, fit=fit, clear=clear, named=tuple(fit.effects(clear)))
    unclear = [i for i in fit.chosen if i not in clear]
    for more in ([*unclear, *fit.calibration], unclear):
        yield replace(out, calibration=tuple(fit.effects(more)))


def _extent(found: ArmFound) -> Array:
    """(n,) how many times as much the extended model leaves of each joint, where it leaves most.

    Infinite where there is no such robot.
    """
    try:
        return np.asarray(np.max(np.nan_to_num(found.ratios), axis=0))
    except ConfigurationError:
        return np.full(found.robot.n_joints, math.inf)


def _worse(found: ArmFound) -> BoolArray | None:
    """(R, n) where the extended model leaves more; None where there is no such robot."""
    try:
        return found.ratios > WORSE
    except ConfigurationError:
        return None


def _culprit(found: ArmFound, plain: Gram) -> int:
    """The cause at the joint that is worst off without which that is best off.

    Of all causes the one with the least evidence where they make no robot.
    """
    selection, rows, extent = found.selection, found.selection.rows, _extent(found)
    if np.isinf(extent).any():
        return min(selection.chosen, key=selection.gain)
    j = int(np.argmax(extent))
    there = [i for i in selection.chosen if rows.candidates[i].where == rows.robot.joints[j]]

    def without(i: int) -> float:
        others = [k for k in selection.chosen if k != i]
        return min(float(_extent(out)[j]) for out in _applied(found, others, plain))

    return min(there or selection.chosen, key=without)
