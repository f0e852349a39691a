"""Robot files: YAML and URDF to `Robot` and `Settings`, every refusal naming its place."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from ..effects.catalogue import changed_robot, parse_effects
from ..effects.effect import AppliedEffect
from ..errors import ConfigurationError
from ..types import Array
from .body import Body, Rotor, effective_inertia
from .files import read_parameters, read_text
from .merge import merge_bodies
from .robot import Robot
from .settings import RobotSettings, SensorSettings, Settings, TruthSettings, parse_settings
from .urdf import MOVING, Tree, check_inertia, parse_urdf
from .wheels import build_rotors, lock_rotors, servicer_gyrostat, target_gyrostats


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A loaded robot file.

    Args:
        robot: The robot of URDF and `robot` section.
        settings: All settings.
        effects: The physical effects that the model believes in beside them.
    """

    robot: Robot
    settings: Settings
    effects: tuple[AppliedEffect, ...] = ()

    @property
    def believed(self) -> Robot:
        """The robot with the changes that the believed effects make to it."""
        return changed_robot(self.robot, self.effects)

    def before_effects(self, believed: Robot) -> Robot:
        """The robot that the effects change into a believed one, for writing it beside them."""
        if not self.effects:
            return believed
        change, momentum = self.believed, believed.target_momentum
        return believed.with_inertial_parameters(
            believed.inertial_parameters
            - change.inertial_parameters
            + self.robot.inertial_parameters
        ).with_target_momentum(momentum - change.target_momentum + self.robot.target_momentum)


def load_robot_file(path: str | Path) -> RobotFile:
    """Load a robot file (YAML) for the command line; a relative `robot.urdf` lies beside the file.

    Args:
        path: The YAML, in ROS 2 parameter-file form (`/**: ros__parameters: ...`).

    Returns:
        Robot, settings and effects.

    Raises:
        ConfigurationError: unreadable file, or anything wrong in it or in the URDF, with the place
            named.
    """
    path = Path(path)
    settings = parse_settings(read_parameters(path), f'{path}: ')
    urdf_path = resolve_urdf(settings.robot.urdf, beside=path.parent)
    robot = build_robot(settings, read_text(urdf_path, 'robot.urdf'), str(urdf_path))
    return RobotFile(robot, settings, parse_effects(settings.effects, robot))


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
        raise ConfigurationError(
            'robot.urdf',
            'is missing: give package://..., an absolute path, or robot_description',
        )
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
    if not path.is_file():
        raise ConfigurationError('robot.urdf', f'no such file: {path}')
    return path


def package_folder(package: str) -> Path:
    """Share folder of a ROS package; this one's source checkout serves without installation."""
    if not package:
        raise ConfigurationError('robot.urdf', 'package:// needs a package name')
    for prefix in filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)):
        share = Path(prefix) / 'share' / package
        if share.is_dir():
            return share
    checkout = Path(__file__).resolve().parents[2]
    if package == 'spacerobot_ros' and (checkout / 'config').is_dir():
        return checkout
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
    tree = parse_urdf(urdf, urdf_name)
    options = settings.robot
    if tree.root != options.base_link:
        raise ConfigurationError(
            'robot.base_link',
            f'{options.base_link!r} is not the root link {tree.root!r} of the URDF',
        )
    _check_joints(options, tree)
    bodies, frames = merge_bodies(lock_rotors(options, tree), options.joints)
    rotors = build_rotors(options, tree, frames)
    _check_bodies(options, bodies, rotors, urdf_name)
    return Robot(
        name=tree.name,
        urdf=urdf,
        is_free=options.base == 'free',
        gravity=np.array(options.gravity),
        joints=options.joints,
        bodies=bodies,
        servicer_wheels=servicer_gyrostat(options, tree, rotors),
        target_wheels=target_gyrostats(options, frames, rotors),
        effort_limits=np.array([tree.joints[name].effort_limit for name in options.joints]),
        position_limits=np.array(
            [tree.joints[name].position_limit for name in options.joints]
        ).reshape(-1, 2),
        sensors=settings.sensors,
        rotors=rotors,
        inertia_uncertainty=options.inertia_uncertainty,
    )


def true_robot(robot: Robot, settings: Settings) -> Robot:
    """The plant: the model's robot with free rotors and effects, and with what `truth` says.

    `truth` has the last word: it says what is, whatever the model believes.

    `truth.inertial_parameters` replace those of plant bodies, true rotors excluded.

    Args:
        robot: The model's robot, in the gyrostat view.
        settings: Parsed settings.

    Raises:
        ConfigurationError: unknown link, wrong number of entries, momentum where rotors need
            rates, unphysical inertia, or effects that don't fit.
    """
    truth = settings.truth
    plant = robot.with_free_rotors(_true_rates(robot, truth))
    plant = changed_robot(plant, parse_effects(settings.effects, robot))
    for side, momentum in (
        ('target', truth.target_momentum),
        ('servicer', truth.servicer_momentum),
    ):
        if momentum and any(rotor.is_target == (side == 'target') for rotor in robot.rotors):
            raise ConfigurationError(
                f'truth.{side}_momentum', f'the wheels are rotors: give truth.{side}_rates'
            )
    if truth.target_momentum:
        plant = plant.with_target_momentum(
            np.array(truth.target_momentum), 'truth.target_momentum'
        )
    if truth.servicer_momentum:
        plant = plant.with_servicer_momentum(
            np.array(truth.servicer_momentum), 'truth.servicer_momentum'
        )
    return _with_true_inertia(plant, truth)


