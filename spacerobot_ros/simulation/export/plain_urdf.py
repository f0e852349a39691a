"""The extended model as plain URDF: inertias, damping and friction of the joints."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator

from ...effects.effect import Effect
from ...effects.robot_file import RobotFile
from ...model.robot import Robot
from ...model.writer import urdf_text
from .losses import (
    Exported,
    in_words,
    only_changes_robot,
    sensor_limits,
    with_rigid_bodies,
    without,
)

_DYNAMICS = {
    'joint_viscous_friction': ('damping', 'coefficient'),
    'joint_coulomb_friction': ('friction', 'torque'),
}
"""Attribute of `<dynamics>` and parameter that is added to it, by effect."""
_IN_ROBOT = (
    *('motor_inertia', 'gravity_error'),
    *('target_wheel_momentum', 'servicer_wheel_momentum_error'),
)
"""Effects that are part of what is lost of the robot."""


def to_urdf(file: RobotFile) -> Exported:
    """Write the robot that a robot file's effects make, as far as URDF goes."""
    robot, changed = with_rigid_bodies(file.believed)
    root = ElementTree.fromstring(urdf_text(robot).encode())
    for joint in root.findall('joint'):
        dynamics = joint.find('dynamics')
        if joint.get('name') in robot.arm and dynamics is not None:
            joint.remove(dynamics)  # all friction that is believed is an effect
    included = [effect for effect in file.effects if _add(root, effect)]
    ElementTree.indent(root)
    text = '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding='unicode') + '\n'
    others = (effect for effect in file.effects if effect.id not in _IN_ROBOT)
    lost = (*changed, *_of_robot(robot), *without(others, included))
    return Exported(text, tuple(map(in_words, included)), lost)


def _add(root: ElementTree.Element, effect: Effect) -> bool:
    """Write an effect; whether that could be done."""
    if effect.id not in _DYNAMICS:
        return only_changes_robot(effect) and effect.id == 'inertial_parameters'
    attribute, parameter = _DYNAMICS[effect.id]
    joint = next(j for j in root.findall('joint') if j.get('name') == effect.where)
    dynamics = joint.find('dynamics')
    if dynamics is None:
        dynamics = ElementTree.SubElement(joint, 'dynamics')
    value = float(dynamics.get(attribute, '0')) + effect[parameter]
    dynamics.set(attribute, repr(value))
    return True


def _of_robot(robot: Robot) -> Iterator[str]:
    for gyrostat in robot.gyrostats:
        if gyrostat.momentum.any():
            x, y, z = gyrostat.momentum
            yield f'wheel momentum of {gyrostat.link} ({x:.6g}, {y:.6g}, {z:.6g} N m s)'
    for joint, body in zip(robot.joints, robot.bodies[1:], strict=True):
        if body.motor_inertia:
            yield f'motor inertia of {joint} ({body.motor_inertia:.6g} kg m^2)'
    if robot.gravity.any():
        x, y, z = robot.gravity
        yield f'gravity ({x:.6g}, {y:.6g}, {z:.6g} m/s^2)'
    for thruster in robot.thrusters:
        yield f'thruster {thruster.name} ({thruster.force:.6g} N)'
    yield from sensor_limits(robot)
    yield f'that the base is {"free" if robot.is_free else "fixed"}'
