"""Lone bodies whose pose is measured and whose rate is not: the search on windows of the pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from ...effects.effect import Effect
from ...effects.surroundings.thrusters import ThrusterGain
from ...estimation.pose_rows import PoseRun
from ...estimation.refit import refine
from ...inference.cluster_robust import robust_covariance
from ...inference.hypotheses import Hypotheses
from ...model.robot import Robot
from ...recording.record import Record
from ..answer.result import Diagnosis
from ..search.conclusion import conclude
from ..search.found import Found
from ..search.linear_rows import CandidateColumns, LinearRows
from ..search.search import RelinearizedSearch


def has_pose_alone(record: Record, robot: Robot) -> bool:
    """Whether a record is judged by windows: a lone body's pose under thrusters, no gyro."""
    is_seen = record.rates is None and record.attitudes is not None
    return not robot.joints and is_seen and {'base_position', 'thrusters'} <= set(record.inputs)


def diagnose_pose(
    record: Record,
    robot: Robot,
    believed: Sequence[Effect],
    kinds: Sequence[type[Effect]],
    report: Callable[[str, float], None],
) -> Diagnosis:
    """What a pose tells of a body and its thrusters.

    Noise has the level of what causes leave, so they are sought again at it until a set recurs.
    Only forces over the file's mass and inertia are seen, which are no causes beside them; and a
    window is too short for effects with states of their own.

    Raises:
        RecordingError: too few windows.
    """
    run = PoseRun(record, robot, believed)
    direct = [k for k in kinds if not (k.hidden or k.group in ('bodies', 'wheels'))]
    sets = list[frozenset[object]]()
    while True:
        found = RelinearizedSearch(run, direct, report).find()
        sets.append(frozenset(cause.key for cause in found.fit.causes))
        if sets[-1] in sets[:-1]:
            break
        run = run.left_by(found.fit.causes)
    windows = f'judged by {run.windows.count} windows of pose, start and rate of each free'
    return replace(conclude(found, (windows, *_gains(found))), method='pose')


def _gains(found: Found) -> tuple[str, ...]:
    """Every thruster's gain beside the causes, in words."""
    run, causes = found.fit.run, found.fit.causes
    named = {cause.key for cause in causes}
    nominal = ThrusterGain.nominal()
    every = [ThrusterGain(name=t.name, where=t.name, values=nominal) for t in run.robot.thrusters]
    fit = refine(run, [*causes, *(gain for gain in every if gain.key not in named)])
    rows = LinearRows(fit, CandidateColumns.of(fit, ()))
    all_of = range(len(fit.causes))
    hypotheses = Hypotheses(rows.blocks(rows.data), rows.hypotheses)
    fitted = hypotheses.fitted(hypotheses.marginal(all_of), all_of)
    stds = robust_covariance(hypotheses, fitted, all_of).deviations
    told = {(fit.causes[i].key, p.name): std for (i, p), std in zip(fit.free, stds, strict=True)}
    gains = (
        f'{c.where} {c["gain"]:.2f} +- {told[c.key, "gain"]:.2f}'
        for c in sorted(fit.causes, key=lambda c: str(c.where))
        if c.id == ThrusterGain.id
    )
    return (f"thrust over the file's mass and inertia: {', '.join(gains)}",)
