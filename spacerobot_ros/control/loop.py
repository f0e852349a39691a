"""The control loop without ROS: samples and estimates in, torques out, stale inputs noticed.

`ControlLoop` is what the controller node and the offline simulation share. Time is the stamp of
the joint states, in nanoseconds; the motion starts at the first one.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import IdentificationError, MessageRejectedError, SpaceRobotError
from ..identification.estimate import Estimate
from ..model.robot import Robot
from ..model.settings import Settings
from ..types import Array, Vector3
from .laws import ComputedTorque, Sample, Torque, law_model, torque_limits
from .reference import Blend, Point, Reference, build_reference, check_reference, rest

Mode = Literal['tracking', 'hold', 'damping']
NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """A torque command with what it rests on.

    Args:
        stamp_ns: Stamp of the joint states that it answers [ns].
        tau: (n,) torque [N m].
        saturated: (n,) bool, where a limit cut it.
        point: Reference at that stamp.
        error: (n,) reference minus measured position [rad].
        error_rate: (n,) reference minus measured rate [rad/s].
        mode: What the loop is doing.
        reason: Why it is damping; empty otherwise.
        uses_estimate: Whether the law runs on a received estimate.
    """

    stamp_ns: int
    tau: Array
    saturated: np.ndarray
    point: Point
    error: Array
    error_rate: Array
    mode: Mode
    reason: str
    uses_estimate: bool


class RateHistory:
    """Recent gyro samples, for the rate and its slope at a time.

    Args:
        span: Time over which samples are kept [s].
    """

    def __init__(self, span: float) -> None:
        self._span_ns = round(span * 1e9)
        self._samples: deque[tuple[int, Vector3]] = deque(maxlen=4096)

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest sample, None before the first."""
        return self._samples[-1][0] if self._samples else None

    def add(self, stamp_ns: int, omega: Vector3) -> None:
        """Take a sample newer than all before."""
        self._samples.append((stamp_ns, omega))
        while stamp_ns - self._samples[0][0] > self._span_ns:
            self._samples.popleft()

    def at(self, stamp_ns: int, base_ns: int) -> tuple[Vector3, Vector3]:
        """Rate and slope at a stamp.

        From the newest sample not after it and one at least `base_ns` older; the slope is zero
        where there are no two such samples. The rate is carried to the stamp with the slope.
        """
        past = [s for s in self._samples if s[0] <= stamp_ns] or list(self._samples)[:1]
        newest_ns, omega = past[-1]
        older = next((s for s in reversed(past) if newest_ns - s[0] >= max(base_ns, 1)), None)
        if older is None:
            return omega, np.zeros(3)
        slope = (omega - older[1]) / ((newest_ns - older[0]) * NS)
        return omega + slope * ((stamp_ns - newest_ns) * NS), slope


