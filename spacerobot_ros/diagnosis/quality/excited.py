r"""What a motion tells of every unknown: the catalogue's effects at every place.

G is the information of the data on small amounts of all effects (columns as the diagnosis makes
them), S their plausible sizes. Of one coefficient the data alone tell

    alone    = G_ii^-1/2                           were it the only unknown
    together = ((G + S^-2)^-1)_ii^1/2              beside all others of plausible size

An unknown is told where three of these standard deviations are less than its plausible size.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np

from ...effects.catalogue import kinds_beside
from ...effects.effect import Effect
from ...effects.robot_file import RobotFile
from ...estimation.balance.arm_levels import leftover_levels
from ...estimation.balance.arm_rows import ArmRows
from ...estimation.balance.balance import balance_of
from ...estimation.columns import Candidate, Signatures, candidates
from ...estimation.inference.evidence import Gram, sum_of
from ...estimation.noise_levels import noise_levels
from ...estimation.runs import Run
from ...estimation.scaling import PROPORTIONAL
from ...estimation.trajectory.observations import observed
from ...model.robot import Robot
from ...recording.faults.thresholds import is_short
from ...recording.record import Record
from ...types import Array
from ..arms.arm_found import refuse_rest

_STRETCH = 60.0  # s that are judged at once: bounds memory, and an initial state more is cheap
_STRETCHES = 5  # of a long record, evenly spread
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

    def to_json(self) -> dict[str, object]:
        """As in the command's JSON."""
        names = ('effect', 'where', 'parameter', 'unit', 'size', 'alone', 'together', 'status')
        return {name: getattr(self, name) for name in names}


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
        found, gram = _of_balance(record, file, kinds)
    else:
        found, gram = _of_prediction(record, file, kinds)
    return tuple(_judged(*_compatible(found, gram), file.robot))


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
) -> tuple[Sequence[Candidate], Gram]:
    """Free base: momentum and torques at the level of the sensors' noise."""
    noise, _ = noise_levels(file.robot.sensors, record)
    found: list[Candidate] | None = None
    grams = []
    for part in _stretches(record):
        rows = Run(part, file.robot, file.effects, noise, 'sampled').rows(())
        found = found or candidates(kinds, rows)
        signatures = Signatures(rows)
        columns = [signatures.whitened(candidate.small_steps) for candidate in found]
        grams.append(Gram.of(np.concatenate(columns, axis=1), rows.data))
    return found or [], reduce(add, grams)


def _stretches(record: Record) -> Iterable[Record]:
    """Parts of a record of a minute at most."""
    start, end = record.span
    if end - start <= 1.5 * _STRETCH:
        return [record]
    starts = np.linspace(start, end - _STRETCH, _STRETCHES) if end - start > _STRETCH else [start]
    parts = [record.between(float(t) - 1e-9, float(t) + _STRETCH) for t in starts]
    return [part for part in parts if not is_short(part.joint_time)]


def _compatible(found: Sequence[Candidate], gram: Gram) -> tuple[Sequence[Candidate], Gram]:
    """Those that can act together: of one law's special cases and first guesses the first."""
    kept: list[Candidate] = []
    places: list[int] = []
    k = 0
    for candidate in found:
        if not (candidate.repeats(kept) or candidate.contradicts(kept)):
            kept.append(candidate)
            places += range(k, k + len(candidate.steps))
        k += len(candidate.steps)
    return kept, gram.part(np.array(places, dtype=int))


def _judged(found: Sequence[Candidate], gram: Gram, robot: Robot) -> Iterable[Excited]:
    sizes = np.concatenate([candidate.sizes for candidate in found])
    scaled = sizes[:, None] * gram.matrix * sizes + np.eye(len(sizes))
    with np.errstate(divide='ignore'):
        alone = 1.0 / np.sqrt(np.maximum(np.diag(gram.matrix), 0.0))
    eigenvalues, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    # of the identity and what the data add: rounding alone makes one less
    together = sizes * np.sqrt(np.sum(vectors**2 / np.maximum(eigenvalues, 1.0), axis=1))
    k = 0
    for candidate in found:
        for name, unit in _numbers(candidate, robot):
            values: list[Array] = [sizes, alone, together]
            size, own, beside = (float(v[k]) for v in values)
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
