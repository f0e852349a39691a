"""Late stamps. Only relative timing is observable: all sensors late alike look punctual."""

from __future__ import annotations

from typing import ClassVar

from .effect import Effect
from .parameter import Parameter, amount


def _delay(relevant: float) -> tuple[Parameter, ...]:
    return (amount('delay', 's', 0.02, relevant, maximum=10.0),)


class Delay(Effect):
    """A sample stamped t shows the truth at t - delay, by one of `effects.effect.CLOCKS`.

    Typical: 0.1 to 100 ms: filters, buses, image processing.
    Source: Markley and Crassidis, Fundamentals of Spacecraft ADCS, 4.2.

    Args:
        delay: Time by which the stamps are late.
    """

    group = 'sensor'
    clock: ClassVar[str]

    def delay(self, clock: str) -> float:
        """The delay, for its own clock."""
        return self['delay'] if clock == self.clock else 0.0


class ImuDelay(Delay):
    """A late gyro.

    Signature: a rate residual in proportion to the angular acceleration of the base.
    """

    id = 'imu_delay'
    clock = 'imu'
    title = 'late gyro'
    needs_free_base = True
    parameters = _delay(1e-4)


class AttitudeDelay(Delay):
    """A late star tracker.

    Signature: an attitude residual in proportion to the rate of the base.
    """

    id = 'attitude_delay'
    clock = 'attitude'
    title = 'late star tracker'
    needs_free_base = True
    parameters = _delay(1.5e-4)


class JointDelay(Delay):
    """Late joint states, the torques included.

    Signature: a position residual in proportion to the joint rates, all joints alike.
    """

    id = 'joint_delay'
    clock = 'joints'
    title = 'late joint states'
    parameters = _delay(1e-4)


class EffortDelay(Delay):
    """Torques that are late beside the rest of the joint states.

    Signature: a torque residual in proportion to the slope of the torque, all joints alike.
    """

    id = 'effort_delay'
    clock = 'effort'
    title = 'torques later than the joint positions that they come with'
    parameters = _delay(5e-4)
