"""Sensors of the simulated robot: rates, and Gaussian noise from one seeded stream a sensor.

A stream is keyed by the seed and by the sensor's place in `STREAMS`, so a sensor that is added,
silenced or sampled at another rate leaves the noise of all others as it was.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..dynamics.state import State
from ..errors import ConfigurationError
from ..model.settings import SensorSettings, SimulatorSettings
from ..types import Array, Quaternion, Vector3

# Append only: the place of a name is part of what a seed means.
STREAMS = ('joint_position', 'joint_velocity', 'joint_effort', 'gyro', 'attitude', 'wheel_rate')


@dataclass(frozen=True, slots=True, eq=False)
class JointMeasurement:
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
class Measurements:
    """What the sensors say at one step; None where a sensor is not due.

    Args:
        joints: Manipulator joints.
        omega: (3,) omega_WB_B of the gyro [rad/s].
        attitude_xyzw: (4,) q_WB of the star tracker, normalised.
        wheel_rates: (n_wheels,) relative rates of the servicer's true rotors [rad/s]; None where
            it has none.
    """

    joints: JointMeasurement | None
    omega: Vector3 | None
    attitude_xyzw: Quaternion | None
    wheel_rates: Array | None = None


class SensorSuite:
    """All sensors of one simulated robot.

    Each noise stream advances once a sample that is due, so `sample` is called once a step, in
    order.

    Args:
        noise: Standard deviations; a missing one means an exact sensor.
        settings: Period, rates, seed, and whether there is noise at all.
        n_joints: Number of manipulator joints.
        n_wheels: Number of the servicer's true rotors with a tachometer; it shares rate and noise
            of the joint rates.

    Raises:
        ConfigurationError: a rate that doesn't divide the control rate.
    """

    def __init__(
        self, noise: SensorSettings, settings: SimulatorSettings, n_joints: int, n_wheels: int = 0
    ) -> None:
        self._n_joints = n_joints
        self._n_wheels = n_wheels
        self._joint_every = steps_between(
            settings.joint_rate, settings.period, 'simulator.joint_rate'
        )
        self._imu_every = steps_between(settings.imu_rate, settings.period, 'simulator.imu_rate')
        self._attitude_every = steps_between(
            settings.attitude_rate, settings.period, 'simulator.attitude_rate'
        )
        stds = (
            noise.joint_position_std,
            noise.joint_velocity_std,
            noise.joint_effort_std,
            noise.gyro_std,
            noise.attitude_std,
            noise.joint_velocity_std,
        )
        self._std = {
            name: (std or 0.0) if settings.noise else 0.0
            for name, std in zip(STREAMS, stds, strict=True)
        }
        self._streams = {
            name: np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=(place,)))
            for place, name in enumerate(STREAMS)
        }

    def sample(self, step_index: int, state: State, effort: Array) -> Measurements:
        """Measure what is due at a step.

        Args:
            step_index: Number of control periods since the start.
            state: True state at that time.
            effort: (n_joints,) torque applied over the step that ended there (`Plant.effort`) [N
                m].
        """
        joints = step_index % self._joint_every == 0
        return Measurements(
            joints=self._joints(state, effort) if joints else None,
            omega=self._noisy('gyro', state.omega_WB_B)
            if step_index % self._imu_every == 0
            else None,
            attitude_xyzw=self._attitude(state.q_WB_xyzw)
            if step_index % self._attitude_every == 0
            else None,
            wheel_rates=self._wheels(state) if joints and self._n_wheels else None,
        )

    def _joints(self, state: State, effort: Array) -> JointMeasurement:
        n = self._n_joints
        return JointMeasurement(
            self._noisy('joint_position', state.q[:n]),
            self._noisy('joint_velocity', state.qd[:n]),
            self._noisy('joint_effort', effort),
        )

    def _wheels(self, state: State) -> Array:
        return self._noisy(
            'wheel_rate', state.qd[self._n_joints : self._n_joints + self._n_wheels]
        )

    def _attitude(self, q_xyzw: Quaternion) -> Quaternion:
        """The true attitude, turned on the body side: R_meas = R_WB exp(skew(noise_B))."""
        error = self._noisy('attitude', np.zeros(3))
        return turned(q_xyzw, error)

    def _noisy(self, name: str, values: Array) -> Array:
        std = self._std[name]
        if std == 0.0:
            return np.array(values, dtype=float)
        return np.asarray(values + std * self._streams[name].standard_normal(len(values)))


def turned(q_WB_xyzw: Quaternion, rotation_vector_B: Vector3) -> Quaternion:
    """Attitude turned about its own axes: q_WB * exp(rotation_vector_B), normalised.

    Args:
        q_WB_xyzw: (4,) attitude.
        rotation_vector_B: (3,) rotation vector in base coordinates [rad].
    """
    half = 0.5 * float(np.linalg.norm(rotation_vector_B))
    a, b, c = 0.5 * np.sinc(half / np.pi) * rotation_vector_B
    x, y, z, w = q_WB_xyzw
    d = np.cos(half)
    q = np.array(
        [
            w * a + x * d + y * c - z * b,
            w * b + y * d + z * a - x * c,
            w * c + z * d + x * b - y * a,
            w * d - x * a - y * b - z * c,
        ]
    )
    return np.asarray(q / np.linalg.norm(q))


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
