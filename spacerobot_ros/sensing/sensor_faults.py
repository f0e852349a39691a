"""What physical effects do to sensors: done to the truth, undone from measurements and records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import scipy

from ..dynamics.state import State
from ..effects.effect import CLOCKS, Effect, own_states
from ..effects.motion import Motion, motion_at
from ..model.robot import Robot
from ..recording.record import JointSeries, Record
from ..types import Array, IntArray

_PASSES = 12  # at most, of the fixed point that undoes a fault; a scale of 0.9 takes them all
_SETTLED = 1e-12  # rad, rad/s, N m; beyond which it goes on


class SensorFaults:
    """Sensor effects of one robot.

    Args:
        robot: The robot.
        effects: Physical effects; only their `sense` and `delay` matter here.
    """

    def __init__(self, robot: Robot, effects: Sequence[Effect] = ()) -> None:
        self._robot = robot
        places = zip(effects, own_states(effects), strict=True)
        self._effects = tuple((e, own) for e, own in places if e.acts('sense'))
        self.delay = {clock: sum(e.delay(clock) for e in effects) for clock in CLOCKS}
        """Lateness of every clock's stamps [s]; the efforts' comes on top of the joints'."""
        late = sum((e.joint_delays(robot) for e in effects), np.zeros(robot.n_joints))
        self.joint_delays = dict(enumerate(late.tolist())) if late.any() else {}
        """By number of the joint, where some are later than the others [s]."""

    @property
    def are_none(self) -> bool:
        """Whether no sensor says anything but the truth; it may say it late."""
        return not self._effects

    def sensed(
        self, channel: str, value: Array, motion: Motion, hidden: Array | None = None
    ) -> Array:
        """What a channel says of N true states; see `Effect.sense`.

        Args:
            channel: One of `effects.effect.CHANNELS`.
            value: (N, n) or (N, 3) truth.
            motion: The N states.
            hidden: Own states of all effects at a single state (`Plant.hidden`); None: those that
                the motion drives.
        """
        for effect, own in self._effects:
            states = None if hidden is None else hidden[None, own]
            value = effect.sense(channel, value, motion, states)
        return value

    def motion(self, time: float, state: State, effort: Array) -> Motion:
        """One true state as a motion; the torques are the manipulator's."""
        torque = np.zeros(self._robot.n_joints)
        torque[: len(effort)] = effort
        return motion_at(self._robot, time, state, torque)

    def undo_joints(
        self,
        q: Array,
        qd: Array,
        effort: Array,
        time: Array | None = None,
        effort_noise: Array | float = 0.0,
    ) -> tuple[Array, Array, Array]:
        """True joint positions, rates and torques behind the measured ones.

        Args:
            q: (n,) or (N, n) [rad].
            qd: Likewise [rad/s].
            effort: Likewise [N m].
            time: (N,) of the samples [s]; None: zero.
            effort_noise: What of the efforts no torque is, which encoders see nothing of: one
                behind some play would else be taken to cross it with every sample [N m].
        """
        if self.are_none:
            return q, qd, effort
        names = ('joint_position', 'joint_velocity', 'joint_effort')

        def read(true: list[Array]) -> list[Array]:
            moving = (_times(true[0], time), *true[:2], true[2] - effort_noise)
            motion = Motion(self._robot, *moving)
            return [self.sensed(name, x, motion) for name, x in zip(names, true, strict=True)]

        true = _undone([np.atleast_2d(values) for values in (q, qd, effort)], read)
        position, rate, torque = (value.reshape(np.shape(q)) for value in true)
        return position, rate, torque

    def undo_rate(self, omega: Array, time: Array | None = None) -> Array:
        """True base rate behind a measured one, (3,) or (N, 3) [rad/s]; `time` as above."""
        if self.are_none or not omega.size:
            return omega

        def read(true: list[Array]) -> list[Array]:
            return [self.sensed('gyro', true[0], self._turning(true[0], time))]

        return _undone([np.atleast_2d(omega)], read)[0].reshape(np.shape(omega))

    def undo_attitude(self, q_WB_xyzw: Array, time: Array | None = None) -> Array:
        """True attitude behind a measured one, (4,) or (N, 4); `time` as above."""
        if self.are_none or not q_WB_xyzw.size:
            return q_WB_xyzw
        measured = np.atleast_2d(q_WB_xyzw)
        zeros = np.zeros((len(measured), 3))
        error = self.sensed('attitude', zeros, self._turning(zeros, time))
        true = (
            scipy.spatial.transform.Rotation.from_quat(measured)
            * scipy.spatial.transform.Rotation.from_rotvec(error).inv()
        )
        return np.asarray(true.as_quat().reshape(np.shape(q_WB_xyzw)))

    def _turning(self, omega: Array, time: Array | None) -> Motion:
        still = np.zeros((len(omega), self._robot.n_joints))
        return Motion(self._robot, _times(omega, time), still, still, still, omega=omega)


