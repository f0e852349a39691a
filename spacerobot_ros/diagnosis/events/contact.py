"""Pulses on joints at one time as an event: whom they act on, and how far out.

A contact on a link is felt by the joints between it and the base, as far as its lever reaches, so
the last joint that feels it moves that link or one nearer the base. Joints of two branches feel
two. What a single joint feels may be its own drive or brake as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...effects.surroundings.external import ExternalJointTorque, ExternalWrench
from ...model.robot import Robot
from .event import Event


@dataclass(frozen=True, slots=True)
class Pulse:
    """A torque on one joint for a while.

    Args:
        joint: Its number. run: Number of the recording.
        start: Since the recording's start [s]. end: [s]. edge: Share of its duration.
        torque: Largest torque from outside [N m]. std: Its standard deviation.
        z: Its size by that.
    """

    joint: int
    run: int
    start: float
    end: float
    edge: float
    torque: float
    std: float
    z: float

    @property
    def times(self) -> dict[str, float]:
        """Parameters of an effect that acts meanwhile."""
        return {'start': max(self.start, 0.0), 'end': self.end, 'edge': self.edge}


def overlap(p: Pulse, q: Pulse) -> bool:
    """Whether two pulses of a recording share some time."""
    return p.run == q.run and p.start < q.end and q.start < p.end


def are_in_line(robot: Robot, j: int, k: int) -> bool:
    """Whether one of two joints moves the other, so that one contact may be felt by both."""
    return bool(robot.moves[j, 1 + k] or robot.moves[k, 1 + j])


def place_of(robot: Robot, joints: Sequence[int]) -> tuple[str, str]:
    """Effect and place of what some joints feel: of one joint alone, that joint."""
    if len(joints) > 1:
        return ExternalWrench.id, _beyond(robot, joints)
    return ExternalJointTorque.id, robot.joints[joints[0]]


def last_felt(robot: Robot, joints: Sequence[int]) -> list[str]:
    """The link of the last joint that feels something; one a branch."""
    last = [j for j in joints if not any(robot.moves[j, 1 + k] for k in joints if k != j)]
    return [robot.bodies[1 + j].name for j in last]


def _beyond(robot: Robot, joints: Sequence[int]) -> str:
    return f'{" and ".join(last_felt(robot, joints))} or beyond'


def event_of(robot: Robot, pulses: Sequence[Pulse], p_value: float | None, last: float) -> Event:
    """An event of one pulse or more, one a joint, the largest of which gives its time.

    Args:
        robot: The robot.
        pulses: What joints feel.
        p_value: Probability of such a size by chance.
        last: End of the recording [s].
    """
    first = max(pulses, key=lambda p: abs(p.z))
    felt = sorted(pulses, key=lambda p: p.joint)
    names = [robot.joints[p.joint] for p in felt]
    effect, where = place_of(robot, [p.joint for p in felt])
    return Event(
        effect=effect,
        where=where,
        joints=tuple(names),
        start=max(first.start, 0.0),
        end=min(first.end, last),
        ongoing=first.end >= last,
        peak={name: p.torque for name, p in zip(names, felt, strict=True)},
        peak_std={name: p.std for name, p in zip(names, felt, strict=True)},
        units={name: robot.unit_of('N m', name) for name in names},
        z=abs(first.z),
        p_value=p_value,
        rivals=() if len(felt) > 1 else (f'external_wrench at {_beyond(robot, [first.joint])}',),
        recording=first.run,
        applied=tuple(
            ExternalJointTorque(
                name=f'event_{robot.joints[p.joint]}',
                where=robot.joints[p.joint],
                values={**p.times, 'torque': p.torque},
            )
            for p in felt
        ),
    )
