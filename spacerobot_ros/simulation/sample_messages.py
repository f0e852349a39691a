"""What the sensors of a simulated robot say, as messages on their topics."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..recording.compose import Composer
from ..sensing.sensors import SensorSamples
from .plant import Plant


def wheels_of(plant: Plant) -> list[str]:
    """Names of the servicer's true rotors, which have a tachometer."""
    return [rotor.joint for rotor in plant.robot.rotors if not rotor.is_target]


def sample_messages(
    compose: Composer, plant: Plant, samples: SensorSamples
) -> Iterator[tuple[str, Any]]:
    """Topic and message of every sample at a step; the joint states last: they ask for a command.

    Args:
        compose: Makes the messages.
        plant: The plant, whose sensors these are.
        samples: What they said now.
    """
    ns, robot = plant.time_ns, plant.robot
    if samples.omega is not None and robot.is_free:
        std = robot.sensors.gyro_std
        yield '/imu/data', compose.imu(ns, robot.base_link, samples.omega, std)
    if samples.attitude_xyzw is not None:
        yield '/attitude', compose.quaternion(ns, samples.attitude_xyzw)
    if samples.wheel_rates is not None:
        wheels = wheels_of(plant)
        yield '/wheel_states', compose.joint_state(ns, wheels, velocity=samples.wheel_rates)
    if samples.joints is not None:
        j, names = samples.joints, robot.arm
        effort = j.effort / robot.effort_units
        if robot.passive_joints:
            effort[np.isin(names, robot.passive_joints)] = 0.0
        message = compose.joint_state(ns, names, j.position, j.velocity, effort)
        yield '/joint_states', message