class ControlLoop:
    """Tracks a reference by computed torque; damps to zero when an input is stale.

    Args:
        robot: The robot as the model believes it to be.
        settings: `controller`, `reference`, `identifier.structure`, `simulator.period` are used.

    Raises:
        ConfigurationError: settings that don't fit the robot.
    """

    def __init__(self, robot: Robot, settings: Settings) -> None:
        self.robot = robot
        self.n = robot.n_joints - robot.rotor_count
        self._settings = settings.controller
        self._reference_settings = settings.reference
        self._structure = settings.identifier.structure
        check_reference(settings.reference, self.n)
        self._model = law_model(self._settings.law, robot)
        limits = torque_limits(robot, self._settings.torque_limit)
        self._law = ComputedTorque(
            self._model, self._settings.bandwidth, limits, self._settings.damping
        )
        self._timeout_ns = round(self._settings.state_timeout * 1e9)
        self._first_hold_ns = round(settings.simulator.period * 1e9)
        self.estimate: Estimate | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the samples, keep the estimate; the motion starts again at the next sample."""
        self._rates = RateHistory(max(0.5, 4.0 * self._settings.state_timeout))
        self._motion: Reference | None = (
            None  # as asked for; `_reference` is it with the blend that joined it
        )
        self._reference: Reference | None = None
        self._start_ns = 0
        self._pending: tuple[Reference, int] | None = None
        self._last: tuple[int, Array, Array] | None = None
        self._hold_ns = self._first_hold_ns
        self._mode: Mode = 'hold'

    @property
    def mode(self) -> Mode:
        """What the loop is doing."""
        return self._mode

    @property
    def takes_estimates(self) -> bool:
        """Whether the law makes use of estimates."""
        return self._settings.use_estimate and self._settings.law != 'computed_torque_no_aam'

    @property
    def joints_ns(self) -> int | None:
        """Stamp of the last joint sample, None before the first."""
        return self._last[0] if self._last else None

    @property
    def rate_ns(self) -> int | None:
        """Stamp of the newest gyro sample, None before the first."""
        return self._rates.newest_ns

    def set_estimate(self, estimate: Estimate | None) -> None:
        """Use an estimate from now on (None: the robot file's model again).

        Raises:
            MessageRejectedError: not valid, not for this robot, or with an indefinite inertia.
        """
        if estimate is not None:
            if not estimate.valid:
                raise MessageRejectedError(f'estimate not valid: {estimate.reason}')
            try:
                estimate.check()
                model = law_model(self._settings.law, self.robot, self._structure, estimate)
                q = self._last[1] if self._last else np.zeros(self.n)
                np.linalg.cholesky(model(q, np.zeros(self.n), np.zeros(3)).H)
            except SpaceRobotError as error:
                raise MessageRejectedError(str(error)) from error
            except np.linalg.LinAlgError as error:
                raise MessageRejectedError('estimate: joint inertia not positive') from error
        else:
            model = law_model(self._settings.law, self.robot)
        self.estimate = estimate
        self._law.model = model

    def set_reference(self, reference: Reference, start_ns: int | None = None) -> None:
        """Follow another motion, joined smoothly from the present one.

        Args:
            reference: The motion.
            start_ns: Stamp of its t = 0; None: the next joint sample.
        """
        self._pending = (reference, -1 if start_ns is None else start_ns)

    def reference_point(self) -> Point | None:
        """Where the present motion is at the last joint sample; None before the first."""
        if self._last is None or self._reference is None:
            return None
        return self._reference.at(self._time(self._last[0]))

    def add_rate(self, stamp_ns: int, omega_WB_B: Vector3) -> None:
        """Take a gyro sample.

        Raises:
            MessageRejectedError: stamp not after the last one.
        """
        newest = self._rates.newest_ns
        if newest is not None and stamp_ns <= newest:
            raise _stamp_error(stamp_ns, newest)
        self._rates.add(stamp_ns, omega_WB_B)

    def add_joints(self, stamp_ns: int, q: Array, qd: Array) -> Command:
        """Take a joint sample and answer it.

        Raises:
            MessageRejectedError: stamp not after the last one.
        """
        if self._last is not None:
            if stamp_ns <= self._last[0]:
                raise _stamp_error(stamp_ns, self._last[0])
            self._hold_ns = min(stamp_ns - self._last[0], self._timeout_ns)
        reason = self._stale_rate(stamp_ns)
        sample = self._sample(stamp_ns, q, qd)
        if reason:
            self._pause(stamp_ns)
        reference = self._prepare_reference(stamp_ns, sample, bool(reason))
        self._last = (stamp_ns, q, qd)
        t = self._time(stamp_ns)
        if reason:
            self._mode = 'damping'
        else:
            self._mode = 'hold' if t >= reference.duration else 'tracking'
        try:
            torque = self._torque(reference, t, sample)
        except (IdentificationError, np.linalg.LinAlgError):
            self.set_estimate(None)  # unusable in this state: back to the robot file's model
            torque = self._torque(reference, t, sample)
        return self._command(stamp_ns, torque, reference.at(t), sample, reason)

    def blind(self, elapsed_ns: int) -> Command | None:
        """Command for when no joint states arrive any more; None while the last is fresh.

        The joints are extrapolated along the decay that the damping law asks for. The torque that
        holds against the wheels fades ten times slower, so that braking is over by then. None
        also before the first sample.

        Args:
            elapsed_ns: Time since the last joint sample [ns].
        """
        if self._last is None or elapsed_ns <= self._timeout_ns:
            return None
        self._mode = 'damping'
        stamp_ns, q, qd = self._last
        rate = self._settings.damping
        past = (elapsed_ns - self._timeout_ns) * NS
        decay = float(np.exp(-rate * past))
        seen = self._timeout_ns * NS
        omega = self._sample(stamp_ns, q, qd).omega_WB_B
        now = Sample(q + qd * (seen + (1.0 - decay) / rate), qd * decay, omega, np.zeros(3))
        point = self.reference_point() or rest(q)
        torque = self._law.damp(now, trust=decay**0.1)
        return self._command(stamp_ns + elapsed_ns, torque, point, now, 'joint states are stale')

    def _torque(self, reference: Reference, t: float, sample: Sample) -> Torque:
        if self._mode == 'damping':
            return self._law.damp(sample)
        hold = self._hold_ns * NS if self._settings.hold_compensation else 0.0
        return self._law.track(reference, t, sample, hold)

    def _stale_rate(self, stamp_ns: int) -> str:
        if not self.robot.is_free:
            return ''
        newest = self._rates.newest_ns
        if newest is None:
            return 'no gyro sample yet'
        return 'gyro is stale' if stamp_ns - newest > self._timeout_ns else ''

    def _sample(self, stamp_ns: int, q: Array, qd: Array) -> Sample:
        if self._rates.newest_ns is None or not self.robot.is_free:
            return Sample(q, qd, np.zeros(3), np.zeros(3))
        if stamp_ns - self._rates.newest_ns > self._timeout_ns:
            stamp_ns = self._rates.newest_ns
        return Sample(q, qd, *self._rates.at(stamp_ns, self._hold_ns))

    def _time(self, stamp_ns: int) -> float:
        return (stamp_ns - self._start_ns) * NS

    def _pause(self, stamp_ns: int) -> None:
        # the motion waits while damping, so that it doesn't run away from joints that don't follow
        if self._last is not None:
            self._start_ns += stamp_ns - self._last[0]

    def _prepare_reference(self, stamp_ns: int, sample: Sample, stale: bool) -> Reference:
        here = Point(sample.q, sample.qd, np.zeros(self.n))
        if self._reference is None or self._motion is None:
            self._motion = self._reference = build_reference(self._reference_settings, sample.q)
            self._start_ns = stamp_ns
        elif not stale and self._lost(stamp_ns):
            self._reference = self._join(self._motion, self._time(stamp_ns), here)
        if self._pending is not None and not stale and self._pending[1] <= stamp_ns:
            here = self._reference.at(self._time(stamp_ns))
            self._motion, start_ns = self._pending
            self._start_ns = stamp_ns if start_ns < 0 else start_ns
            t = self._time(stamp_ns)
            # its acceleration may begin with a step, as that of every cubic does
            start = Point(here.q, here.qd, self._motion.at(t).qdd)
            self._reference = self._join(self._motion, t, start)
            self._pending = None
        return self._reference

    def _lost(self, stamp_ns: int) -> bool:
        if self._last is not None and stamp_ns - self._last[0] > self._timeout_ns:
            self._pause(stamp_ns)
            return True
        return self._mode == 'damping'

    def _join(self, reference: Reference, t: float, start: Point) -> Reference:
        return Blend(reference, t, start, 4.0 / self._settings.bandwidth)

    def _command(
        self, stamp_ns: int, torque: Torque, point: Point, sample: Sample, reason: str
    ) -> Command:
        return Command(
            stamp_ns,
            torque.tau,
            torque.saturated,
            point,
            point.q - sample.q,
            point.qd - sample.qd,
            self._mode,
            reason,
            self.estimate is not None and self.takes_estimates,
        )


def _stamp_error(stamp_ns: int, last_ns: int) -> MessageRejectedError:
    return MessageRejectedError(
        'duplicate stamp' if stamp_ns == last_ns else 'stamp goes backwards'
    )
