"""Every parameter of a robot file, once: type, unit, bounds and meaning.

A robot file is a ROS 2 parameter file (`/**: ros__parameters:`) shared by all nodes and by the
command line, so one schema serves all of them: each section below is a frozen dataclass whose
fields carry unit, bounds and meaning (`model.schema`). `parse_settings` turns a nested mapping
into a `Settings`, refusing unknown keys, wrong types, wrong lengths and non-finite or
out-of-bound numbers with the parameter named.
"""

from __future__ import annotations

import math
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from .schema import (
    FloatList,
    FloatOrList,
    FreeMaps,
    TextList,
    TextOrList,
    param,
    parse_section,
)

ADAPTIVE_LAWS = (
    'passivity',
    'adaptive_rls',
    'adaptive_lyapunov',
    'adaptive_composite',
    'adaptive_rls_paper',
    'adaptive_lyapunov_paper',
)
COMPUTED_TORQUE_LAWS = ('computed_torque', 'computed_torque_no_aam', 'computed_torque_paper')
CONSISTENCIES = ('none', 'project', 'natural')
ANCHORS = ('none', 'gravity', 'inertia')
EFFORT_KINDS = ('motor', 'link', 'current', 'gravity_compensated', 'command')


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSettings:
    """Wheels of the servicer or of the captured body, as gyrostats or as true rotors.

    Gyrostat: `momentum` relative to the host link, three numbers a link in that link's frame; the
    link's inertia in the URDF includes the wheels, locked. True rotors: `joints` names continuous
    joints of the URDF whose child links are the rotors, and `rates` their relative rates at the
    start; the carrying link's inertia excludes them.

    Args:
        links: Links that carry gyrostat wheels.
        momentum: Relative wheel momentum, three a link, in the link frame.
        joints: URDF joints that are true wheel rotors.
        rates: Relative rate of each rotor at the start; zero where empty.
    """

    links: TextList = param(())
    momentum: FloatList = param((), 'N m s')
    joints: TextList = param(())
    rates: FloatList = param((), 'rad/s')


