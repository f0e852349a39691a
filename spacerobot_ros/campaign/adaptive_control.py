"""All experiments of the adaptive-control paper on our own robot, and some of ours."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..control.adaptive.settings import AdaptiveSettings
from .adaptive_identities import Identities, identities
from .adaptive_run import Case, Run, run_case
from .adaptive_timing import TIMED, cycle_time
from .tasks import Task, run_tasks

LAWS = (
    ('passivity', 'none'),
    ('adaptive_lyapunov_paper', 'none'),
    ('adaptive_lyapunov', 'none'),
    ('adaptive_rls_paper', 'none'),
    ('adaptive_rls', 'none'),
    ('adaptive_composite', 'none'),
    ('adaptive_composite', 'project'),
    ('adaptive_lyapunov', 'natural'),
)
PAPER_ERROR = 0.016  # rad, of the paper's gradient law, whose step nothing bounds
SHAPES = {'true': 'elements', 'iid': 'elements', 'physical': 'bodies'}
"""`adaptive.prior_shape` by the kind of wrong prior: the law believes what the draws are like."""
LAMBDAS = (0.4, 0.8, 1.2, 1.6, 2.0)
SAMPLING = ((0.25, 0.4), (0.25, 2.0), (0.5, 1.0), (0.5, 2.0), (1.0, 0.4), (1.0, 0.8))
PERIODS = (0.01, 0.02, 0.05, 0.1, 0.25)
NOISE = (0.1, 1.0, 5.0)
NOISY_LAWS = (
    ('adaptive_rls_paper', 'none'),
    ('adaptive_rls', 'none'),
    ('adaptive_composite', 'project'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How much to run.

    Args:
        runs: Wrong priors a law and size of error, and noise seeds.
        etas: Sizes of the prior's error.
        workers: Processes.
    """

    runs: int = 6
    etas: tuple[float, ...] = (0.1, 0.2, 0.3, 0.4)
    workers: int = 1

    @classmethod
    def quick(cls, runs: int = 2, workers: int = 1) -> Options:
        """A sixth of the work."""
        return cls(runs=runs, etas=(0.2, 0.4), workers=workers)


@dataclass(frozen=True, slots=True, eq=False)
class Adaptation:
    """All results.

    Args:
        options: What was run.
        runs: By (experiment, ...).
        times: Time of a cycle by law and consistency [us].
        identities: Residuals of the identities and ranks.
    """

    options: Options
    runs: dict[tuple[object, ...], Run]
    times: dict[tuple[str, str], float]
    identities: Identities

    def of(self, *key: object) -> list[Run]:
        """Runs whose key starts with this."""
        return [run for k, run in self.runs.items() if k[: len(key)] == key]


def settings_of(law: str, consistency: str, **values: float | str) -> AdaptiveSettings:
    """A law at the benchmark's gains."""
    if law == 'adaptive_lyapunov_paper':
        values.setdefault('adaptation_error', PAPER_ERROR)
    fields = {'law': law, 'physical_consistency': consistency, **values}
    return AdaptiveSettings(**fields)  # type: ignore[arg-type]


def cases(options: Options) -> dict[tuple[object, ...], Case]:
    """Every closed loop to run, by key."""
    out: dict[tuple[object, ...], Case] = {}
    seeds = range(options.runs)
    for law in LAWS:
        true = settings_of(*law, prior_shape=SHAPES['true'])
        out[('harmonic', 'true', 0.0, *law, 0)] = Case(task='harmonic', settings=true)
        for kind in ('iid', 'physical'):
            settings = settings_of(*law, prior_shape=SHAPES[kind])
            for eta in options.etas:
                for seed in seeds:
                    wrong = Case(
                        task='harmonic', settings=settings, prior=kind, eta=eta, seed=seed
                    )
                    out[('harmonic', kind, eta, *law, seed)] = wrong
    for law in (
        ('passivity', 'none'),
        ('adaptive_rls', 'none'),
        ('adaptive_composite', 'project'),
    ):
        for seed in seeds:
            out[('unmeasured', *law, seed)] = Case(
                task='harmonic',
                settings=settings_of(*law, prior_shape=SHAPES['iid']),
                prior='iid',
                eta=0.4,
                seed=seed,
                measures_velocity=False,
            )
    return {**out, **_set_points(options), **_noisy(options), **_sampled(options)}