def _true_rates(robot: Robot, truth: TruthSettings) -> Array:
    rates = np.array([rotor.rate for rotor in robot.rotors])
    for name, is_target, given in (
        ('truth.servicer_rates', False, truth.servicer_rates),
        ('truth.target_rates', True, truth.target_rates),
    ):
        chosen = [i for i, rotor in enumerate(robot.rotors) if rotor.is_target == is_target]
        if given and len(given) != len(chosen):
            raise ConfigurationError(
                name, f'expected {len(chosen)} (one a rotor), got {len(given)}'
            )
        if given:
            rates[chosen] = given
    return rates


def _with_true_inertia(robot: Robot, truth: TruthSettings) -> Robot:
    if len(truth.inertial_parameters) != 10 * len(truth.links):
        raise ConfigurationError(
            'truth.inertial_parameters',
            f'expected 10 a link in truth.links, got {len(truth.inertial_parameters)}',
        )
    names = [body.name for body in robot.bodies]
    parameters = robot.inertial_parameters.copy()
    for i, link in enumerate(truth.links):
        if link not in names:
            raise ConfigurationError(
                f'truth.links[{i}]', f'no body {link!r} (bodies: {", ".join(names)})'
            )
        if link in truth.links[:i]:
            raise ConfigurationError(f'truth.links[{i}]', f'{link!r} is named twice')
        row = np.array(truth.inertial_parameters[10 * i : 10 * i + 10])
        where = f'truth.inertial_parameters of {link!r}'
        if row[0] <= 0.0:
            raise ConfigurationError(where, f'mass {row[0]:g} kg must be above zero')
        inertia = pin.Inertia.FromDynamicParameters(row)
        check_inertia(inertia.mass, inertia.inertia, where)
        parameters[names.index(link)] = row
    return robot.with_inertial_parameters(parameters) if truth.links else robot


def _check_joints(options: RobotSettings, tree: Tree) -> None:
    moving = [j.name for j in tree.joints.values() if j.kind in MOVING]
    if not options.joints:
        raise ConfigurationError('robot.joints', 'is empty: name the manipulator joints')
    named = [(f'robot.joints[{i}]', name) for i, name in enumerate(options.joints)]
    for section, wheels in (
        ('servicer_wheels', options.servicer_wheels),
        ('target_wheels', options.target_wheels),
    ):
        named += [(f'robot.{section}.joints[{i}]', name) for i, name in enumerate(wheels.joints)]
    seen: dict[str, str] = {}
    for place, name in named:
        if name not in moving:
            raise ConfigurationError(
                place, f'the URDF has no moving joint {name!r} (it has {", ".join(moving)})'
            )
        if name in seen:
            raise ConfigurationError(
                place, f'joint {name!r} is named twice, first as {seen[name]}'
            )
        seen[name] = place
    for name in moving:
        if name not in seen:
            raise ConfigurationError(
                'robot.joints',
                f'joint {name!r} of the URDF moves but is not named: list it or make it fixed',
            )


def _check_bodies(
    options: RobotSettings, bodies: tuple[Body, ...], rotors: tuple[Rotor, ...], urdf_name: str
) -> None:
    """Refuse a singular mass matrix: a massless base or end, or a carrier that is all rotor."""
    base = bodies[0]
    if options.base == 'free' and (base.mass <= 0.0 or np.linalg.eigvalsh(base.inertia)[0] <= 0.0):
        raise ConfigurationError(
            f'{urdf_name}: link {base.name!r}',
            'a free base needs a mass and an inertia about every axis',
        )
    parents = {body.parent for body in bodies}
    for index, body in enumerate(bodies[1:], start=1):
        if index not in parents and effective_inertia(body) <= 0.0:
            raise ConfigurationError(
                f'{urdf_name}: link {body.name!r}',
                f'joint {options.joints[index - 1]!r} moves it, so it needs mass and inertia',
            )
    for carrier in sorted({rotor.body.parent for rotor in rotors}):
        rotor_mass = sum(rotor.body.mass for rotor in rotors if rotor.body.parent == carrier)
        if bodies[carrier].mass <= rotor_mass * (1.0 + 1e-9):
            raise ConfigurationError(
                f'{urdf_name}: link {bodies[carrier].name!r}',
                'carries rotors, so it needs a mass and an inertia of its own',
            )


__all__ = [
    'RobotFile',
    'SensorSettings',
    'build_robot',
    'load_robot_file',
    'resolve_urdf',
    'true_robot',
]
