r"""Which extra motion would make the wheel momentum known, and by how much.

Each motion of a small family, from cheap (one joint alone) to dear (all joints at once), is played
on the estimate: the base follows from the conservation of momentum, within the limits of joints
and base. With C the covariance of [AAM; y] from the data and F what the motion tells of them
(`information.Information`),

    C' = (C^-1 + F)^-1

has the deviations of the AAM after it. Those that shrink the largest of them most for their cost
are named. Pairs are made of the best single joints alone, so the cost is linear in the joints but
for the unknowns.

Symbols: T times, n joints, m unknowns [AAM; y].
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.base_response import BaseMotion, BaseResponse, BaseStart
from ..estimation.trajectory.motion_limits import Limits
from ..formats import counted
from ..model.settings import Settings, SimulatorSettings
from ..recording.record import Record
from ..types import Array
from .information import Information, with_typical
from .momentum_posterior import MomentumPosterior
from .summary import Identification

_TIMES = np.linspace(0.0, 40.0, 161)  # s
_SWING = 1.0  # rad or m of one joint, halved where more move; less within narrow limits
_PERIODS = (20.0, 8.0)  # s, of the first and the last moving joint
_LEAST = 0.02  # rad or m of amplitude; motions of less are as good as none
_TURN = 0.05  # rad/s of the base, which a star tracker still follows
_SPIN = np.array([1.0, 0.7, -0.5]) / np.linalg.norm([1.0, 0.7, -0.5])
_USE = 0.98  # of every limit
_AMPLE = 0.8  # of the limits that resting joints may use, for the base to keep its rate
_ROUNDS = 6  # of scaling a motion to its limits
_BEST = 4  # single joints of which pairs are made
_MOST, _CHEAP = 5, 3  # motions that are named; single joints among them
_WORTH = 1.5  # times better known, or not worth a word where the estimate is valid
_MORE = 1.25  # times better than what is cheaper
_SEEN = 1.05  # times better known, or the motion tells nothing
_WELL = 0.2  # of the limit of validity: well below it


@dataclass(frozen=True, slots=True)
class Advice:
    """One extra motion.

    Args:
        motion: In words; empty where no motion of the family tells more.
        tells: What it tells, in words.
        aam_std: Largest standard deviation of the AAM after it [N m s].
        factor: By how much that is smaller than now.
    """

    motion: str
    tells: tuple[str, ...]
    aam_std: float
    factor: float


class _Probe(NamedTuple):
    """Joints that swing, the base axis that turns (0 to 2), and whether the own wheels spin up."""

    joints: tuple[int, ...] = ()
    turn: int | None = None
    spins: bool = False

    @property
    def cost(self) -> int:
        return len(self.joints) + 2 * (self.turn is not None) + 2 * self.spins


class _Tried(NamedTuple):
    """A probe as large as the limits leave it; `worst` is the AAM's largest deviation after it."""

    probe: _Probe
    words: str
    worst: float
    better: int


def advise_on(record: Record, found: Identification, settings: Settings) -> tuple[Advice, ...]:
    """Name the extra motions that tell most of the wheel momentum for their cost.

    Args:
        record: What the estimate is from; its joints are taken to be held where they mostly were.
        found: The estimate.
        settings: The robot file's, for the limits.

    Returns:
        At most five, cheap ones first; none where the AAM is known well enough or bodies were not
        sought, and a single one without a motion where none tells more.
    """
    posterior = found.posterior
    if found.model is None or posterior is None or not found.model.n_aam:
        return ()
    worst = float(np.max(np.sqrt(np.diag(posterior.covariance))[found.model.aam]))
    if worst < _WELL * found.limit:
        return ()
    range_ = _Range(record, found.model, posterior, settings)
    tried = range_.try_all()
    is_valid = worst <= found.limit
    least = _WORTH if is_valid else _SEEN
    kept = _worth_saying([one for one in tried if one.worst * least < worst], worst)
    if not kept and not is_valid:
        words = f'none of {len(tried)} motions within the limits of joints and base tells more'
        return (Advice('', (f'wheel momentum +- {worst:.2g} N m s: {words}',), worst, 1.0),)
    return tuple(
        Advice(range_.hint + one.words, tuple(_tells(one, worst)), one.worst, worst / one.worst)
        for one in kept
    )


