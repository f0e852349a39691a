r"""Rows by balance: the torques that a model misses along a measured motion, where effects act.

    H(q) q'' + c(q, q') - tau - believed effects = sum of effects + inertial errors + leftover

Rows are the left side below the band of the motion, where joints move. Nothing is integrated, so
a model that is wrong everywhere is as good a start as any: this is for data whose noise nobody
knows. Real joints have torques that are in no catalogue, links are not as in the file, and sensors
are filtered before they are logged: by what is left then, `leftover` tells.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...dynamics.equations import Dynamics
from ...effects.effect import Effect
from ...effects.motion import Motion
from ...model.robot import Robot
from ...model.robot_settings import COMPENSATED
from ...recording.record import Record
from ...sensing.sensor_faults import corrected_record
from ...types import Array, IntArray
from ..columns import Signatures
from ..filters.torque_process import TorqueDriven
from ..noise_levels import fourth_difference_std
from ..rows import ChannelError
from ..trajectory.reference import Kinematics
from .arm_motion import ArmMotion
from .motor_constants import in_newton_metres

_SMALL = 1e-4  # rad; a position error so small that inverse dynamics are linear in it
_SHOWN = 25.0  # Hz, of the channels
_AT_ONCE = 8  # columns: all samples of all of them would be most of the memory of a diagnosis


class Balance:
    """Torque balance of one model along one recording of a fixed-base robot.

    Args:
        arm: The recording, its sensors as the model believes them.
        process: The model.
        compensation: (N, n) what measured efforts lack of the motors' torques [N m].
        estimated: Joints whose torques are currents by an estimated constant.
    """

    def __init__(
        self,
        arm: ArmMotion,
        process: TorqueDriven,
        compensation: Array | float = 0.0,
        estimated: Sequence[str] = (),
    ) -> None:
        self.robot = process.robot
        self.is_torque = ~np.isin(self.robot.joints, estimated)
        """(n,) whether the effort of a joint that has one is measured in N m."""
        self.arm, self.process, self._compensation = arm, process, compensation
        off = arm.unpowered
        given = process.motion(
            arm.kinematics, np.where(off, 0.0, arm.effort + compensation), unpowered=off
        )
        self.missed = -process.force_error(given)[:, 6:]
        # A faulty gain scales, and friction that goes with the load follows, what the model needs:
        # of what is measured, a gain of zero and no masses would explain everything.
        needed = np.where(off, 0.0, self._required(given))
        self.motion = process.motion(arm.kinematics, needed, unpowered=off)

    def beside(self, effects: Sequence[Effect]) -> Balance:
        """The same of a model with more effects."""
        process = TorqueDriven(self.robot, (*self.effects, *effects)).under(self.arm.record)
        estimated = [
            j for j, known in zip(self.robot.joints, self.is_torque, strict=True) if not known
        ]
        return Balance(self.arm, process, self._compensation, estimated)

    @property
    def effects(self) -> tuple[Effect, ...]:
        """What the model believes to act as a force."""
        return self.process.effects

    @property
    def is_held(self) -> bool:
        """Below 4 Hz holds look like what they are held of."""
        return False

    @property
    def effort_rate(self) -> Array:
        """(N, n) time derivative of the torques that the model needs of what is read [N m/s]."""
        return np.gradient(self.motion.effort - self._compensation, self.arm.step, axis=0)

    @cached_property
    def weight(self) -> Array:
        """(N, n) torques that the model needs at rest [N m]."""
        at = self.arm.kinematics
        still = replace(at, qd=np.zeros_like(at.qd), qdd=np.zeros_like(at.qd))
        return self.process.needed(self.process.motion(still, self.arm.effort))[:, 6:]

    @cached_property
    def torque(self) -> Array:
        """(M, n) torques that the model misses, row by row [N m]."""
        return self.in_rows(self.missed, np.arange(self.robot.n_joints))

    def samples(self) -> Mapping[str, tuple[Kinematics, Motion]]:
        """Joint positions at the times of the balance: rates and accelerations follow them."""
        return {'joint_position': (self.arm.kinematics, self.motion)}

    def columns(self, directions: Sequence[tuple[Effect, float]]) -> Array:
        """(M, n, K) torques that the model would miss by each direction's coefficient.

        Args:
            directions: Effects a small step from doing nothing, with that step.
        """
        signatures, count = Signatures(self), max(len(directions), 1)
        some = (directions[k : k + _AT_ONCE] for k in range(0, count, _AT_ONCE))
        return np.concatenate([signatures.whitened(part) for part in some], axis=2)

    def whitened(self, forces: Array, measured: Mapping[str, Array]) -> Array:
        """(M, n, K); see `Rows.whitened`. Levels are those of all recordings: `leftover`."""
        torques = forces[:, 6:].copy()
        if 'joint_position' in measured:
            for k, error in enumerate(np.moveaxis(measured['joint_position'], 2, 0)):
                if error.any():
                    torques[:, :, k] += self._misread(error)
        n = torques.shape[1]
        flat = torques.reshape(len(torques), -1)
        seen = np.any(flat != 0.0, axis=0)  # most effects act on one joint
        rows = np.zeros((len(self.row_times), flat.shape[1]))
        rows[:, seen] = self.in_rows(flat[:, seen], np.repeat(np.arange(n), forces.shape[2])[seen])
        return rows.reshape(len(rows), n, -1)

    @property
    def row_times(self) -> Array:
        """(M,) [s]."""
        return self.arm.times[:: self.arm.stride]

    def channels(self) -> tuple[ChannelError, ...]:
        """Missed torque of every joint in the band, where it moves; all along at rest."""
        stride = max(1, round(1.0 / self.arm.step / _SHOWN))
        error = self.arm.in_band(self.missed)[::stride]
        time, moving = self.arm.times[::stride], self.arm.is_shown[::stride]
        return tuple(
            ChannelError(
                f'joint_torque/{name}',
                self.robot.unit_of('N m', name),
                time[at],
                np.zeros(0),
                error[at, i],
                np.nan,
            )
            for i, (name, at) in enumerate(zip(self.robot.joints, moving.T, strict=True))
        )

    def in_rows(self, values: Array, joints: IntArray) -> Array:
        """(M, c) rows of (N, c) torques: without what is faster than the band.

        At rest friction holds any torque, which the filter would bring into rows beside it: where
        a joint moves they are those of torques that are bridged over its rests.

        Args:
            values: Torques [N m].
            joints: (c,) numbers of the joints at which they act.
        """
        arm = self.arm
        out = arm.in_band(values)[:: arm.stride]
        for j in np.unique(joints).tolist():
            own, moving = joints == j, arm.is_moving[:: arm.stride, j]
            if moving.any() and not moving.all():
                bridged = arm.in_band(arm.bridged(values[:, own], j))[:: arm.stride]
                out[np.ix_(moving, own)] = bridged[moving]
        return out

    def _required(self, motion: Motion) -> Array:
        """(N, n) motor torque that the model needs for a motion, effects included [N m]."""
        return (self.process.needed(motion) - self.process.forces(motion))[:, 6:]

    def _misread(self, error: Array) -> Array:
        """(N, n) torque that inverse dynamics add where positions are read by `error` too large.

        Args:
            error: (N, n) by a unit of a coefficient [rad].
        """
        scale = _SMALL / float(np.max(np.abs(error)))
        at = self.arm.kinematics
        off = scale * error
        slope = np.gradient(off, at.time, axis=0)
        bend = np.gradient(slope, at.time, axis=0)
        read = Kinematics(
            at.time, at.q + off, at.qd + slope, at.omega, at.rotation, at.qdd + bend, at.alpha
        )
        required = self._required(
            self.process.motion(read, self.motion.effort, unpowered=self.motion.unpowered)
        )
        return np.asarray((required - self._as_read) / scale)

    @cached_property
    def _as_read(self) -> Array:
        """(N, n) of the motion itself."""
        return self._required(self.motion)


def balance_of(
    record: Record,
    robot: Robot,
    effects: Sequence[Effect],
    left_out: tuple[tuple[float, float], ...] = (),
) -> Balance:
    """A recording under a robot with effects, those of its sensors undone.

    Args:
        record: Of a fixed-base robot, with efforts.
        robot: The robot file's robot.
        effects: Believed effects; the motor constants of currents among them.
        left_out: Starts and ends of times [s] in which something acts from outside.
    """
    estimated = record.joints.in_amperes if record.joints else ()
    record, robot, effects = in_newton_metres(record, robot, effects)
    process = TorqueDriven(robot, effects).under(record)
    corrected = corrected_record(record, process.robot, effects)
    arm = ArmMotion(corrected, left_out)
    kinds = zip(robot.arm, robot.effort_kinds, strict=True)
    lacking = np.array([k == COMPENSATED and j not in robot.passive_joints for j, k in kinds])
    weight: Array | float = 0.0
    if lacking.any():
        read = arm if corrected is record else ArmMotion(record, left_out)
        weight = _compensation(read, robot, arm.times) * lacking
    return Balance(arm, process, weight, estimated)


def _compensation(read: ArmMotion, robot: Robot, times: Array) -> Array:
    """(N, n) torques against gravity that efforts leave out, by the robot file as it stands.

    A controller that takes them off knows no more than the file, and no other angles than it
    reads: a payload shows, and so does the zero of an encoder.
    """
    at = read.kinematics
    still = replace(at, qd=np.zeros_like(at.qd), qdd=np.zeros_like(at.qdd))
    process = TorqueDriven(robot)
    weight = process.needed(process.motion(still, read.effort))[:, 6:]
    return np.column_stack([np.interp(times, read.times, own) for own in weight.T])


def noise_in_band(balance: Balance, position: float | Array, effort: float | Array) -> Array:
    """(n,) rms of the torques that sensor noise alone leaves in the band [N m].

    White noise of a sample keeps 2 B dt of its variance below B. Of positions it is that of the
    accelerations: ((2 pi B)^4 / 5)^1/2 times it on the joint's own inertia.

    Args:
        balance: Of a recording.
        position: Standard deviation of a sample, of all joints or one each [rad].
        effort: The same [N m].
    """
    band, n = balance.arm.band, balance.robot.n_joints
    kept = np.sqrt(2.0 * band * balance.arm.interval)
    inertia = np.diag(Dynamics(balance.robot).mass_matrix(np.zeros(n)))[-n:]
    moved = (2.0 * np.pi * band) ** 2 / np.sqrt(5.0) * position * inertia
    return np.asarray(kept * np.hypot(effort, moved))


def own_noise_in_band(balance: Balance) -> Array:
    """(n,) rms that the noise of each joint's own sensors leaves in the band [N m].

    By the fourth differences of its samples, whatever the robot file states of all joints.
    """
    record = balance.arm.record
    position, effort = (
        np.array(
            [fourth_difference_std(column[:, None], record.joint_time) for column in values.T]
        )
        for values in (record.q, np.asarray(record.effort))
    )
    return noise_in_band(balance, position, effort)


def rms(balances: Iterable[Balance]) -> Array:
    """(n,) rms of the torques that a model misses in the band where joints move [N m].

    NaN for a joint that never does.
    """
    total, count = 0.0, 0
    for balance in balances:
        moving = balance.arm.is_moving[:: balance.arm.stride]
        total = total + np.sum(balance.torque**2 * moving, axis=0)
        count = count + np.sum(moving, axis=0)
    with np.errstate(invalid='ignore'):
        return np.asarray(np.sqrt(total / np.where(count, count, np.nan)))
