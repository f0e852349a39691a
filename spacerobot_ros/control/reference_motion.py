"""The motion in force: its clock, and how another one or a lost one is joined.

While something acts from outside, `EventAnswer` damps or holds (`monitor.on_event`).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..model.motion_settings import ReferenceSettings
from ..types import Array, Quaternion
from .attitude import AttitudeBlend, AttitudeReference, AttitudeSetpoint, Turn, build_attitude
from .command import NS, Feedback, Torque
from .joint_reference import Blend, Hold, Reference, Setpoint, build_reference

_BRAKING = 1.0  # s


class ReferenceMotion:
    """Joint motion and, where it is controlled, attitude, on the clock of the joint samples.

    Args:
        settings: Section `reference` of the robot file.
        joining: Time over which an offset dies away when a motion is joined [s].
    """

    def __init__(self, settings: ReferenceSettings, joining: float) -> None:
        self._settings, self._joining = settings, joining
        self.reset()

    def reset(self) -> None:
        """The motion starts again at the next sample."""
        # as asked for; what is followed is that with the blend that joined it
        self._requested: Reference | None = None
        self._joints: Reference | None = None
        self._requested_attitude: AttitudeReference | None = None
        self._attitude: AttitudeReference | None = None
        self._start_ns = self._attitude_start_ns = 0
        self._pending: tuple[Reference, int | None] | None = None
        self._halted_ns: int | None = None

    @property
    def is_halted(self) -> bool:
        """Whether the robot holds still until `release`."""
        return self._halted_ns is not None

    @property
    def joints(self) -> Reference:
        """The joint motion."""
        if self._joints is None:
            raise RuntimeError('the motion has not begun')
        return self._joints

    @property
    def has_begun(self) -> bool:
        """Whether there is a joint motion."""
        return self._joints is not None

    def time(self, stamp_ns: int) -> float:
        """Time of the joint motion at a stamp [s]."""
        return (stamp_ns - self._start_ns) * NS

    def setpoint(self, stamp_ns: int) -> Setpoint:
        """Setpoint of the joints at a stamp."""
        return self.joints.at(self.time(stamp_ns))

    def attitude(self, stamp_ns: int) -> AttitudeSetpoint:
        """Setpoint of the attitude at a stamp."""
        if self._attitude is None:
            raise RuntimeError('the attitude is not known')
        return self._attitude.at((stamp_ns - self._attitude_start_ns) * NS)

    def rests(self, stamp_ns: int) -> bool:
        """Whether all rests from a stamp on."""
        turning = self._attitude is not None and (
            (stamp_ns - self._attitude_start_ns) * NS < self._attitude.duration
        )
        return not turning and self.time(stamp_ns) >= self.joints.duration

    def left(self, stamp_ns: int) -> float:
        """Time to the end of what was asked for last [s]; infinite while it is not begun."""
        is_begun = self._pending is None and self._joints is not None
        return self.joints.duration - self.time(stamp_ns) if is_begun else np.inf

    def begin(self, stamp_ns: int, q: Array) -> None:
        """Start the joint motion at a sample."""
        self._requested = self._joints = build_reference(self._settings, q)
        self._start_ns = stamp_ns

    def begin_attitude(self, q_WB_xyzw: Quaternion) -> None:
        """Start the attitude's motion there, unless it runs already."""
        if self._attitude is None:
            self._attitude_start_ns = self._start_ns
            self._requested_attitude = self._attitude = build_attitude(self._settings, q_WB_xyzw)

    def wait(self, elapsed_ns: int) -> None:
        """Let the motion stand still for a time."""
        self._start_ns += elapsed_ns
        self._attitude_start_ns += elapsed_ns

    def follow(self, reference: Reference, start_ns: int | None) -> None:
        """Follow another joint motion from its start (None: the next sample) on."""
        self._pending = (reference, start_ns)

    def joined(self, reference: Reference, stamp_ns: int, start_ns: int | None) -> Blend:
        """Another motion, as it would be joined from the present one at a stamp."""
        t = 0.0 if start_ns is None else (stamp_ns - start_ns) * NS
        here = self.setpoint(stamp_ns)
        # its acceleration may begin with a step, as that of every cubic does
        start = Setpoint(here.q, here.qd, reference.at(t).qdd)
        return Blend(reference, t, start, self._joining)

    def rejoin(self, stamp_ns: int, sample: Feedback) -> None:
        """Join the motion from where the robot is."""
        if self._requested is not None:
            here = Setpoint(sample.q, sample.qd, np.zeros(len(sample.q)))
            self._joints = Blend(self._requested, self.time(stamp_ns), here, self._joining)
        if self._requested_attitude is not None and sample.q_WB_xyzw is not None:
            t = (stamp_ns - self._attitude_start_ns) * NS
            start = (t, sample.q_WB_xyzw, self._joining)
            self._attitude = AttitudeBlend(self._requested_attitude, *start)

    def halt(self, stamp_ns: int, sample: Feedback) -> None:
        """Come to rest within a second, where that is smooth, and hold; the motion waits."""
        here = self.setpoint(stamp_ns)  # so that no torque has a step
        there = Hold(here.q + 0.5 * _BRAKING * here.qd)
        self._joints = Blend(there, self.time(stamp_ns), here, _BRAKING)
        if sample.q_WB_xyzw is not None:
            t = (stamp_ns - self._attitude_start_ns) * NS
            still = Turn(sample.q_WB_xyzw, np.zeros(3), Hold(np.zeros(1)))
            self._attitude = AttitudeBlend(still, t, sample.q_WB_xyzw, _BRAKING)
        self._halted_ns = stamp_ns

    def release(self, stamp_ns: int) -> None:
        """End what `halt` began; what was asked for is to be joined where it waits."""
        if self._halted_ns is not None:
            self.wait(stamp_ns - self._halted_ns)
            self._halted_ns = None

    def take_pending(self, stamp_ns: int) -> None:
        """Join the motion that was asked for, if its time has come and no other is followed."""
        if self.is_halted or self._pending is None or (self._pending[1] or stamp_ns) > stamp_ns:
            return
        self._requested, start_ns = self._pending
        self._joints = self.joined(self._requested, stamp_ns, start_ns)
        self._start_ns = stamp_ns if start_ns is None else start_ns
        self._pending = None