def _tells(one: _Tried, now: float) -> Iterator[str]:
    yield (
        f'wheel momentum +- {now:.2g} -> +- {one.worst:.2g} N m s in {_TIMES[-1]:g} s '
        f'({now / one.worst:.2g} times better)'
    )
    if one.better:
        yield f'{counted(one.better, "number")} of the bodies at least twice as well'


def _worth_saying(tried: Sequence[_Tried], now: float) -> list[_Tried]:
    """The best single joints, and the best of each cost where it beats all that is cheaper."""
    kept: list[_Tried] = []
    for cost in sorted({one.probe.cost for one in tried}):
        best = min((one for one in tried if one.probe.cost == cost), key=lambda one: one.worst)
        if best.worst * _MORE < min((one.worst for one in kept), default=np.inf):
            kept.append(best)
    cheap = sorted((one for one in tried if one.probe.cost == 1), key=lambda one: one.worst)
    kept += [one for one in cheap[:_CHEAP] if one not in kept]
    kept.sort(key=lambda one: np.log(one.worst / now) / (1.0 + one.probe.cost))
    return sorted(kept[:_MOST], key=lambda one: (one.probe.cost, one.worst))


class _Range:
    """Motions within the limits of one robot, and what they tell beside an estimate.

    Attributes:
        hint: What is to be done before any of them, in words.
    """

    def __init__(
        self,
        record: Record,
        model: MomentumModel,
        posterior: MomentumPosterior,
        settings: Settings,
    ) -> None:
        self._model = model
        self._robot = robot = model.robot_at(posterior.mean)
        self._limits = limits = Limits(robot, settings.excitation)
        self._rest = np.clip(np.median(record.q, axis=0), limits.lower, limits.upper)
        rates, (noise, _) = _rates(record, settings.simulator), with_typical(robot.sensors)
        self._information = Information(model, posterior.mean, noise, rates, settings.identifier)
        head, prior = slice(3, model.y.stop), self._information.prior_std
        self._covariance = posterior.covariance[head, head] / np.outer(prior, prior)
        base = BaseResponse(robot)
        place = _swing(_Probe(), np.zeros(model.n), self._rest)
        still = BaseStart(np.array([0.0, 0.0, 0.0, 1.0]), np.zeros(3))
        rested = base.move(_TIMES, *place, still)
        self._inverse = rested.inverse[0, 0]
        self._spin = _TURN * np.linalg.solve(self._inverse, _SPIN)
        # the rate that is left once the joints rest, in the attitude that was measured last
        attitude = record.attitude_xyzw[-1] if len(record.attitude_time) else still.attitude_xyzw
        total = Rotation.from_quat(attitude).inv().apply(posterior.mean[:3])
        omega = self._inverse @ (total - rested.h_W[0])
        self._start = BaseStart(attitude, omega)
        kept = self._use(base.move(_TIMES, *place, self._start)) <= _AMPLE
        self.hint = '' if kept else 'bring the base to rest, then '
        if not kept:
            self._start = BaseStart(attitude, np.zeros(3))

    def try_all(self) -> list[_Tried]:
        """The family, the pairs of the best singles included."""
        joints = range(self._model.n)
        singles = self._try([_Probe((j,)) for j in joints])
        best = sorted(singles, key=lambda one: one.worst)[:_BEST]
        chosen = [one.probe.joints for one in best]
        more = [*(_Probe(turn=axis) for axis in range(3)), _Probe(spins=True)]
        more += [_Probe(tuple(sorted(a + b))) for a, b in combinations(chosen, 2)]
        more += [_Probe(one, spins=True) for one in chosen[:2]]
        more += [_Probe(one, turn=axis) for one in chosen[:1] for axis in range(3)]
        if len(joints) > 2:
            more.append(_Probe(tuple(joints)))
        return singles + self._try(more)

    def _try(self, probes: Iterable[_Probe]) -> list[_Tried]:
        n, now, out = self._model.n_aam, np.sqrt(np.diag(self._covariance)), []
        for probe, words, motion in filter(None, map(self._play, probes)):
            std = self._after(motion)
            worst = float(np.max(std[:n] * self._information.prior_std[:n]))
            out.append(_Tried(probe, words, worst, int(np.sum(2.0 * std[n:] < now[n:]))))
        return out

    def _after(self, motion: BaseMotion) -> Array:
        """(m,) deviations of [AAM; y] after a motion, in those of the prior."""
        now, told = self._covariance, self._information.fisher(motion)[0]
        after = np.linalg.solve(np.eye(len(now)) + now @ told, now)
        return np.sqrt(np.maximum(np.diag(after), 0.0))

    def _play(self, probe: _Probe) -> tuple[_Probe, str, BaseMotion] | None:
        """The motion, as large as the limits allow, in words; None where they leave nothing."""
        share = 1.0
        for _ in range(_ROUNDS):
            reach, motion = self._motion(probe, share)
            if (use := self._use(motion)) <= 1.0:
                break
            share *= max(_USE / use, 0.3)
        moved = np.abs(reach[list(probe.joints)])
        if use > 1.0 or np.any(moved < _LEAST) or share < _LEAST:
            return None
        return probe, self._words(probe, reach, share), motion

    def _motion(self, probe: _Probe, share: float) -> tuple[Array, BaseMotion]:
        """(n,) amplitudes of the joints, and the motion, with a share of its full size."""
        robot, omega, reach = self._robot, self._start.omega, share * self._reach(probe)
        if probe.spins:
            spin = share * self._spin
            robot = robot.with_servicer_momentum(robot.servicer_momentum + spin)
            omega = omega - self._inverse @ spin
        if probe.turn is not None:
            omega = omega + share * _TURN * np.eye(3)[probe.turn]
        start = BaseStart(self._start.attitude_xyzw, omega)
        return reach, BaseResponse(robot).move(_TIMES, *_swing(probe, reach, self._rest), start)

    def _words(self, probe: _Probe, reach: Array, share: float) -> str:
        robot, parts = self._robot, []
        if len(probe.joints) == len(robot.joints) > 2:
            parts.append('move all joints at once')
        elif probe.joints:
            moved = (
                f'{robot.joints[j]} by {2.0 * reach[j]:+.2g} '
                f'{robot.unit_of("rad", robot.joints[j])} and back in {period:g} s'
                for j, period in zip(probe.joints, _periods(probe), strict=True)
            )
            parts.append('move ' + ', '.join(moved))
        if probe.turn is not None:
            rate = share * _TURN
            parts.append(f'turn the base about {"xyz"[probe.turn]} by {rate:.2g} rad/s')
        if probe.spins:
            size = share * float(np.linalg.norm(self._spin))
            parts.append(f"spin up the servicer's wheels by {size:.2g} N m s")
        return ' while you '.join(parts)

    def _reach(self, probe: _Probe) -> Array:
        """(n,) signed amplitudes: to the side with more room, as far and as fast as allowed."""
        limits, out = self._limits, np.zeros(len(self._rest))
        size = _SWING if len(probe.joints) == 1 else 0.5 * _SWING
        up, down = limits.upper - self._rest, limits.lower - self._rest
        half = 0.5 * np.where(up >= -down, up, down)
        for joint, period in zip(probe.joints, _periods(probe), strict=True):
            reach = min(size, abs(half[joint]), limits.rate[joint] * period / (2.0 * np.pi))
            out[joint] = _USE * np.copysign(reach, half[joint])
        return out

    def _use(self, motion: BaseMotion) -> float:
        return float(np.max(self._limits.fractions(motion), initial=0.0))


def _periods(probe: _Probe) -> Array:
    """(k,) of the joints that move [s]."""
    return np.linspace(*_PERIODS, len(probe.joints))


def _swing(probe: _Probe, reach: Array, rest: Array) -> tuple[Array, Array, Array]:
    """(1, T, n) positions, rates and accelerations: joints start at rest, where they are held."""
    q = np.tile(rest, (1, len(_TIMES), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    for joint, period in zip(probe.joints, _periods(probe), strict=True):
        rate, far = 2.0 * np.pi / period, reach[joint]
        q[..., joint] += far * (1.0 - np.cos(rate * _TIMES))
        qd[..., joint] = far * rate * np.sin(rate * _TIMES)
        qdd[..., joint] = far * rate**2 * np.cos(rate * _TIMES)
    return q, qd, qdd


def _rates(record: Record, usual: SimulatorSettings) -> SimulatorSettings:
    """How often the sensors sampled."""
    times = {
        'joint_rate': record.joint_time,
        'imu_rate': record.rate_time,
        'attitude_rate': record.attitude_time,
    }
    found = {name: 1.0 / float(np.median(np.diff(t))) for name, t in times.items() if len(t) > 1}
    return replace(usual, **found)  # type: ignore[arg-type]  # rates alone
