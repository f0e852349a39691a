"""Robot files in and out: YAML and URDF to `Robot` and `Settings`, with every refusal naming its place."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from ..errors import ConfigurationError
from ..types import Array
from .robot import Gyrostat, Robot, merge_bodies
from .settings import RobotSettings, SensorSettings, Settings, WheelSettings, parse_settings
from .urdf import MOVING, Tree, check_inertia, parse_urdf


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A loaded robot file: the robot that the model believes in, and all settings."""

    robot: Robot
    settings: Settings


def load_robot_file(path: str | Path) -> RobotFile:
    """Load a robot file (YAML) for the command line; a relative `robot.urdf` lies beside the file.

    Args:
        path: The YAML, in ROS 2 parameter-file form (`/**: ros__parameters: ...`).

    Returns:
        Robot and settings.

    Raises:
        ConfigurationError: unreadable file, or anything wrong in it or in the URDF, with the place named.
    """
    path = Path(path)
    settings = parse_settings(_read_parameters(path), f'{path}: ')
    urdf_path = resolve_urdf(settings.robot.urdf, beside=path.parent)
    return RobotFile(build_robot(settings, _read_text(urdf_path, 'robot.urdf'), str(urdf_path)), settings)


def resolve_urdf(url: str, beside: Path | None) -> Path:
    """Find a URDF named by `package://`, an absolute path, or (with `beside`) a relative path.

    Args:
        url: The value of `robot.urdf`.
        beside: Folder of the robot file; None where it is unknown, as in a node.

    Raises:
        ConfigurationError: empty, relative without a folder, unknown package, or no such file.
    """
    if not url:
        raise ConfigurationError('robot.urdf', 'is missing: give package://..., an absolute path, or robot_description')
    if url.startswith('package://'):
        package, _, inside = url.removeprefix('package://').partition('/')
        path = package_folder(package) / inside
    else:
        path = Path(url)
        if not path.is_absolute():
            if beside is None:
                raise ConfigurationError(
                    'robot.urdf',
                    f'{url!r} is relative, and a node does not know where its parameter file lies: use package://, '
                    'an absolute path, or robot_description',
                )
            path = beside / path
    if not path.is_file():
        raise ConfigurationError('robot.urdf', f'no such file: {path}')
    return path


def package_folder(package: str) -> Path:
    """Share folder of a ROS package; for this one the source checkout serves where it isn't installed."""
    for prefix in filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)):
        share = Path(prefix) / 'share' / package
        if share.is_dir():
            return share
    checkout = Path(__file__).resolve().parents[2]
    if package == 'spacerobot_ros' and (checkout / 'config').is_dir():
        return checkout
    raise ConfigurationError('robot.urdf', f'package {package!r} is not on AMENT_PREFIX_PATH')


def build_robot(settings: Settings, urdf: str, urdf_name: str = 'URDF') -> Robot:
    """Build the robot that the model believes in.

    Args:
        settings: Parsed settings.
        urdf: URDF text.
        urdf_name: What to call the URDF in error messages.

    Raises:
        ModelError: anything wrong in the URDF.
        ConfigurationError: settings that don't fit the URDF.
    """
    tree = parse_urdf(urdf, urdf_name)
    options = settings.robot
    if tree.root != options.base_link:
        raise ConfigurationError('robot.base_link', f'{options.base_link!r} is not the root link {tree.root!r} of the URDF')
    rotors = (*options.servicer_wheels.joints, *options.target_wheels.joints)
    joints = (*options.joints, *rotors)
    _check_joints(options, tree, rotors)
    bodies, frames = merge_bodies(tree, joints)
    if options.base == 'free' and bodies[0].mass <= 0.0:
        raise ConfigurationError(f'{urdf_name}: link {tree.root!r}', 'a free base needs a mass and an inertia')
    _check_leaf_inertias(joints, bodies, urdf_name)
    rates = (*_rates(options.servicer_wheels, 'robot.servicer_wheels'), *_rates(options.target_wheels, 'robot.target_wheels'))
    return Robot(
        name=tree.name,
        urdf=urdf,
        is_free=options.base == 'free',
        gravity=np.array(options.gravity),
        joints=joints,
        bodies=bodies,
        servicer_wheels=_servicer_gyrostat(options, tree, frames),
        target_wheels=_target_gyrostats(options, frames),
        effort_limits=np.array([tree.joints[name].effort_limit for name in joints]),
        position_limits=np.array([tree.joints[name].position_limit for name in joints]).reshape(-1, 2),
        sensors=settings.sensors,
        rotor_count=len(rotors),
        rotor_rates=np.array(rates, dtype=float),
        target_rotors=options.target_wheels.joints,
    )


