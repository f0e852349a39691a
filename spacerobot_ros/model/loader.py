"""URDF and settings of a robot file to a `Robot`, every refusal naming its place."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import ConfigurationError, refuse_all
from .body import Body, Rotor, last_bodies, merge_bodies
from .files import is_file
from .inputs import read_thrusters
from .robot import Robot
from .robot_settings import RobotSettings
from .schema import REST
from .settings import Settings
from .uncertainty import body_uncertainties
from .urdf import Tree, parse_urdf
from .urdf_joints import MOVING, left_moving, with_rest
from .wheels import build_rotors, lock_rotors, servicer_gyrostat, target_gyrostats

_ONE_LINE = 1e-9  # sine of the angle, and m, between two axes that are one
_MOST_JOINTS = 500  # of n, the torque regressor of a single sample has 10 n^2 numbers: 20 MB


def resolve_urdf(url: str, beside: Path | None) -> Path:
    """Find a URDF named by `package://`, `file://`, an absolute or a relative path.

    Args:
        url: The value of `robot.urdf`.
        beside: Folder of the robot file, for relative paths; None where it is unknown, as in a
            node.

    Raises:
        ConfigurationError: empty, relative without a folder, unknown package, or no such file.
    """
    if not url:
        why = 'is missing: give package://..., an absolute path, or robot_description'
        raise ConfigurationError('robot.urdf', why)
    if url.startswith('package://'):
        package, _, inside = url.removeprefix('package://').partition('/')
        path = package_folder(package) / inside
    else:
        path = Path(url.removeprefix('file://'))
        if not path.is_absolute():
            if beside is None:
                raise ConfigurationError(
                    'robot.urdf',
                    f'{url!r} is relative, and a node does not know where its parameter file '
                    'lies: use package://, an absolute path, or robot_description',
                )
            path = beside / path
    if not is_file(path):
        raise ConfigurationError('robot.urdf', f'no such file: {path}')
    return path


def package_folder(package: str) -> Path:
    """Share folder of a ROS package; this one's may also be pip's, or the checkout."""
    if not package:
        raise ConfigurationError('robot.urdf', 'package:// needs a package name')
    here = [*Path(__file__).resolve().parents]
    if package == 'spacerobot_ros' and (here[2] / 'config').is_dir():
        own = [here[2]]
    else:
        own = [prefix / 'share' / package for prefix in here[5:6]]  # of lib/pythonX/site-packages
    prefixes = filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep))
    for folder in (*(Path(prefix) / 'share' / package for prefix in prefixes), *own):
        if folder.is_dir():
            return folder
    raise ConfigurationError('robot.urdf', f'package {package!r} is not on AMENT_PREFIX_PATH')


def build_robot(settings: Settings, urdf: str, urdf_name: str = 'URDF') -> Robot:
    """Build the robot that the model believes in: the gyrostat view, true rotors locked.

    Args:
        settings: Parsed settings.
        urdf: URDF text.
        urdf_name: What to call the URDF in error messages.

    Raises:
        ModelError: anything wrong in the URDF.
        ConfigurationError: settings that don't fit the URDF.
    """
    options = settings.robot
    is_on_ground = options.base == 'fixed'
    held: Mapping[str, float] = options.held
    if REST in held:
        listed = {*options.joints, *(name for w in options.wheels.values() for name in w.joints)}
        given = parse_urdf(urdf, urdf_name, is_on_ground=is_on_ground).joints
        held = with_rest(given, listed, held)
    tree = parse_urdf(urdf, urdf_name, is_on_ground=is_on_ground, held=held)
    if options.base_link not in ('', tree.root):
        why = f'{options.base_link!r} is not the root link {tree.root!r} of the URDF'
        raise ConfigurationError('robot.base_link', why)
    for place, why in _faulty_joints(options, tree):
        raise ConfigurationError(place, why)
    for i, name in enumerate(options.passive_joints):
        if name not in options.joints:
            place = f'robot.passive_joints[{i}]'
            raise ConfigurationError(place, f'{name!r} is none of robot.joints')
    for name in ('joint_position_std', 'joint_velocity_std', 'joint_effort_std'):
        _each(options, f'sensors.{name}', getattr(settings.sensors, name))
    bodies, frames = merge_bodies(lock_rotors(options, tree), options.joints)
    rotors = build_rotors(options, tree, frames)
    faults = _faulty_bodies(options, bodies, rotors)
    wrong = [ConfigurationError(f'{urdf_name}: link {b.name!r}', why) for b, why in faults]
    refuse_all(wrong, urdf_name)
    joints = [tree.joints[name] for name in options.joints]
    return Robot(
        name=tree.name,
        urdf=urdf,
        is_free=options.base == 'free',
        gravity=np.array(options.gravity),
        joints=options.joints,
        bodies=bodies,
        servicer_wheels=servicer_gyrostat(options, tree, frames, rotors),
        target_wheels=target_gyrostats(options, frames, rotors),
        effort_limits=np.array([joint.effort_limit for joint in joints]),
        velocity_limits=np.array([joint.velocity_limit for joint in joints]),
        position_limits=np.array([joint.position_limit for joint in joints]).reshape(-1, 2),
        sensors=settings.sensors,
        rotors=rotors,
        inertia_uncertainty=options.inertia_uncertainty,
        uncertainties=body_uncertainties(options.uncertainty, frames, len(bodies)),
        uncertain_bodies=frozenset(frames[link][0] for link in options.uncertainty.links),
        effort_kinds=_each(options, 'robot.effort_kind', options.effort_kind),
        motor_constants=_each(options, 'robot.motor_constant', options.motor_constant),
        passive_joints=options.passive_joints,
        anchor=options.scale.anchor,
        thrusters=read_thrusters(options.thrusters),
        held={name: j.held for name, j in tree.joints.items() if j.held is not None},
    )


def _each(options: RobotSettings, place: str, given: Any) -> tuple[Any, ...]:
    """One entry a joint of what is given once or once a joint; none where nothing is."""
    n = len(options.joints)
    if given is None:
        return ()
    if not isinstance(given, tuple):
        return (given,) * n
    if len(given) != n:
        raise ConfigurationError(
            place, f'expected one for all joints, or a list of {n}; got a list of {len(given)}'
        )
    return given


def _faulty_joints(options: RobotSettings, tree: Tree) -> Iterator[tuple[str, str]]:
    """Names of joints that don't fit the URDF: place and reason."""
    moving = [j.name for j in tree.joints.values() if j.kind in MOVING]
    if not options.joints and options.base == 'fixed':
        yield 'robot.joints', 'is empty: on a fixed base nothing moves then'
    if len(options.joints) > _MOST_JOINTS:
        yield 'robot.joints', f'has {len(options.joints)} joints; the most is {_MOST_JOINTS}'
    named = [(f'robot.joints[{i}]', name) for i, name in enumerate(options.joints)]
    for section, wheels in options.wheels.items():
        named += [(f'robot.{section}.joints[{i}]', name) for i, name in enumerate(wheels.joints)]
    seen: dict[str, str] = {}
    for place, name in named:
        if name in options.held:
            yield place, f'{name!r} is one of robot.held, too: a joint moves or is held'
        if name not in moving:
            yield place, f'the URDF has no moving joint {name!r} (it has {", ".join(moving)})'
        if name in seen:
            yield place, f'joint {name!r} is named twice, first as {seen[name]}'
        seen[name] = place
    followers = [name for name in moving if tree.joints[name].mimic]
    left = followers or [name for name in moving if name not in seen]
    if left:
        words = left_moving(tree.joints[left[0]])
        if len(left) > 1:
            words = f'{words}; so do {", ".join(map(repr, left[1:]))} (all: robot.held: rest)'
        yield 'robot.joints', words


