"""A scene as the `<figure>` that `assets/replay.js` plays."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..model.body import tree_order
from ..simulation.replay.scene import Scene
from ..simulation.replay.shapes import Shape
from ..simulation.replay.tracks import RobotTrack
from ..types import Matrix3
from .plots import packed


def scene_values(scene: Scene) -> dict[str, Any]:
    """Everything that the script reads, arrays as base64 of float32."""
    return {
        'bodies': [
            {
                'name': body.name,
                'parent': body.parent,
                'position': body.translation.tolist(),
                'quat': _quat(body.rotation),
                'axis': body.axis.tolist(),
                'slides': body.is_prismatic,
                'com': body.com.tolist(),
                'shapes': [_shape(shape) for shape in shapes],
            }
            for body, shapes in zip(scene.robot.bodies, scene.shapes, strict=True)
        ],
        'is_free': scene.robot.is_free,
        'size': _size(scene),
        'time': packed(scene.measured.time),
        'measured': _track(scene.measured),
        'predicted': None if scene.predicted is None else _track(scene.predicted),
        'arrows': [_packed(arrow, 'label', 'body', 'values') for arrow in scene.arrows],
        'channels': [_packed(c, 'title', 'unit', 'labels', 'values') for c in scene.channels],
        'marks': [{'body': body, 'text': text} for body, text in scene.marks],
    }


def _packed(thing: object, *names: str) -> dict[str, Any]:
    """Attributes by name."""
    values = {name: getattr(thing, name) for name in names}
    return {n: packed(v) if isinstance(v, np.ndarray) else v for n, v in values.items()}


def _track(track: RobotTrack) -> dict[str, Any]:
    own = _packed(track, 'position', 'q')
    return {**own, 'attitude': packed(track.attitude_xyzw)}


def _shape(shape: Shape) -> dict[str, Any]:
    out = _packed(shape, 'kind', 'size', 'color', *['triangles'] * (shape.kind == 'mesh'))
    position = np.asarray(shape.position).tolist()
    return {**out, 'position': position, 'quat': _quat(shape.rotation)}


def _quat(rotation: Matrix3) -> list[float]:
    return list(Rotation.from_matrix(rotation).as_quat().tolist())


def _size(scene: Scene) -> float:
    """Half the extent of the robot stretched out, by which the camera stands off [m]."""
    bodies = scene.robot.bodies
    origins, ends = [0.0] * len(bodies), [1e-3]
    for i in (0, *tree_order(bodies)):
        body = bodies[i]
        if i:
            origins[i] = origins[body.parent] + float(np.linalg.norm(body.translation))
        shapes = scene.shapes[i]
        ends += [origins[i] + float(np.linalg.norm(s.position)) + _radius(s) for s in shapes]
    return 0.6 * max(ends + origins)


def _radius(shape: Shape) -> float:
    if shape.kind == 'mesh':
        return float(np.abs(shape.triangles).max(initial=0.0))
    return 0.6 * max(shape.size)
