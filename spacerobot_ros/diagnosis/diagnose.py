"""A run against a robot: what is wrong, what causes it, what remains."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from ..effects.catalogue import CATALOGUE
from ..effects.effect import Effect
from ..estimation.balance import noise_shown
from ..estimation.noise_levels import noise_levels
from ..estimation.observations import observed
from ..estimation.prediction import TIMINGS
from ..estimation.refit import refine
from ..estimation.runs import BalanceRun, Run
from ..model.robot import Robot
from ..recording.faults.check import check_data
from ..recording.record import Record
from .answer.result import Diagnosis
from .conclusion import conclude
from .limits import MISFIT, MOST
from .search import Search
from .timing import better_timing, first_timing, held_after_all, in_words

_UNFINISHED = 'the search was ended before all that stands out was looked into'
_BALANCED = (
    'the robot file states no joint_effort_std, and the efforts say more than noise of their own '
    'allows: what the whole catalogue leaves of the torques is taken for noise instead'
)


def diagnose(
    record: Record,
    robot: Robot,
    believed: Sequence[Effect] = (),
    catalogue: Iterable[type[Effect]] | None = None,
    report: Callable[[str, float], None] = lambda what, share: None,
) -> Diagnosis:
    """Compare a run with the robot's simulation and name what is different.

    Args:
        record: What was measured.
        robot: The robot file's robot, gyrostat view.
        believed: The robot file's own effects.
        catalogue: Effects that may be causes; the whole catalogue without it.
        report: Called with what is being done and the share done, from 0 to 1.

    Raises:
        RecordingError: a record from which nothing can be said, or only what is wrong.
    """
    check_data(record, robot)
    measured = observed(record, robot)
    noise, notes = noise_levels(robot.sensors, measured)
    report('finding how efforts act', 0.02)
    kinds = list(CATALOGUE.values() if catalogue is None else catalogue)
    timing = first_timing(measured, robot, believed, noise, kinds)
    run = Run(measured, robot, believed, noise, timing)
    if not _is_of_unknown_noise(run):
        return _predicted(run, kinds, notes, report)
    found = Search(BalanceRun(run, kinds), kinds, report).find()
    if noise_shown(run.record, noise) and _may_fit(run, found.fit.causes, kinds):
        diagnosis = _predicted(run, kinds, notes, report)
        if (diagnosis.fit_p or 0.0) >= MISFIT:
            return diagnosis
    report('measuring the gain', 0.9)
    return conclude(found, (*notes, _BALANCED))


def _may_fit(run: Run, causes: Sequence[Effect], kinds: Sequence[type[Effect]]) -> bool:
    """Whether a search could explain the record to the noise of its sensors.

    It can where the causes that the balance of torques names do so, or where one effect with
    states of its own, which that balance does not judge, takes most of what they leave.
    """
    fit = refine(run, causes)
    if timing := better_timing(fit, (run.timing,)):
        fit = refine(run.timed(timing), causes)
    if (fit.rows.whiteness()[0] or 0.0) >= MISFIT:
        return True
    hidden = Search(fit.run, [kind for kind in kinds if kind.hidden], lambda what, share: None)
    left = float(fit.data @ fit.data) - len(fit.data)
    return any(judged.score.gain > MOST * left for judged in hidden.judge(fit))


def _predicted(
    run: Run,
    kinds: Sequence[type[Effect]],
    notes: tuple[str, ...],
    report: Callable[[str, float], None],
) -> Diagnosis:
    """The answer of rows by prediction."""
    found = Search(run, kinds, report).find()
    if held := held_after_all(found.fit):
        found = Search(run.timed(held), kinds, report, TIMINGS).find()
    report('measuring the gain', 0.9)
    if not found.is_complete:
        notes = (*notes, _UNFINISHED)
    return conclude(found, (*notes, *in_words(found.fit.run.timing)))


def _is_of_unknown_noise(run: Run) -> bool:
    """Whether torques are measured on a fixed base, and nobody says how well."""
    stated = run.robot.sensors.joint_effort_std is not None
    return not (run.robot.is_free or stated or run.record.effort is None)
