"""The samples that a control loop gets, less those that contradict their forerunners."""

from __future__ import annotations

from collections import Counter

from ..dynamics.rotation import rotation_between
from ..model.control_settings import ControllerSettings
from ..model.robot_settings import SensorSettings
from ..types import Array, Quaternion, Vector3
from .feedback import NS
from .sample_gate import AttitudeGate, JointGate, RateGate


class SampleScreen:
    """Gates of all sensors; what comes after a pause is compared with nothing.

    Args:
        sensors: Standard deviations of a sample.
        settings: When a sensor is stale.

    Attributes:
        left_out: Samples that contradict their forerunners, by sensor.
    """

    def __init__(self, sensors: SensorSettings, settings: ControllerSettings) -> None:
        names = ('joint_position', 'joint_velocity', 'gyro', 'attitude')
        self._std = {name: sensors.std(name) or 0.0 for name in names}
        self._timeout, self._attitude_timeout = settings.state_timeout, settings.attitude_timeout
        self.left_out: Counter[str] = Counter()
        self.reset()

    def reset(self) -> None:
        """Compare the next samples with nothing."""
        std = self._std
        self._newest: dict[str, float] = {}
        self._joints = JointGate(std['joint_position'], std['joint_velocity'])
        self._rates, self._attitudes = RateGate(std['gyro']), AttitudeGate(std['attitude'])

    def joints(self, stamp_ns: int, q: Array, qd: Array) -> tuple[Array, Array]:
        """Position and rate at a stamp: the measured ones, or what stands in for them."""
        time = stamp_ns * NS
        if self._is_after_pause('joints', time, self._timeout):
            self._joints = JointGate(self._std['joint_position'], self._std['joint_velocity'])
        if not self._joints.is_doubtful(time, q, qd):
            return q, qd
        self.left_out['joints'] += 1
        return self._joints.stand_in(time, self._timeout)

    def is_lost(self, stamp_ns: int) -> bool:
        """Whether no joint sample was believed for so long that nothing can stand in."""
        return self._joints.silence(stamp_ns * NS) > self._timeout

    def takes_rate(self, stamp_ns: int, omega_WB_B: Vector3) -> bool:
        """Whether a gyro sample is to be used."""
        time = stamp_ns * NS
        if self._is_after_pause('imu', time, self._timeout):
            self._rates = RateGate(self._std['gyro'])
        if self._rates.is_doubtful(time, omega_WB_B):
            self.left_out['imu'] += 1
            return False
        self._rates.take(time, omega_WB_B)
        return True

    def takes_attitude(
        self, stamp_ns: int, q_WB_xyzw: Quaternion, predicted: Quaternion | None
    ) -> bool:
        """Whether an attitude is to be used, where the one before and the gyro predict another."""
        if self._is_after_pause('attitude', stamp_ns * NS, self._attitude_timeout):
            self._attitudes = AttitudeGate(self._std['attitude'])
        elif predicted is not None and self._attitudes.is_doubtful(
            rotation_between(predicted, q_WB_xyzw)
        ):
            self.left_out['attitude'] += 1
            return False
        return True

    def _is_after_pause(self, sensor: str, time: float, longest: float) -> bool:
        last = self._newest.get(sensor, -float('inf'))
        self._newest[sensor] = time
        return time - last > longest
