r"""Faults that only the robot's dynamics shows: slips in all columns of a joint.

Along the measured motion the model asks for the torques

    tau = H(q) q'' + c(q, q', omega)                     # base eliminated; docs/equations.md

Where the measured efforts are unlike it and one slip of a data sheet makes them alike, that slip
is named. Both are judged three times: as they are, with friction and bias allowed for, and beside
unknown momenta of captured wheels and bodies that are a quarter off, too. What no slip explains is
left to the diagnosis.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy

from ...dynamics.equations import joint_torques
from ...model.robot import Robot
from ...model.robot_settings import COMPENSATED
from ...types import Array, BoolArray, IntArray
from ..integral import interpolated
from ..record import Record
from . import thresholds as limits
from .motion_faults import DEGREES
from .thresholds import DataFault


@dataclass(frozen=True, slots=True)
class _Slip:
    """What was done to the data, undone by exchanging columns and dividing by factors.

    Args:
        fault: Its name.
        motion: Factor of positions; one, or (n,).
        effort: Factor of efforts, likewise.
        pair: Joints whose columns were exchanged; twice the same where none were.
        with_motion: Whether positions were exchanged along with the efforts.
        gravity: Whether gravity is in the efforts against what the robot file says, or not in
            them against it.
        weight: (3,) gravity that is in them instead of the robot file's [m/s^2].
    """

    fault: DataFault
    motion: Array | float = 1.0
    effort: Array | float = 1.0
    pair: tuple[int, int] = (0, 0)
    with_motion: bool = True
    gravity: bool = False
    weight: Array | None = None

    def undone(self, values: Array, *, effort: bool = False) -> Array:
        """(N, n) positions or efforts as they would be without it."""
        order = self.order(values.shape[1], effort=effort)
        return np.asarray(values[:, order] / (self.effort if effort else self.motion))

    def changed(self, n: int) -> BoolArray:
        """(n,) joints that it could mend: those whose efforts it changed, or any by the motion."""
        if not self.keeps_motion or self.gravity:
            return np.ones(n, dtype=bool)
        is_other = self.order(n, effort=True) != np.arange(n)
        return np.asarray(is_other | (np.broadcast_to(self.effort, n) != 1.0))

    def order(self, n: int, *, effort: bool) -> IntArray:
        """(n,) columns of positions or efforts as they would be without it."""
        order = np.arange(n)
        if effort or self.with_motion:
            order[list(self.pair)] = self.pair[::-1]
        return order

    @property
    def keeps_motion(self) -> bool:
        """Whether positions and gravity stay what they are."""
        is_same = self.pair[0] == self.pair[1] or not self.with_motion
        return is_same and self.weight is None and bool(np.all(self.motion == 1.0))


def find_torque_faults(record: Record, robot: Robot) -> tuple[DataFault, ...]:
    """The slip that makes measured efforts and the model's torques alike, if there is one.

    Args:
        record: With joint efforts; for a free base with the gyro.
        robot: What the model believes.

    Returns:
        At most one fault; none where the data lack what it takes, or where none is needed.
    """
    torques = _Torques.of(record, robot)
    if torques is None:
        return ()
    before = torques.unlike(_Slip(DataFault('', '', '')))
    if np.all(before[0] < limits.UNLIKE):
        return ()
    off = None if record.joints is None else record.joints.unpowered
    compensated = () if off is not None and off.all() else _gravity_slips(robot.effort_kinds)
    slips = [*_slips(robot), *compensated, *torques.turned_base()]
    shares = np.array([torques.unlike(slip) for slip in slips])
    # Of joints that turn little, and one way, friction is like the weight of another direction:
    # a turned base has to be nearer beside friction and bias, too.
    turned = np.array([slip.weight is not None for slip in slips])
    nearer = shares[:, 1].mean(axis=1) < limits.NEARER * before[1].mean()
    shares[turned & ~nearer] = np.inf
    for way in range(len(before)):
        best = int(np.argmin(shares[:, way].mean(axis=1)))
        # without what they share, friction or a weight, torques that are alike are noise
        own = slips[best].changed(len(torques.moves)) & (before[0] > limits.UNLIKE)
        if _explains(before[way], shares[best, way], own):
            return (slips[best].fault,)
    return ()


def _explains(before: Array, after: Array, own: BoolArray) -> bool:
    """Whether a slip mends at least one of its own joints and spoils none; noise stays."""
    mended = (
        own & (before > limits.UNLIKE) & (after < np.minimum(limits.ALIKE, before / limits.GAIN))
    )
    return bool(mended.any() and np.all(after < np.maximum(limits.ALIKE, limits.SPOILED * before)))


@dataclass(frozen=True, slots=True, eq=False)
class _Torques:
    """A record, smoothed, at the times that are looked at.

    Args:
        robot: The model.
        motion: (3, K, n) positions [rad], rates and accelerations.
        effort: (K, n) measured [N m].
        omega: (K, 3) base rate [rad/s].
        model: (K, n) torques that the model asks for [N m].
        friction: (n, K, 3) orthonormal, of each joint's bias and friction.
        unsure: (n, K, C) torques of what the model may be off by, and (C,) at most.
    """

    robot: Robot
    motion: Array
    effort: Array
    omega: Array
    model: Array
    friction: Array
    unsure: Array
    most: Array

    @staticmethod
    def of(record: Record, robot: Robot) -> _Torques | None:
        """None where the record lacks what it takes."""
        time, effort = record.joint_time, record.effort
        if effort is None or robot.rotor_count or (robot.is_free and record.rates is None):
            return None
        if record.joints is None or record.joints.in_amperes:  # of any scale
            return None
        if len(time) < limits.FEWEST_SAMPLES or np.isnan(effort).any():
            return None
        step = float(np.median(np.diff(time)))
        half = _span(step) // 2
        # about what is looked at there is no pause, in which a joint may go anywhere, and no stop
        broken = np.diff(time) > limits.JUMP_PERIODS * step
        broken |= record.stopped(time[:-1], time[1:]).any(axis=1)
        pauses = np.append(0, np.cumsum(broken))
        first = np.searchsorted(time, time - half * step, 'right') - 1
        last = np.searchsorted(time, time + half * step)
        is_within = (first >= 0) & (last < len(time))
        whole = np.flatnonzero(is_within & (pauses[first] == pauses[last % len(time)]))
        if len(whole) < 6 * half:
            return None
        rows = np.linspace(0, len(whole) - 1, limits.ROWS).astype(int)
        centres = time[whole[rows]]
        even = centres[:, None] + step * np.arange(-half, half + 1)
        omega = np.zeros((len(centres), 3))
        if robot.is_free:
            omega = interpolated(centres, record.rate_time, record.omega)
        torque, *_ = smoothed(interpolated(even, time, effort), step)
        motion = smoothed(interpolated(even, time, record.q), step)
        position, rate, acceleration = motion
        model = joint_torques(robot, position, rate, acceleration, omega)
        friction = np.stack([_span_of(_others(rate)) for rate in motion[1].T])
        unsure, most = _unsure(robot, motion, omega, model)
        return _Torques(robot, motion, torque, omega, model, friction, unsure, most)

    def unlike(self, slip: _Slip) -> Array:
        """(3, n) share of each joint's torque that the model does not explain, the slip undone.

        As it is, with friction and bias taken out of both, and beside what is unsure; none of a
        joint at rest, which friction holds under any torque. Where positions are others what is
        unsure is not asked.
        """
        measured = slip.undone(self.effort, effort=True)
        model = self._model(slip)
        lacking = np.array([kind == COMPENSATED for kind in self.robot.effort_kinds])
        if self.robot.gravity.any() and (lacking.any() or slip.gravity):
            position = slip.undone(self.motion[0])
            rest = np.zeros_like(position)
            weight = joint_torques(self.robot, position, rest, rest, np.zeros_like(self.omega))
            # Off the model where the file says so: beside a weight that is added to them, efforts
            # of any scale would look right.
            model = model - (lacking & (not slip.gravity)) * weight
            measured = measured + (~lacking & slip.gravity) * weight
        order = slip.order(len(self.moves), effort=False)
        both = np.stack([model, measured], axis=2)
        beside = self.friction[order]  # of any factor of the rate, friction spans the same
        both = both.transpose(1, 0, 2)
        rest = both - beside @ (np.swapaxes(beside, 1, 2) @ both)
        beside_all = np.full(len(self.moves), np.inf)
        if slip.keeps_motion and not slip.gravity:
            beside_all = _differences(self._beside_unsure(rest, beside))
        return np.where(self.moves, [_differences(both), _differences(rest), beside_all], 0.0)

    def _beside_unsure(self, pairs: Array, beside: Array) -> Array:
        """(n, K, 2) the same beside what is unsure, every joint by its own torque.

        Of what is known to no size both are taken without: efforts of any scale would look right
        beside it. What has bounds is added to the model, as far as the efforts want.
        """
        unsure = self.unsure - beside @ (np.swapaxes(beside, 1, 2) @ self.unsure)
        scale = np.maximum(np.sqrt(np.mean(np.max(pairs**2, axis=2), axis=1)), 1e-12)
        weight = (self.moves / scale)[:, None, None]
        flat = (np.concatenate([unsure, pairs], axis=2) * weight).reshape(-1, len(self.most) + 2)
        is_free = np.isinf(self.most)
        free = _span_of(flat[:, :-2][:, is_free])
        rest = flat - free @ (free.T @ flat)
        columns, most = rest[:, :-2][:, ~is_free], self.most[~is_free]
        wanted = rest[:, -1] - rest[:, -2]
        found = scipy.optimize.lsq_linear(columns, wanted, (-most, most), method='bvls')
        both = np.column_stack([rest[:, -2] + columns @ found.x, rest[:, -1]])
        return both.reshape(pairs.shape)

    def _model(self, slip: _Slip) -> Array:
        """(K, n) torques that the model asks for, the slip undone."""
        if slip.keeps_motion:
            return self.model
        robot = self.robot if slip.weight is None else replace(self.robot, gravity=slip.weight)
        position, rate, acceleration = map(slip.undone, self.motion)
        return joint_torques(robot, position, rate, acceleration, self.omega)

    @property
    def moves(self) -> BoolArray:
        """(n,) whether a joint moves, and not in jerks, between which friction holds it.

        Beside a fast joint, in any unit, the jitter of another one is no motion.
        """
        rate = np.abs(self.motion[1])
        fastest = float(np.sqrt(np.max(np.mean(rate**2, axis=0))))
        goes = np.mean(rate > min(limits.SLOW, limits.BESIDE * fastest), axis=0)
        return np.asarray((np.ptp(self.motion[0], axis=0) > limits.MOVED) & (goes > limits.SELDOM))

    def turned_base(self) -> Iterator[_Slip]:
        """Gravity along the direction that the efforts want, where that is another one.

        Torques are linear in gravity: least squares beside friction and bias, every joint by its
        own torque; the length is the robot file's.
        """
        robot, length = self.robot, float(np.linalg.norm(self.robot.gravity))
        if (
            robot.is_free
            or not length
            or COMPENSATED in robot.effort_kinds
            or not self.moves.any()
        ):
            return
        position, rate, acceleration = self.motion
        model = [
            joint_torques(replace(robot, gravity=g), position, r, a, self.omega)
            for g, r, a in (
                (np.zeros(3), rate, acceleration),
                *((g, 0.0 * rate, 0.0 * rate) for g in np.eye(3)),
            )
        ]
        columns = np.stack([self.effort - model[0], *model[1:]])
        rows = []
        for j in np.flatnonzero(self.moves):
            others = _others(rate[:, j])
            left = columns[:, :, j].T / max(float(np.std(self.effort[:, j])), 1e-12)
            rows.append(left - others @ np.linalg.lstsq(others, left, rcond=None)[0])
        known = np.vstack(rows)
        gravity = np.asarray(np.linalg.lstsq(known[:, 1:], known[:, 0], rcond=None)[0], float)
        if not np.any(gravity):
            return
        gravity *= length / np.linalg.norm(gravity)
        if gravity @ robot.gravity < length**2 * np.cos(limits.TURNED):
            words = ', '.join(f'{x:.2f}' for x in gravity)
            message = (
                f'the weight in them is that of a base that is turned: robot.gravity [{words}]?'
            )
            yield _Slip(DataFault('gravity', 'joint_torque', message), weight=gravity)


def _unsure(robot: Robot, motion: Array, omega: Array, model: Array) -> tuple[Array, Array]:
    """(n, K, C) torques of what the model may be off by, and (C,) by how much of it.

    Momenta of captured wheels, by any; every body, by a share; gravity, by a tilt.
    """
    columns, most = list[Array](), list[float]()

    def add(changed: Robot, step: float, limit: float) -> None:
        torque = joint_torques(changed, motion[0], motion[1], motion[2], omega)
        columns.append((torque - model) / step)
        most.append(limit)

    known = np.concatenate([np.zeros(0), *(g.momentum for g in robot.target_wheels)])
    for unit in np.eye(len(known)):
        add(robot.with_target_momentum(known + unit), 1.0, np.inf)
    rows, gravity = robot.inertial_parameters, robot.gravity
    for k in range(1, len(rows)):
        grown = rows.copy()
        grown[k] *= 1.0 + _STEP
        add(robot.with_inertial_parameters(grown), _STEP, limits.BODY_OFF)
    for unit in np.eye(3) if gravity.any() and not robot.is_free else ():
        tilt = limits.TURNED * float(np.linalg.norm(gravity))
        add(replace(robot, gravity=gravity + unit), 1.0, tilt)
    return np.stack(columns, axis=2).transpose(1, 0, 2), np.array(most)


_STEP = 1e-3  # of a body, for what it adds; on a free base that is not quite linear


def _span(step: float) -> int:
    """Samples that are smoothed together, an odd number."""
    return 2 * max(2, round(0.5 * limits.SPAN / step)) + 1


def smoothed(values: Array, step: float) -> Array:
    """(3, M, k) values amid M stretches and their derivatives, of cubics through (M, span, k).

    What Savitzky and Golay's filter gives; SciPy's takes 0.4 s to load.
    """
    span = values.shape[1]
    around = np.arange(span) - span // 2
    fit = np.linalg.pinv(np.vander(around.astype(float), 4, increasing=True))[:3]
    fit *= np.array([1.0, 1.0 / step, 2.0 / step**2])[:, None]
    return np.asarray(np.einsum('ds,msk->dmk', fit, values))


def _others(rate: Array) -> Array:
    """(N, 3) bias and friction of a joint."""
    return np.column_stack([np.ones_like(rate), rate, np.sign(rate)])


def _span_of(columns: Array) -> Array:
    """(N, k) orthonormal, zero where columns (N, k) are not independent."""
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left * (singular > 1e-13 * np.max(singular, initial=0.0)))


def _differences(pairs: Array) -> Array:
    """(n,) squared difference of pairs (n, K, 2), a share of the larger one's square."""
    scale = np.max(np.sum(pairs**2, axis=1), axis=1)
    off = np.sum((pairs[..., 1] - pairs[..., 0]) ** 2, axis=1)
    return np.divide(off, scale, out=np.zeros_like(off), where=scale > 0.0)


