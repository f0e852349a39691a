"""Recordings of an arm whose noise nobody knows: level of what is left, causes, values."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ...effects.effect import Effect
from ...errors import ConfigurationError
from ...estimation.balance.arm_fit import ArmFit
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_priors import DRY, is_kind_of
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.arm_rows_about import about_delay, about_loads
from ...estimation.balance.motor_constants import first_constants, scaled_constant
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..answer.cause import Evidence
from ..events.arm_events import arm_events
from ..events.event import Spans
from .applicable import applicable, plain_of
from .arm_evidence import evidence_of
from .arm_found import ArmFound, balances_of, refuse_rest, refuse_short
from .held_out_checks import check_bodies, check_held_out, check_plain, check_refinements
from .selection import Selection
from .spectral_check import check_spectrum

_ROUNDS = 4
_DELAY = 'effort_delay'
_SETTLED = 1e-3  # of a motor constant, from round to round


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
    refuse_short(rows, records)
    report('looking for events', 0.15)
    events = arm_events(balances, rows)
    if any(events.left_out):
        rows = ArmRows.of(balances_of(records, robot, believed, events.left_out), kinds)
        rows = rows.with_own(loaded)
        refuse_rest(rows.balances, records)
    rows = rows.with_masses()  # beside these, what lasts for a while would pass for an event
    report('finding the level of what no cause explains', 0.2)
    zeros = rows.own_zeros
    usual = [i for i in range(len(rows.candidates)) if i not in zeros]
    parts = rows.parts(leftover_levels(rows, rows.deviations(usual), rows.friction))
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
    _check(selection, levels)
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
        _equal(selection),
        events=events,
    )
    return applicable(found)


def _check(selection: Selection, levels: Sequence[Array]) -> None:
    """Keep what holds. What had given way to a cause that does not is asked again, and checked."""
    gone: set[int] = set()
    while True:
        before = set(selection.chosen)
        check_held_out(selection)
        for check in (check_refinements, check_bodies, check_plain):
            check(selection, plain_of(selection, levels, _equal(selection)))
        gone |= check_spectrum(selection, levels)
        gone |= before - set(selection.chosen)
        if not gone or not selection.ask_again(gone):
            return


def _equal(selection: Selection) -> Array:
    """(R, n) weights of rows that all count once."""
    rows = selection.rows
    return np.ones((len(rows.balances), rows.robot.n_joints))


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
    if _DELAY not in kinds:
        return rows
    i = rough.chosen[kinds.index(_DELAY)]
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
        if is_kind_of(candidate.kind, DRY):  # several laws share one friction, some less than none
            value = float(fit.posterior.mean[rows.places[i][0]])
            friction[rows.robot.joints.index(str(candidate.where))] += value
    return leftover_levels(rows, rows.deviations([*chosen.chosen, *more]), np.abs(friction))


def _beyond_placebos(selection: Selection, levels: Sequence[Array]) -> dict[int, Evidence]:
    """Evidence of every cause; what predicts no better than columns without meaning goes."""
    while True:
        evidence = {i: evidence_of(selection, levels, i) for i in selection.chosen}
        excess = {i: e.held_out_gain - e.placebo_gain for i, e in evidence.items()}
        worst = min(excess, key=excess.__getitem__, default=None)
        if worst is None or excess[worst] > 0.0 or math.isnan(excess[worst]):
            return evidence
        worst = selection.leaning_on(worst)
        selection.drop(worst)
        if selection.ask_again([worst]):
            _check(selection, levels)
