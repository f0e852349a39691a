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
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from ..effects.effect import Effect
from ..effects.parameter import Parameter
from ..effects.robot_file import RobotFile
from ..estimation.columns import Signatures
from ..estimation.reference import NoiseLevels
from ..estimation.refit import Fit, Run
from ..model.settings import SensorSettings
from ..recording.record import AttitudeSeries, JointSeries, RateSeries, Record, to_stamps
from ..types import Array
from .design import scaled_to_limits
from .information import TYPICAL, with_typical
from .motions import Motions

GAP = 6.0
"""Gap in log evidence from which the diagnosis names one effect rather than the other."""
_STEP = 1e-3  # of a plausible size: where a column is taken
_SAFE = 1.0 - 1e-6  # of the limits
_OWN = 'robot file'
_LEVELS = (1.0, 0.4)  # of the limits, by the motions to compare
_PACES = (1.0, 0.5, 2.0)  # of the duration
_CHANGE = 0.3  # of the amplitudes, by a step of the refinement
_NOTHING = 1e-6  # T below which an effect is not told at all
_LONGEST_FREE = 1.0  # plausible size of a parameter that states none


@dataclass(frozen=True, slots=True, eq=False)
class Place:
    """An effect at a place: one side of the question."""

    kind: type[Effect]
    where: str | None

    @property
    def name(self) -> str:
        """As the command line says it."""
        return self.kind.id if self.where is None else f'{self.kind.id}@{self.where}'


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """How one effect is told from the other.

    Args:
        seen: Standard deviations of the noise by which its plausible size stands out at all.
        told: The same of the part that the other effect can not imitate.
    """

    seen: float
    told: float

    @property
    def sine(self) -> float:
        """Share of the signature that the other effect can not imitate, 0 to 1."""
        return self.told / self.seen if self.seen > 0.0 else 0.0

    @property
    def smallest(self) -> float:
        """Smallest share of its plausible size that is told from the other effect."""
        return math.sqrt(2.0 * GAP) / self.told if self.told > 0.0 else math.inf


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Flight:
    """A motion with what it tells.

    Args:
        motions: The family that it is from. x: (size,) amplitudes [rad].
        origin: Where it comes from.
        first: The first effect from the second. second: The other way.
    """

    motions: Motions
    x: Array
    origin: str
    first: Told
    second: Told

    @property
    def score(self) -> float:
        """Mean logarithm of what is told; larger is better."""
        return 0.5 * sum(math.log(max(t.told, _NOTHING)) for t in (self.first, self.second))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Separated:
    """Result of the search: the best motion, and the file's own for comparison if it has one."""

    best: Flight
    own: Flight | None
    tried: int


def separate(
    file: RobotFile,
    first: Place,
    second: Place,
    duration: float | None = None,
    progress: Callable[[int], None] = lambda _: None,
) -> Separated:
    """Find the motion that best tells two effects apart.

    Random motions of several paces and amplitudes, and the robot file's own, are compared; the
    best is then changed step by step as long as that helps.

    Args:
        file: The robot file; `excitation` has limits, starts, steps and seed.
        first: An effect.
        second: The other one.
        duration: Of the motion [s]; None: the file's, half and twice of it are tried.
        progress: Called with the number of motions tried, of `budget(file, duration)`.

    Raises:
        ConfigurationError: limits that leave no motion.
    """
    rng = np.random.default_rng(file.settings.excitation.seed)
    flights: list[Flight] = []

    def try_out(motions: Motions, x: Array, origin: str) -> Flight:
        flights.append(fly(file, motions, x, origin, (first, second)))
        progress(len(flights))
        return flights[-1]

    for start in _starts(file, duration, rng):
        try_out(*start)
    own = next((f for f in flights if f.origin == _OWN), None)
    best = max(flights, key=lambda f: f.score)
    for _ in range(_steps(file)):
        changed = try_out(best.motions, _changed(best, rng), f'{best.origin}, refined')
        if changed.score > best.score:
            best = replace(changed, origin=changed.origin.replace(', refined' * 2, ', refined'))
    return Separated(best=best, own=own, tried=len(flights))


def budget(file: RobotFile, duration: float | None = None) -> int:
    """Number of motions that `separate` tries at most."""
    paces = len(_PACES) if duration is None else 1
    return paces * len(_LEVELS) * (file.settings.excitation.starts + 1) + _steps(file)


def fly(
    file: RobotFile, motions: Motions, x: Array, origin: str, places: tuple[Place, Place]
) -> Flight:
    """What one motion tells of two effects."""
    run = Run(_record(file, motions, x), file.robot, file.effects, _noise(file), 'sampled')
    columns = _columns(Fit(run, ()), places)
    first, second = (_told(a, b) for a, b in (columns, columns[::-1]))
    return Flight(motions=motions, x=x, origin=origin, first=first, second=second)