def _gravity_slips(kinds: tuple[str, ...]) -> Iterator[_Slip]:
    """Efforts of all joints with or without gravity, against what the robot file says of all."""
    are = {kind == COMPENSATED for kind in kinds}
    if len(are) == 1:
        held = f'is not in them: robot.effort_kind {COMPENSATED}, by control or counterweights?'
        words = 'is in them' if are.pop() else held
        yield _Slip(DataFault('gravity', 'joint_torque', f'gravity {words}'), gravity=True)


def _slips(robot: Robot) -> Iterator[_Slip]:
    """Every slip that is tried, the efforts' own first."""
    for factor, times in (
        (1000.0, 'a thousand times too large'),
        (1e-3, 'a thousand times too small'),
        (100.0, 'a hundred times too large'),
        (1e-2, 'a hundred times too small'),
    ):
        message = f'{times} for this robot: {robot.unit_of("N m")} expected'
        yield _Slip(DataFault('scale', 'joint_torque', message), effort=factor)
    message = 'all efforts are of the wrong sign'
    yield _Slip(DataFault('sign', 'joint_torque', message), effort=-1.0)
    for factor, words in (
        (DEGREES, 'degrees instead of radians'),
        (1.0 / DEGREES, 'radians converted as if they were degrees'),
    ):
        yield _Slip(DataFault('scale', 'joints', f'positions are {words}'), motion=factor)
    names = robot.joints
    for i, name in enumerate(names):
        flip = np.where(np.arange(len(names)) == i, -1.0, 1.0)
        yield _Slip(DataFault('sign', f'joint_torque/{name}', 'of the wrong sign'), effort=flip)
        message = 'position, rate and effort are of the wrong sign'
        yield _Slip(DataFault('sign', f'joints/{name}', message), flip, flip)
        message = 'position and rate are of the wrong sign'
        yield _Slip(DataFault('sign', f'joints/{name}', message), flip)
    for i, j in itertools.combinations(range(len(names)), 2):
        message = f'columns of {names[i]} and {names[j]} are exchanged'
        efforts = DataFault('exchanged', 'joint_torque', message)
        yield _Slip(efforts, pair=(i, j), with_motion=False)
        yield _Slip(DataFault('exchanged', 'joints', message), pair=(i, j))
