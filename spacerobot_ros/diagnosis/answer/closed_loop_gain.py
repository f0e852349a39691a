"""What the extended model is worth to a controller: one tracking task in simulation, twice.

The plant is the robot with everything that the diagnosis found; the controller knows first the
robot file as it was, then the extended one. Neither sees a `truth` section: what the file's author
knows beyond the model is no part of a diagnosis.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...control.loop import ControlLoop
from ...effects.effect import Effect
from ...effects.robot_file import RobotFile
from ...errors import ConfigurationError, SpaceRobotError
from ...formats import either
from ...model.control_settings import COMPUTED_TORQUE_LAWS
from ...model.motion_settings import ReferenceSettings
from ...model.settings import Settings, TruthSettings
from ...simulation.closed_loop import ClosedLoop
from ...types import Array
from .extended_model import effects_section

_LONGEST = 20.0  # s of simulated time a run
_AMPLITUDE = 0.3  # rad or m, of the motion of a robot file that names none
_PERIOD = 20.0  # s, of the same
_HARMONICS = 6  # of the same, at most
_LAW = 'computed_torque'
_MOST = 60_000
"""Forces of effects in a run, one an effect and integration step: 5 s of a slow core. Stiff
friction on a body that is lighter than its gear needs millions."""


@dataclass(frozen=True, slots=True)
class RmsErrors:
    """Root mean square error of a joint, with the old and with the extended model."""

    unit: str
    rms_before: float
    rms_after: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedLoopGain:
    """Tracking error of the same task, controlled with the old and with the extended model.

    Args:
        task: The motion in words.
        duration: Simulated time of a run [s].
        joints: Errors of every joint.
    """

    json_too = ('rms_before', 'rms_after', 'ratio', 'unit')
    task: str
    duration: float
    joints: Mapping[str, RmsErrors]

    @property
    def unit(self) -> str:
        """Of what is said of all joints."""
        return either(own.unit for own in self.joints.values())

    @property
    def rms_before(self) -> float:
        """Over all joints, with the old model."""
        return _rms([own.rms_before for own in self.joints.values()])

    @property
    def rms_after(self) -> float:
        """Over all joints, with the extended model."""
        return _rms([own.rms_after for own in self.joints.values()])

    @property
    def ratio(self) -> float:
        """After by before; nan where nothing was left before."""
        return self.rms_after / self.rms_before if self.rms_before else math.nan


def closed_loop_gain(
    file: RobotFile, added: Sequence[Effect]
) -> tuple[ClosedLoopGain | None, str]:
    """Simulate the task with both controllers.

    Args:
        file: The robot file as it was.
        added: What the diagnosis adds, under free names.

    Returns:
        The gain, and an empty text; or None, and why there is none.
    """
    if not added:
        return None, 'nothing was found that a controller could use'
    old = _task_settings(file.settings, file.robot.n_joints)
    extended = {**file.settings.effects, **effects_section(added)}
    try:
        plant = replace(old, effects=extended)
        before, after = (
            np.sqrt(np.mean(tracking_errors(file, plant, believed) ** 2, axis=0))
            for believed in (old, plant)
        )
    except SpaceRobotError as error:
        return None, f'the closed loop could not be simulated: {error}'
    pairs = zip(file.robot.joints, before.tolist(), after.tolist(), strict=True)
    return ClosedLoopGain(
        task=_in_words(file),
        duration=_duration(old.reference),
        joints={joint: RmsErrors(file.robot.unit_of('rad', joint), b, a) for joint, b, a in pairs},
    ), ''


def _task_settings(settings: Settings, n: int) -> Settings:
    """The file's settings with a motion to follow, a law that follows it, and no hidden truth."""
    reference = settings.reference
    if not _is_motion(reference):
        reference = _default_reference(n)
    controller = settings.controller
    if controller.law not in COMPUTED_TORQUE_LAWS:
        controller = replace(controller, law=_LAW)
    return replace(settings, reference=reference, controller=controller, truth=TruthSettings())


def tracking_errors(file: RobotFile, plant: Settings, believed: Settings) -> Array:
    """(N, n) reference less true position of every joint along the plant's reference.

    Args:
        file: The robot.
        plant: With the effects that it has.
        believed: With those that its controller knows.
    """
    loop = ClosedLoop(file.robot, plant)
    loop.controller = ControlLoop(file.robot, believed)
    steps = max(1, round(_duration(plant.reference) / plant.simulator.period))
    cost = steps * loop.plant.substeps * len(loop.plant.effects)
    if cost > _MOST:
        why = f'{loop.plant.substeps} integration steps a period for effects as stiff as these'
        raise ConfigurationError('simulator', f'{why} would take minutes')
    n = file.robot.n_joints
    errors = [
        step.command.setpoint.q - step.state.q[:n]
        for step in loop.run(steps)
        if step.command is not None
    ]
    return np.array(errors)


def _is_motion(reference: ReferenceSettings) -> bool:
    """Whether a robot file names a motion that can be followed without ROS."""
    if reference.kind == 'fourier':
        return bool(np.any(reference.sine) or np.any(reference.cosine))
    return reference.kind not in ('hold', 'topic')


def _default_reference(n: int) -> ReferenceSettings:
    """Every joint swings at its own multiple of a slow rate."""
    harmonics = min(n, _HARMONICS)
    sine = np.zeros((n, harmonics))
    sine[np.arange(n), np.arange(n) % harmonics] = _AMPLITUDE * 2.0 * np.pi / _PERIOD
    return ReferenceSettings(
        kind='fourier',
        duration=_PERIOD,
        harmonics=harmonics,
        sine=tuple(sine.ravel().tolist()),
        cosine=(0.0,) * sine.size,
    )


def _duration(reference: ReferenceSettings) -> float:
    return min(reference.duration, _LONGEST)


def _in_words(file: RobotFile) -> str:
    reference = file.settings.reference
    if not _is_motion(reference):
        unit = file.robot.unit_of('rad')
        return f'a Fourier motion of {_AMPLITUDE:g} {unit} (the robot file names none)'
    return f"the robot file's own motion ({reference.kind.replace('_', ' ')})"


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else 0.0
