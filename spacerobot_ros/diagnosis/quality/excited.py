r"""What a motion tells of every unknown: the catalogue's effects at every place.

G is the information of the data on small amounts of all effects (columns as the diagnosis makes
them), S their plausible sizes. Of one coefficient the data alone tell

    alone    = G_ii^-1/2                           were it the only unknown
    together = ((G + S^-2)^-1)_ii^1/2              beside all others of plausible size

An unknown is told where three of these standard deviations are less than its plausible size.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import groupby
from operator import add

import numpy as np

from ...effects.catalogue import kinds_beside
from ...effects.effect import Effect
from ...effects.robot_file import RobotFile
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import balance_of
from ...estimation.columns import Candidate, Signatures, candidates
from ...estimation.noise_levels import noise_levels
from ...estimation.runs import Run
from ...estimation.scaling import PROPORTIONAL
from ...estimation.trajectory.observations import observed
from ...inference.gram import Gram, sum_of
from ...model.robot import Robot
from ...recording.faults.thresholds import SHORTEST, is_short
from ...recording.record import Record
from ..arms.arm_found import refuse_rest

_STRETCH = 60.0  # s that are judged at once: bounds memory, and an initial state more is cheap
_STRETCHES, _WHOLE = 5, 1.5  # of a long record, evenly spread
_COLUMNS = 25  # a joint, of all effects
_MOST_WORK = 6e10  # products of a stretch: some seconds; arms of 14 joints take half in a minute
_LARGE = 20  # joints of a fixed robot beyond which a part is judged
_MOST_ENTRIES, _LEAST_LONG = 8e7, 5.0  # torques times columns of that part: some seconds; s
_SPARSEST = 5  # samples of which one is taken of a large robot, before its stretch is shortened
_AT_ONCE = 64  # columns: what changes along the rows stays in a processor's cache
_ROUNDING = 1e6  # plausible sizes: what is seen from there on is rounding of columns
TOLD = 3.0  # standard deviations within the plausible size


@dataclass(frozen=True, slots=True)
class Excited:
    """What the data tell of one number of an effect.

    Args:
        effect: Id in the catalogue. where: Its place.
        parameter: Name of the number, or of the pair's amplitude that it is a part of.
        size: Plausible size, in the unit that it is estimated in.
        unit: Of the parameter.
        alone: Standard deviation were nothing else unknown.
        together: Standard deviation beside all other unknowns; at most the plausible size.
    """

    json_too = ('status',)
    effect: str
    where: str | None
    parameter: str
    unit: str
    size: float
    alone: float
    together: float

    @property
    def status(self) -> str:
        """`told`, `not told apart` or `not seen`."""
        if self.size > TOLD * self.together:
            return 'told'
        return 'not told apart' if self.size > TOLD * self.alone else 'not seen'


def count_told(found: Sequence[Excited]) -> int:
    """How many of them the data tell."""
    return sum(one.status == 'told' for one in found)


def excited(record: Record, file: RobotFile) -> tuple[Excited, ...]:
    """Of every number of every effect that the diagnosis would try on this robot.

    Raises:
        RecordingError: nothing of this robot's motion was measured.
    """
    record = observed(record, file.robot)
    kinds = [kind for kind in kinds_beside(file.effects) if not (kind.hidden or kind.is_rare)]
    if not file.robot.is_free and record.effort is not None:
        (part,) = _stretches(record, _longest(record, file.robot))
        every, gram = _of_balance(part, file, kinds)
        found = _compatible(every)
        gram = _part(every, found, gram)
    else:
        found, gram = _of_prediction(record, file, kinds)
    return tuple(_judged(found, gram, file.robot))


def _of_balance(
    record: Record, file: RobotFile, kinds: Sequence[type[Effect]]
) -> tuple[Sequence[Candidate], Gram]:
    """Fixed base: torques at the level of what the whole catalogue leaves of them."""
    balances = [balance_of(record, file.robot, file.effects)]
    refuse_rest(balances, [record])
    rows = ArmRows.of(balances, kinds)
    return rows.candidates, sum_of(rows.parts(leftover_levels(rows, rows.sizes, rows.friction)))


def _of_prediction(
    record: Record, file: RobotFile, kinds: Sequence[type[Effect]]
) -> tuple[list[Candidate], Gram]:
    """Free base: momentum and torques at the level of the sensors' noise."""
    noise, _ = noise_levels(file.robot.sensors, record)
    found: list[Candidate] | None = None
    grams = []
    every = _every(record, file.robot)
    for part in _stretches(_thinned(record, every), _longest(record, file.robot)):
        rows = Run(part, file.robot, file.effects, noise, 'sampled').rows(())
        found = found or _compatible(candidates(kinds, rows))
        signatures = Signatures(rows)
        columns = [signatures.whitened(steps) for steps in _groups(found)]
        grams.append(Gram.of(np.concatenate(columns, axis=1), rows.data).times(every))
    return found or [], reduce(add, grams)


