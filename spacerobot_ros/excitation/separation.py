r"""How well a motion tells two effects apart, and the motion that does it best.

The diagnosis sees an effect as whitened columns A of prediction errors, here of a noise-free
record of the motion, scaled to the effect's plausible size. What another effect B can not imitate
of it, with amounts as plausible as any, is

    T_A = tr(A^T A - A^T B (B^T B + I)^-1 B^T A) / K

over the K numbers of A: half of it is the gap in log likelihood at which A of plausible size
stands over B. Two effects are told apart as well as the harder of both ways, A from B and B from
A; the logarithms' mean is what the search raises. Where one effect is a special case of the other,
one way is closed on every motion, and the search raises the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..effects.effect import Effect
from ..effects.robot_file import RobotFile
from ..errors import ConfigurationError
from ..estimation.columns import Signatures, candidate_at
from ..estimation.fit import Fit
from ..estimation.runs import Run
from ..estimation.trajectory.base_response import noise_free_record
from ..identification.information import with_typical
from ..inference.decisive import CONFOUNDED
from ..inference.gram import Gram
from ..json_values import json_as
from ..model.robot import Robot
from ..types import Array
from .motions import SAFE, Motions

_OWN, _REFINED = 'robot file', ', refined'
_LEVELS = (1.0, 0.4)  # of the limits, by the motions to compare
_PACES = (1.0, 0.5, 2.0)  # of the duration
_CHANGE = 0.3  # of the amplitudes, by a step of the refinement
_NOTHING = 1e-6  # T below which an effect is not told apart at all


class Place(NamedTuple):
    """An effect at a place: one side of the question."""

    kind: type[Effect]
    where: str | None

    @property
    def name(self) -> str:
        """As the command line says it."""
        return self.kind.id if self.where is None else f'{self.kind.id}@{self.where}'


@dataclass(frozen=True, slots=True)
class Contrast:
    """How one effect stands out against the other.

    Args:
        visible: Standard deviations of the noise by which its plausible size stands out at all.
        apart: The same of the part that the other effect can not imitate.
    """

    json_too = ('sine', 'smallest')
    visible: float = json_as('seen')
    apart: float = json_as('told')

    @property
    def sine(self) -> float:
        """Share of the signature that the other effect can not imitate, 0 to 1."""
        return self.apart / self.visible if self.visible > 0.0 else 0.0

    @property
    def smallest(self) -> float:
        """Smallest share of its plausible size that is told from the other effect."""
        return math.sqrt(2.0 * CONFOUNDED) / self.apart if self.apart > 0.0 else math.inf

    @classmethod
    def of(cls, own: Array, other: Array) -> Contrast:
        """Of whitened columns (R, K) against others (R, L)."""
        gram, count = Gram.of(np.hstack([other, own]), np.zeros(len(own))), other.shape[1]
        parts = own.T @ own, gram.without(count, np.ones(count)).matrix
        size = max(1, own.shape[1])
        return cls(*(math.sqrt(max(float(np.trace(part)), 0.0) / size) for part in parts))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trial:
    """A motion with what it tells.

    Args:
        motions: The family that it is from. x: (size,) amplitudes [rad].
        origin: Where it comes from.
        first: The first effect from the second. second: The other way.
    """

    motions: Motions
    x: Array
    origin: str
    first: Contrast
    second: Contrast

    @property
    def score(self) -> float:
        """Mean logarithm of how far the effects are apart; larger is better."""
        return 0.5 * sum(math.log(max(c.apart, _NOTHING)) for c in (self.first, self.second))

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        sides, duration = [self.first, self.second], self.motions.family.duration
        return {'origin': self.origin, 'duration': duration, 'sides': sides}


class Separated(NamedTuple):
    """Result of the search: the best motion, and the file's own for comparison if it has one."""

    best: Trial
    own: Trial | None
    tried: int


