"""Runs against a robot: what is wrong, what causes it, what remains."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from ..effects.believed_friction import with_friction
from ..effects.catalogue import kinds_beside
from ..effects.effect import Effect
from ..effects.equivalents import unasked
from ..estimation.balance.arm_rows import ArmRows
from ..estimation.balance.balance import Balance, balance_of
from ..estimation.balance.motor_constants import as_recorded
from ..estimation.fit import Fit
from ..estimation.noise_levels import noise_levels
from ..estimation.runs import Run
from ..estimation.stretches import LongRecord
from ..estimation.trajectory.observations import observed, refuse_unbalanced
from ..estimation.trajectory.time_base import turning_axes
from ..identification.outliers import screened
from ..inference.decisive import MISFIT
from ..model.robot import Robot
from ..recording.faults.data_faults import check_data
from ..recording.record import Record
from .answer.event_answer import with_events
from .answer.result import Diagnosis
from .arms.arm_conclusion import conclude_arm, still_answer
from .arms.arm_found import ArmFound, refuse_rest
from .arms.arms import find_arm_causes
from .arms.long_arm import Stretches
from .discovery.discover import discover
from .discovery.other_recording import unmeasured_inputs, unshared_extras
from .events.arm_events import arm_events
from .events.event import Event, Events, PossibleEvent
from .events.impulses import MomentumSteps, spans_of, steps_beside_usual
from .limits import UNLIKE_STEPS
from .lone_bodies.pose import diagnose_pose, has_pose_alone
from .lone_bodies.spin_causes import diagnose_spin, is_spinning
from .orders.orders import find_orders, wheel_orders
from .search.conclusion import conclude
from .search.found import Found
from .search.long_flight import find_in_stretches
from .search.predictable import is_predictable
from .search.search import RelinearizedSearch
from .search.timing import in_words

_BALANCED = (
    'the robot file states no joint_effort_std, and more is left of the torques than noise of '
    'their own: the level of what no cause explains was estimated along'
)
_FEW_AXES = 'hits are looked for where the rates about all three axes are measured: not here'
_TOGETHER = (
    'torques of all recordings were balanced; the level of what no cause explains was found'
)


def diagnose(
    records: Record | Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect] = (),
    catalogue: Iterable[type[Effect]] | None = None,
    report: Callable[[str, float], None] = lambda what, share: None,
    loaded: Sequence[int] = (),
) -> Diagnosis:
    """Compare runs with the robot's simulation and name what is different.

    Args:
        records: What was measured, in one run or several of the same machine.
        robot: The robot file's robot, gyrostat view.
        believed: The robot file's own effects.
        catalogue: Effects that may be causes; the whole catalogue without it.
        report: Called with what is being done and the share done, from 0 to 1.
        loaded: Numbers of the recordings with the same load at the last link of an arm.

    Raises:
        RecordingError: a record from which nothing can be said, or only what is wrong; several
            of a robot whose torques can not be balanced.
    """
    every = [records] if isinstance(records, Record) else list(records)
    kinds = kinds_beside(believed) if catalogue is None else list(catalogue)
    robot = with_friction(robot, believed)
    answer = _diagnosed(every, robot, believed, kinds, report, loaded)
    named = [c.applied.key for c in (*answer.causes, *answer.minor)]
    alike = unasked(robot, named, {kind.id for kind in kinds})
    lacking = (*unmeasured_inputs(believed, every), *unshared_extras(every))
    return replace(answer, notes=(*answer.notes, *alike, *lacking))


def _diagnosed(
    every: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
    loaded: Sequence[int],
) -> Diagnosis:
    """What `diagnose` says of the machine; notes of what is alike and lacking are its own."""
    if loaded:
        refuse_unbalanced(every, robot)
    measured = []
    for record in every:
        check_data(record, robot)
        measured.append(observed(record, robot))
    if answer := _by_windows(measured, robot, believed, kinds, report):
        return answer
    robot = as_recorded(robot, measured)
    if len(measured) > 1:
        refuse_unbalanced(measured, robot)
    if len(measured) == 1 and (long := LongRecord.of(measured[0])):
        return _long(long, measured[0], robot, believed, kinds, report)
    balanced = _is_balanced(measured[0], robot)
    balances = [balance_of(record, robot, believed) for record in measured * balanced]
    if still := _at_rest(balances, measured, lambda: arm_events(balances, None).events):
        return still
    if len(measured) > 1:
        found = find_arm_causes(measured, robot, believed, kinds, report, loaded)
        return conclude_arm(*discover(found, report), (_TOGETHER,))
    return _of_one(measured[0], balances, robot, believed, kinds, report)


def _of_one(
    record: Record,
    balances: Sequence[Balance],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> Diagnosis:
    """The answer for one record that fits into memory."""
    found: ArmFound | None = None
    noise, notes = noise_levels(robot.sensors, record)
    if _is_of_unknown_noise(record, robot):
        found = find_arm_causes([record], robot, believed, kinds, report)
        is_whole = not (_lacks_efforts(record) or robot.passive_joints or robot.rate_only)
        is_whole = is_whole and not robot.without_constant
        if not (is_whole and is_predictable(found, noise, kinds)):
            return _balanced(found, notes, report)
    record, left_out = screened(record, noise)
    notes = (*notes, *left_out)
    run = Run(record, robot, believed, noise)
    answer = _predicted(run, balances, kinds, notes, report)
    if found is None or answer.verdict in ('consistent', 'explained'):
        return answer
    return _balanced(found, notes, report)  # what is left is no noise of sensors, after all


def _is_balanced(record: Record, robot: Robot) -> bool:
    """Whether the torques of a record can be balanced, all of them by a known constant."""
    return not (robot.is_free or robot.without_constant or record.effort is None)


def _long(
    long: LongRecord,
    record: Record,
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> Diagnosis:
    """The answer for a record that is summed over stretches: by balance, where it can be.

    Laws are of a sample, so that they are said and not applied.
    """
    if not (_is_balanced(record, robot) or _is_of_unknown_noise(record, robot)):
        noise, notes = noise_levels(robot.sensors, record)
        middle, _ = screened(long.every[long.sample[len(long.sample) // 2]], noise)
        run = Run(middle, robot, believed, noise)
        flight, steps = find_in_stretches(long, run, kinds, report)
        return with_events(_concluded(flight, (*notes, long.note), report), steps)
    sample = [long.every[i] for i in long.sample]
    if _is_balanced(record, robot):
        balances = [balance_of(own, robot, believed) for own in sample]
        every = Stretches.of(long.every, robot)
        if still := _at_rest(balances, sample, lambda: every.with_events(believed, None)[1]):
            return still
    found = find_arm_causes(sample, robot, believed, kinds, report, long=long)
    _, leftover = discover(found, report)
    said = tuple(replace(entry, applied=None) for entry in leftover)
    of_sample = f'levels of noise, laws and lines are of {len(sample)} of them'
    return conclude_arm(found, said, (f'{long.note}; {of_sample}',))


def _balanced(
    found: ArmFound, notes: tuple[str, ...], report: Callable[[str, float], None]
) -> Diagnosis:
    """The answer of the balance of torques."""
    return conclude_arm(*discover(found, report), (*notes, _BALANCED))


def _at_rest(
    balances: Sequence[Balance], records: Sequence[Record], events_of: Callable[[], Events]
) -> Diagnosis | None:
    """The answer where no joint moves, which events alone can be; None where one does.

    Raises:
        RecordingError: nothing moves, and nobody pushes.
    """
    if not balances or any(b.arm.is_moving.any() for b in balances):
        return None
    events = events_of()
    if not (events.named or events.possible):
        refuse_rest(balances, records)
    return still_answer(balances, events)


def _by_windows(
    records: Sequence[Record],
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> Diagnosis | None:
    """The answer for a lone body that is seen too little to be predicted all along.

    Raises:
        RecordingError: too few windows, or several recordings of a pose.
    """
    if is_spinning(records, robot):
        report('fitting the spin that the magnetometer sees', 0.1)
        return diagnose_spin(records, robot)
    if not has_pose_alone(records[0], robot):
        return None
    if len(records) > 1:
        refuse_unbalanced(records, robot)
    return diagnose_pose(records[0], robot, believed, kinds, report)


def _is_of_unknown_noise(record: Record, robot: Robot) -> bool:
    """Whether torques are measured on a fixed base, and nobody says how well, or not of all."""
    stated = robot.sensors.joint_effort_std is not None and not _lacks_efforts(record)
    stated = stated and not robot.without_constant
    return not (robot.is_free or stated or record.effort is None)


def _lacks_efforts(record: Record) -> bool:
    return record.joints is not None and bool(record.joints.without_effort)


def _with(fit: Fit, events: Sequence[Event | PossibleEvent]) -> Fit:
    """Causes and events along a whole record."""
    applied = (e for event in events for e in event.applied)
    return Fit(fit.run.without(()), [*fit.causes, *applied])


def _cost(fit: Fit) -> float:
    """Minus twice the log evidence (Schwarz 1978)."""
    return fit.misfit + len(fit.free) * math.log(len(fit.data))


def _causes_of(
    run: Run, kinds: Sequence[type[Effect]], report: Callable[[str, float], None]
) -> Found:
    return RelinearizedSearch(run, kinds, report).find()


def _concluded(
    found: Found, notes: tuple[str, ...], report: Callable[[str, float], None]
) -> Diagnosis:
    """The answer of a search.

    Orders of joints are asked where the model does not fit; those of wheels always, as they may be
    above what the fit follows, or too small for a test of all that is left.
    """
    report('measuring the gain', 0.9)
    run = found.fit.run
    answer = conclude(found, (*notes, *in_words(run.timing)))
    units = {joint: run.robot.unit_of('N m', joint) for joint in run.robot.arm}
    if answer.fit_p is None or answer.fit_p < MISFIT:
        return replace(answer, orders=find_orders([run.record], units))
    if run.record.wheels is None:
        return answer
    lines = wheel_orders(run.record, units)
    return replace(answer, orders=tuple(order for own in lines.values() for order in own))


def _predicted(
    run: Run,
    balances: Sequence[Balance],
    kinds: Sequence[type[Effect]],
    notes: tuple[str, ...],
    report: Callable[[str, float], None],
) -> Diagnosis:
    """The answer of rows by prediction.

    Events of an arm on the ground are those of its balance.
    """
    report('looking for events', 0.05)
    if balances:
        events = arm_events(balances, ArmRows.of(balances, kinds))
        found = _causes_of(run.without(events.left_out[0]), kinds, report)
        return with_events(_concluded(found, notes, report), events.events)
    is_seen = not {0, 1, 2} - {*run.record.gyro_axes, *turning_axes(run.record)}
    if not (run.robot.is_free and is_seen):
        notes = (*notes, _FEW_AXES) if run.robot.is_free else notes
        return _concluded(_causes_of(run, kinds, report), notes, report)
    found, steps = _in_flight(run, kinds, report)
    return with_events(_concluded(found, notes, report), steps)


def _in_flight(
    run: Run, kinds: Sequence[type[Effect]], report: Callable[[str, float], None]
) -> tuple[Found, Events]:
    """Causes of a free base, and steps of its momentum.

    Where causes explain the record, steps are looked for beside them. Small ones that do may stand
    for a step, and where none do a step may hide them, as no part of the record agrees with the
    others: then steps come first, and causes without their times, and what explains more is kept.
    """
    found = RelinearizedSearch(run, kinds, report).find()
    run = found.null.run
    report('looking for events', 0.7)
    if found.is_good and found.gain > UNLIKE_STEPS:
        steps, _ = steps_beside_usual(run, found.fit.causes)
        return _beside(found, steps, run, kinds, report)
    steps, large = steps_beside_usual(run)
    if steps.all and not (found.is_good and not steps.named):
        cost = _cost(_with(found.fit, ()))
        others = _causes_of(run.without(spans_of(steps)), kinds, report)
        if _cost(_with(others.fit, steps.all)) <= cost:
            found = others
        else:
            steps = Events()
    if steps.is_judged:
        return found, steps
    beside = MomentumSteps(found.fit)
    steps, large = beside.events, (*large, *beside.standing_out)
    if steps.is_judged or not large:
        return _beside(found, steps, run, kinds, report)
    causes = _causes_of(run.without(large), kinds, report)
    beside_causes = MomentumSteps(Fit(run, causes.fit.causes)).events
    is_better = _cost(_with(causes.fit, beside_causes.all)) < _cost(_with(found.fit, ()))
    return (causes, beside_causes) if beside_causes.named and is_better else (found, steps)


def _beside(
    found: Found,
    steps: Events,
    run: Run,
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> tuple[Found, Events]:
    """Causes without the times of steps, where any are named."""
    if not steps.named:
        return found, steps
    return _causes_of(run.without(spans_of(steps)), kinds, report), steps
