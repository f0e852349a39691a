"""Late stamps. Only relative timing is observable: all sensors late alike look punctual."""

from __future__ import annotations

from dataclasses import dataclass

from .effect import Effect, Parameter, Values


@dataclass(frozen=True, kw_only=True)
class Delay(Effect):
    """A sample stamped t shows the truth at t - delay.

    Args:
        clock: One of `effects.effect.CLOCKS`.
    """

    clock: str

    def delay(self, clock: str, values: Values) -> float:
        """The delay, for its own clock."""
        return values['delay'] if clock == self.clock else 0.0


def _delay(
    id: str, clock: str, title: str, *, relevant: float, signature: str, on_base: bool = False
) -> Delay:
    parameter = Parameter(
        name='delay',
        unit='s',
        doc='Time by which the stamps are late.',
        minimum=0.0,
        maximum=10.0,
        size=0.02,
        relevant=relevant,
    )
    return Delay(
        id=id,
        clock=clock,
        title=title,
        group='sensor',
        parameters=(parameter,),
        needs_free_base=on_base,
        magnitude='0.1 to 100 ms: filters, buses, image processing',
        signature=signature,
        source='Markley and Crassidis, Fundamentals of Spacecraft ADCS, 4.2',
    )


EFFECTS = (
    _delay(
        'imu_delay',
        'imu',
        'late gyro',
        relevant=1e-4,
        signature='a rate residual in proportion to the angular acceleration of the base',
        on_base=True,
    ),
    _delay(
        'attitude_delay',
        'attitude',
        'late star tracker',
        relevant=1.5e-4,
        signature='an attitude residual in proportion to the rate of the base',
        on_base=True,
    ),
    _delay(
        'joint_delay',
        'joints',
        'late joint states',
        relevant=1e-4,
        signature='a position residual in proportion to the joint rates, all joints alike',
    ),
    _delay(
        'effort_delay',
        'effort',
        'torques later than the joint positions that they come with',
        relevant=5e-4,
        signature='a torque residual in proportion to the slope of the torque, all joints alike',
    ),
)