def _faulty_bodies(
    options: RobotSettings, bodies: tuple[Body, ...], rotors: tuple[Rotor, ...]
) -> Iterator[tuple[Body, str]]:
    """What makes the mass matrix singular: a massless base or end, a host that is all rotor."""
    base = bodies[0]
    if options.base == 'free' and (base.mass <= 0.0 or np.linalg.eigvalsh(base.inertia)[0] <= 0.0):
        yield base, 'a free base needs a mass and an inertia about every axis'
    for index in last_bodies(bodies):
        if bodies[index].effective_inertia <= 0.0:
            joint = options.joints[index - 1]
            yield (
                bodies[index],
                f'joint {joint!r} moves it, so it needs mass and inertia about its axis',
            )
    for above, below in _without_mass_between(bodies):
        one, other = (options.joints[k - 1] for k in (above, below))
        how = 'slide along one direction' if bodies[above].is_prismatic else 'turn about one line'
        yield (
            bodies[above],
            f'joints {one!r} and {other!r} {how} with no mass between them, so that nothing '
            'tells their motions apart: give the link a mass, or hold one by '
            f'robot.held: {{{other}: 0.0}}',
        )
    for host in sorted({rotor.body.parent for rotor in rotors}):
        rotor_mass = sum(rotor.body.mass for rotor in rotors if rotor.body.parent == host)
        if bodies[host].mass <= rotor_mass * (1.0 + 1e-9):
            yield bodies[host], 'carries rotors, so it needs a mass and an inertia of its own'


def _without_mass_between(bodies: tuple[Body, ...]) -> Iterator[tuple[int, int]]:
    """Pairs of joints, by body, that move alike and have nothing between them that has mass."""
    for k, body in enumerate(bodies):
        above = bodies[body.parent] if body.parent > 0 else None
        if above is None or above.mass > 0.0 or above.motor_inertia > 0.0:
            continue
        axis, beside = body.rotation @ body.axis, [b for b in bodies if b.parent == body.parent]
        is_alike = above.is_prismatic == body.is_prismatic and len(beside) == 1
        off = np.cross(axis, above.axis)
        apart = np.cross(body.translation, above.axis) * (not body.is_prismatic)
        if is_alike and max(np.max(np.abs(off)), np.max(np.abs(apart))) < _ONE_LINE:
            yield body.parent, k
