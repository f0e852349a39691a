"""Robot files out: the inertial parameters of a robot written back as URDF and YAML."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..types import Matrix3
from .files import read_parameters, write_parameters, write_text
from .robot import Body, Robot
from .urdf import INERTIA
from .urdf_joints import Joint


def write_robot_file(robot: Robot, template: str | Path, path: str | Path) -> tuple[Path, Path]:
    """Write a robot as YAML and URDF that every tool loads.

    Args:
        robot: The robot; its inertial parameters and believed wheel momentum are written.
        template: The robot file it comes from; every other setting is kept.
        path: The YAML to write; the URDF goes beside it under the same name.

    Returns:
        Paths of YAML and URDF.

    Raises:
        ConfigurationError: the template can't be read or the files can't be written.
    """
    path = Path(path)
    return write_robot(
        robot, read_parameters(Path(template)), path, path.with_suffix('.urdf').name
    )


def write_robot(
    robot: Robot, parameters: Mapping[str, Any], path: str | Path, urdf: str
) -> tuple[Path, Path]:
    """Write a robot with the parameters of a robot file.

    Args:
        robot: The robot; its inertial parameters and believed wheel momentum are written.
        parameters: Content of `ros__parameters`; every other setting is kept.
        path: The YAML to write; the URDF goes beside it under the same name.
        urdf: What the YAML calls the URDF.

    Returns:
        Paths of YAML and URDF.

    Raises:
        ConfigurationError: the files can't be written.
    """
    path = Path(path)
    section = {**parameters['robot'], 'urdf': urdf}
    section.pop('held', None)  # fixed in the URDF
    _set_momentum(section, robot)
    urdf_path = write_text(path.with_suffix('.urdf'), urdf_text(robot))
    return write_parameters(path, {**parameters, 'robot': section}), urdf_path


def parameters_of(settings: Any) -> dict[str, Any]:
    """A settings section as the mapping that it is parsed from, without what is not set.

    Args:
        settings: `Settings` or one of its sections.
    """
    out: dict[str, Any] = {}
    for f in fields(settings):
        value = getattr(settings, f.name)
        if is_dataclass(value):
            value = parameters_of(value)
        elif isinstance(value, tuple):
            value = list(value)
        if value not in (None, '', [], {}):
            out[f.name] = value
    return out


def urdf_text(robot: Robot) -> str:
    """The robot's URDF with the inertial parameters of its bodies.

    A body of several links joined by fixed joints is written as the inertial of its main link, the
    others losing theirs: only their sum is known. Links of true rotors keep their own. Joints that
    are held are fixed.
    """
    rates = np.array([rotor.rate for rotor in robot.rotors])
    bodies = {body.name: body for body in robot.with_free_rotors(rates).bodies}
    root = ElementTree.fromstring(robot.urdf)
    for link in root.findall('link'):
        name = link.get('name', '')
        for old in link.findall('inertial'):
            link.remove(old)
        if name in bodies and bodies[name].mass > 0.0:
            link.insert(0, _inertial(bodies[name]))
    joints = robot.tree.joints
    for element in root.findall('joint'):
        _fix(element, joints[element.get('name', '')])
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding='unicode') + '\n'


def _fix(element: ElementTree.Element, joint: Joint) -> None:
    """Write a joint that is held as a fixed one where it is."""
    if joint.held is None:
        return
    element.set('type', 'fixed')
    for child in list(element):
        if child.tag not in ('parent', 'child'):
            element.remove(child)
    origin = {'xyz': joint.translation.tolist(), 'rpy': _angles_of(joint.rotation)}
    written = {key: ' '.join(map(repr, value)) for key, value in origin.items()}
    element.insert(0, ElementTree.Element('origin', written))


def _angles_of(rotation: Matrix3) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a URDF, for any of its rotations."""
    (xx, xy, xz), (yx, yy, yz), (zx, _, _) = rotation.tolist()
    yaw = math.atan2(yx, xx)
    s, c = math.sin(yaw), math.cos(yaw)  # undone: the rest is also right where pitch is 90 deg
    return math.atan2(s * xz - c * yz, c * yy - s * xy), math.atan2(-zx, math.hypot(xx, yx)), yaw


def _inertial(body: Body) -> ElementTree.Element:
    element = ElementTree.Element('inertial')
    origin = ' '.join(repr(float(x)) for x in body.com)
    ElementTree.SubElement(element, 'origin', xyz=origin, rpy='0 0 0')
    ElementTree.SubElement(element, 'mass', value=repr(float(body.mass)))
    values = {
        name: repr(float(body.inertia['xyz'.index(name[1]), 'xyz'.index(name[2])]))
        for name in INERTIA
    }
    ElementTree.SubElement(element, 'inertia', values)
    return element


def _set_momentum(section: dict[str, Any], robot: Robot) -> None:
    wheels = section.get('target_wheels')
    if wheels and 'links' in wheels:
        section['target_wheels'] = wheels = dict(wheels)
        wheels['momentum'] = [float(x) for x in robot.target_momentum]
