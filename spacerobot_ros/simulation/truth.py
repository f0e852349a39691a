"""The simulated machine of a robot file: its truth, its effects, its start."""

from __future__ import annotations

from ..dynamics.state import initial_state
from ..effects.catalogue import parse_effects
from ..model.loader import true_robot
from ..model.robot import Robot
from ..model.settings import Settings
from .plant import Plant


def build_plant(robot: Robot, settings: Settings) -> Plant:
    """The plant at its start, its centre of mass at rest.

    Args:
        robot: The robot of the robot file (`model.loader.build_robot`).
        settings: All settings; `truth` and `effects` say what the plant really is.

    Raises:
        ConfigurationError: settings that don't fit the robot.
    """
    options = settings.simulator
    truth, effects = true_robot(robot, settings), parse_effects(settings.effects, robot)
    start = initial_state(truth, settings.initial)
    plant = Plant(truth, start, options.period, options.substeps)
    at_rest = plant.dynamics.at_rest_centre(start)
    return Plant(truth, at_rest, options.period, options.substeps, effects)
