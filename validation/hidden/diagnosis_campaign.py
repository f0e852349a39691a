"""Diagnosis campaign: hidden effects in simulated records, thousands of seeded cases.

A case hides nothing, one effect, two, three, or one that is taken out of the catalogue. Records
are of the project's own plant, or of any module that offers the same (`truth_of`).
"""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from spacerobot_ros.diagnosis.answer.cause import Cause
from spacerobot_ros.diagnosis.answer.result import Diagnosis
from spacerobot_ros.diagnosis.diagnose import diagnose
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.errors import SpaceRobotError
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.noise_levels import noise_levels
from spacerobot_ros.estimation.runs import Run
from spacerobot_ros.estimation.trajectory.observations import observed
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.recording.record import Record

from ..campaigns import TrialRecord, grouped
from .diagnosis_draw import drawn, places
from .diagnosis_judge import NOT_SIMULATED, REFUSED, cause_record
from .diagnosis_scenario import DURATION, truth_of
from .diagnosis_score import drawings, results, shown  # noqa: F401  the campaign's

MULTIPLES = (1.0, 3.0, 10.0)
_SEEDS = 2  # of every effect on every robot, at the strengths that figures are asked of
_SEVERAL = {'pair': (2, 60), 'triple': (3, 30)}  # effects at once, and records at each strength
_QUICK_SEVERAL = 2
_BRIEF = 1.0  # s
_LAST = ('single', MULTIPLES[0])  # of no figure to reach


@dataclass(frozen=True, slots=True, kw_only=True)
class HiddenCase:
    """One record to diagnose.

    Args:
        kind: `clean`, `single`, `pair`, `triple` or `left_out`.
        robot: Name. excitation: Name. seed: Of motion, noise and values.
        effects: Ids of what is hidden; the places are drawn.
        multiple: Strength by the detection limit.
        duration: [s].
        truth: Module that simulates; empty: the project's own plant.
    """

    kind: str
    robot: str
    excitation: str
    seed: int
    effects: tuple[str, ...] = ()
    multiple: float = 0.0
    duration: float = DURATION
    truth: str = ''

    @property
    def key(self) -> str:
        """What a finished case is recognized by."""
        return json.dumps(asdict(self), sort_keys=True)


def trials(runs: int, is_quick: bool, truth: str = '') -> list[str]:
    """Every case, mixed; what the figures to reach are about comes first.

    Args:
        runs: Records in which nothing is hidden.
        is_quick: Each effect once, at three times its limit, and few at once: minutes, no night.
        truth: Module that simulates.
    """
    clean = (_case('clean', seed, seed, truth=truth) for seed in range(runs))
    out = [*clean, *_hidden(is_quick, truth), *_several(is_quick, truth)]
    order = np.random.default_rng(0).permutation(len(out))
    return [case.key for case in _by_urgency(out[i] for i in order)]


def _by_urgency(cases: Iterable[HiddenCase]) -> list[HiddenCase]:
    """All kinds spread evenly over each other, in case the campaign is cut off."""
    groups = grouped(cases, lambda case: (case.kind, case.multiple))
    placed = [
        (group == _LAST, (number + 0.5) / len(some), case)
        for group, some in groups.items()
        for number, case in enumerate(some)
    ]
    return [case for *_, case in sorted(placed, key=lambda entry: entry[:2])]


def _fitted(robot: str, truth: str) -> list[str]:
    """What the diagnosis looks for on a robot and the truth can have."""
    module = truth_of(truth)
    here = {effect for effect, _ in places(module.robot_file(robot).robot)}
    return [effect for effect in module.EFFECTS if effect in here]


