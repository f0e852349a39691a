"""The diagnosis campaign on records of MuJoCo.

The module takes the place of `validation/hidden/diagnosis_scenario.py`: robots, motions, records.
What was drawn of the catalogue is made of MuJoCo's own bodies, joints and forces.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

from spacerobot_ros.effects.effect import Effect
from spacerobot_ros.effects.robot_file import RobotFile, load_robot_file
from spacerobot_ros.errors import SimulationDivergedError
from spacerobot_ros.recording.record import Record

from ..hidden import diagnosis_campaign
from ..hidden.diagnosis_campaign import drawings as drawings
from ..hidden.diagnosis_campaign import judge as judge
from ..hidden.diagnosis_campaign import results as results
from ..hidden.diagnosis_campaign import run as run
from ..hidden.diagnosis_campaign import shown as shown
from .robots import ROBOTS as KNOWN
from .robots import SERVICER, TruthRobot
from .run import Excitation
from .sensors import Sensors
from .truth import generate, write_robot

TWIN = TruthRobot(
    SERVICER.with_name('twin.urdf').read_text(encoding='utf-8'),
    tuple(f'{side}_joint_{k}' for side in ('left', 'right') for k in (1, 2, 3)),
    servicer_wheels=(4.0, -6.0, 5.0),
    target_link='left_3',
    target_wheels=(-7.0, 5.0, 11.0),
    q0=(0.3, 0.7, -0.4, -0.3, 0.8, 0.6),
    omega=(0.02, -0.03, 0.025),
)
_TRUTH = {'servicer': KNOWN['servicer'], 'sixdof': KNOWN['sixdof'], 'twin': TWIN}
ROBOTS = tuple(_TRUTH)
EXCITATIONS = {
    'default': Excitation(amplitude=0.3, period=10.0),
    'fast': Excitation(amplitude=0.6, period=4.0, harmonics=2),
    'slow': Excitation(amplitude=0.3, period=20.0, harmonics=2),
}
Values = Mapping[str, float]
trials = partial(diagnosis_campaign.trials, truth=__name__)


def _vector(v: Values, prefix: str = '') -> tuple[float, ...]:
    return tuple(v[prefix + axis] for axis in 'xyz')


def _relative(v: Values) -> dict[str, Any]:
    return {'gain': v['gain'] - 1.0}


def _opposite(v: Values) -> dict[str, Any]:
    """The plan turns the sensor, the catalogue what it says."""
    return {axis: -v[axis] for axis in 'xyz'}


def _payload(v: Values) -> dict[str, Any]:
    """A point mass, which is all that the campaign draws of inertial parameters."""
    return {'mass': v['mass'], 'com': tuple(m / v['mass'] for m in _vector(v, 'm'))}


def _panel(v: Values) -> dict[str, Any]:
    return {name: v[name] for name in ('inertia', 'frequency', 'damping')} | {'axis': _vector(v)}


def _tank(v: Values) -> dict[str, Any]:
    """At the centre of mass, where the campaign puts it."""
    return {name: v[name] for name in ('mass', 'frequency', 'damping')}


def _leak(v: Values) -> dict[str, Any]:
    return {'force': _vector(v, 'force_'), 'at': _vector(v, 'at_')}


def _gradient(v: Values) -> dict[str, Any]:
    return {'orbital_rate': v['orbital_rate'], 'direction': _vector(v)}


def _gear(v: Values) -> dict[str, Any]:
    own = {name: v[name] for name in ('stiffness', 'damping', 'rotor_inertia')}
    return own | {'encoder': 'motor' if v['motor_side'] > 0.5 else 'link'}


_PLANNED: dict[str, Callable[[Values], dict[str, Any]]] = {
    'joint_torque_constant': _relative,
    'encoder_scale': _relative,
    'joint_rate_scale': _relative,
    'gyro_misalignment': _opposite,
    'inertial_parameters': _payload,
    'flexible_appendage': _panel,
    'fuel_slosh': _tank,
    'thruster_leak': _leak,
    'gravity_gradient': _gradient,
    'joint_flexibility': _gear,
}
_AS_IN_THE_CATALOGUE = (
    *('joint_viscous_friction', 'joint_coulomb_friction', 'joint_stribeck_friction'),
    *('joint_torque_ripple', 'joint_stiffness', 'motor_inertia', 'encoder_offset'),
    *('torque_sensor_bias', 'gyro_bias', 'gyro_scale'),
    *('attitude_misalignment', 'imu_delay', 'attitude_delay', 'joint_delay', 'effort_delay'),
    *('target_wheel_momentum', 'servicer_wheel_momentum_error', 'target_wheel_drag'),
    *('servicer_wheel_drag', 'wheel_imbalance', 'external_torque_body'),
    'external_torque_inertial',
)
EFFECTS = (*_AS_IN_THE_CATALOGUE, *_PLANNED)


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
    hidden = [(e.id, e.where, _PLANNED.get(e.id, dict)(e.values)) for e in effects]
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
