"""Wheels of a robot file: gyrostats given by momentum, true rotors given by URDF joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..errors import ConfigurationError
from ..types import Vector3
from .body import Body, Frames, Gyrostat, Rotor
from .robot_settings import RobotSettings, WheelSettings
from .urdf import Tree
from .urdf_joints import Joint

# Slack of a rotor's balance: centre of mass off the axis [m], and products of inertia relative to
# the axial moment.
_BALANCE_OFFSET = 1e-4
_BALANCE_TILT = 1e-3


def lock_rotors(options: RobotSettings, tree: Tree) -> Tree:
    """The same tree with the rotors' joints fixed, as the gyrostat view has them."""
    locked = {name for wheels in options.wheels.values() for name in wheels.joints}
    joints = {
        name: replace(j, kind='fixed') if name in locked else j for name, j in tree.joints.items()
    }
    return replace(tree, joints=joints)


def build_rotors(options: RobotSettings, tree: Tree, frames: Frames) -> tuple[Rotor, ...]:
    """True rotors, the servicer's first, each group in the order of the robot file.

    Args:
        options: The `robot` section.
        tree: URDF with the rotor joints still moving.
        frames: Link frames in the bodies of the tree with the rotors locked.

    Raises:
        ConfigurationError: momentum and joints both given, wrong number of rates, a joint that
            slides, a child that is no leaf or not balanced, or a rotor of the servicer that is not
            on the base.
    """
    rotors = []
    for section, wheels in options.wheels.items():
        rates = _rates(wheels, f'robot.{section}')
        for i, name in enumerate(wheels.joints):
            place = f'robot.{section}.joints[{i}]'
            joint = tree.joints[name]
            for why in _faults_of_rotor(joint, tree):
                raise ConfigurationError(place, why)
            body, rotation, origin = frames[joint.child]
            if section == 'servicer_wheels' and body != 0:
                why = f"the servicer's wheels are on {tree.root!r}, not on {joint.parent!r}"
                raise ConfigurationError(place, why)
            solid = tree.links[joint.child]
            part = Body(joint.child, body, rotation, origin, joint.axis, False, *solid)
            is_target = section == 'target_wheels'
            link = joint.parent if is_target else tree.root
            rotors.append(Rotor(name, link, is_target, part, rates[i]))
    return tuple(rotors)


def servicer_gyrostat(
    options: RobotSettings, tree: Tree, frames: Frames, rotors: tuple[Rotor, ...]
) -> Gyrostat:
    """Gyrostat of the base, in the frame of `base_link`."""
    wheels, place = options.servicer_wheels, 'robot.servicer_wheels'
    if wheels.links not in ((), (tree.root,)):
        raise ConfigurationError(f'{place}.links', f"the servicer's wheels are on {tree.root!r}")
    own = [r for r in rotors if not r.is_target]
    return _gyrostats(wheels, (tree.root,), frames, own, place)[0]


def target_gyrostats(
    options: RobotSettings, frames: Frames, rotors: tuple[Rotor, ...]
) -> tuple[Gyrostat, ...]:
    """Gyrostats of the captured body, one a link: as listed, or as the rotors first name them."""
    wheels, own = options.target_wheels, [r for r in rotors if r.is_target]
    links = wheels.links or tuple(dict.fromkeys(r.link for r in own))
    return _gyrostats(wheels, links, frames, own, 'robot.target_wheels')


def _gyrostats(
    wheels: WheelSettings, links: tuple[str, ...], frames: Frames, rotors: list[Rotor], place: str
) -> tuple[Gyrostat, ...]:
    momentum = np.array(wheels.momentum or (0.0,) * (3 * len(links)))
    if len(momentum) != 3 * len(links):
        why = f'expected three a link ({3 * len(links)}), got {len(momentum)}'
        raise ConfigurationError(f'{place}.momentum', why)
    gyrostats = []
    for i, link in enumerate(links):
        if link not in frames:
            raise ConfigurationError(f'{place}.links[{i}]', f'the URDF has no link {link!r}')
        if link in links[:i]:
            raise ConfigurationError(f'{place}.links[{i}]', f'{link!r} is named twice')
        body, rotation, _ = frames[link]
        spin = sum((r.body_momentum for r in rotors if r.link == link), np.zeros(3))
        own = momentum[3 * i : 3 * i + 3] + rotation.T @ spin
        gyrostats.append(Gyrostat(link, body, rotation, own))
    return tuple(gyrostats)


def _rates(wheels: WheelSettings, place: str) -> tuple[float, ...]:
    if wheels.joints and (wheels.momentum or wheels.links):
        why = 'give either links and momentum (gyrostats) or joints and rates (true rotors)'
        raise ConfigurationError(place, why)
    if wheels.rates and len(wheels.rates) != len(wheels.joints):
        why = f'expected {len(wheels.joints)} (one a joint), got {len(wheels.rates)}'
        raise ConfigurationError(f'{place}.rates', why)
    return wheels.rates or (0.0,) * len(wheels.joints)


def _faults_of_rotor(joint: Joint, tree: Tree) -> Iterator[str]:
    """Why a joint can't be that of a true rotor."""
    if joint.kind == 'prismatic':
        yield f'joint {joint.name!r} is prismatic: a rotor turns'
    rotor, link = f'rotor link {joint.child!r}', tree.links[joint.child]
    for other in tree.joints.values():
        if other.parent == joint.child:
            yield f'{rotor} must be a leaf of the tree, but carries joint {other.name!r}'
    axial = float(joint.axis @ link.inertia @ joint.axis)
    if axial <= 0.0:
        yield f'{rotor} needs a mass and an inertia about its axis'
    offset = _off_axis(link.com, joint.axis)
    tilt = _off_axis(link.inertia @ joint.axis, joint.axis)
    if offset > _BALANCE_OFFSET or tilt > _BALANCE_TILT * axial:
        found = f'{offset:.3g} m off, products of inertia {tilt:.3g} kg m^2'
        yield f'{rotor} is not balanced about its axis: centre of mass {found}'


def _off_axis(vector: Vector3, axis: Vector3) -> float:
    return float(np.linalg.norm(vector - axis * (axis @ vector)))