def is_part(record: Record, robot: Robot) -> bool:
    """Whether so large a robot is judged by a part of its recording."""
    start, end = record.span
    return _longest(record, robot) < min(end - start, _STRETCH if robot.is_free else np.inf)


def _work(record: Record, robot: Robot) -> float:
    """Products of the columns with each other, of a second of a record of a free robot."""
    return 2.0 * robot.n_joints * _rate(record) * (_COLUMNS * robot.n_joints) ** 2


def _rate(record: Record) -> float:
    """Samples of the joints a second."""
    return len(record.joint_time) / max(float(np.ptp(record.span)), 1e-9)


def _every(record: Record, robot: Robot) -> int:
    """Samples of which one is taken; each then counts as many times."""
    start, end = record.span
    work = _work(record, robot) * min(end - start, _STRETCH)
    return int(np.clip(np.ceil(work / _MOST_WORK), 1, _SPARSEST))


def _longest(record: Record, robot: Robot) -> float:
    """Length of a stretch [s]; infinite of a fixed robot, unless it is large."""
    if not robot.is_free:
        entries = _rate(record) * _COLUMNS * robot.n_joints**2
        return np.inf if robot.n_joints <= _LARGE else max(_MOST_ENTRIES / entries, _LEAST_LONG)
    work = _work(record, robot) / _every(record, robot)
    return float(np.clip(_MOST_WORK / max(work, 1e-9), SHORTEST, _STRETCH))


def _thinned(record: Record, every: int) -> Record:
    """One of so many samples of each sensor."""
    if every == 1:
        return record
    sensors = {name: getattr(record, name) for name in ('joints', 'rates', 'attitudes')}
    thin = {n: s.at(np.arange(len(s)) % every == 0) for n, s in sensors.items() if s is not None}
    return replace(record, **thin)


def _groups(found: Sequence[Candidate]) -> Iterable[list[tuple[Effect, float]]]:
    """Small steps of candidates of one kind, in groups that are faster than one by one."""
    for _, same in groupby(found, key=lambda candidate: candidate.kind):
        steps = [step for candidate in same for step in candidate.small_steps]
        yield from (steps[k : k + _AT_ONCE] for k in range(0, len(steps), _AT_ONCE))


def _stretches(record: Record, length: float) -> Iterable[Record]:
    """Parts of a record of so many seconds at most: five, or of a large robot the middle."""
    start, end = record.span
    if end - start <= (_WHOLE if length == _STRETCH else 1.0) * length:
        return [record]
    starts = [0.5 * (start + end - length)]
    if length == _STRETCH:
        starts = np.linspace(start, end - length, _STRETCHES).tolist()
    parts = [record.between(t - 1e-9, t + length) for t in starts]
    return [part for part in parts if not is_short(part.joint_time)]


def _compatible(found: Sequence[Candidate]) -> list[Candidate]:
    """Those that can act together: of one law's special cases and first guesses the first."""
    kept: list[Candidate] = []
    for candidate in found:
        if not (candidate.repeats(kept) or candidate.contradicts(kept)):
            kept.append(candidate)
    return kept


def _part(found: Sequence[Candidate], kept: Sequence[Candidate], gram: Gram) -> Gram:
    """The information of some of the candidates."""
    wanted = {id(candidate) for candidate in kept}
    is_kept = [id(candidate) in wanted for candidate in found]
    counts = [len(candidate.steps) for candidate in found]
    return gram.part(np.flatnonzero(np.repeat(is_kept, counts)))


def _judged(found: Sequence[Candidate], gram: Gram, robot: Robot) -> Iterable[Excited]:
    sizes = np.concatenate([candidate.sizes for candidate in found])
    scaled = sizes[:, None] * gram.matrix * sizes + np.eye(len(sizes))
    with np.errstate(divide='ignore'):
        alone = 1.0 / np.sqrt(np.maximum(np.diag(gram.matrix), 0.0))
    alone[alone > _ROUNDING * sizes] = np.inf
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    # of the identity and what the data add: rounding alone makes one less
    together = sizes * np.sqrt(np.sum(vectors**2 / np.maximum(eigenvalues, 1.0), axis=1))
    k = 0
    for candidate in found:
        for name, unit in _numbers(candidate, robot):
            size, own, beside = (float(v[k]) for v in (sizes, alone, together))
            yield Excited(candidate.kind.id, candidate.where, name, unit, size, own, beside)
            k += 1


def _numbers(candidate: Candidate, robot: Robot) -> Iterable[tuple[str, str]]:
    """Name and unit of each coefficient: the value that its direction moves."""
    still = {**candidate.kind.nominal(), **candidate.variant}
    for direction in candidate.directions:
        parameter = next(
            p
            for p in candidate.kind.parameters
            if p.role in PROPORTIONAL and direction[p.name] != still[p.name]
        )
        suffix = {'reciprocal': '^-1', 'square': '^2'}.get(parameter.role, '')
        unit = candidate.kind.unit_at(robot, candidate.where, parameter)
        unit = f'({unit}){suffix}' if suffix and unit else unit
        yield parameter.name, unit
