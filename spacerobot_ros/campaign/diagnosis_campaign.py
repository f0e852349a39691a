"""Diagnosis campaign: hidden effects in simulated records, thousands of seeded cases.

A case hides nothing, one effect, two, or one that is taken out of the catalogue.
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..diagnosis.answer.result import Cause, Diagnosis
from ..diagnosis.diagnose import diagnose
from ..effects.catalogue import CATALOGUE
from ..effects.effect import Effect
from ..errors import SpaceRobotError
from ..estimation.noise_levels import noise_levels
from ..estimation.observations import observed
from ..estimation.refit import Fit
from ..estimation.runs import Run
from .description import Record
from .diagnosis_campaign_tables import drawings as drawings
from .diagnosis_campaign_tables import tables as tables
from .diagnosis_draw import drawn, places
from .diagnosis_judge import NOT_SIMULATED, REFUSED
from .diagnosis_scenario import DURATION, EXCITATIONS, ROBOTS, robot_file, simulated
from .diagnosis_score import judge as judge
from .diagnosis_score import results as results

MULTIPLES = (1.0, 3.0, 10.0)
_SEEDS = 2  # of every effect at every strength, on every robot
_PAIRS, _QUICK_PAIRS = 60, 2  # of effects, each hidden at two strengths
_URGENCY = {
    ('clean', 0.0): 0,
    ('single', MULTIPLES[1]): 0,
    ('pair', MULTIPLES[1]): 1,
    ('left_out', MULTIPLES[-1]): 1,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenCase:
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


def trials(runs: int, is_quick: bool) -> list[str]:
    """Every case, mixed; what the figures to reach are about comes first.

    Args:
        runs: Records in which nothing is hidden.
        is_quick: Each effect once, at three times its limit, and few pairs: minutes, not a night.
    """
    clean = (_case('clean', seed, seed) for seed in range(runs))
    out = [*clean, *_hidden(is_quick), *_pairs(_QUICK_PAIRS if is_quick else _PAIRS)]
    order = np.random.default_rng(0).permutation(len(out))
    cases = sorted((out[i] for i in order), key=lambda c: _URGENCY.get((c.kind, c.multiple), 2))
    return [case.key for case in cases]


def _fitted() -> list[str]:
    return [effect.id for effect in CATALOGUE.values() if effect.is_fitted]


def _hidden(is_quick: bool) -> Iterator[HiddenCase]:
    """Each effect at all strengths, and the strongest again without its name in the catalogue."""
    for number, effect in enumerate(_fitted()):
        turns = (number % len(ROBOTS),) if is_quick else range(_SEEDS * len(ROBOTS))
        for k in turns:
            seed = 10_000 + 100 * number + k
            for multiple in MULTIPLES[1:2] if is_quick else MULTIPLES:
                yield _case('single', k, seed, (effect,), multiple)
            if not is_quick:
                yield _case('left_out', k, seed, (effect,), MULTIPLES[-1])


def _pairs(count: int) -> Iterator[HiddenCase]:
    ids = _fitted()
    rng = np.random.default_rng(1)
    for k in range(count):
        first, second = rng.choice(len(ids), 2, replace=False)
        for multiple in MULTIPLES[1:]:
            yield _case('pair', k, 20_000 + k, (ids[first], ids[second]), multiple)


def _case(
    kind: str, turn: int, seed: int, effects: tuple[str, ...] = (), multiple: float = 0.0
) -> HiddenCase:
    robots, excitations = len(ROBOTS), tuple(EXCITATIONS)
    return HiddenCase(
        kind=kind,
        robot=ROBOTS[turn % robots],
        excitation=excitations[turn // robots % len(excitations)],
        seed=seed,
        effects=effects,
        multiple=multiple,
    )


def run(key: str) -> Record:
    """Hide, simulate, diagnose."""
    case = HiddenCase(**json.loads(key))
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
    return {
        **{name: getattr(case, name) for name in ('kind', 'robot', 'excitation', 'multiple')},
        'strength': strength,
        'hidden': [{'effect': h.id, 'where': h.where, 'values': dict(h.values)} for h in hidden],
        'wall_s': wall,
        **said,
    }


def _known(case: HiddenCase) -> list[type[Effect]]:
    """The catalogue, without what is hidden where it is left out."""
    out = case.effects if case.kind == 'left_out' else ()
    return [effect for effect in CATALOGUE.values() if effect.id not in out]


def _hide(case: HiddenCase, rng: np.random.Generator) -> tuple[list[Effect], float]:
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
