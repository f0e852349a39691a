"""The diagnosis campaign on records of MuJoCo.

The module takes the place of `validation/hidden/diagnosis_scenario.py`: robots, motions, records.
What was drawn of the catalogue is made of MuJoCo's own bodies, joints and forces.
"""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file
from spacerobot_ros.errors import SimulationDivergedError
from spacerobot_ros.recording.record import Record

from ..hidden import diagnosis_campaign
from ..hidden.diagnosis_campaign import drawings, results, run, shown  # noqa: F401  the campaign's
from ..replay.machines import machine
from .run import Excitation
from .sensors import Sensors
from .truth import ROBOTS as KNOWN
from .truth import generate, write_robot

_TRUTH = {
    **{name: KNOWN[name] for name in ('servicer', 'sixdof')},
    'twin': replace(machine('twin', 0), effort_std=0.05),
}
ROBOTS = tuple(_TRUTH)
EXCITATIONS = {
    'default': Excitation(amplitude=0.3, period=10.0),
    'fast': Excitation(amplitude=0.6, period=4.0, harmonics=2),
    'slow': Excitation(amplitude=0.3, period=20.0, harmonics=2),
}
EFFECTS = (  # seeds of trials go by their order
    *('joint_viscous_friction', 'joint_coulomb_friction', 'joint_stribeck_friction'),
    *('joint_torque_ripple', 'joint_stiffness', 'motor_inertia', 'encoder_offset'),
    *('torque_sensor_bias', 'gyro_bias', 'gyro_scale'),
    *('attitude_misalignment', 'imu_delay', 'attitude_delay', 'joint_delay', 'effort_delay'),
    *('target_wheel_momentum', 'servicer_wheel_momentum_error', 'target_wheel_drag'),
    *(
        'servicer_wheel_drag',
        'wheel_imbalance',
        'external_torque_body',
        'external_torque_inertial',
    ),
    *('joint_torque_constant', 'encoder_scale', 'joint_rate_scale', 'gyro_misalignment'),
    *('inertial_parameters', 'flexible_appendage', 'fuel_slosh', 'thruster_leak'),
    *('gravity_gradient', 'joint_flexibility'),
)
trials = partial(diagnosis_campaign.trials, truth=__name__)


@cache
def robot_file(name: str) -> RobotFile:
    """A robot of `ROBOTS` as its user has it."""
    with tempfile.TemporaryDirectory() as folder:
        return load_robot_file(write_robot(_TRUTH[name], _sensors(name), Path(folder)))


def _sensors(name: str) -> Sensors:
    return Sensors(effort_std=_TRUTH[name].effort_std)


def simulated(
    robot: str, excitation: str, seed: int, effects: Sequence[Effect], duration: float
) -> Record:
    """A record of the robot with effects.

    Raises:
        SimulationDivergedError: the controller is not stable with the effects.
    """
    hidden = [(e.id, e.where, e.values) for e in effects]
    with tempfile.TemporaryDirectory() as folder:
        try:
            case = generate(
                _TRUTH[robot],
                hidden,
                folder=Path(folder),
                seed=seed,
                duration=duration,
                excitation=EXCITATIONS[excitation],
            )
        except ArithmeticError as error:
            raise SimulationDivergedError(duration, str(error)) from error
    return case.data
