"""Sensors of the simulated robot: when they sample, what they see, what they say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..dynamics.rotation import turned
from ..dynamics.state import State
from ..effects.effect import CLOCKS as EFFECT_CLOCKS
from ..errors import ConfigurationError
from ..model.robot_settings import SensorSettings
from ..model.settings import SimulatorSettings
from ..types import Array, Quaternion, Vector3
from .imperfections import CLOCKS, Imperfections, StateHistory
from .sensor_faults import SensorFaults


@dataclass(frozen=True, slots=True, eq=False)
class JointSample:
    """One sample of the manipulator joints.

    Args:
        position: (n,) [rad].
        velocity: (n,) [rad/s].
        effort: (n,) torque applied over the step that ended at the stamp [N m]; the torque of the
            step that begins there is not known to any sensor yet. Zero before the first step.
    """

    position: Array
    velocity: Array
    effort: Array


@dataclass(frozen=True, slots=True, eq=False)
class SensorSamples:
    """What the sensors say at one step; None where a sensor is not due.

    Args:
        joints: Manipulator joints.
        omega: (3,) omega_WB_B of the gyro [rad/s].
        attitude_xyzw: (4,) q_WB of the star tracker, normalized.
        wheel_rates: (n_wheels,) relative rates of the servicer's true rotors [rad/s]; None where
            it has none.
    """

    joints: JointSample | None
    omega: Vector3 | None
    attitude_xyzw: Quaternion | None
    wheel_rates: Array | None = None


class SensorSuite:
    """All sensors of one simulated robot.

    Each noise stream advances once a sample that is due, so `sample` is called once a step, in
    order. A sensor that is late says what was true before its stamp.

    Args:
        noise: Noise and limits; a missing standard deviation means an exact sensor.
        settings: Period, rates, seed, and whether there is noise at all.
        n_joints: Number of manipulator joints.
        n_wheels: Number of the servicer's true rotors with a tachometer; it shares rate, noise and
            clock of the joint rates.
        faults: What physical effects do to the sensors.

    Raises:
        ConfigurationError: a rate that doesn't divide the control rate.
    """

    def __init__(
        self,
        noise: SensorSettings,
        settings: SimulatorSettings,
        n_joints: int,
        n_wheels: int = 0,
        faults: SensorFaults | None = None,
    ) -> None:
        self._n_joints = n_joints
        self._n_wheels = n_wheels
        self._period = settings.period
        self._every = {
            clock: steps_between(
                getattr(settings, f'{name}_rate'), settings.period, f'simulator.{name}_rate'
            )
            for clock, name in CLOCKS.items()
        }
        self._imperfections = Imperfections(noise, settings)
        self._faults = faults
        self._delay = dict.fromkeys(EFFECT_CLOCKS, 0.0) if faults is None else faults.delay
        self._joint_delays = {} if faults is None else faults.joint_delays
        self._history = StateHistory()

    def sample(
        self, step_index: int, state: State, effort: Array, hidden: Array | None = None
    ) -> SensorSamples:
        """Measure what is due at a step.

        Args:
            step_index: Number of control periods since the start.
            state: True state at that time.
            effort: (n_joints,) torque applied over the step that ended there (`Plant.effort`) [N
                m].
            hidden: Own states of all effects (`Plant.hidden`).
        """
        own = np.zeros(0) if hidden is None else hidden
        time = step_index * self._period
        self._history.add(time, state, effort, own, self._span(time))
        joints, imu, attitude = (self._seen(clock, step_index) for clock in CLOCKS)
        return SensorSamples(
            joints=None if joints is None else self._joints(joints),
            omega=None if imu is None else self._rate(imu),
            attitude_xyzw=None if attitude is None else self._attitude(attitude),
            wheel_rates=self._wheels(joints) if joints is not None and self._n_wheels else None,
        )

    def _seen(self, clock: str, step_index: int) -> float | None:
        """Time that a sensor's sample shows [s]; None where it says nothing."""
        if step_index % self._every[clock]:
            return None
        time = step_index * self._period
        late = self._delay[clock] + self._imperfections.late(clock, time)
        return None if self._imperfections.is_lost(clock, step_index) else time - late

    def _span(self, time: float) -> float:
        late = [
            self._delay[clock] + self._imperfections.most_late(clock, time) for clock in CLOCKS
        ]
        return max(late) + self._delay['effort'] + max(self._joint_delays.values(), default=0.0)

    def _joints(self, time: float) -> JointSample:
        n, noisy = self._n_joints, self._imperfections.noisy
        state = self._history.state(time)
        effort_late = self._delay['effort']
        truth = {'joint_position': state.q[:n], 'joint_velocity': state.qd[:n]}
        truth['joint_effort'] = self._history.effort(time - effort_late)
        for j, late in self._joint_delays.items():
            own = self._history.state(time - late)
            seen = (own.q[:n], own.qd[:n], self._history.effort(time - late - effort_late))
            is_own = np.arange(n) == j
            truth = {
                name: np.where(is_own, value, truth[name])
                for name, value in zip(truth, seen, strict=True)
            }
        sensed = self._sensed(time, truth)
        return JointSample(*(noisy(name, value) for name, value in sensed.items()))

    def _wheels(self, time: float) -> Array:
        n = self._n_joints
        rates = self._history.state(time).qd[n : n + self._n_wheels]
        return self._imperfections.noisy('wheel_rate', rates)

    def _rate(self, time: float) -> Vector3:
        state = self._history.state(time)
        sensed = self._sensed(time, {'gyro': state.omega_WB_B})
        return self._imperfections.rate(sensed['gyro'])

    def _attitude(self, time: float) -> Quaternion | None:
        """The true attitude, turned on the body side: R_meas = R_WB exp(skew(error_B))."""
        state = self._history.state(time)
        error = self._sensed(time, {'attitude': np.zeros(3)})['attitude']
        noise = self._imperfections.noisy('attitude', np.zeros(3))
        if self._imperfections.is_blind(state.omega_WB_B):
            return None
        q = turned(state.q_WB_xyzw, error) if error.any() else state.q_WB_xyzw
        return turned(q, noise)

    def _sensed(self, time: float, channels: dict[str, Array]) -> dict[str, Array]:
        """True values of channels at a time with what physical effects do to them."""
        faults = self._faults
        if faults is None or faults.are_none:
            return channels
        history = self._history
        motion = faults.motion(time, history.state(time), history.effort(time))
        hidden = history.hidden(time)
        return {
            name: faults.sensed(name, value[None], motion, hidden)[0]
            for name, value in channels.items()
        }


def steps_between(rate: float, period: float, place: str) -> int:
    """Control periods from one sample to the next.

    Args:
        rate: Sample rate [Hz].
        period: Control period [s].
        place: Name of the parameter, for the error.

    Raises:
        ConfigurationError: a rate above the control rate, or one that doesn't divide it.
    """
    ratio = 1.0 / (period * rate)
    steps = round(ratio)
    if steps < 1 or abs(ratio - steps) > 1e-9 * ratio:
        raise ConfigurationError(
            place,
            f'{rate:g} Hz does not divide the control rate of {1.0 / period:g} Hz '
            f'(simulator.period = {period:g} s)',
        )
    return steps
