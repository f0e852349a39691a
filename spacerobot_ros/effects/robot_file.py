"""Robot files: YAML and URDF to a robot, its settings and its believed effects."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from ..model.files import read_parameters, read_text
from ..model.loader import build_robot, resolve_urdf
from ..model.robot import Robot
from ..model.settings import Settings, parse_settings
from .catalogue import believed_effects, changed_robot
from .effect import Effect


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A loaded robot file.

    Args:
        robot: The robot of URDF and `robot` section.
        settings: All settings.
        effects: The physical effects that the model believes in beside them.
        folder: That of the URDF, for what it names by a relative path.
    """

    robot: Robot
    settings: Settings
    effects: tuple[Effect, ...] = ()
    folder: Path = field(default_factory=Path)

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
    """Load a robot file (YAML); a relative `robot.urdf` lies beside it.

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
    modules = tuple(_absolute(name, path.parent) for name in settings.robot.effect_modules)
    settings = replace(settings, robot=replace(settings.robot, effect_modules=modules))
    urdf_path = resolve_urdf(settings.robot.urdf, beside=path.parent)
    robot = build_robot(settings, read_text(urdf_path, 'robot.urdf'), str(urdf_path))
    effects = believed_effects(settings, robot, path.parent)
    return RobotFile(robot, settings, effects, urdf_path.parent)


def _absolute(module: str, folder: Path) -> str:
    """A module's file with its folder, for whoever does not know the robot file's."""
    return str((folder / module).absolute()) if module.endswith('.py') else module
