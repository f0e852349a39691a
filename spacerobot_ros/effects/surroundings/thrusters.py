"""Faults of commanded inputs: thrusters that give another force, commands that act late."""

from __future__ import annotations

from dataclasses import replace

from ...model.robot import Robot
from ..effect import Effect
from ..parameter import Parameter, amount


class ThrusterGain(Effect):
    """F = gain F_file of one thruster; a dead one has a gain of 0.

    What the inertia of the body is not known for, its thrusters' gains share: they are relative to
    the file's mass and inertia.

    Typical: 0.8 to 1.1: supply pressure, wear; 0 for a valve that does not open.
    Signature: the body does not do what this thruster was told to, in proportion to its command.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.4.

    Args:
        gain: Force for the file's.
    """

    id = 'thruster_gain'
    title = 'thruster of another force than the file says'
    group = 'inputs'
    needs_free_base = True
    parameters = (Parameter('gain', '', 0.5, 0.02, nominal=1.0, minimum=0.0),)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """Every thruster."""
        return tuple(thruster.name for thruster in robot.thrusters)

    def change(self, robot: Robot) -> Robot:
        """The robot with this thruster's force scaled."""
        thrusters = tuple(
            replace(t, force=self['gain'] * t.force) if t.name == self.where else t
            for t in robot.thrusters
        )
        return replace(robot, thrusters=thrusters)


class CommandDelay(Effect):
    """Thrusters do at t what was commanded for t - delay, all alike.

    Typical: 5 ms (valves) to 0.2 s (radio link, pneumatic lines).
    Signature: every pulse is seen late by the same time.
    Source: Wertz, Spacecraft Attitude Determination and Control, 17.4.

    Args:
        delay: Time from a command to its force.
    """

    id = 'command_delay'
    title = 'thrusters later than their commands'
    group = 'inputs'
    needs_free_base = True
    parameters = (amount('delay', 's', 0.05, 1e-3, maximum=10.0),)

    @classmethod
    def places(cls, robot: Robot) -> tuple[str | None, ...]:
        """The thrusters as a whole, where there are any."""
        return (None,) if robot.thrusters else ()

    def change(self, robot: Robot) -> Robot:
        """The robot with its commands later."""
        if robot.inputs is None:
            return robot
        return replace(robot, inputs=robot.inputs.delayed(self['delay']))
