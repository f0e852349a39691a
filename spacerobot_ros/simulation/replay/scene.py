"""Everything that a replay shows, as plain arrays and names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...dynamics.equations import Dynamics
from ...effects.robot_file import RobotFile
from ...model.robot import Robot
from ...recording.record import Record
from ...sensing.sensor_faults import corrected_record
from ...types import Array
from .shapes import Shape, shapes_of
from .tracks import RobotTrack, frame_times, measured_track, predicted_track


@dataclass(frozen=True, slots=True, eq=False)
class Arrow:
    """A momentum.

    Args:
        label: What it is.
        body: Index of the body that carries it; -1: at the centre of mass, in inertial axes.
        values: (1, 3) constant, or (N, 3) at every time [N m s].
    """

    label: str
    body: int
    values: Array


@dataclass(frozen=True, slots=True, eq=False)
class ShownChannel:
    """Lines of one set of axes beneath the picture.

    Args:
        title: What it is. unit: SI.
        labels: Of its lines.
        values: (K, N) at the times of the frames.
    """

    title: str
    unit: str
    labels: tuple[str, ...]
    values: Array


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A recording as it is played.

    Args:
        robot: Gives bodies and joints.
        shapes: Of every body.
        measured: Where it was.
        predicted: Where the model would have gone; None: it says nothing.
        arrows: Momenta.
        channels: What is drawn beneath.
        marks: Words at bodies, by index.
        notes: What should be said beside it.
    """

    robot: Robot
    shapes: Sequence[Sequence[Shape]]
    measured: RobotTrack
    predicted: RobotTrack | None
    arrows: tuple[Arrow, ...]
    channels: tuple[ShownChannel, ...]
    marks: tuple[tuple[int, str], ...]
    notes: tuple[str, ...]


def scene_of(
    record: Record,
    file: RobotFile,
    marks: Sequence[tuple[str | None, str]] = (),
    *,
    has_prediction: bool = True,
) -> Scene:
    """Make a scene.

    Args:
        record: As it was read.
        file: The robot file; its model predicts, and its believed wheels are shown.
        marks: Places (joint, link or None: the base) and what to write there.
        has_prediction: Whether the model's prediction is wanted, too.
    """
    robot = file.believed
    record = corrected_record(record, robot, file.effects)
    shapes, notes = shapes_of(robot, file.folder)
    measured = measured_track(record, robot, frame_times(record))
    predicted, why = predicted_track(record, file, measured) if has_prediction else (None, '')
    return Scene(
        robot=robot,
        shapes=shapes,
        measured=measured,
        predicted=predicted,
        arrows=_arrows(robot, measured),
        channels=_channels(record, robot, measured.time),
        marks=tuple((_body(robot, place), text) for place, text in marks),
        notes=(*notes, *([why] if why else [])),
    )


def _body(robot: Robot, place: str | None) -> int:
    """Index of the body that a joint moves, of a link's body, or of the base."""
    if place in robot.joints:
        return 1 + robot.joints.index(str(place))
    names = [body.name for body in robot.bodies]
    return names.index(place) if place in names else 0


def _arrows(robot: Robot, track: RobotTrack) -> tuple[Arrow, ...]:
    arrows = [
        Arrow(f'wheels of {g.link}', g.body, g.body_momentum[None])
        for g in robot.gyrostats
        if g.momentum.any()
    ]
    if robot.is_free:
        dynamics = Dynamics(robot)
        states = (dynamics.at_rest_centre(track.state(k)) for k in range(len(track.time)))
        total = np.array([dynamics.momentum(state)[3:] for state in states])
        arrows.append(Arrow('total angular momentum', -1, total))
    return tuple(arrows)


def _channels(record: Record, robot: Robot, time: Array) -> tuple[ShownChannel, ...]:
    names = () if record.joints is None else record.joints.names
    found: list[ShownChannel] = []
    for title, unit, labels, at, values in (
        ('joint positions', robot.unit_of('rad'), names, record.joint_time, record.q),
        ('joint rates', robot.unit_of('rad/s'), names, record.joint_time, record.qd),
        ('joint efforts', robot.unit_of('N m'), names, record.joint_time, record.effort),
        ('gyro', 'rad/s', tuple('xyz'), record.rate_time, record.omega),
    ):
        if values is not None and len(at) > 1 and len(labels):
            lines = [np.interp(time, at, column) for column in values.T]
            found.append(ShownChannel(title, unit, labels, np.array(lines)))
    return tuple(found)