def _undone(measured: list[Array], read: Callable[[list[Array]], list[Array]]) -> list[Array]:
    """The truth that is read as measured."""
    true = measured
    for _ in range(_PASSES):
        missed = [wrong - seen for wrong, seen in zip(measured, read(true), strict=True)]
        true = [value + change for value, change in zip(true, missed, strict=True)]
        if all(np.max(np.abs(change), initial=0.0) < _SETTLED for change in missed):
            break
    return true


def _times(values: Array, time: Array | None) -> Array:
    return np.zeros(len(values)) if time is None else time


def corrected_record(
    record: Record,
    robot: Robot,
    effects: Sequence[Effect],
    is_held: bool = False,
    effort_noise: Array | float = 0.0,
) -> Record:
    """Samples as right sensors with punctual clocks would have taken them.

    Efforts that are later than the rest stay where they are, and say so (`effort_time`).

    Args:
        record: As measured.
        robot: The robot that the effects act on.
        effects: Believed effects; only those of sensors matter here.
        is_held: Whether torques are held between the stamps. A sample that is somewhat late shows
            the same hold, so that late joint states make no torque later.
        effort_noise: See `SensorFaults.undo_joints`.
    """
    faults = SensorFaults(robot, effects)
    if faults.are_none and not (any(faults.delay.values()) or faults.joint_delays):
        return record

    def earlier(stamp_ns: IntArray, clock: str) -> IntArray:
        return stamp_ns - round(faults.delay[clock] * 1e9)

    joints, rates, attitudes = record.joints, record.rates, record.attitudes
    if joints is not None and joints.names:
        stamps = earlier(joints.stamp_ns, 'joints')
        right = _joints(joints, record.joint_time, faults, is_held, effort_noise)
        joints = replace(right, stamp_ns=stamps)
    if rates is not None:
        omega = faults.undo_rate(rates.omega, record.rate_time)
        rates = replace(rates, stamp_ns=earlier(rates.stamp_ns, 'imu'), omega=omega)
    if attitudes is not None:
        q_xyzw = faults.undo_attitude(attitudes.q_xyzw, record.attitude_time)
        stamps = earlier(attitudes.stamp_ns, 'attitude')
        attitudes = replace(attitudes, stamp_ns=stamps, q_xyzw=q_xyzw)
    origin = record.origin_ns
    return replace(record, joints=joints, rates=rates, attitudes=attitudes, zero_ns=origin)


def _joints(
    series: JointSeries,
    time: Array,
    faults: SensorFaults,
    is_held: bool,
    effort_noise: Array | float,
) -> JointSeries:
    zeros = np.zeros_like(series.position)
    rates = zeros if series.velocity is None else series.velocity
    efforts = zeros if series.effort is None else series.effort
    late = [faults.joint_delays.get(j, 0.0) for j in range(len(series.names))]
    q, qd = (_earlier(time, x, late) for x in (series.position, rates))
    if not is_held:
        efforts = _earlier(time, efforts, late)
    q, qd, effort = faults.undo_joints(q, qd, efforts, time, effort_noise)
    return replace(
        series,
        position=q,
        velocity=None if series.velocity is None else qd,
        effort=None if series.effort is None else effort,
        effort_delay=series.effort_delay
        + faults.delay['effort']
        - (faults.delay['joints'] if is_held else 0.0),
    )


def _earlier(time: Array, values: Array, delays: Sequence[float]) -> Array:
    """(N, n) samples that were so late, column by column, at their own times; the last is held."""
    out = np.array(values)
    for j, delay in enumerate(delays):
        if delay and not np.isnan(values[:, j]).any():
            spline = scipy.interpolate.make_interp_spline(time, values[:, j])
            out[:, j] = spline(np.minimum(time + delay, time[-1]))
    return out