def separate(
    file: RobotFile,
    places: tuple[Place, Place],
    duration: float | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> Separated:
    """Find the motion that best tells two effects apart.

    Random motions of several paces and amplitudes, and the robot file's own, are compared; the
    best is then changed step by step as long as that helps.

    Args:
        file: The robot file; `excitation` has limits, starts, steps and seed.
        places: The two effects.
        duration: Of the motion [s]; None: the file's, half and twice of it are tried.
        progress: Called with the number of motions tried, of `budget(file, duration)`.

    Raises:
        ConfigurationError: limits that leave no motion, or an effect that leaves no robot.
    """
    rng = np.random.default_rng(file.settings.excitation.seed)
    trials: list[Trial] = []

    def try_out(motions: Motions, x: Array, origin: str) -> Trial:
        trials.append(trial(file, motions, x, origin, places))
        progress(len(trials))
        return trials[-1]

    for start in _starts(file, duration, rng):
        try_out(*start)
    own = next((t for t in trials if t.origin == _OWN), None)
    best = max(trials, key=lambda t: t.score)
    for _ in range(_steps(file)):
        step = _CHANGE * np.sqrt(np.mean(best.x**2)) * rng.standard_normal(len(best.x))
        origin = f'{best.origin.removesuffix(_REFINED)}{_REFINED}'
        changed = try_out(best.motions, best.motions.scaled(best.x + step), origin)
        best = max(best, changed, key=lambda t: t.score)
    return Separated(best, own, len(trials))


def budget(file: RobotFile, duration: float | None = None) -> int:
    """Number of motions that `separate` tries at most."""
    paces = len(_PACES) if duration is None else 1
    return paces * len(_LEVELS) * (file.settings.excitation.starts + 1) + _steps(file)


def trial(
    file: RobotFile, motions: Motions, x: Array, origin: str, places: tuple[Place, Place]
) -> Trial:
    """What one motion tells of two effects."""
    noise, _ = with_typical(file.settings.sensors)
    rates = file.settings.simulator
    times = np.arange(0.0, motions.family.duration, 1.0 / rates.joint_rate)
    motion = motions.move(x[None], motions.family.at(times))
    record = noise_free_record(motions.robot, motion, rates)
    run = Run(record, file.robot, file.effects, noise, 'sampled')
    fit = Fit(run, ())
    first, second = (_directions(place, fit.rows.robot) for place in places)
    both = Signatures(fit.rows).whitened([*first, *second])
    columns = both[:, : len(first)], both[:, len(first) :]
    ways = {'first': Contrast.of(*columns), 'second': Contrast.of(*columns[::-1])}
    return Trial(motions=motions, x=x, origin=origin, **ways)


def _directions(place: Place, robot: Robot) -> list[tuple[Effect, float]]:
    """A small step from doing nothing for each number of an effect, as a share of its size."""
    variants = place.kind.variants(robot, place.where)
    found = candidate_at(place.kind, robot, place.where, variants[len(variants) // 2])
    if found is None:
        raise ConfigurationError('--separate', f'{place.name} leaves no physical robot')
    shares = (found.steps / found.sizes).tolist()
    return [(found.applied(d), share) for d, share in zip(found.directions, shares, strict=True)]


def _starts(
    file: RobotFile, duration: float | None, rng: np.random.Generator
) -> Iterator[tuple[Motions, Array, str]]:
    """Motions to compare: the file's own first, then random ones, of every pace and amplitude."""
    options = file.settings.excitation
    paces = _PACES if duration is None else (1.0,)
    for pace in paces:
        motions = Motions(file.believed, file.settings, pace * (duration or options.duration))
        for level in _LEVELS:
            own = motions.own()
            if own is not None:
                is_own_pace = motions.family.duration == file.settings.reference.duration
                is_own = level == 1.0 and is_own_pace
                yield motions, level * own, _OWN if is_own else f'{_OWN}, changed'
            for _ in range(options.starts):
                yield motions, level * motions.random(rng, SAFE), 'random'


def _steps(file: RobotFile) -> int:
    return min(file.settings.excitation.iterations, 8)