def _hidden(is_quick: bool, truth: str) -> Iterator[HiddenCase]:
    """Each effect at all strengths, and the strongest again without its name in the catalogue.

    Without its name, and at its limit, of which no figure is asked, once on every robot.
    """
    module = truth_of(truth)
    robots, every = len(module.ROBOTS), {r: _fitted(r, truth) for r in module.ROBOTS}
    for number, effect in enumerate(module.EFFECTS):
        turns = [k for k in range(_SEEDS * robots) if effect in every[module.ROBOTS[k % robots]]]
        if is_quick:
            turns = turns[number % len(turns) :][:1] if turns else []
        for k in turns:
            seed = 10_000 + 100 * number + k
            # a search for what is not there takes ten times as long
            is_once = not is_quick and (k // robots + number) % _SEEDS == 1
            for multiple in MULTIPLES[1:2] if is_quick else MULTIPLES[not is_once :]:
                yield _case('single', k, seed, (effect,), multiple, truth)
            if is_once:
                yield _case('left_out', k, seed, (effect,), MULTIPLES[-1], truth)


def _several(is_quick: bool, truth: str) -> Iterator[HiddenCase]:
    robots = truth_of(truth).ROBOTS
    rng = np.random.default_rng(1)
    for kind, (size, count) in _SEVERAL.items():
        for k in range(_QUICK_SEVERAL if is_quick else count):
            ids = _fitted(robots[k % len(robots)], truth)
            chosen = tuple(str(e) for e in rng.choice(ids, size, replace=False))
            for multiple in MULTIPLES[1:]:
                yield _case(kind, k, 10_000 * size + k, chosen, multiple, truth)


def _case(
    kind: str,
    turn: int,
    seed: int,
    effects: tuple[str, ...] = (),
    multiple: float = 0.0,
    truth: str = '',
) -> HiddenCase:
    module = truth_of(truth)
    robots, excitations = len(module.ROBOTS), tuple(module.EXCITATIONS)
    return HiddenCase(
        kind=kind,
        robot=module.ROBOTS[turn % robots],
        excitation=excitations[turn // robots % len(excitations)],
        seed=seed,
        effects=effects,
        multiple=multiple,
        truth=truth,
    )


def run(key: str) -> TrialRecord:
    """Hide, simulate, diagnose."""
    case = HiddenCase(**json.loads(key))
    rng = np.random.default_rng([case.seed, 11])
    hidden: list[Effect] = []
    strength = wall = 0.0
    failure = NOT_SIMULATED  # such as an effect under which the controller is not stable
    try:
        hidden, strength = _hide(case, rng)
        record, robot = _simulated(case, hidden)
        failure, started = REFUSED, time.perf_counter()
        answer = _answer_row(diagnose(record, robot, catalogue=_known(case)))
        wall = time.perf_counter() - started
    except SpaceRobotError as error:
        answer = {'verdict': failure, 'causes': [], 'minor': [], 'error': str(error)}
    return {
        **{
            name: getattr(case, name)
            for name in ('kind', 'robot', 'excitation', 'multiple', 'truth')
        },
        'strength': strength,
        'hidden': [{'effect': h.id, 'where': h.where, 'values': dict(h.values)} for h in hidden],
        'wall_s': wall,
        **answer,
    }


def _simulated(case: HiddenCase, hidden: Sequence[Effect]) -> tuple[Record, Robot]:
    """The record of a case, and the robot that its user has."""
    module = truth_of(case.truth)
    record = module.simulated(case.robot, case.excitation, case.seed, hidden, case.duration)
    return record, module.robot_file(case.robot).robot


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
    record, robot = _simulated(case, ())
    measured = observed(record, robot)
    clean = Fit(Run(measured, robot, (), noise_levels(robot.sensors, measured)[0]), ())
    hidden = []
    for effect in case.effects:
        where = [w for e, w in places(robot) if e == effect]
        if where:
            place = where[int(rng.integers(len(where)))]
            hidden.append(drawn(clean, effect, place, case.multiple, rng))
    named = [replace(h, name=f'hidden_{i}') for i, (h, _) in enumerate(hidden)]
    complete = len(hidden) == len(case.effects) and all(_leaves_traces(case, h) for h in named)
    return named, min(strength for _, strength in hidden) if complete else 0.0


def _leaves_traces(case: HiddenCase, effect: Effect) -> bool:
    """Whether a record with the effect alone differs from a clean one.

    Efforts that are late by less than the interval over which a torque is held do not.
    """
    if not effect.acts('delay'):
        return True
    brief = replace(case, duration=_BRIEF)
    one, other = (_simulated(brief, hidden)[0] for hidden in ([effect], []))
    channels = ('q', 'effort', 'omega', 'attitude_xyzw')
    return not all(np.array_equal(getattr(one, c), getattr(other, c)) for c in channels)


def _answer_row(diagnosis: Diagnosis) -> dict[str, Any]:
    """What is scored of a diagnosis."""
    every = (*diagnosis.causes, *diagnosis.minor)
    return {
        'verdict': diagnosis.verdict,
        'fit_p': diagnosis.fit_p,
        'null_p': diagnosis.null_p,
        'evidence': max((c.evidence.log_odds for c in every), default=0.0),
        'after': diagnosis.gain.after,
        'causes': [_named(cause) for cause in diagnosis.causes],
        'minor': [_named(cause) for cause in diagnosis.minor],
    }


def _named(cause: Cause) -> TrialRecord:
    a = cause.applied
    return cause_record(a.id, a.where, cause.parameters, cause.rivals)