def _told(own: Array, other: Array) -> Told:
    total = own.T @ own
    held = other.T @ other + np.eye(other.shape[1])
    across = other.T @ own
    left = total - across.T @ np.linalg.solve(held, across)
    size = max(1, len(total))
    return Told(
        seen=math.sqrt(max(float(np.trace(total)), 0.0) / size),
        told=math.sqrt(max(float(np.trace(left)), 0.0) / size),
    )


def _columns(fit: Fit, places: tuple[Place, Place]) -> tuple[Array, Array]:
    """Whitened signatures of both effects at their plausible sizes."""
    directions = [_directions(place, fit) for place in places]
    both = Signatures(fit.filter).whitened([*directions[0], *directions[1]])
    cut = len(directions[0])
    return both[:, :cut], both[:, cut:]


def _directions(place: Place, fit: Fit) -> list[tuple[Effect, float]]:
    """A small step from doing nothing for each number of an effect, as a share of its size."""
    kind, where = place.kind, place.where
    variants = kind.variants(fit.filter.process.robot, where)
    still = {**kind.nominal(), **variants[len(variants) // 2]}
    phase = next((p.name for p in kind.parameters if p.role == 'phase'), None)
    out: list[tuple[Effect, float]] = []
    for p in kind.parameters:
        if p.role in ('phase', 'search'):
            continue
        turns = (0.0, 0.5 * math.pi) if phase is not None and not out else (None,)
        for turn in turns:
            values = {**still, p.name: _small(p)}
            if phase is not None and turn is not None:
                values[phase] = turn
            applied = kind(name=place.name, where=where, values=values)
            out.append((applied, _STEP))
    return out


def _small(p: Parameter) -> float:
    """A parameter's value a small step from doing nothing."""
    size = _STEP * (p.size if math.isfinite(p.size) else _LONGEST_FREE)
    if p.role == 'reciprocal':
        return 1.0 / size
    return p.nominal + (math.sqrt(size) if p.role == 'square' else size)


def _starts(
    file: RobotFile, duration: float | None, rng: np.random.Generator
) -> Iterator[tuple[Motions, Array, str]]:
    """Motions to compare: the file's own first, then random ones, of every pace and amplitude."""
    options = file.settings.excitation
    paces = _PACES if duration is None else (1.0,)
    for pace in paces:
        motions = Motions(file.believed, file.settings, pace * (duration or options.duration))
        for level in _LEVELS:
            own = _own(file, motions)
            if own is not None:
                is_own = (
                    level == 1.0 and motions.family.duration == file.settings.reference.duration
                )
                yield motions, level * own, _OWN if is_own else f'{_OWN}, changed'
            for _ in range(options.starts):
                shape = (motions.robot.n_joints, 2, motions.family.harmonics)
                x = rng.standard_normal(shape) / np.arange(1, motions.family.harmonics + 1)
                x = scaled_to_limits(motions, x.ravel(), _SAFE, np.inf)
                yield motions, level * x, 'random'


def _own(file: RobotFile, motions: Motions) -> Array | None:
    reference = file.settings.reference
    if reference.kind != 'fourier':
        return None
    x = motions.family.amplitudes(reference)
    return scaled_to_limits(motions, x, _SAFE, 1.0) if np.any(x) else None


def _changed(flight: Flight, rng: np.random.Generator) -> Array:
    """Amplitudes near a flight's, within the limits."""
    step = _CHANGE * np.sqrt(np.mean(flight.x**2)) * rng.standard_normal(len(flight.x))
    return scaled_to_limits(flight.motions, flight.x + step, _SAFE, 1.0)


def _steps(file: RobotFile) -> int:
    return min(file.settings.excitation.iterations, 8)


def _record(file: RobotFile, motions: Motions, x: Array) -> Record:
    """Noise-free samples of a motion at the sensors' rates."""
    rates = file.settings.simulator
    times = np.arange(0.0, motions.family.duration, 1.0 / rates.joint_rate)
    motion = motions.move(x[None], motions.family.at(times))
    every = max(1, round(rates.joint_rate / rates.attitude_rate))
    is_free = motions.robot.is_free
    stamps = to_stamps(times)
    joints = JointSeries(motions.robot.joints, stamps, motion.q[0], motion.qd[0], motion.torque[0])
    if not is_free:
        return Record(joints=joints)
    q_xyzw = Rotation.from_matrix(motion.R_WB[0, ::every]).as_quat()
    return Record(
        joints=joints,
        rates=RateSeries(stamps, motion.omega[0]),
        attitudes=AttitudeSeries(stamps[::every], q_xyzw),
    )


def _noise(file: RobotFile) -> NoiseLevels:
    """Of one sample, typical where the file states none."""
    stated: SensorSettings = with_typical(file.settings.sensors)[0]

    def std(name: str) -> float:
        return float(getattr(stated, name) or getattr(TYPICAL, name))

    return NoiseLevels(
        joint_position=std('joint_position_std'),
        joint_velocity=std('joint_velocity_std'),
        joint_effort=std('joint_effort_std'),
        gyro=std('gyro_std'),
        attitude=std('attitude_std'),
    )
