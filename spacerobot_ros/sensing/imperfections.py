"""What makes sensors real: noise, bias walk, limits, steps, lost and badly timed samples.

Every random stream is keyed by the seed and by its place in `STREAMS`, so a sensor that is added,
silenced or sampled at another rate leaves the noise of all others as it was.
"""

from __future__ import annotations

import math

import numpy as np

from ..model.robot_settings import SensorSettings
from ..model.settings import SimulatorSettings
from ..types import Array, Vector3

# Append only: the place of a name is part of what a seed means.
STREAMS = (
    'joint_position',
    'joint_velocity',
    'joint_effort',
    'gyro',
    'attitude',
    'wheel_rate',
    'gyro_bias_walk',
    'joints_lost',
    'imu_lost',
    'attitude_lost',
    'joints_jitter',
    'imu_jitter',
    'attitude_jitter',
)
CHANNELS = ('joint_position', 'joint_velocity', 'joint_effort', 'gyro', 'attitude')
CLOCKS = {'joints': 'joint', 'imu': 'imu', 'attitude': 'attitude'}
"""Clocks, and what their settings' names begin with."""


class Imperfections:
    """Noise and limits of all sensors of one simulated robot.

    Args:
        sensors: Standard deviations, a missing one meaning no noise, and limits.
        settings: Seed, rates, and whether anything is random at all.
    """

    def __init__(self, sensors: SensorSettings, settings: SimulatorSettings) -> None:
        self._streams = {
            name: np.random.default_rng(np.random.SeedSequence(settings.seed, spawn_key=(place,)))
            for place, name in enumerate(STREAMS)
        }
        random = 1.0 if settings.noise else 0.0
        self._std = {
            channel: random * np.array(getattr(sensors, f'{channel}_std') or 0.0)
            for channel in CHANNELS
        }
        # a tachometer is as noisy as a joint's rate
        self._std['wheel_rate'] = np.array(random * (sensors.std('joint_velocity') or 0.0))
        self._resolution = {
            channel: getattr(sensors, f'{channel}_resolution', 0.0) for channel in CHANNELS
        }
        self._lost, self._jitter, self._drift = (
            {clock: share * getattr(sensors, f'{name}_{what}') for clock, name in CLOCKS.items()}
            for what, share in (('dropout', random), ('jitter', random), ('clock_drift', 1.0))
        )
        self._walk = random * sensors.gyro_bias_walk / math.sqrt(settings.imu_rate)
        self._bias: Vector3 = np.zeros(3)
        self._gyro_range = sensors.gyro_range or math.inf
        self._blind_above = sensors.attitude_rate_limit or math.inf

    def most_late(self, clock: str, time: float) -> float:
        """Largest lateness of a clock's stamps around a time, fixed delays excluded [s]."""
        return self._jitter[clock] + self._drift[clock] * time

    def late(self, clock: str, time: float) -> float:
        """Lateness of one stamp [s]; takes from the clock's stream."""
        late = self._drift[clock] * time
        if self._jitter[clock]:
            late += self._jitter[clock] * float(self._streams[f'{clock}_jitter'].random())
        return late

    def is_lost(self, clock: str, step_index: int) -> bool:
        """Whether a sample is lost; the first never is, for it starts whoever waits for it."""
        if not self._lost[clock]:
            return False
        draw = float(self._streams[f'{clock}_lost'].random())
        return step_index > 0 and draw < self._lost[clock]

    def is_blind(self, omega: Vector3) -> bool:
        """Whether the star tracker sees nothing at a body rate [rad/s]."""
        return float(np.linalg.norm(omega)) > self._blind_above

    def rate(self, omega: Vector3) -> Vector3:
        """(3,) what the gyro says: noise and walking bias, within its range [rad/s]."""
        if self._walk:
            step = self._streams['gyro_bias_walk'].standard_normal(3)
            self._bias = self._bias + self._walk * step
            omega = omega + self._bias
        noisy = self.noisy('gyro', omega, stepped=False)
        return self._stepped('gyro', np.clip(noisy, -self._gyro_range, self._gyro_range))

    def noisy(self, name: str, values: Array, *, stepped: bool = True) -> Array:
        """Values with white noise, rounded to the sensor's steps."""
        std = self._std[name]
        out = np.array(values, dtype=float)
        if std.any():
            out = values + std * self._streams[name].standard_normal(len(values))
        return self._stepped(name, out) if stepped else out

    def _stepped(self, name: str, values: Array) -> Array:
        step = self._resolution.get(name, 0.0)
        return np.round(values / step) * step if step else values
