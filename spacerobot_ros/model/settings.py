"""Every parameter of a robot file, once: type, unit, bounds and meaning.

A robot file is a ROS 2 parameter file (`/**: ros__parameters:`) shared by all nodes and by the
command line, so one schema serves all of them: each section below is a frozen dataclass whose
fields carry unit, bounds and meaning (`model.schema`). `parse_settings` turns a nested mapping
into a `Settings`, refusing unknown keys, wrong types, wrong lengths and non-finite or
out-of-bound numbers with the parameter named.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .control_settings import AdaptationSettings, ControllerSettings
from .motion_settings import ExcitationSettings, InitialSettings, ReferenceSettings
from .old_keys import without_old_keys
from .robot_settings import RobotSettings, SensorSettings
from .schema import LONGEST, TIMES, FloatList, FreeMaps, TextList, param, parse_section


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifierSettings:
    """The identifier: what is estimated, and when it counts as known.

    Args:
        structure: generic: bodies may be any. symmetric: zeros of the URDF in link centres of mass
            and products of inertia are taken as known.
        nuisances: Further unknowns: gyro_bias, torque_hold (sampled control), encoder_offset,
            imu_delay, attitude_delay, external_torque_inertial, target_wheel_drag,
            servicer_wheel_drag.
        torque_hold_period: Period over which motors hold their torque; 0: seen in the efforts or
            estimated.
        solve_period: Period of /estimate.
        momentum_prior_std: Prior on the wheel momentum, each axis.
        valid_std: Valid once the std of the AAM is below this fraction of the AAM, or of the
            largest momentum so far that the joints' motion has about the system's centre.
        lateness: How far a sample may come behind newer joint and gyro samples; the node keeps
            back the newest data for as long (0.5 s at least).
        buffer: Length of the raw-sample buffer used to re-linearize.
        save_file: File to which each valid estimate is saved, and from which the next start goes
            on; empty: none.
    """

    structure: str = param('generic', choices=('symmetric', 'generic'))
    nuisances: TextList = param(('gyro_bias', 'torque_hold'))
    torque_hold_period: float = param(0.0, 's', minimum=0.0, maximum=LONGEST)
    solve_period: float = param(1.0, 's', **TIMES)
    momentum_prior_std: float = param(1000.0, 'N m s', above=0.0)
    valid_std: float = param(0.05, above=0.0)
    lateness: float = param(0.5, 's', minimum=0.0, maximum=10.0)
    buffer: float = param(120.0, 's', **TIMES)
    save_file: str = param('')


@dataclass(frozen=True, slots=True, kw_only=True)
class MonitorSettings:
    """The monitor: how it watches the model in flight, and what it keeps of an event.

    Args:
        learn: First part of a run, which tells noise levels and how efforts act; judged after it.
        block: The model is judged once a block; an alarm comes at most this much later.
        false_alarm_interval: Mean time between false alarms, at least; it sets the threshold of
            all tests.
        clear_after: An alarm ends when all tests have been below half the threshold for as long.
        whiteness_window: Length of the data in which lines and slow errors are searched.
        target_momentum: estimated: the captured wheels are unknown until /estimate or the flight
            tells; believed: as robot.target_wheels says.
        on_event: What the controller does while something acts from outside: report: nothing;
            damp: the motion waits and the joint rates decay; hold: it waits and the joints hold
            where they were; both go on with the motion once the event is over.
        record_folder: Folder of the bags around alarms; empty: nothing is recorded.
        pre_trigger: Recorded before an alarm.
        post_trigger: Recorded after an alarm.
    """

    learn: float = param(8.0, 's', minimum=3.0, maximum=120.0)
    block: float = param(1.0, 's', minimum=0.2, maximum=10.0)
    false_alarm_interval: float = param(3600000.0, 's', minimum=3600.0, maximum=LONGEST)
    clear_after: float = param(5.0, 's', minimum=0.0, maximum=LONGEST)
    whiteness_window: float = param(30.0, 's', minimum=5.0, maximum=600.0)
    target_momentum: str = param('estimated', choices=('estimated', 'believed'))
    on_event: str = param('report', choices=('report', 'damp', 'hold'))
    record_folder: str = param('')
    pre_trigger: float = param(10.0, 's', minimum=0.0, maximum=300.0)
    post_trigger: float = param(10.0, 's', minimum=0.0, maximum=3600.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthSettings:
    """What the simulated plant really is, where it differs from the model in `robot`.

    Args:
        target_momentum: True wheel momentum of the captured body, as in robot.
        servicer_momentum: True momentum of the servicer's wheels.
        target_rates: True rates of the captured body's rotors at the start.
        servicer_rates: True rates of the servicer's rotors at the start.
        links: Links whose inertial parameters differ from the URDF.
        inertial_parameters: Ten a link: m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link
            origin (kg, kg m, kg m^2).
    """

    target_momentum: FloatList = param((), 'N m s')
    servicer_momentum: FloatList = param((), 'N m s')
    target_rates: FloatList = param((), 'rad/s')
    servicer_rates: FloatList = param((), 'rad/s')
    links: TextList = param(())
    inertial_parameters: FloatList = param(())


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorSettings:
    """The simulator: steps, sensors' rates, pacing.

    Args:
        period: Control period; torques are held over it.
        substeps: Runge-Kutta steps in one control period.
        integrator: Method of a step. dop853: order 8, twelve evaluations, keeps momentum to
            rounding; rk4: order 4, four evaluations, right to 1e-6 at 10 ms and twice as fast.
        joint_rate: Rate of /joint_states; divides 1/period.
        imu_rate: Rate of /imu/data; divides 1/period.
        attitude_rate: Rate of /attitude; divides 1/period.
        noise: Add the noise of `sensors`.
        seed: Seed of every random stream.
        lockstep: Wait for the command of step k before step k+1 (deterministic).
        lockstep_timeout: Wall time after which a missing command is reported.
        real_time_factor: Pace outside lockstep.
        command_timeout: Age after which a held torque falls to zero.
    """

    period: float = param(0.01, 's', minimum=1e-6, maximum=1.0)
    substeps: int = param(1, minimum=1, maximum=1000)
    integrator: str = param('dop853', choices=('dop853', 'rk4'))
    joint_rate: float = param(100.0, 'Hz', **TIMES)
    imu_rate: float = param(100.0, 'Hz', **TIMES)
    attitude_rate: float = param(10.0, 'Hz', **TIMES)
    noise: bool = param(True)
    seed: int = param(1, minimum=0)
    lockstep: bool = param(False)
    lockstep_timeout: float = param(5.0, 's', **TIMES)
    real_time_factor: float = param(1.0, minimum=1e-6, maximum=1e6)
    command_timeout: float = param(0.5, 's', **TIMES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All sections of a robot file.

    `effects` holds physical effects that the model believes in, under free names, as {effect: id,
    where: place, parameters...}; `effects.catalogue.bind_effects` checks them against the robot.
    `firings` are the commands of a simulated run, under free names: {thruster: name, start: s,
    width: s, share: 1, period: s}, without a period once.

    Args:
        effects: Of a physical effect that the model believes in.
        firings: Of commands to a thruster in a simulated run.
    """

    robot: RobotSettings
    sensors: SensorSettings = field(default_factory=SensorSettings)
    reference: ReferenceSettings = field(default_factory=ReferenceSettings)
    initial: InitialSettings = field(default_factory=InitialSettings)
    truth: TruthSettings = field(default_factory=TruthSettings)
    simulator: SimulatorSettings = field(default_factory=SimulatorSettings)
    identifier: IdentifierSettings = field(default_factory=IdentifierSettings)
    monitor: MonitorSettings = field(default_factory=MonitorSettings)
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    adaptive: AdaptationSettings = field(default_factory=AdaptationSettings)
    excitation: ExcitationSettings = field(default_factory=ExcitationSettings)
    effects: FreeMaps = field(default_factory=dict)
    firings: FreeMaps = field(default_factory=dict)

    def changed(self, values: Mapping[str, Any]) -> Settings:
        """Settings with other values by name, such as `simulator.seed`; None leaves one as is."""
        settings = self
        for name, value in values.items():
            section, _, key = name.partition('.')
            if value is not None:
                part = replace(getattr(settings, section), **{key: value})
                settings = replace(settings, **{section: part})
        return settings


def parse_settings(values: Mapping[str, Any], place: str = '') -> Settings:
    """Validate a nested mapping (the content of `ros__parameters`) against the schema.

    Args:
        values: Nested mapping of sections.
        place: Prefix for error messages, such as the file's name.

    Returns:
        The typed, validated settings.

    Raises:
        ConfigurationError: on an unknown key, wrong type, wrong length, or non-finite or
            out-of-bound number.
    """
    return typing.cast(Settings, parse_section(Settings, without_old_keys(values), place))
