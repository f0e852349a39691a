"""A transient: what acts from outside for a while, on a joint or on a free base.

A contact on a link is felt by the joints between it and the base, as far as its lever reaches, so
the last joint that feels it moves that link or one nearer the base. Joints of two branches feel
two. What a single joint feels may be its own drive or brake as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.effect import Effect
from ...effects.surroundings.external import AngularImpulse, ExternalJointTorque, ExternalWrench
from ...model.robot import Robot
from ...types import Array
from .event import Event, PossibleEvent

AXES = 'xyz'
BASE = -1
"""In the place of a joint's number."""


@dataclass(frozen=True, slots=True, eq=False)
class Transient:
    """A pulse with a start and an end.

    Args:
        joint: Its number, or `BASE`.
        run: Number of the recording.
        start: Since the recording's start [s]. end: [s]. edge: Share of its duration.
        value: (k,) largest torque on the joint [N m], k = 1; angular impulse on the base along
            inertial axes [N m s], k = 3.
        covariance: (k, k).
        z: Size by these, not negative.
    """

    joint: int
    run: int
    start: float
    end: float
    edge: float
    value: Array
    covariance: Array
    z: float

    @classmethod
    def on_joint(
        cls, joint: int, run: int, times: tuple[float, float, float], torque: float, std: float
    ) -> Transient:
        """Of a torque [N m] and its standard deviation, between a start and an end, with edges."""
        size, covariance = np.array([torque]), np.array([[std**2]])
        return cls(joint, run, *times, size, covariance, abs(torque) / std)

    @property
    def duration(self) -> float:
        """[s]."""
        return self.end - self.start

    @property
    def middle(self) -> float:
        """[s]."""
        return 0.5 * (self.start + self.end)

    @property
    def std(self) -> Array:
        """(k,) standard deviations."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def times(self) -> dict[str, float]:
        """Parameters of an effect that acts meanwhile."""
        return {'start': max(self.start, 0.0), 'end': self.end, 'edge': self.edge}

    def overlaps(self, other: Transient, margin: float = 0.0) -> bool:
        """Whether two share some time of a recording, or come as near as a margin [s]."""
        near = self.start < other.end + margin and other.start < self.end + margin
        return self.run == other.run and near

    def applied(self, robot: Robot) -> Effect:
        """As an effect."""
        if self.joint == BASE:
            sizes = dict(zip(AXES, self.value.tolist(), strict=True))
            return AngularImpulse(name='event', where=None, values=self.times | sizes)
        joint, torque = robot.joints[self.joint], float(self.value[0])
        values = {**self.times, 'torque': torque}
        return ExternalJointTorque(name=f'event_{joint}', where=joint, values=values)


@dataclass(frozen=True, slots=True, eq=False)
class Shapes:
    """M pulses of unit size: (M,) centre and duration [s], and the share of their edges."""

    centre: Array
    duration: Array
    edge: Array

    @classmethod
    def of(cls, *found: Transient) -> Shapes:
        """Those of transients."""
        return cls(*np.array([(p.middle, p.duration, p.edge) for p in found]).T)

    @classmethod
    def bells(cls, centre: Array, duration: float) -> Shapes:
        """Bells at centres (M,)."""
        return cls(centre, np.full(len(centre), duration), np.full(len(centre), 0.5))

    def __len__(self) -> int:
        """Number of them."""
        return len(self.centre)

    def __getitem__(self, at: slice) -> Shapes:
        """Some of them."""
        return Shapes(self.centre[at], self.duration[at], self.edge[at])

    @property
    def start(self) -> Array:
        """(M,) [s]."""
        return self.centre - 0.5 * self.duration

    @property
    def end(self) -> Array:
        """(M,) [s]."""
        return self.centre + 0.5 * self.duration


def apart(found: Sequence[Transient], margin: float = 0.0) -> list[Transient]:
    """The largest transients, without those that share time and place with a larger one."""
    out: list[Transient] = []
    for p in sorted(found, key=lambda p: -p.z):
        if not any(p.joint == q.joint and p.overlaps(q, margin) for q in out):
            out.append(p)
    return out


def are_in_line(robot: Robot, j: int, k: int) -> bool:
    """Whether one of two joints moves the other, so that one contact may be felt by both."""
    return bool(robot.moves[j, 1 + k] or robot.moves[k, 1 + j])


def last_felt(robot: Robot, joints: Sequence[int]) -> list[str]:
    """The link of the last joint that feels something; one a branch."""
    last = [j for j in joints if not any(robot.moves[j, 1 + k] for k in joints if k != j)]
    return [robot.bodies[1 + j].name for j in last]


def place_of(robot: Robot, joints: Sequence[int]) -> tuple[str, str | None]:
    """Effect and place of what some joints feel: of one joint alone, that joint; of none, none."""
    if not joints:
        return AngularImpulse.id, None
    if len(joints) > 1:
        return ExternalWrench.id, _beyond(robot, joints)
    return ExternalJointTorque.id, robot.joints[joints[0]]


def _beyond(robot: Robot, joints: Sequence[int]) -> str:
    return f'{" and ".join(last_felt(robot, joints))} or beyond'


def event_of(
    robot: Robot, pulses: Sequence[Transient], p_value: float | None, last: float
) -> Event:
    """An event of one transient or more, one a joint, the largest of which gives its time.

    Args:
        robot: The robot.
        pulses: What joints feel, or the one on the base.
        p_value: Probability of such a size by chance.
        last: End of the recording [s].
    """
    first = max(pulses, key=lambda p: p.z)
    felt = sorted(pulses, key=lambda p: p.joint)
    joints = [p.joint for p in felt if p.joint != BASE]
    effect, where = place_of(robot, joints)
    names = tuple(robot.joints[j] for j in joints)
    units = {name: robot.unit_of('N m', name) for name in names}
    alone = (f'external_wrench at {_beyond(robot, joints)}',) if len(joints) == 1 else ()
    values = np.concatenate([p.value for p in felt]).tolist()
    stds = np.concatenate([p.std for p in felt]).tolist()
    return Event(
        effect=effect,
        where=where,
        joints=names,
        start=max(first.start, 0.0),
        end=min(first.end, last),
        ongoing=first.end >= last,
        peak=dict(zip(names or AXES, values, strict=True)),
        peak_std=dict(zip(names or AXES, stds, strict=True)),
        units=units or dict.fromkeys(AXES, 'N m s'),
        z=first.z,
        p_value=p_value,
        rivals=alone,
        recording=first.run,
        applied=tuple(p.applied(robot) for p in felt),
    )


def possible_of(robot: Robot, pulses: Sequence[Transient], reason: str) -> PossibleEvent:
    """What some joints feel, or the base, at the time of the largest, listed for a reason."""
    first = max(pulses, key=lambda p: p.z)
    return PossibleEvent(
        start=first.start,
        end=first.end,
        joints=tuple(robot.joints[p.joint] for p in pulses if p.joint != BASE),
        z=first.z,
        reason=reason,
        recording=first.run,
        applied=tuple(p.applied(robot) for p in pulses if p.joint == BASE),
    )
