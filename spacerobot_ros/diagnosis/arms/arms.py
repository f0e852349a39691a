"""Recordings of an arm whose noise nobody knows: level of what is left, causes, values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from ...effects.effect import Effect
from ...errors import ConfigurationError
from ...estimation.balance.arm_candidates import GAIN
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_priors import DRY, is_kind_of
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.arm_rows_about import about_model, about_readings, is_of_readings
from ...estimation.balance.motor_constants import first_constants, scaled_constant
from ...estimation.balance.row_blocks import CLUSTERS_AT_MOST
from ...estimation.stretches import LongRecord
from ...inference.gram_blocks import GramBlocks
from ...inference.hypotheses import Hypotheses
from ...inference.inferred import Inferred, infer
from ...inference.model_search import ChosenSet, best_set
from ...model.robot import Robot
from ...recording.record import Record
from ...types import Array
from ..events.arm_events import ArmEvents, arm_events
from ..events.event import Spans
from ..limits import CHANCE
from .arm_found import ArmFound, balances_of, refuse_rest, refuse_short, without_harm
from .arm_hypotheses import add_blocks, arm_hypotheses, no_blocks
from .fitted_arm import FittedArm
from .long_arm import Stretches
from .spectral_level import SpectralRows

_ROUNDS = 4
_LINEARIZED = 2  # times, of a long record: about what a sample says, then about all
_AT_BOUND = 0.999  # of a gain's bound, beyond which it is there
_SETTLED = 1e-3  # of a motor constant, from round to round


def find_arm_causes(
    records: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
    loaded: Sequence[int] = (),
    long: LongRecord | None = None,
) -> ArmFound:
    """Causes that hold on all recordings, and motor constants where nobody states them.

    Args:
        records: Of one machine; of a long record the sample.
        robot: The robot file's robot.
        believed: Its own effects.
        kinds: Effects that may be causes.
        report: Called with what is being done and the share done, from 0 to 1.
        loaded: Numbers of the recordings with the same load at the last link.
        long: One record that is too long for memory, whose rows are summed stretch by stretch.

    Raises:
        RecordingError: no joint moves, or currents that tell no motor constant.
    """
    constants = first_constants(records, robot, believed)
    for _ in range(_ROUNDS if constants else 1):
        found = replace(
            _found(records, robot, (*believed, *constants), kinds, report, loaded, long),
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
    rows, mean = found.fit.rows, found.fit.mean
    gains = {str(c.where): 1.0 for c in found.constants}
    for candidate, at in zip(rows.candidates, rows.places, strict=True):
        if candidate.kind.id == GAIN and candidate.where in gains:
            gains[candidate.where] = 1.0 / (1.0 - min(float(mean[at[0]]), 0.9))
    return gains


def _found(
    records: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
    loaded: Sequence[int],
    long: LongRecord | None,
) -> ArmFound:
    """Causes beside what is believed.

    The level of what is left is found twice: beside the whole catalogue, then beside what was
    chosen, since a catalogue explains some of any leftover.
    """

    def rows_without(left_out: Sequence[Spans]) -> ArmRows:
        rows = ArmRows.of(balances_of(records, robot, believed, left_out), kinds)
        refuse_rest(rows.balances, records)
        return rows if long else rows.with_own(loaded)

    report('balancing torques along the motion', 0.1)
    rows, stretches = rows_without([()] * len(records)), None
    refuse_short(rows, records)
    report('looking for events', 0.15)
    if long:
        stretches, found = Stretches.of(long.every, robot).with_events(believed, rows)
        events = ArmEvents(found, tuple(stretches.left_out[i] for i in long.sample))
    else:
        events = arm_events(rows.balances, rows)
    if any(events.left_out):
        rows = rows_without(events.left_out)
    report('finding the level of what no cause explains', 0.2)
    zeros = rows.own_zeros
    usual = [i for i in range(len(rows.candidates)) if i not in zeros]
    levels = leftover_levels(rows, rows.deviations(usual), rows.friction)
    report('choosing causes', 0.4)
    rough = _chosen(rows, levels, zeros)
    if zeros:  # of single recordings: judged at the level that is left beside all of them
        beside = _chosen(rows, levels_of(rows, rough, zeros), ())
        rough = rough if set(zeros).isdisjoint(beside.chosen) else beside
    first = rows
    for _ in range(_LINEARIZED if stretches else 1):

        def about(
            own: ArmRows, some: Sequence[Record], spans: Sequence[Spans], rough: FittedArm = rough
        ) -> ArmRows:
            return _about(own.linearized(rough.mean), rough, some, believed, spans)

        rows = about(first, records, events.left_out)
        levels = levels_of(rows, rough)
        report('choosing causes at the level that is left', 0.6)
        blocks, spectral = no_blocks(rows), SpectralRows(rows, arm_hypotheses(rows))
        for own in stretches.rows(first, believed, about) if stretches else (rows,):
            most = stretches.blocks_of_each if stretches else CLUSTERS_AT_MOST
            add_blocks(blocks, own.clusters(most), levels)
            spectral.add(own, levels)
        inferred = _inferred(rows, blocks)
        causes = {cast(int, c.key): c for c in inferred.causes}
        fit = FittedArm(rows, blocks, tuple(sorted(causes)))
        if fit.chosen == rough.chosen:
            break
        rough = fit
    unsupported = spectral.unsupported(fit)
    clear = tuple(i for i in fit.chosen if fit.chance(i) < CHANCE and i not in unsupported)
    unclear = [i for i in fit.chosen if i not in clear]
    return without_harm(
        ArmFound(
            records=tuple(records),
            robot=robot,
            believed=tuple(believed),
            fit=fit,
            causes=causes,
            levels=np.array(levels),
            clear=clear,
            named=tuple(fit.effects(clear)),
            calibration=tuple(fit.effects([*unclear, *fit.calibration])),
            events=events,
            stretches=stretches,
        )
    )


def _inferred(rows: ArmRows, blocks: GramBlocks) -> Inferred:
    """What the rows say; torques that do not follow from the model at all have no gain."""
    every = arm_hypotheses(rows)

    def at_bound(hypotheses: Hypotheses, found: ChosenSet) -> list[int]:
        mean = hypotheses.mean(found.marginal, found.chosen)
        gains = (i for i in found.chosen if rows.candidates[i].kind.id == GAIN)
        return [i for i in gains if mean[rows.places[i][0]] > _AT_BOUND * every[i].most[0]]

    return infer(blocks, every, refused=at_bound)


def _chosen(rows: ArmRows, levels: Sequence[Array], barred: Collection[int]) -> FittedArm:
    """The best set of causes, nothing of it validated yet."""
    out = FittedArm.of(rows, levels, ())
    return replace(out, chosen=tuple(sorted(best_set(out.hypotheses, barred=barred).chosen)))


def _about(
    rows: ArmRows,
    rough: FittedArm,
    records: Sequence[Record],
    believed: Sequence[Effect],
    left_out: Sequence[Spans],
) -> ArmRows:
    """Rows about a model that has what was found, where columns hold for small causes."""
    effects = rough.effects([*rough.chosen, *rough.calibration])
    read = [i for i in rough.chosen if is_of_readings(rows.candidates[i])]
    if not read and not any(e.follows_load for e in effects):
        return rows
    try:
        moving = [e for e in effects if e.acts('force') or e.acts('change')]
        whole = balances_of(records, rows.robot, (*believed, *moving), left_out)
        of_load = (i for i in rough.chosen if rows.candidates[i].kind.follows_load)
        rows = about_model(rows, dict(enumerate(whole)), of_load)
        if read:
            known = rough.effects(read)
            whole = balances_of(records, rows.robot, (*believed, *moving, *known), left_out)
            undone = balances_of(records, rows.robot, (*believed, *known), left_out)
            values = {i: rough.values[rows.places[i]] for i in read}
            rows = about_readings(rows, values, undone, whole)
    except ConfigurationError:  # together they are no robot
        pass
    return rows


def levels_of(rows: ArmRows, chosen: FittedArm, more: Sequence[int] = ()) -> list[Array]:
    """(8,) variances of each joint, with what is chosen, and more, beside the tolerances."""
    friction = rows.friction.copy()
    for i in chosen.chosen:
        candidate = rows.candidates[i]
        if is_kind_of(candidate.kind, DRY):  # several laws share one friction, some less than none
            value = float(chosen.mean[rows.places[i][0]])
            friction[rows.robot.joints.index(str(candidate.where))] += value
    return leftover_levels(rows, rows.deviations([*chosen.chosen, *more]), np.abs(friction))
