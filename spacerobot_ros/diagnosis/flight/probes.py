"""Where a model may fail: torques that it does not know, sensors that it does not describe.

Which effect is behind it, `spacerobot diagnose` tells from the recorded bag.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...model.robot import Robot

_SENSORS = (('joint_position', 'position', 'rad'), ('joint_velocity', 'rate', 'rad/s'))


@dataclass(frozen=True, slots=True)
class Probe:
    """One way in which a model may fail.

    Args:
        channel: `joint_torque`, `angular_momentum` or one of `grid.CHANNELS`.
        axis: Joint or axis number.
        name: For people, such as `joint_2 torque`.
        unit: Of what is unexplained.
        driven: Index among the filter's velocities of what an unknown torque drives; None for a
            sensor.
    """

    channel: str
    axis: int
    name: str
    unit: str
    driven: int | None = None


def probes_of(robot: Robot) -> tuple[Probe, ...]:
    """All probes of a robot."""
    base = 3 if robot.is_free else 0
    out = [
        Probe('joint_torque', i, f'{joint} torque', robot.unit_of('N m', joint), base + i)
        for i, joint in enumerate(robot.joints)
    ]
    if robot.is_free:
        out += [
            Probe('angular_momentum', i, f'angular momentum {x}', 'N m', i)
            for i, x in enumerate('xyz')
        ]
        for channel, unit in (('gyro', 'rad/s'), ('attitude', 'rad')):
            out += [Probe(channel, i, f'{channel} {x}', unit) for i, x in enumerate('xyz')]
    for channel, word, unit in _SENSORS:
        out += [
            Probe(channel, i, f'{joint} {word}', robot.unit_of(unit, joint))
            for i, joint in enumerate(robot.joints)
        ]
    return tuple(out)