def _set_points(options: Options) -> dict[tuple[object, ...], Case]:
    out: dict[tuple[object, ...], Case] = {}
    passive = settings_of('passivity', 'none')
    out['orientation', 'true', 0.0, 0] = Case(task='orientation', settings=passive, duration=30.0)
    for kind in ('iid', 'physical'):
        for eta in (0.2, 0.4):
            for seed in range(options.runs):
                out['orientation', kind, eta, seed] = Case(
                    task='orientation',
                    settings=passive,
                    prior=kind,
                    eta=eta,
                    seed=seed,
                    duration=30.0,
                )
    for rate in LAMBDAS:
        settings = settings_of('passivity', 'none', attitude_bandwidth=rate, joint_bandwidth=rate)
        out['lambda', rate] = Case(task='orientation', settings=settings, duration=30.0)
    return out


def _noisy(options: Options) -> dict[tuple[object, ...], Case]:
    return {
        ('noise', scale, *law, seed): Case(
            task='harmonic',
            settings=settings_of(*law, prior_shape=SHAPES['iid']),
            prior='iid',
            eta=0.4,
            seed=0,
            noise=scale,
            noise_seed=seed,
        )
        for scale in NOISE
        for law in NOISY_LAWS
        for seed in range(options.runs)
    }


def _sampled(options: Options) -> dict[tuple[object, ...], Case]:
    out: dict[tuple[object, ...], Case] = {}
    for period, rate in SAMPLING:
        settings = settings_of(
            'passivity',
            'none',
            kappa=1.0,
            attitude_bandwidth=rate,
            joint_bandwidth=rate,
            sampling_check='warn',
        )
        loop = {'task': 'orientation', 'settings': settings, 'period': period}
        out['sampling', period, rate, 'true', 0] = Case(**loop)  # type: ignore[arg-type]
        for seed in range(options.runs):
            wrong = {'prior': 'iid', 'eta': 0.4, 'seed': seed}
            out['sampling', period, rate, 'iid', seed] = Case(**loop, **wrong)  # type: ignore[arg-type]
    for period in PERIODS:
        settings = settings_of('passivity', 'none', sampling_check='warn')
        out['period', period] = Case(task='harmonic', settings=settings, period=period)
    return out


def count_tasks(options: Options) -> int:
    """Number of steps that `run` reports."""
    return len(cases(options)) + len(TIMED) + 1


def run(options: Options, done: Callable[[], None] = lambda: None) -> Adaptation:
    """Make all computations.

    Args:
        options: How much.
        done: Called after each of `count_tasks` steps.
    """
    times = {}
    for law in TIMED:  # before other processes compete
        times[law] = cycle_time(*law)
        done()
    found = identities()
    done()
    tasks = [Task(key, run_case, (case,)) for key, case in cases(options).items()]
    results = run_tasks(tasks, options.workers, done)
    runs = {key: results[key] for key in cases(options)}
    return Adaptation(options, runs, times, found)


def worst(runs: list[Run]) -> tuple[float, float]:
    """Largest root mean squares of attitude and joints [deg] of several runs.

    Infinite where one of them diverged.
    """
    if any(run.diverged for run in runs):
        return float('inf'), float('inf')
    values = np.array([run.rms_deg() for run in runs])
    attitude, joints = np.max(values, axis=0)
    return float(attitude), float(joints)


def median(runs: list[Run]) -> tuple[float, float]:
    """Median root mean squares of attitude and joints [deg]; a diverged run's are infinite."""
    gone = (float('inf'), float('inf'))
    values = np.array([gone if run.diverged else run.rms_deg() for run in runs])
    attitude, joints = np.median(values, axis=0)
    return float(attitude), float(joints)


def settling_time(run: Run, limit_deg: float = 0.1) -> float:
    """Time from which on the attitude error stays below a limit [s]; infinite if it does not."""
    outside = np.flatnonzero(np.rad2deg(run.attitude_error) >= limit_deg)
    if run.diverged or (len(outside) and outside[-1] == len(run.time) - 1):
        return float('inf')
    return float(run.time[outside[-1] + 1]) if len(outside) else 0.0


def last_deg(run: Run) -> float:
    """Largest attitude error of the last 10 s [deg]; infinite if the run diverged."""
    if run.diverged:
        return float('inf')
    return float(np.rad2deg(np.max(run.attitude_error[run.time > run.time[-1] - 10.0])))


def rebound_deg(run: Run) -> float:
    """Largest attitude error after its first fall below 0.1 degrees [deg]: overshoot."""
    error = np.rad2deg(run.attitude_error)
    inside = np.flatnonzero(error < 0.1)
    return float(np.max(error[inside[0] :])) if len(inside) else float(error[-1])


def base_errors(run: Run, truth: np.ndarray) -> np.ndarray:
    """(N, 4) relative errors of the base's Ixx, Iyy, Izz (about its origin) and mass."""
    chosen = [4, 6, 9, 0]
    return np.abs(run.base[:, chosen] / truth[chosen] - 1.0)
