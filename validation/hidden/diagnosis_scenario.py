"""The packaged robots as campaigns fly them; motions and records of the diagnosis campaign.

Records are of the project's own plant with effects.

Another module may take this one's place (`truth_of`), so that records come from an engine that
shares no code with what is put to the test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np

from spacerobot_ros.control.joint_reference import build_reference
from spacerobot_ros.control.loop import ControlLoop
from spacerobot_ros.diagnosis.answer.extended_model import effects_section
from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file
from spacerobot_ros.errors import ConfigurationError, SimulationDivergedError
from spacerobot_ros.excitation.motions import Motions
from spacerobot_ros.model.loader import build_robot, package_folder
from spacerobot_ros.model.motion_settings import (
    ExcitationSettings,
    InitialSettings,
    ReferenceSettings,
)
from spacerobot_ros.model.settings import TruthSettings
from spacerobot_ros.recording.buffer import SampleBuffer
from spacerobot_ros.recording.record import Record
from spacerobot_ros.simulation.closed_loop import ClosedLoop, Step
from spacerobot_ros.types import Array

RATE = 100.0
"""Of joints and gyro [Hz]; the tracker has a tenth."""


@cache
def packaged(name: str) -> RobotFile:
    """A robot file of folder `config`."""
    return load_robot_file(package_folder('spacerobot_ros') / 'config' / f'{name}.yaml')


def flown(name: str, seed: int = 0, **sections: Any) -> RobotFile:
    """A robot file with 100 Hz sensors, under computed torque.

    Args:
        name: Of the file.
        seed: Of the sensors' noise.
        sections: Other settings, by their names.
    """
    file = packaged(name)
    settings = file.settings
    rates: dict[str, Any] = {'period': 1.0 / RATE, 'joint_rate': RATE, 'imu_rate': RATE}
    simulator = replace(settings.simulator, **rates, attitude_rate=0.1 * RATE, seed=seed)
    controller = replace(settings.controller, law='computed_torque')
    changed = replace(settings, simulator=simulator, controller=controller, **sections)
    return replace(file, settings=changed)


def fourier(
    duration: float, sine: Array, cosine: Array, repeat: bool = False
) -> ReferenceSettings:
    """A motion of n joints from amplitudes (n, harmonics) of sine and cosine [rad/s]."""
    return ReferenceSettings(
        kind='fourier',
        duration=duration,
        harmonics=sine.shape[1],
        repeat=repeat,
        sine=tuple(sine.ravel().tolist()),
        cosine=tuple(cosine.ravel().tolist()),
    )


ROBOTS = ('servicer', 'minisat', 'twin')
EFFECTS = tuple(effect.id for effect in CATALOGUE.values() if effect.is_fitted)
EXCITATIONS = {'default': (0.3, 2, 4), 'fast': (0.6, 5, 8), 'slow': (0.3, 1, 2)}
"""Name to largest angle of a joint [rad], first and last harmonic of the record's length."""

DURATION = 20.0  # s of a record
_UNSTABLE = 5.0  # times the motion's fastest rate: no controller would be flown like that
_WHEELS = {  # N m s in the captured body, known to the model
    'servicer': (42.0, 49.0, 41.0),
    'twin': (-7.0, 5.0, 11.0),
}


def truth_of(module: str) -> ModuleType:
    """The module that simulates, by its name; this one without.

    It has `ROBOTS`, names of its robots; `EFFECTS`, ids of what it can hide; `EXCITATIONS`, by the
    name of a motion; `robot_file(name)` as its user has it; `simulated` as this one has.

    Raises:
        ConfigurationError: there is no such module.
    """
    try:
        return import_module(module or __name__)
    except ImportError as error:
        raise ConfigurationError('truth', f'{module!r} can not be imported: {error}') from error


@cache
def robot_file(name: str) -> RobotFile:
    """A robot of `ROBOTS`, its model as the plant is; `NAME, fixed`: with its base held."""
    name, _, base = name.partition(', ')
    file = flown(name, truth=TruthSettings())
    if base:
        held = replace(file.settings.robot, base=base)
        settings = replace(file.settings, robot=held, initial=InitialSettings())
        file = replace(file, settings=settings, robot=build_robot(settings, file.robot.urdf))
    momentum = _WHEELS.get(name)
    if momentum is None:
        return file
    return replace(file, robot=file.robot.with_target_momentum(np.array(momentum)))


def simulated(
    robot: str,
    excitation: str,
    seed: int,
    effects: Sequence[Effect] = (),
    duration: float = DURATION,
) -> Record:
    """A record of the robot with effects that neither its file nor its controller knows.

    Args:
        robot: One of `ROBOTS`.
        excitation: One of `EXCITATIONS`.
        seed: Of motion and noise.
        effects: What the plant has beyond the file.
        duration: [s].

    Raises:
        SimulationDivergedError: the controller is not stable with the effects.
    """
    file = robot_file(robot)
    reference = motion_of(file, excitation, seed, duration)
    simulator = replace(file.settings.simulator, seed=seed)
    believed = replace(file.settings, reference=reference, simulator=simulator)
    loop = ClosedLoop(file.robot, replace(believed, effects=effects_section(effects)))
    loop.controller = ControlLoop(file.robot, believed)
    steps = list(loop.run(round(duration / simulator.period)))
    asked = build_reference(reference, np.zeros(file.robot.n_joints))
    times = np.linspace(0.0, duration, len(steps))
    _check_stable(steps, max(float(np.max(np.abs(asked.at(t).qd))) for t in times))
    samples = SampleBuffer(loop.joints)
    for step in steps:
        step.feed(samples)
    return replace(samples.record(), source=f'{robot}, {excitation}, seed {seed}')


def _check_stable(steps: Sequence[Step], fastest: float) -> None:
    for step in steps:
        joints = step.measured.joints
        if joints is not None and np.max(np.abs(joints.velocity)) > _UNSTABLE * fastest:
            reason = f'a joint is {_UNSTABLE:g} times as fast as asked: an unstable controller'
            raise SimulationDivergedError(1e-9 * step.stamp_ns, reason)


def motion_of(file: RobotFile, excitation: str, seed: int, duration: float) -> ReferenceSettings:
    """Random harmonics of the record's length, up to an angle or as far as limits allow."""
    n = file.robot.n_joints
    largest, first, last = EXCITATIONS[excitation]
    order = np.arange(first, last + 1)
    rng = np.random.default_rng([seed, 7])
    sine, cosine = rng.standard_normal((2, n, len(order))) / order
    angle = 2.0 * np.pi * np.linspace(0.0, 1.0, 400)[:, None] * order
    w = 2.0 * np.pi * order / duration
    sine -= sine.mean(axis=1, keepdims=True)  # at rest at both ends, ...
    cosine -= np.outer(cosine @ w, w) / (w @ w)  # ... and not pulled
    moved = (np.sin(angle) / w) @ sine.T - (np.cos(angle) / w) @ cosine.T
    scale = largest / np.max(np.abs(moved - moved[0]), axis=0)[:, None]
    coefficients = np.zeros((2, n, last))
    coefficients[:, :, first - 1 :] = sine * scale, cosine * scale
    options = ExcitationSettings(harmonics=last)
    asked = replace(file.settings, reference=fourier(duration, *coefficients), excitation=options)
    motions = Motions(file.robot, asked, duration)
    return motions.family.reference(motions.scaled(motions.family.amplitudes(asked.reference)))
