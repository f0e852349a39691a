"""All experiments of the wheel-momentum identification paper, and their results together.

`run` makes the computations, `checks` holds the results against the figures that are to be
reached.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..types import Array
from . import paper
from .identification import NoiseFreeResult, noise_free
from .linear_system import relative_errors, true_solution
from .monte_carlo import EstimatorScore, NoisyRun, bound_std, noisy_run, score
from .noise import SCALES
from .scenario import STARTS, scenario
from .tasks import Task, run_tasks
from .tracking import TrackingRun, soft_bandwidth, track, track_identified

_RUNS = (
    ('correct', 'corrected'),
    ('correct', 'no_aam'),
    ('correct', 'paper'),
    ('paper', 'paper'),
    ('paper', 'no_aam'),
)  # plant and law
TABLE_SCALE = 0.1  # where least squares makes errors as large as those in Table III


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How much to run.

    Args:
        runs: Noisy records an estimator, noise level and robot.
        axes: Robots with the symmetry of Table I for all experiments.
        sets: Further robots and minimal sets for the condition numbers.
        starts: Ways to start.
        bandwidths: Double poles of the tracking error [rad/s].
        noisy_axes: Robots for the experiments with noise.
        soft: (axes, plant) for which to look for the gains behind the paper's 8 degrees.
        workers: Processes.
    """

    runs: int = 10
    axes: tuple[str, ...] = ('zyx', 'xyy')
    further_axes: tuple[str, ...] = ('zyy',)
    structures: tuple[str, ...] = ('symmetric', 'generic')
    starts: tuple[str, ...] = STARTS
    bandwidths: tuple[float, ...] = (0.3, 0.5, 1.0, 2.0)
    noisy_axes: tuple[str, ...] = ('zyx', 'xyy')
    soft: tuple[tuple[str, str], ...] = (
        ('xyy', 'correct'),
        ('xyy', 'paper'),
        ('zyx', 'correct'),
        ('zyx', 'paper'),
    )
    workers: int = 1

    @classmethod
    def quick(cls, runs: int = 2, workers: int = 1) -> Options:
        """A fifth of the work."""
        return cls(
            runs=runs,
            further_axes=(),
            starts=('moving', 'spin_up'),
            bandwidths=(1.0,),
            noisy_axes=('zyx',),
            soft=(('xyy', 'correct'),),
            workers=workers,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """All results.

    Args:
        noise_free: Condition numbers and errors without noise.
        tracking: Closed-loop runs with known parameters.
        soft: Runs whose gains give the paper's 8 degrees.
        noisy: All noisy records' estimates.
        scores: Estimators against the bound.
        bounds: (3 + k,) Cramer-Rao bound of [AAM; x] by axes and noise scale.
        identified: Closed-loop runs with parameters identified at noise scale 1, by axes and
            method; None where they are unusable.
    """

    noise_free: list[NoiseFreeResult]
    tracking: list[TrackingRun]
    soft: list[TrackingRun]
    noisy: list[NoisyRun]
    scores: list[EstimatorScore]
    bounds: dict[tuple[str, float], Array]
    identified: dict[tuple[str, str], TrackingRun | None]

    def run_of(self, axes: str, plant: str, law: str, bandwidth: float) -> TrackingRun:
        """The tracking run with these properties."""
        wanted = (axes, plant, law, bandwidth)
        return next(r for r in self.tracking if (r.axes, r.plant, r.law, r.bandwidth) == wanted)

    @property
    def noisy_axes(self) -> tuple[str, ...]:
        """Robots of the experiments with noise."""
        return tuple(dict.fromkeys(axes for axes, _ in self.bounds))

    def noise_free_of(self, axes: str, structure: str, start: str) -> NoiseFreeResult:
        """The noise-free result with these properties."""
        wanted = (axes, structure, start)
        return next(r for r in self.noise_free if (r.axes, r.structure, r.start) == wanted)

    def base_parameters(self, axes: str) -> Array:
        """(k,) true minimal parameters."""
        case = scenario(axes)
        return true_solution(case.robot, case.minimal)[3:]

    def table_iii(self, axes: str) -> dict[str, Array]:
        """Relative errors (3 + k,) [%] by method, first record at Table III's noise level."""
        case = scenario(axes)
        truth = true_solution(case.robot, case.minimal)
        run = next(r for r in self.noisy if r.axes == axes and r.scale == TABLE_SCALE)
        return {name: relative_errors(x, truth) for name, x in run.solutions.items()}


def count_tasks(options: Options) -> int:
    """Number of steps that `run` reports."""
    return len(_tasks(options)) + len(_identified_pairs(options))


def run(options: Options, done: Callable[[], None] = lambda: None) -> Reproduction:
    """Make all computations.

    Args:
        options: How much.
        done: Called after each of `count_tasks` steps.
    """
    results = run_tasks(_tasks(options), options.workers, done)

    def of(kind: str) -> list[Any]:
        return [value for key, value in results.items() if key[0] == kind]  # type: ignore[index]

    noisy: list[NoisyRun] = of('noisy')
    bounds = {(axes, s): bound_std(axes, s) for axes in options.noisy_axes for s in SCALES}
    scores = []
    for (axes, s), bound in bounds.items():
        scores += score([r for r in noisy if (r.axes, r.scale) == (axes, s)], bound)
    return Reproduction(
        noise_free=[result for part in of('noise_free') for result in part],
        tracking=of('track'),
        soft=of('soft'),
        noisy=noisy,
        scores=scores,
        bounds=bounds,
        identified=_track_identified(options, noisy, done),
    )


def _tasks(options: Options) -> list[Task]:
    tasks = [
        Task(('noisy', axes, scale, seed), noisy_run, (axes, scale, seed))
        for axes in options.noisy_axes
        for scale in SCALES
        for seed in range(options.runs)
    ]
    tasks += [
        Task(('soft', *pair), soft_bandwidth, (*pair, paper.TRACKING_ERROR_DEG))
        for pair in options.soft
    ]
    tasks += [
        Task(('noise_free', axes, start), noise_free, (axes, start, options.structures))
        for axes in (*options.axes, *options.further_axes)
        for start in options.starts
    ]
    tasks += [
        Task(('track', axes, plant, law, w), track, (axes, plant, law, w))
        for axes in options.axes
        for plant, law in _RUNS
        for w in options.bandwidths
    ]
    return tasks


def _identified_pairs(options: Options) -> list[tuple[str, str]]:
    return [(axes, method) for axes in options.noisy_axes for method in ('ls', 'online', 'ml')]


def _track_identified(
    options: Options, noisy: list[NoisyRun], done: Callable[[], None]
) -> dict[tuple[str, str], TrackingRun | None]:
    first = {r.axes: r for r in reversed(noisy) if r.scale == SCALES[0]}
    tasks = [
        Task((axes, method), track_identified, (axes, method, first[axes].estimates[method]))
        for axes, method in _identified_pairs(options)
    ]
    results = run_tasks(tasks, 1, done)
    return {(axes, method): results[axes, method] for axes, method in _identified_pairs(options)}
