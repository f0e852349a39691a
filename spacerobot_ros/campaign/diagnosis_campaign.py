"""Diagnosis campaign: hidden effects in simulated records, thousands of seeded cases.

One line of JSON a finished case in `diagnosis.jsonl`: a campaign that was interrupted goes on from
there. A case hides nothing, one effect, two, or one that is taken out of the catalogue.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..diagnosis.answer.result import Cause, Diagnosis
from ..diagnosis.diagnose import diagnose
from ..effects.catalogue import CATALOGUE
from ..effects.effect import Effect
from ..errors import SpaceRobotError
from ..estimation.noise_levels import noise_levels
from ..estimation.observations import observed
from ..estimation.refit import Fit, Run
from ..json_values import json_value
from .diagnosis_draw import drawn, places
from .diagnosis_judge import NOT_SIMULATED, REFUSED
from .diagnosis_scenario import DURATION, EXCITATIONS, ROBOTS, robot_file, simulated
from .resumable import run_resumable
from .tasks import Task

FILE = 'diagnosis.jsonl'
MULTIPLES = (1.0, 3.0, 10.0)
_PAIR_MULTIPLES = MULTIPLES[1:]
_URGENCY = {
    ('clean', 0.0): 0,
    ('single', MULTIPLES[1]): 0,
    ('pair', MULTIPLES[1]): 1,
    ('left_out', MULTIPLES[-1]): 1,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """How much is done.

    Args:
        clean: Records in which nothing is hidden.
        seeds: Of every effect at every strength, on every robot.
        pairs: Pairs of effects, each hidden at two strengths.
        duration: Of a record [s].
        workers: Processes.
        minutes: Time after which nothing new is begun.
    """

    clean: int = 300
    seeds: int = 2
    pairs: int = 60
    duration: float = DURATION
    workers: int = 2
    minutes: float = math.inf

    @classmethod
    def quick(cls, workers: int) -> Options:
        """Minutes instead of a night."""
        return cls(clean=6, seeds=0, pairs=2, workers=workers)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One record to diagnose.

    Args:
        kind: `clean`, `single`, `pair` or `left_out`.
        robot: Name. excitation: Name. seed: Of motion, noise and values.
        effects: Ids of what is hidden; the places are drawn.
        multiple: Strength by the detection limit.
        duration: [s].
    """

    kind: str
    robot: str
    excitation: str
    seed: int
    effects: tuple[str, ...] = ()
    multiple: float = 0.0
    duration: float = DURATION

    @property
    def key(self) -> str:
        """What a finished case is recognised by."""
        return json.dumps(asdict(self), sort_keys=True)


def cases(options: Options) -> list[Case]:
    """Every case of a campaign, mixed; what the figures to reach are about comes first."""
    out = [*_clean(options), *_hidden(options), *_pairs(options)]
    order = np.random.default_rng(0).permutation(len(out))
    return sorted((out[i] for i in order), key=lambda c: _URGENCY.get((c.kind, c.multiple), 2))


def _clean(options: Options) -> Iterator[Case]:
    for seed in range(options.clean):
        yield _case(options, 'clean', seed, seed)


def _hidden(options: Options) -> Iterator[Case]:
    """Each effect at all strengths, and the strongest again without its name in the catalogue."""
    for number, effect in enumerate(e.id for e in CATALOGUE.values() if e.is_fitted):
        for k in range(max(options.seeds, 1) * len(ROBOTS)):
            seed = 10_000 + 100 * number + k
            if not options.seeds and k != number % len(ROBOTS):
                continue
            for multiple in MULTIPLES if options.seeds else (3.0,):
                yield _case(options, 'single', k, seed, (effect,), multiple)
            if options.seeds:
                yield _case(options, 'left_out', k, seed, (effect,), MULTIPLES[-1])


def _pairs(options: Options) -> Iterator[Case]:
    ids = [e.id for e in CATALOGUE.values() if e.is_fitted]
    rng = np.random.default_rng(1)
    for k in range(options.pairs):
        first, second = rng.choice(len(ids), 2, replace=False)
        for multiple in _PAIR_MULTIPLES:
            yield _case(options, 'pair', k, 20_000 + k, (ids[first], ids[second]), multiple)