_VALID_NS = 2_000_000_000  # for which what was said of an event counts; a monitor says it oftener

_EASING_NS = 250_000_000  # in which the torque before gives way to damping


class EventAnswer:
    """Damps or holds while something acts from outside.

    Args:
        kind: `report`: does neither.

    Attributes:
        words: What acts at the last sample; empty: nothing that is answered.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self.forget()

    def forget(self) -> None:
        """Nothing acts."""
        self.words = self._received = ''
        self._received_ns: int | None = None
        self._offset: tuple[int, Array] | None = None

    def hear(self, words: str, stamp_ns: int | None) -> None:
        """Take what a monitor says; empty: it is over.

        Args:
            words: One line.
            stamp_ns: Stamp of the last joint sample [ns]; None before the first.
        """
        self._received, self._received_ns = words, stamp_ns

    def damps(self, stamp_ns: int) -> bool:
        """Whether the joints are to be damped at a sample; sets `words`."""
        if self._received_ns is None:
            self._received_ns = stamp_ns
        is_old = stamp_ns - self._received_ns > _VALID_NS
        self.words = '' if is_old or self._kind == 'report' else self._received
        if not self.words:
            self._offset = None
        return bool(self.words) and self._kind == 'damp'

    def eased(self, torque: Torque, before: Array | None, stamp_ns: int) -> Torque:
        """Damping that is joined from the torque (n,) before it [N m]; None: at once."""
        if not self.words or before is None:
            return torque
        if self._offset is None:
            self._offset = stamp_ns, before - torque.tau
        start_ns, offset = self._offset
        rest = 1.0 - min((stamp_ns - start_ns) / _EASING_NS, 1.0)
        return replace(torque, tau=np.asarray(torque.tau + rest * offset))

    def follow(self, motion: ReferenceMotion, stamp_ns: int, sample: Feedback) -> bool:
        """Halt the motion for an event, go on with it afterwards; whether it is halted."""
        if self.words and not motion.is_halted:
            motion.halt(stamp_ns, sample)
        elif motion.is_halted and not self.words:
            motion.release(stamp_ns)
            motion.rejoin(stamp_ns, sample)
            return True
        return motion.is_halted
