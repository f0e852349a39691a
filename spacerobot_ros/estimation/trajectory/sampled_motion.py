"""A record with its reference trajectory: by how much the samples deviate, and sensors misread."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ...effects.effect import Effect
from ...effects.motion import Motion
from ...recording.record import Record
from ...sensing.reading_gains import AS_READ, Readings
from ...types import Array
from .reference import Kinematics, NoiseLevels, ReferenceTrajectory
from .time_base import CHANNELS, RowIndex

_CLOCKS = {'gyro': 'imu', 'attitude': 'attitude'}  # all other channels come with the joints


class SampledMotion:
    """What does not depend on a model of the motion.

    Args:
        record: Sensor effects already undone.
        noise: Noise levels.
        reference: Through the record.
        rows: Its samples at the reference's times.
        readings: How sure the samples are.
    """

    def __init__(
        self,
        record: Record,
        noise: NoiseLevels,
        reference: ReferenceTrajectory,
        rows: RowIndex,
        readings: Readings = AS_READ,
    ) -> None:
        self.record, self.noise, self._readings = record, noise, readings
        self.reference, self.rows = reference, rows
        self._at: dict[str, Kinematics] = {}

    @cached_property
    def kinematics(self) -> Kinematics:
        """The reference at its times."""
        return self.reference.at(self.reference.times)

    def at_samples(self, channel: str) -> Kinematics:
        """The reference at the (corrected) times of a channel's samples."""
        if channel not in self._at:
            record, times = self.record, self.reference.times
            stamps = {'gyro': record.rate_time, 'attitude': record.attitude_time}
            at = np.clip(stamps.get(channel, record.joint_time), times[0], times[-1])
            self._at[channel] = self.reference.at(at)
        return self._at[channel]

    @cached_property
    def deviations(self) -> Array:
        """(R,) measured less reference."""
        record = self.record
        joints = self.at_samples('joint_position')
        values = {'joint_position': record.q - joints.q}
        if record.qd is not None:
            values['joint_velocity'] = record.qd - joints.qd
        if len(record.rate_time):
            values['gyro'] = record.omega - self.at_samples('gyro').omega
        if record.attitude is not None:
            reference = self.at_samples('attitude').rotation
            values['attitude'] = (reference.inv() * record.attitude).as_rotvec()
        return self.rows.of({c: v[..., None] for c, v in values.items()})[:, 0]

    @cached_property
    def row_variance(self) -> Array:
        """(R,) of the sensors' noise, and of what their readings were corrected by."""
        levels = self._levels * np.sqrt(1.0 + self._beyond_noise)
        if gains := self._readings.gains:
            beyond = {channel: own[..., None] - 1.0 for channel, own in gains.items()}
            levels = levels / (1.0 + self.rows.of(beyond)[:, 0])
        return np.asarray(levels**2)

    @property
    def spread_cost(self) -> float:
        """Twice what corrections that are unsure take from the log density of the readings.

        Errors that are alike in k rows have log(1 + u^2) together, with u^2 / k in each; rows that
        are taken to have u^2 leave squares of (1 + u^2 / k) / (1 + u^2) where such errors leave 1.
        """
        u2, alike = self._beyond_noise, self._readings.alike
        missing = (1.0 - 1.0 / alike) * u2 / (1.0 + u2)
        return float(np.sum(np.log1p(u2) / alike + missing))

    @property
    def _levels(self) -> Array:
        return np.array([getattr(self.noise, c) for c in CHANNELS])[self.rows.channel]

    @cached_property
    def _beyond_noise(self) -> Array:
        """(R,) u^2: variance of the corrections by that of the noise."""
        stds = {channel: std[..., None] for channel, std in self._readings.unsure.items()}
        if not stds:
            return np.zeros(len(self.rows.state))
        return np.asarray((self.rows.of(stds)[:, 0] / self._levels) ** 2)


def misreading(effect: Effect, channel: str, at: Kinematics, motion: Motion) -> Array:
    """(N, width) by which a channel reads more than the truth.

    Args:
        effect: Only its `sense` and `delay` count.
        channel: One of `CHANNELS`.
        at: The truth.
        motion: The same, as effects ask for it.
    """
    value, slope = {
        'joint_position': (at.q, at.qd),
        'joint_velocity': (at.qd, at.qdd),
        'gyro': (at.omega, at.alpha),
        'attitude': (np.zeros_like(at.omega), at.omega),
    }[channel]
    late: float | Array = effect.delay(_CLOCKS.get(channel, 'joints'))
    if channel in ('joint_position', 'joint_velocity'):
        late = late + effect.joint_delays(motion.robot)
    return effect.sense(channel, value, motion) - value - late * slope