def _case(
    options: Options,
    kind: str,
    turn: int,
    seed: int,
    effects: tuple[str, ...] = (),
    multiple: float = 0.0,
) -> Case:
    return Case(
        kind=kind,
        robot=ROBOTS[turn % len(ROBOTS)],
        excitation=tuple(EXCITATIONS)[turn // len(ROBOTS) % len(EXCITATIONS)],
        seed=seed,
        effects=effects,
        multiple=multiple,
        duration=options.duration,
    )


def run_campaign(folder: Path, options: Options, done: Callable[[], None]) -> list[dict[str, Any]]:
    """Do the cases that a folder lacks.

    Returns:
        Every finished case of the campaign, in its order.

    Raises:
        RecordingError: the folder's file is not a campaign's.
    """
    tasks = [Task(case.key, run_case, (case,)) for case in cases(options)]
    return run_resumable(folder / FILE, tasks, options.workers, done, options.minutes)


def run_case(case: Case) -> dict[str, Any]:
    """Hide, simulate, diagnose; plain data."""
    rng = np.random.default_rng([case.seed, 11])
    hidden: list[Effect] = []
    strength = wall = 0.0
    failure = NOT_SIMULATED  # such as an effect under which the controller is not stable
    try:
        hidden, strength = _hide(case, rng)
        record = simulated(case.robot, case.excitation, case.seed, hidden, case.duration)
        failure, started = REFUSED, time.perf_counter()
        said = _said(diagnose(record, robot_file(case.robot).robot, catalogue=_known(case)))
        wall = time.perf_counter() - started
    except SpaceRobotError as error:
        said = {'verdict': failure, 'causes': [], 'minor': [], 'error': str(error)}
    line: dict[str, Any] = json_value(
        {
            'case': case.key,
            **{name: getattr(case, name) for name in ('kind', 'robot', 'excitation', 'multiple')},
            'strength': strength,
            'hidden': [
                {'effect': h.id, 'where': h.where, 'values': dict(h.values)} for h in hidden
            ],
            'wall_s': wall,
            **said,
        }
    )
    return line


def _known(case: Case) -> list[type[Effect]]:
    """The catalogue, without what is hidden where it is left out."""
    out = case.effects if case.kind == 'left_out' else ()
    return [effect for effect in CATALOGUE.values() if effect.id not in out]


def _hide(case: Case, rng: np.random.Generator) -> tuple[list[Effect], float]:
    """The effects of a case, and the weakest one's strength by the detection limit.

    It is 0 where the robot has no place for one.
    """
    if not case.effects:
        return [], 0.0
    robot = robot_file(case.robot).robot
    record = simulated(case.robot, case.excitation, case.seed, (), case.duration)
    measured = observed(record, robot)
    clean = Fit(Run(measured, robot, (), noise_levels(robot.sensors, measured)[0]), ())
    hidden = []
    for effect in case.effects:
        where = [w for e, w in places(robot) if e == effect]
        if where:
            place = where[int(rng.integers(len(where)))]
            hidden.append(drawn(clean, effect, place, case.multiple, rng))
    named = [replace(h, name=f'hidden_{i}') for i, (h, _) in enumerate(hidden)]
    complete = len(hidden) == len(case.effects)
    return named, min(strength for _, strength in hidden) if complete else 0.0


def _said(diagnosis: Diagnosis) -> dict[str, Any]:
    """What is scored of a diagnosis."""
    return {
        'verdict': diagnosis.verdict,
        'fit_p': diagnosis.fit_p,
        'null_p': diagnosis.null_p,
        'evidence': max((r.evidence for r in diagnosis.ranking), default=0.0),
        'after': diagnosis.gain.after,
        'causes': [_plain(cause) for cause in diagnosis.causes],
        'minor': [_plain(cause) for cause in diagnosis.minor],
    }


def _plain(cause: Cause) -> dict[str, Any]:
    """A cause with its values and their standard deviations."""
    return {
        'effect': cause.applied.id,
        'where': cause.applied.where,
        'rivals': [[r.effect, r.where] for r in cause.rivals],
        'values': {
            name: [estimated.value, estimated.std] for name, estimated in cause.parameters.items()
        },
    }