@dataclass(frozen=True, slots=True, kw_only=True)
class ScaleSettings:
    """What the file knows of the size of all torques, masses and inertias together.

    It counts where no torque is measured in N m: motion alone, and currents, tell ratios only.

    Args:
        anchor: What of the URDF is right: gravity, the weight's torques (masses times centres of
            mass); inertia, the inertias; none: results are ratios.
    """

    anchor: str = param('none', choices=ANCHORS)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSettings:
    """The robot: its URDF and what a URDF can't say.

    `effort_kind` says what a measured effort is. motor: torque of the motor through the gear, the
    joint's friction in it. link: of a torque sensor behind the gear. current: of the motor, in A
    where a message or mapping gives it so; times `motor_constant` it is a torque of the motor.
    gravity_compensated: torque of the motor less what holds the arm. command: what was commanded.

    `thrusters` on the base are a map under free names: {at: [x, y, z], direction: [x, y, z],
    force: N at a command of 1}, the direction that of the force on the base, in its coordinates.

    Args:
        urdf: package:// URL, absolute path, or path beside the robot file.
        base: Free-floating base, or fixed for a ground test.
        base_link: Root link of the URDF.
        gravity: Gravity in the inertial frame.
        inertia_uncertainty: Standard deviation of every inertial parameter, as a share of its
            magnitude.
        joints: Manipulator joints in the order of every vector and message.
        effort_kind: What measured efforts are; one for all joints, or one a joint.
        motor_constant: Torque at the joint of one ampere; one for all joints, or one a joint.
            Without it currents are read in A, and the diagnosis estimates it.
        passive_joints: Joints without a motor: their torque is zero.
        effect_modules: Python modules with effects of your own: names that can be imported, or
            files ending in .py beside the robot file. They are run as they are.
    """

    urdf: str = param('')
    base: str = param('free', choices=('free', 'fixed'))
    base_link: str = param('base_link')
    gravity: FloatList = param((0.0, 0.0, 0.0), 'm/s^2', length=3)
    inertia_uncertainty: float = param(0.1, above=0.0, maximum=1.0)
    joints: TextList = param()
    effort_kind: TextOrList = param('motor', choices=EFFORT_KINDS)
    motor_constant: FloatOrList | None = param(None, 'N m/A', above=0.0)
    passive_joints: TextList = param(())
    effect_modules: TextList = param(())
    scale: ScaleSettings = field(default_factory=ScaleSettings)
    thrusters: FreeMaps = field(default_factory=dict)
    servicer_wheels: WheelSettings = field(default_factory=WheelSettings)
    target_wheels: WheelSettings = field(default_factory=WheelSettings)

    @property
    def wheels(self) -> dict[str, WheelSettings]:
        """Wheels of both sides by the name of their section."""
        return {'servicer_wheels': self.servicer_wheels, 'target_wheels': self.target_wheels}


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """Noise and limits of the sensors.

    A missing standard deviation is estimated from the data; those of joints are one number for
    all, or one a joint. What stands below the standard
    deviations only the simulator uses: a sensor without it is continuous, unlimited and punctual.
    A gyro's angle random walk is `gyro_std` times the square root of its sample period. Jitter and
    clock drift make a stamp late; of a slow clock, say that the other sensors' clocks are fast.

    Args:
        joint_position_std: Encoder noise.
        joint_velocity_std: Joint rate noise.
        joint_effort_std: Torque sensor noise.
        gyro_std: Gyro noise a sample and axis.
        attitude_std: Star tracker noise an axis.
        gyro_bias_walk: Random walk of the gyro's bias, from zero.
        gyro_range: Largest rate that the gyro can say, each axis.
        joint_position_resolution: Step of the encoders; 0: continuous.
        joint_velocity_resolution: Step of the joint rates; 0: continuous.
        joint_effort_resolution: Step of the torque sensors; 0: continuous.
        gyro_resolution: Step of the gyro; 0: continuous.
        attitude_rate_limit: Body rate above which the star tracker is blind.
        joint_dropout: Share of joint samples lost; never the first.
        imu_dropout: Share of gyro samples lost; never the first.
        attitude_dropout: Share of star tracker samples lost; never the first.
        joint_jitter: Joint stamps are late by up to this, evenly spread.
        imu_jitter: Gyro stamps are late by up to this, evenly spread.
        attitude_jitter: Star tracker stamps are late by up to this, evenly spread.
        joint_clock_drift: How fast the joint stamps fall late.
        imu_clock_drift: How fast the gyro stamps fall late.
        attitude_clock_drift: How fast the tracker stamps fall late.
    """

    joint_position_std: FloatOrList | None = param(None, 'rad', above=0.0)
    joint_velocity_std: FloatOrList | None = param(None, 'rad/s', above=0.0)
    joint_effort_std: FloatOrList | None = param(None, 'N m', above=0.0)
    gyro_std: float | None = param(None, 'rad/s', above=0.0)
    attitude_std: float | None = param(None, 'rad', above=0.0)
    gyro_bias_walk: float = param(0.0, 'rad/s/sqrt(s)', minimum=0.0)
    gyro_range: float | None = param(None, 'rad/s', above=0.0)
    joint_position_resolution: float = param(0.0, 'rad', minimum=0.0)
    joint_velocity_resolution: float = param(0.0, 'rad/s', minimum=0.0)
    joint_effort_resolution: float = param(0.0, 'N m', minimum=0.0)
    gyro_resolution: float = param(0.0, 'rad/s', minimum=0.0)
    attitude_rate_limit: float | None = param(None, 'rad/s', above=0.0)
    joint_dropout: float = param(0.0, minimum=0.0, maximum=0.99)
    imu_dropout: float = param(0.0, minimum=0.0, maximum=0.99)
    attitude_dropout: float = param(0.0, minimum=0.0, maximum=0.99)
    joint_jitter: float = param(0.0, 's', minimum=0.0)
    imu_jitter: float = param(0.0, 's', minimum=0.0)
    attitude_jitter: float = param(0.0, 's', minimum=0.0)
    joint_clock_drift: float = param(0.0, 's/s', minimum=0.0, maximum=0.1)
    imu_clock_drift: float = param(0.0, 's/s', minimum=0.0, maximum=0.1)
    attitude_clock_drift: float = param(0.0, 's/s', minimum=0.0, maximum=0.1)

    def std(self, channel: str) -> float | None:
        """One standard deviation of a channel: over joints, the root mean square of theirs [SI].

        Args:
            channel: Such as `joint_effort` or `gyro`.

        Returns:
            None where it is not stated.
        """
        stated: FloatOrList | None = getattr(self, f'{channel}_std')
        if not isinstance(stated, tuple):
            return stated
        return math.sqrt(sum(std**2 for std in stated) / len(stated))


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceSettings:
    """The motion that the controller follows.

    The attitude counts for the laws that control it: passivity and the adaptive ones. They hold
    the attitude at the start where nothing else is said.

    Args:
        kind: hold; fourier: around the start; set_point: a smooth move; step: the goal at once;
            harmonic: sines around the start, for ever; topic: hold until /reference comes.
        duration: Duration of one pass of the Fourier motion or of the move; period of the
            harmonics.
        harmonics: Number of Fourier harmonics.
        sine: Coefficients a of sin/(w l), joint by joint, harmonics inside.
        cosine: Coefficients b of -cos/(w l), joint by joint, harmonics inside.
        set_point: Goal of `set_point` and `step`, one a joint.
        amplitude: Amplitude of `harmonic`, one a joint.
        attitude_xyzw: Goal q_WB of `set_point` and `step`, normalized within 1e-3; empty: as it
            is.
        attitude_amplitude: Rotation vector of `harmonic`, in base coordinates at the start; empty:
            none.
        repeat: Start the Fourier motion again when it ends, instead of holding.
    """

    kind: str = param(
        'hold', choices=('hold', 'fourier', 'set_point', 'step', 'harmonic', 'topic')
    )
    duration: float = param(20.0, 's', above=0.0)
    harmonics: int = param(3, minimum=1, maximum=20)
    sine: FloatList = param((), 'rad/s')
    cosine: FloatList = param((), 'rad/s')
    set_point: FloatList = param((), 'rad')
    amplitude: FloatList = param((), 'rad')
    attitude_xyzw: FloatList = param(())
    attitude_amplitude: FloatList = param((), 'rad')
    repeat: bool = param(False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """The controller: law, gains, limits and time-outs.

    Args:
        law: Control law. computed_torque: joints of a floating base. The others control the base's
            attitude, too: passivity with fixed parameters; adaptive_rls by filtered least squares;
            adaptive_lyapunov by the gradient of the Lyapunov function; adaptive_composite by both;
            `_paper` as in the papers, for comparison.
        physical_consistency: Adaptive laws: none; project: onto physical bodies in the metric of
            the information; natural: gradient law on the manifold of physical bodies
            (adaptive_lyapunov).
        bandwidth: Double pole of the error dynamics.
        use_estimate: Use the latest valid /estimate; adaptive laws start from the first one.
            Otherwise the model of the robot file.
        torque_limit: One a joint; empty: the URDF's effort limits.
        base_torque_limit: On the base, one an axis of base_link; empty: none.
        damping: Decay of the joint rates while damping to zero.
        state_timeout: Age of the joint states or gyro that ends tracking.
        attitude_timeout: Age of the attitude that ends tracking where the law controls it; younger
            ones are carried on with the gyro.
        hold_compensation: Computed torque: evaluate the law at the middle of the interval that
            holds its torque.
        save_parameters: YAML to which ~/save_parameters and the end of the node write the robot
            with the parameters in force, the URDF beside it; empty: nowhere.
        save_file: Adaptive laws: file to which what was learned is saved every second, and from
            which the next start goes on; empty: none.
    """

    law: str = param('computed_torque', choices=(*COMPUTED_TORQUE_LAWS, *ADAPTIVE_LAWS))
    physical_consistency: str = param('project', choices=CONSISTENCIES)
    bandwidth: float = param(1.0, 'rad/s', above=0.0, maximum=100.0)
    use_estimate: bool = param(True)
    torque_limit: FloatList = param((), 'N m', above=0.0)
    base_torque_limit: FloatList = param((), 'N m', above=0.0)
    damping: float = param(1.0, '1/s', above=0.0)
    state_timeout: float = param(0.1, 's', above=0.0)
    attitude_timeout: float = param(1.0, 's', above=0.0)
    hold_compensation: bool = param(True)
    save_parameters: str = param('')
    save_file: str = param('')


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptationSettings:
    """Adaptive control of base attitude and joints: bandwidths, prior, gains.

    `controller.law` and `controller.physical_consistency` choose the law.

    Args:
        kappa: Bandwidth of the rate loop: K_D = kappa M(q0).
        attitude_bandwidth: Lambda of the attitude.
        joint_bandwidth: Lambda of the joints.
        sampling_check: What to do where bandwidths are too fast for the control period.
        filter_rate: Low-pass of the momentum regression.
        prior_std: Relative standard deviation of the inertial parameters.
        prior_shape: bodies: each is like the believed one, stretched and moved; elements: each
            parameter is wrong on its own, which few physical bodies are.
        wheel_momentum_std: Standard deviation of the captured wheels' momentum, each axis; 0:
            known.
        adaptation_error: Attitude error that weighs as much in the gradient laws as a parameter
            wrong by its prior standard deviation; a smaller one adapts faster.
        torque_noise: Noise of the torques besides the sensors'; weighs data against the prior.
    """

    kappa: float = param(2.0, '1/s', above=0.0, maximum=100.0)
    attitude_bandwidth: float = param(1.0, '1/s', above=0.0, maximum=100.0)
    joint_bandwidth: float = param(1.0, '1/s', above=0.0, maximum=100.0)
    sampling_check: str = param('refuse', choices=('refuse', 'warn'))
    filter_rate: float = param(2.0, '1/s', above=0.0, maximum=1000.0)
    prior_std: float = param(0.3, above=0.0, maximum=10.0)
    prior_shape: str = param('bodies', choices=('bodies', 'elements'))
    wheel_momentum_std: float = param(0.0, 'N m s', minimum=0.0)
    adaptation_error: float = param(0.005, 'rad', above=0.0)
    torque_noise: float = param(0.0, 'N m', minimum=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifierSettings:
    """The identifier: what is estimated, and when it counts as known.

    Args:
        structure: symmetric: zeros of the URDF in link centres of mass and products of inertia are
            taken as known.
        manifold: physical: what rigid bodies can be; linear: the minimal set is left free.
        nuisances: Further unknowns: gyro_bias, torque_hold (sampled control), encoder_offset,
            imu_delay, attitude_delay, external_torque_inertial, target_wheel_drag,
            servicer_wheel_drag.
        torque_hold_period: Period over which motors hold their torque; 0: seen in the efforts or
            estimated.
        solve_period: Period of /estimate.
        prior_std: Relative standard deviation of the prior on inertial parameters.
        momentum_prior_std: Prior on the wheel momentum, each axis.
        valid_std: Valid once the std of the AAM is below this fraction of its scale.
        lateness: How far a sample may come behind newer joint and gyro samples; the node keeps
            back the newest data for as long (0.5 s at least).
        buffer: Length of the raw-sample buffer used to re-linearize.
        save_file: File to which each valid estimate is saved, and from which the next start goes
            on; empty: none.
    """

    structure: str = param('symmetric', choices=('symmetric', 'generic'))
    manifold: str = param('physical', choices=('physical', 'linear'))
    nuisances: TextList = param(('gyro_bias', 'torque_hold'))
    torque_hold_period: float = param(0.0, 's', minimum=0.0)
    solve_period: float = param(1.0, 's', above=0.0)
    prior_std: float = param(1.0, above=0.0)
    momentum_prior_std: float = param(1000.0, 'N m s', above=0.0)
    valid_std: float = param(0.05, above=0.0)
    lateness: float = param(0.5, 's', minimum=0.0, maximum=10.0)
    buffer: float = param(120.0, 's', above=0.0)
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
        record_folder: Folder of the bags around alarms; empty: nothing is recorded.
        pre_trigger: Recorded before an alarm.
        post_trigger: Recorded after an alarm.
    """

    learn: float = param(8.0, 's', minimum=3.0, maximum=120.0)
    block: float = param(1.0, 's', minimum=0.2, maximum=10.0)
    false_alarm_interval: float = param(3600000.0, 's', minimum=3600.0)
    clear_after: float = param(5.0, 's', minimum=0.0)
    whiteness_window: float = param(30.0, 's', minimum=5.0, maximum=600.0)
    target_momentum: str = param('estimated', choices=('estimated', 'believed'))
    record_folder: str = param('')
    pre_trigger: float = param(10.0, 's', minimum=0.0, maximum=300.0)
    post_trigger: float = param(10.0, 's', minimum=0.0, maximum=3600.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationSettings:
    """Design of an identification motion (`spacerobot excite`): family, limits, search.

    A joint limit is one number for all joints or one a joint. The URDF's position limits hold
    besides.

    Args:
        duration: Duration of the motion.
        harmonics: Number of Fourier harmonics a joint.
        start: Base rate at the start: initial.angular_velocity; rest; spin_up: at rest, then the
            servicer's wheels are spun up; auto: initial where base_rate and base_rotation allow
            it, else rest.
        joint_range: Largest joint angle; 175 deg.
        joint_rate: Largest joint rate; empty: no limit.
        joint_acceleration: Largest joint acceleration; empty: no limit.
        joint_torque: Largest joint torque; 90 % of the URDF's effort limits hold besides.
        base_rotation: Largest turn of the base from its first attitude.
        base_rate: Largest rate of the base, such that trackers see.
        momentum_uncertainty: Limits hold also where an axis of the captured wheels' momentum is
            off by this.
        criterion: information: bits told of the whole estimate; condition: the paper's condition
            number; unit_condition: the same with columns of unit norm.
        starts: Number of starting points.
        iterations: Largest number of steps a start.
        seed: Seed of the starting points.
    """

    duration: float = param(20.0, 's', above=0.0)
    harmonics: int = param(3, minimum=1, maximum=20)
    start: str = param('auto', choices=('auto', 'initial', 'rest', 'spin_up'))
    joint_range: FloatList = param((3.0543261909900763,), 'rad', above=0.0)
    joint_rate: FloatList = param((), 'rad/s', above=0.0)
    joint_acceleration: FloatList = param((), 'rad/s^2', above=0.0)
    joint_torque: FloatList = param((), 'N m', above=0.0)
    base_rotation: float | None = param(None, 'rad', above=0.0)
    base_rate: float | None = param(None, 'rad/s', above=0.0)
    momentum_uncertainty: float = param(0.0, 'N m s', minimum=0.0)
    criterion: str = param('information', choices=('information', 'condition', 'unit_condition'))
    starts: int = param(3, minimum=1, maximum=1000)
    iterations: int = param(80, minimum=1, maximum=10000)
    seed: int = param(1, minimum=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialSettings:
    """State at the start of a simulation.

    Args:
        attitude_xyzw: q_WB, normalized within 1e-3.
        angular_velocity: omega_WB_B.
        joint_position: Joint positions; zero where empty.
        joint_velocity: Joint rates; zero where empty.
    """

    attitude_xyzw: FloatList = param((0.0, 0.0, 0.0, 1.0), length=4)
    angular_velocity: FloatList = param((0.0, 0.0, 0.0), 'rad/s', length=3)
    joint_position: FloatList = param((), 'rad')
    joint_velocity: FloatList = param((), 'rad/s')


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

    period: float = param(0.01, 's', above=0.0, maximum=1.0)
    substeps: int = param(1, minimum=1, maximum=1000)
    integrator: str = param('dop853', choices=('dop853', 'rk4'))
    joint_rate: float = param(100.0, 'Hz', above=0.0)
    imu_rate: float = param(100.0, 'Hz', above=0.0)
    attitude_rate: float = param(10.0, 'Hz', above=0.0)
    noise: bool = param(True)
    seed: int = param(1, minimum=0)
    lockstep: bool = param(False)
    lockstep_timeout: float = param(5.0, 's', above=0.0)
    real_time_factor: float = param(1.0, above=0.0)
    command_timeout: float = param(0.5, 's', above=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All sections of a robot file.

    `effects` holds physical effects that the model believes in, under free names, as {effect: id,
    where: place, parameters...}; `effects.catalogue.bind_effects` checks them against the robot.
    `firings` are the commands of a simulated run, under free names: {thruster: name, start: s,
    width: s, share: 1, period: s}, without a period once.
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
    return typing.cast(Settings, parse_section(Settings, values, place))