def true_robot(robot: Robot, settings: Settings) -> Robot:
    """The plant: the model's robot with what `truth` says is different.

    Raises:
        ConfigurationError: unknown link, wrong number of entries, or unphysical inertia.
    """
    truth = settings.truth
    if truth.target_momentum:
        robot = robot.with_target_momentum(np.array(truth.target_momentum))
    if truth.servicer_momentum:
        robot = robot.with_servicer_momentum(np.array(truth.servicer_momentum))
    if not truth.links:
        return robot
    if len(truth.inertial_parameters) != 10 * len(truth.links):
        raise ConfigurationError(
            'truth.inertial_parameters', f'expected 10 a link in truth.links, got {len(truth.inertial_parameters)}'
        )
    names = [body.name for body in robot.bodies]
    parameters = robot.inertial_parameters.copy()
    for i, link in enumerate(truth.links):
        if link not in names:
            raise ConfigurationError(f'truth.links[{i}]', f'no body {link!r} (bodies: {", ".join(names)})')
        parameters[names.index(link)] = truth.inertial_parameters[10 * i : 10 * i + 10]
    changed = robot.with_inertial_parameters(parameters)
    for i, link in enumerate(truth.links):
        body = changed.bodies[names.index(link)]
        check_inertia(body.mass, body.inertia, f'truth.inertial_parameters of {link!r}')
    return changed


def _read_parameters(path: Path) -> Mapping[str, Any]:
    try:
        content = yaml.safe_load(_read_text(path, 'robot file'))
    except yaml.YAMLError as error:
        raise ConfigurationError(str(path), f'not valid YAML: {" ".join(str(error).split())}') from error
    if not isinstance(content, Mapping) or len(content) != 1:
        raise ConfigurationError(str(path), "expected one entry '/**' with ros__parameters below it")
    node, parameters = next(iter(content.items()))
    if not isinstance(parameters, Mapping) or 'ros__parameters' not in parameters:
        raise ConfigurationError(f'{path}: {node}', 'expected ros__parameters below it')
    return dict(parameters['ros__parameters'] or {})


def _read_text(path: Path, what: str) -> str:
    try:
        return path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigurationError(str(path), f'{what} can not be read: {error}') from error


def _check_joints(options: RobotSettings, tree: Tree, rotors: tuple[str, ...]) -> None:
    moving = [j.name for j in tree.joints.values() if j.kind in MOVING]
    named = [(f'robot.joints[{i}]', name) for i, name in enumerate(options.joints)]
    named += [('robot.*_wheels.joints', name) for name in rotors]
    if not options.joints:
        raise ConfigurationError('robot.joints', 'is empty: name the manipulator joints')
    seen: set[str] = set()
    for place, name in named:
        if name not in moving:
            raise ConfigurationError(place, f'the URDF has no moving joint {name!r} (it has {", ".join(moving)})')
        if name in seen:
            raise ConfigurationError(place, f'joint {name!r} is named twice')
        seen.add(name)
    for name in moving:
        if name not in seen:
            raise ConfigurationError(
                'robot.joints', f'joint {name!r} of the URDF moves but is not named: list it or make it fixed'
            )


def _check_leaf_inertias(joints: tuple[str, ...], bodies: tuple[Any, ...], urdf_name: str) -> None:
    parents = {body.parent for body in bodies}
    for index, body in enumerate(bodies[1:], start=1):
        if index not in parents and body.mass <= 0.0:
            raise ConfigurationError(
                f'{urdf_name}: link {body.name!r}', f'joint {joints[index - 1]!r} moves it, so it needs mass and inertia'
            )


def _rates(wheels: WheelSettings, place: str) -> tuple[float, ...]:
    if wheels.joints and wheels.momentum:
        raise ConfigurationError(place, 'give either momentum (gyrostat) or joints and rates (true rotors), not both')
    if len(wheels.rates) != len(wheels.joints):
        raise ConfigurationError(f'{place}.rates', f'expected {len(wheels.joints)} (one a joint), got {len(wheels.rates)}')
    return wheels.rates


Frames = dict[str, tuple[int, Array, Array]]


def _servicer_gyrostat(options: RobotSettings, tree: Tree, frames: Frames) -> Gyrostat:
    wheels = options.servicer_wheels
    if wheels.links not in ((), (tree.root,)):
        raise ConfigurationError('robot.servicer_wheels.links', f"the servicer's wheels are on {tree.root!r}")
    momentum = wheels.momentum or (0.0, 0.0, 0.0)
    if len(momentum) != 3:
        raise ConfigurationError('robot.servicer_wheels.momentum', f'expected 3 numbers, got {len(momentum)}')
    body, rotation, _ = frames[tree.root]
    return Gyrostat(tree.root, body, rotation, np.array(momentum))


def _target_gyrostats(options: RobotSettings, frames: Frames) -> tuple[Gyrostat, ...]:
    wheels = options.target_wheels
    momentum = wheels.momentum or (0.0,) * (3 * len(wheels.links))
    if len(momentum) != 3 * len(wheels.links):
        raise ConfigurationError(
            'robot.target_wheels.momentum', f'expected three a link ({3 * len(wheels.links)}), got {len(momentum)}'
        )
    gyrostats = []
    for i, link in enumerate(wheels.links):
        if link not in frames:
            raise ConfigurationError(f'robot.target_wheels.links[{i}]', f'the URDF has no link {link!r}')
        body, rotation, _ = frames[link]
        gyrostats.append(Gyrostat(link, body, rotation, np.array(momentum[3 * i : 3 * i + 3])))
    return tuple(gyrostats)


__all__ = ['RobotFile', 'SensorSettings', 'build_robot', 'load_robot_file', 'resolve_urdf', 'true_robot']
