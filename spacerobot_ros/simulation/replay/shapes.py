"""What the bodies look like: the URDF's visuals, or ellipsoids of their inertia."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...errors import ConfigurationError
from ...formats import counted
from ...model.body import Body, inertia_ellipsoid, merge_bodies
from ...model.loader import resolve_urdf
from ...model.robot import Robot
from ...types import Array, Matrix3, Vector3

MOST = 20_000
"""Triangles of one mesh that are kept: a page of twenty links is then 14 MB at the most."""
_KINDS = ('.stl', '.obj', '.dae')


def read_mesh(path: Path) -> Array:
    """(K, 3, 3) corners of the triangles [m]; every so-manieth of more than `MOST`.

    Raises:
        ConfigurationError: another format, damaged, or what reads meshes is not installed.
    """
    place, kind = f'mesh {path.name}', path.suffix.lower()
    if kind not in _KINDS:
        why = f'{kind or "no suffix"} is not read (STL, OBJ and DAE are): convert it'
        raise ConfigurationError(place, why)
    try:
        import trimesh

        if kind == '.dae':
            import collada  # noqa: F401  with it trimesh reads them
    except ImportError as error:
        why = f"{error.name} is not installed: pip install 'spacerobot_ros[meshes]'"
        raise ConfigurationError(place, why) from error
    try:
        scene = trimesh.load_scene(path, process=False)
        scene = scene.convert_units('m') if scene.units else scene  # DAE says them
        corners = np.asarray(scene.triangles)
        if not len(corners) or not np.all(np.isfinite(corners)):
            raise ValueError('it has no triangles, or not finite ones')
    except Exception as error:  # of a damaged file the readers raise nearly anything
        raise ConfigurationError(place, f'is damaged: {error}') from error
    return corners[:: 1 + (len(corners) - 1) // MOST]


_INSTEAD = 'the inertia is shown instead, as an ellipsoid'


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """One part of a body as it is seen.

    Args:
        kind: box, cylinder (along z), sphere, ellipsoid or mesh.
        size: Edges, (radius, length), (radius,), half axes, or scale factors [m].
        rotation: (3, 3) to body coordinates. position: (3,) in the body frame [m].
        triangles: (K, 3, 3) corners of a mesh, else of no triangle [m].
        color: Red, green, blue from 0 to 1; None takes the body's.
    """

    kind: str
    size: tuple[float, ...]
    rotation: Matrix3
    position: Vector3
    triangles: Array = field(default_factory=lambda: np.zeros((0, 3, 3)))
    color: tuple[float, float, float] | None = None


def shapes_of(robot: Robot, folder: Path) -> tuple[list[list[Shape]], tuple[str, ...]]:
    """Shapes of every body.

    Args:
        robot: The robot.
        folder: That of the URDF, for relative names of meshes.

    Returns:
        The shapes of each body, and a line a reason for which visuals could not be read: where a
        body has no other the ellipsoid of its inertia stands in their place.
    """
    tree = robot.tree
    joints = {  # rotors turn, and look the same all the time
        name: joint if name in robot.joints else replace(joint, kind='fixed')
        for name, joint in tree.joints.items()
    }
    _, frames = merge_bodies(replace(tree, joints=joints), robot.joints)
    found: list[list[Shape]] = [[] for _ in robot.bodies]
    missing: dict[str, list[str]] = {}
    root = ElementTree.fromstring(robot.urdf.encode())
    colors = {m.get('name'): _color(m) for m in root.findall('material')}
    for link in root.findall('link'):
        body, rotation, origin = frames[link.get('name', '')]
        for visual in link.findall('visual'):
            try:
                shape = _shape(visual, folder, colors)
            except ConfigurationError as error:
                missing.setdefault(error.reason, []).append(error.place)
                continue
            turned = rotation @ shape.rotation, origin + rotation @ shape.position
            found[body].append(replace(shape, rotation=turned[0], position=turned[1]))
    for i, own in enumerate(found):
        own += [] if own else _inertia(robot.bodies[i])
    lines = (f'{", ".join(links)}: {why}; {_INSTEAD}' for why, links in missing.items())
    return found, tuple(lines)


def _inertia(body: Body) -> Iterator[Shape]:
    """The homogeneous ellipsoid of the same inertia; nothing of a body without one."""
    seen = inertia_ellipsoid(body)
    if seen is not None:
        half_axes, axes = seen
        yield Shape('ellipsoid', tuple(half_axes.tolist()), axes, body.com)


def _shape(
    visual: ElementTree.Element,
    folder: Path,
    colors: dict[str | None, tuple[float, float, float] | None],
) -> Shape:
    geometry = visual.find('geometry')
    element = next(iter(geometry), None) if geometry is not None else None
    if element is None:
        raise ConfigurationError('visual', 'has no geometry')
    origin = visual.find('origin')
    xyz, rpy = (
        _numbers(None if origin is None else origin.get(key), 3, 0.0) for key in ('xyz', 'rpy')
    )
    rotation = Rotation.from_euler('xyz', rpy).as_matrix()
    material = visual.find('material')
    color = None
    if material is not None:
        color = _color(material) or colors.get(material.get('name'))
    place = Shape(element.tag, (), rotation, np.array(xyz), color=color)
    if element.tag == 'box':
        return replace(place, size=_numbers(element.get('size'), 3))
    if element.tag == 'sphere':
        return replace(place, size=_numbers(element.get('radius'), 1))
    if element.tag == 'cylinder':
        size = _numbers(element.get('radius'), 1) + _numbers(element.get('length'), 1)
        return replace(place, size=size)
    if element.tag == 'mesh':
        scale = _numbers(element.get('scale'), 3, 1.0)
        path = _mesh_file(element.get('filename', ''), folder)
        return replace(place, size=scale, triangles=read_mesh(path) * np.array(scale))
    raise ConfigurationError('visual', f'no such geometry: {element.tag}')


def _mesh_file(name: str, folder: Path) -> Path:
    """The file of a mesh.

    Raises:
        ConfigurationError: it is not there.
    """
    try:
        return resolve_urdf(name, folder)
    except ConfigurationError as error:
        raise ConfigurationError(f'mesh {Path(name).name}', error.reason) from error


def _color(material: ElementTree.Element) -> tuple[float, float, float] | None:
    color = material.find('color')
    if color is None:
        return None
    red, green, blue = _numbers(' '.join(color.get('rgba', '').split()[:3]), 3)
    return red, green, blue


def _numbers(text: str | None, count: int, missing: float | None = None) -> tuple[float, ...]:
    if text is None and missing is not None:
        return (missing,) * count
    try:
        values = tuple(float(word) for word in (text or '').split())
    except ValueError:
        values = ()
    if len(values) != count or not np.all(np.isfinite(values)):
        raise ConfigurationError('visual', f'expected {counted(count, "number")}, got {text!r}')
    return values
