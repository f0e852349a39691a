"""The simulated machine of a robot file: its truth, its effects, its start; sensors' messages."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from ..dynamics.equations import Dynamics
from ..dynamics.integrate import TABLEAUS
from ..dynamics.state import initial_state
from ..effects.catalogue import believed_effects, changed_robot
from ..errors import ConfigurationError
from ..model.rigid_body import Solid, check_inertia
from ..model.robot import Robot
from ..model.settings import Settings, TruthSettings
from ..recording.bags.compose import Composer
from ..sensing.sensor_faults import SensorFaults
from ..sensing.sensors import SensorSamples, SensorSuite
from ..types import Array
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


_SIDES = {'target': True, 'servicer': False}


def build_plant(robot: Robot, settings: Settings) -> Plant:
    """The plant at its start, its centre of mass at rest.

    Args:
        robot: The robot of the robot file (`model.loader.build_robot`).
        settings: All settings; `truth` and `effects` say what the plant really is.

    Raises:
        ConfigurationError: settings that don't fit the robot.
    """
    options = settings.simulator
    truth, effects = true_robot(robot, settings), believed_effects(settings, robot)
    start = initial_state(truth, settings.initial)
    at_rest, method = Dynamics(truth).at_rest_centre(start), TABLEAUS[options.integrator]
    return Plant(truth, at_rest, options.period, options.substeps, effects, method)


def build_sensors(plant: Plant, settings: Settings) -> SensorSuite:
    """The plant's sensors with their noise and faults, at its start.

    Raises:
        ConfigurationError: rates that don't fit the period.
    """
    faults = SensorFaults(plant.robot, plant.effects)
    wheels = len(wheels_of(plant))
    return SensorSuite(settings.sensors, settings.simulator, plant.n_arm, wheels, faults)


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
    plant = changed_robot(plant, believed_effects(settings, robot))
    for side, is_target in _SIDES.items():
        momentum, name = getattr(truth, f'{side}_momentum'), f'truth.{side}_momentum'
        if momentum and any(rotor.is_target == is_target for rotor in robot.rotors):
            raise ConfigurationError(name, f'the wheels are rotors: give truth.{side}_rates')
        if momentum:
            plant = getattr(plant, f'with_{side}_momentum')(np.array(momentum), name)
    return _with_true_inertia(plant, truth)


def _true_rates(robot: Robot, truth: TruthSettings) -> Array:
    rates = np.array([rotor.rate for rotor in robot.rotors])
    for side, is_target in _SIDES.items():
        given = getattr(truth, f'{side}_rates')
        chosen = [i for i, rotor in enumerate(robot.rotors) if rotor.is_target == is_target]
        if given and len(given) != len(chosen):
            expected = f'expected {len(chosen)} (one a rotor), got {len(given)}'
            raise ConfigurationError(f'truth.{side}_rates', expected)
        if given:
            rates[chosen] = given
    return rates


def _with_true_inertia(robot: Robot, truth: TruthSettings) -> Robot:
    if len(truth.inertial_parameters) != 10 * len(truth.links):
        why = f'expected 10 a link in truth.links, got {len(truth.inertial_parameters)}'
        raise ConfigurationError('truth.inertial_parameters', why)
    names = [body.name for body in robot.bodies]
    parameters = robot.inertial_parameters.copy()
    for i, link in enumerate(truth.links):
        if link not in names:
            why = f'no body {link!r} (bodies: {", ".join(names)})'
            raise ConfigurationError(f'truth.links[{i}]', why)
        if link in truth.links[:i]:
            raise ConfigurationError(f'truth.links[{i}]', f'{link!r} is named twice')
        row = np.array(truth.inertial_parameters[10 * i : 10 * i + 10])
        where = f'truth.inertial_parameters of {link!r}'
        if row[0] <= 0.0:
            raise ConfigurationError(where, f'mass {row[0]:g} kg must be above zero')
        solid = Solid.of_row(row)
        check_inertia(solid.mass, solid.inertia, where)
        parameters[names.index(link)] = row
    return robot.with_inertial_parameters(parameters) if truth.links else robot
