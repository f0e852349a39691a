"""Samples that belong together: joint states wait for the gyro and attitude of their stamp.

In lockstep the torque would otherwise depend on which of two messages was handled first.
"""

from __future__ import annotations

from typing import Any

from ..control.loop import ControlLoop
from ..model.settings import SimulatorSettings
from ..sensing.sensors import steps_between
from .pace import IdleTime


class Pairing:
    """Joint states that wait for the other sensors.

    Args:
        loop: Takes the samples; knows the newest gyro sample and attitude.
        simulator: Rates of the simulated sensors, and whether they come in lockstep.
        idle: Counts the time between calls of `overdue`.

    Raises:
        ConfigurationError: rates that don't divide the control rate.
    """

    def __init__(self, loop: ControlLoop, simulator: SimulatorSettings, idle: IdleTime) -> None:
        self.is_lockstep = simulator.lockstep and loop.robot.is_free
        self.waiting: tuple[Any, ...] | None = None
        self._loop, self._idle = loop, idle
        self._patience_ns = round(simulator.lockstep_timeout * 1e9)
        self._gyro_ns = _period_ns(simulator, 'imu_rate')
        self._attitude_ns = _period_ns(simulator, 'attitude_rate')

    def hold_back(self, joints: tuple[Any, ...]) -> bool:
        """Keep joint states back until the samples of their stamp are there; whether it does."""
        if not self.is_lockstep or self._is_complete(joints[0]):
            return False
        if self.waiting is None:
            self._idle.clear()
        self.waiting = joints
        return True

    def overdue(self) -> tuple[Any, ...] | None:
        """Joint states that waited for `lockstep_timeout`: a dead sensor does not stop time."""
        self._idle.tick()
        return self.waiting if self._idle.ns > self._patience_ns else None

    def _is_complete(self, stamp: int) -> bool:
        streams = [(self._loop.rate_ns, self._gyro_ns)]
        if self._loop.controller.controls_attitude:
            streams.append((self._loop.attitude_ns, self._attitude_ns))
        return all(
            newest is not None and newest >= stamp // period * period for newest, period in streams
        )


def _period_ns(simulator: SimulatorSettings, rate: str) -> int:
    """Time between two samples of a simulated sensor [ns]."""
    steps = steps_between(getattr(simulator, rate), simulator.period, f'simulator.{rate}')
    return round(simulator.period * 1e9) * steps
