r"""Which extra motion would tell what the data could not.

What the data leave open is a subspace W of the unknowns t = [AAM; x]. Each motion of a small
family, from cheap (one joint alone) to dear (everything at once), is played on the estimate: the
base follows from the conservation of momentum, so the rows of

    0 = R^T h_W - sum_b R_b h_b - Y x - h0

hold exactly, as they will in flight. A motion tells those directions of W that its rows see once
h_W is eliminated. Motions are taken in the order of their cost, and within the same cost the one
that tells most, until nothing is left; a motion counts together with those before it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy.linalg
from scipy.spatial.transform import Rotation

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import Kinematics
from ..model.robot import Robot
from ..recording.record import Record
from ..types import Array
from .estimate import Estimate

_TIMES = np.linspace(0.0, 40.0, 161)  # s
_SWING = 1.0  # rad, halved where two or more joints move; less within narrow limits
_LEAST = 0.02  # rad of room; motions of less are as good as none
_PERIODS = (20.0, 13.0)  # s, of the first and the second moving joint
_TURN = 0.05  # rad/s of the base, which a star tracker still follows
_SEEN = 1e-3  # of what the motion shows best; noise in the regressor hides the rest
_ALONG = 0.7  # cosine to the estimate itself; noise turns the direction somewhat
_SCALE = 'the common scale of all numbers; only ratios are known otherwise'


@dataclass(frozen=True, slots=True)
class Advice:
    """One extra motion.

    Args:
        motion: In words; empty where no motion of the family tells the directions.
        tells: What it tells, in words, such as `J3xx with -1.00 J2xx`.
    """

    motion: str
    tells: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Probe:
    """Joints that swing, base axes that turn (0 to 2), and whether the own wheels spin up."""

    joints: tuple[int, ...] = ()
    turns: tuple[int, ...] = ()
    spins: bool = False

    def words(self, names: tuple[str, ...]) -> str:
        parts = []
        if self.joints:
            parts.append('move ' + ' and '.join(names[j] for j in self.joints))
        if self.turns:
            parts.append('turn the base about ' + ' and '.join('xyz'[a] for a in self.turns))
        if self.spins:
            parts.append("spin up the servicer's wheels")
        return ' while you '.join(parts)


def advise(model: MomentumModel, unknowns: Array, weak: Array, rest: Array) -> tuple[Advice, ...]:
    """Name the cheapest extra motions that tell the directions left open.

    Args:
        model: Robot and minimal set.
        unknowns: (3 n_links + k,) estimate [AAM; x], in N m s and kg m^2.
        weak: (m, 3 n_links + k) directions that the data leave open, in the units of `unknowns`.
        rest: (n,) where joints are held that do not move [rad].

    Returns:
        Motions in the order in which to add them; the last one, without a motion, holds the
        directions that none of them tells.
    """
    scale = _scale(model, unknowns)
    left = scipy.linalg.orth((weak / scale).T).T if len(weak) else weak
    names = model.names
    constants = _playable(model, unknowns, rest)
    advice = []
    if not np.any(model.robot.servicer_wheels.body_momentum):
        left, had_scale = _without_scale(left, unknowns / scale)
        if had_scale:
            advice.append(Advice(_Probe(spins=True).words(()), (_SCALE,)))
    joints = np.flatnonzero(np.abs(_room(model.robot, rest)) >= _LEAST).tolist()
    for tier in _family(joints):
        seen = {probe: _play(model, constants, probe, rest) * scale for probe in tier}
        while len(left):
            split = {probe: _split(rows, left) for probe, rows in seen.items()}
            best = max(split, key=lambda probe: len(split[probe][0]))
            found, others = split[best]
            if not len(found):
                break
            words = best.words(model.robot.joints)
            advice.append(Advice(words, directions_in_words(found * scale, names)))
            left = others
        if not len(left):
            return tuple(advice)
    return (*advice, Advice('', directions_in_words(left * scale, names)))


def advise_on(record: Record, model: MomentumModel, estimate: Estimate) -> tuple[Advice, ...]:
    """`advise` on an estimate from a record, joints held where they mostly were in it."""
    if record.joints is None or not len(estimate.weak):
        return ()
    rest = np.median(record.joints.position, axis=0)
    unknowns = np.concatenate([estimate.aam, estimate.parameters])
    return advise(model, unknowns, estimate.weak, rest)


def directions_in_words(directions: Array, names: tuple[str, ...]) -> tuple[str, ...]:
    """Directions as one unknown each and what else moves with it while the data stay the same.

    The basis is chosen for that: each direction has an unknown that no other has.

    Args:
        directions: (m, k), independent.
        names: (k,).
    """
    unit = directions / np.max(np.abs(directions), axis=1, keepdims=True)
    _, _, pivots = scipy.linalg.qr(unit, pivoting=True, mode='economic')
    own = pivots[: len(unit)]
    reduced = np.linalg.solve(unit[:, own], unit)
    return tuple(_describe(row, int(i), names) for i, row in zip(own, reduced, strict=True))


def _without_scale(left: Array, unknowns: Array) -> tuple[Array, bool]:
    """Orthonormal rows without the common scale of all unknowns, and whether they held it.

    Where the own wheels rest, the equations are homogeneous: the estimate itself is a direction
    that no motion tells. Noise turns it a little, which a motion must not be taken to see.
    """
    share = left @ unknowns / np.linalg.norm(unknowns)
    size = float(np.linalg.norm(share))
    if size < _ALONG:
        return left, False
    _, _, right = np.linalg.svd(share[None] / size)
    return right[1:] @ left, True


def _describe(row: Array, own: int, names: tuple[str, ...], most: int = 4) -> str:
    others = [i for i in np.argsort(-np.abs(row)) if i != own and abs(row[i]) > 0.01]
    if not others:
        return f'{names[own]} alone'
    terms = ' '.join(f'{row[i]:+.2f} {names[i]}' for i in others[:most])
    more = f' and {len(others) - most} more' if len(others) > most else ''
    return f'{names[own]} with {terms}{more}'


def _scale(model: MomentumModel, unknowns: Array) -> Array:
    """(3 n_links + k,) sizes of the unknowns that turn the base about as much."""
    inertia = float(np.max(np.abs(unknowns[model.n_aam :])))
    return np.where(np.arange(len(unknowns)) < model.n_aam, inertia * _TURN, inertia)


def _family(joints: list[int]) -> Iterator[list[_Probe]]:
    """Motions of some joints in tiers of rising cost."""
    single = [(j,) for j in joints]
    pairs = list(combinations(joints, 2))
    yield [_Probe(joints) for joints in single]
    yield [_Probe(spins=True)]
    yield [_Probe(turns=(axis,)) for axis in range(3)]
    for moved in (single, pairs):
        if moved is pairs:
            yield [_Probe(joints) for joints in pairs]
        yield [_Probe(joints, spins=True) for joints in moved]
        yield [_Probe(joints, (axis,)) for joints in moved for axis in range(3)]
    yield [_Probe(tuple(joints), (0, 1, 2), spins=True)]


def _play(model: MomentumModel, constants: Array, probe: _Probe, rest: Array) -> Array:
    """(3 N, 3 n_links + k) rows of a motion, h_W eliminated."""
    q, qd = _swing(model.robot, probe, rest)
    wheels = _spin_up(model, constants, probe)
    omega, rotation = _base(model, constants, probe, q, qd, wheels)
    columns, _ = model.regressor(Kinematics(_TIMES, q, qd, omega, rotation))
    rows = columns[..., : model.x.stop].reshape(-1, model.x.stop)
    free, wanted = rows[:, :3], rows[:, 3:]
    basis = np.linalg.qr(free)[0]
    return np.asarray(wanted - basis @ (basis.T @ wanted))


def _swing(robot: Robot, probe: _Probe, rest: Array) -> tuple[Array, Array]:
    """(N, n) positions and rates; joints start at rest, from where they are held.

    They swing to the side on which there is more room, as far and as fast as the URDF lets them.
    """
    half = 0.5 * _room(robot, rest)
    q, qd = np.tile(rest, (len(_TIMES), 1)), np.zeros((len(_TIMES), len(rest)))
    size = _SWING if len(probe.joints) == 1 else 0.5 * _SWING
    for i, joint in enumerate(probe.joints):
        rate = 2.0 * np.pi / (_PERIODS[i] if i < len(_PERIODS) else _PERIODS[0] / (1.0 + i))
        reach = min(size, abs(half[joint]), robot.velocity_limits[joint] / rate)
        far = np.copysign(reach, half[joint])
        q[:, joint] += far * (1.0 - np.cos(rate * _TIMES))
        qd[:, joint] = far * rate * np.sin(rate * _TIMES)
    return q, qd


def _room(robot: Robot, rest: Array) -> Array:
    """(n,) from where joints are held to the limit that is further away [rad]."""
    low, high = (robot.position_limits - rest[:, None]).T
    return np.where(high >= -low, np.maximum(high, 0.0), np.minimum(low, 0.0))


def _spin_up(model: MomentumModel, constants: Array, probe: _Probe) -> Array:
    """(N, 3) momentum of the own wheels, in the base frame."""
    h0 = np.tile(model.robot.servicer_wheels.body_momentum, (len(_TIMES), 1))
    if probe.spins:
        size = _TURN * np.max(np.abs(constants[model.x]))
        h0 = h0 + size * np.outer(_TIMES / _TIMES[-1], [1.0, 0.7, -0.5])
    return h0


def _base(
    model: MomentumModel, constants: Array, probe: _Probe, q: Array, qd: Array, wheels: Array
) -> tuple[Array, Rotation]:
    """Body rates (N, 3) and attitudes by which the total momentum stays what it was at first."""
    inertia = model.inertia(q, constants)[:, :3, :3]
    omega = np.zeros((len(q), 3))
    still = Kinematics(_TIMES, q, qd, omega, Rotation.identity(len(q)))
    known = wheels - model.regressor(still)[0] @ constants  # its h_W is zero
    inverse = np.linalg.inv(inertia)
    omega[0, list(probe.turns)] = _TURN
    total = inertia[0] @ omega[0] + known[0]
    attitudes = [Rotation.identity()]
    for i in range(1, len(q)):
        step = float(_TIMES[i] - _TIMES[i - 1])
        attitudes.append(attitudes[-1] * Rotation.from_rotvec(step * omega[i - 1]))
        omega[i] = inverse[i] @ (attitudes[-1].inv().apply(total) - known[i])
    return omega, Rotation.concatenate(attitudes)


def _playable(model: MomentumModel, unknowns: Array, rest: Array) -> Array:
    """(p,) constants to play motions on: the estimate, or the robot file's where it is no body."""
    rotating = _swing(model.robot, _Probe(tuple(range(model.n))), rest)[0]
    others = np.zeros(model.nuisances.size)
    constants = np.concatenate([np.zeros(3), unknowns, others])
    positive = np.linalg.eigvalsh(model.inertia(rotating, constants)[:, :3, :3]) > 0.0
    return constants if np.all(positive) else model.prior()


def _split(rows: Array, left: Array) -> tuple[Array, Array]:
    """Orthonormal rows of `left`, turned into those that a motion tells and the others."""
    best = np.linalg.norm(rows, ord=2)
    _, singular, right = np.linalg.svd(rows @ left.T, full_matrices=True)
    count = int(np.sum(singular > _SEEN * best)) if best > 0.0 else 0
    turned = right @ left
    return turned[:count], turned[count:]
