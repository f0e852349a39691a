"""Every parameter of a robot file, once: type, unit, bounds and meaning.

A robot file is a ROS 2 parameter file (`/**: ros__parameters:`) shared by all nodes and by the
command line, so one schema serves all of them: each section below is a frozen dataclass whose
fields carry their unit, bounds and documentation as metadata. `parse_settings` turns a nested
mapping into a `Settings`, refusing unknown keys, wrong types, wrong lengths and non-finite or
out-of-bound numbers with the parameter named.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field
from typing import Any

from .schema import FloatList, TextList, parse_section


def param(
    default: Any = MISSING,
    *,
    doc: str,
    unit: str = '',
    minimum: float | None = None,
    above: float | None = None,
    maximum: float | None = None,
    choices: tuple[str, ...] = (),
    length: int | None = None,
) -> Any:
    """A dataclass field with what a user must know of the parameter.

    Args:
        default: Value where the file is silent; without one the parameter is required.
        doc: One sentence.
        unit: SI unit; empty for a pure number or text.
        minimum: Smallest allowed value (inclusive), also of each entry of a list.
        above: Exclusive lower bound, also of each entry of a list.
        maximum: Largest allowed value (inclusive), also of each entry of a list.
        choices: Allowed texts.
        length: Required number of entries of a list.
    """
    metadata = {
        'doc': doc,
        'unit': unit,
        'minimum': minimum,
        'above': above,
        'maximum': maximum,
        'choices': choices,
        'length': length,
    }
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, slots=True, kw_only=True)
class WheelSettings:
    """Wheels of the servicer or of the captured body, as gyrostats or as true rotors.

    Gyrostat: `momentum` relative to the host link, three numbers a link in that link's frame; the
    link's inertia in the URDF includes the wheels, locked. True rotors: `joints` names continuous
    joints of the URDF whose child links are the rotors, and `rates` their relative rates at the
    start; the carrying link's inertia excludes them.
    """

    links: TextList = param((), doc='Links that carry gyrostat wheels.')
    momentum: FloatList = param(
        (), unit='N m s', doc='Relative wheel momentum, three a link, in the link frame.'
    )
    joints: TextList = param((), doc='URDF joints that are true wheel rotors.')
    rates: FloatList = param(
        (), unit='rad/s', doc='Relative rate of each rotor at the start; zero where empty.'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotSettings:
    """The robot: its URDF and what a URDF can't say."""

    urdf: str = param('', doc='package:// URL, absolute path, or path beside the robot file.')
    base: str = param(
        'free', choices=('free', 'fixed'), doc='Free-floating base, or fixed for a ground test.'
    )
    base_link: str = param('base_link', doc='Root link of the URDF.')
    gravity: FloatList = param(
        (0.0, 0.0, 0.0), unit='m/s^2', length=3, doc='Gravity in the inertial frame.'
    )
    joints: TextList = param(doc='Manipulator joints in the order of every vector and message.')
    servicer_wheels: WheelSettings = field(default_factory=WheelSettings)
    target_wheels: WheelSettings = field(default_factory=WheelSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """Standard deviation of a sample of each sensor; a missing one is estimated from the data."""

    joint_position_std: float | None = param(None, unit='rad', above=0.0, doc='Encoder noise.')
    joint_velocity_std: float | None = param(
        None, unit='rad/s', above=0.0, doc='Joint rate noise.'
    )
    joint_effort_std: float | None = param(None, unit='N m', above=0.0, doc='Torque sensor noise.')
    gyro_std: float | None = param(
        None, unit='rad/s', above=0.0, doc='Gyro noise a sample and axis.'
    )
    attitude_std: float | None = param(
        None, unit='rad', above=0.0, doc='Star tracker noise an axis.'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReferenceSettings:
    """The motion that the controller follows."""

    kind: str = param(
        'hold',
        choices=('hold', 'fourier', 'set_point', 'topic'),
        doc='Where the reference comes from.',
    )
    duration: float = param(
        20.0, unit='s', above=0.0, doc='Duration of one pass of the Fourier motion or of the move.'
    )
    harmonics: int = param(3, minimum=1, maximum=20, doc='Number of Fourier harmonics.')
    sine: FloatList = param(
        (), unit='rad/s', doc='Coefficients a of sin/(w l), joint by joint, harmonics inside.'
    )
    cosine: FloatList = param(
        (), unit='rad/s', doc='Coefficients b of -cos/(w l), joint by joint, harmonics inside.'
    )
    set_point: FloatList = param((), unit='rad', doc='Goal of `set_point`, one a joint.')
    repeat: bool = param(
        False, doc='Start the Fourier motion again when it ends, instead of holding.'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialSettings:
    """State at the start of a simulation."""

    attitude_xyzw: FloatList = param(
        (0.0, 0.0, 0.0, 1.0), length=4, doc='q_WB, normalised within 1e-3.'
    )
    angular_velocity: FloatList = param((0.0, 0.0, 0.0), unit='rad/s', length=3, doc='omega_WB_B.')
    joint_position: FloatList = param((), unit='rad', doc='Joint positions; zero where empty.')
    joint_velocity: FloatList = param((), unit='rad/s', doc='Joint rates; zero where empty.')


@dataclass(frozen=True, slots=True, kw_only=True)
class TruthSettings:
    """What the simulated plant really is, where it differs from the model in `robot`."""

    target_momentum: FloatList = param(
        (), unit='N m s', doc='True wheel momentum of the captured body, as in robot.'
    )
    servicer_momentum: FloatList = param(
        (), unit='N m s', doc="True momentum of the servicer's wheels."
    )
    target_rates: FloatList = param(
        (), unit='rad/s', doc="True rates of the captured body's rotors at the start."
    )
    servicer_rates: FloatList = param(
        (), unit='rad/s', doc="True rates of the servicer's rotors at the start."
    )
    links: TextList = param((), doc='Links whose inertial parameters differ from the URDF.')
    inertial_parameters: FloatList = param(
        (),
        doc='Ten a link: m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the link origin '
        '(kg, kg m, kg m^2).',
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatorSettings:
    """The simulator: steps, sensors' rates, pacing."""

    period: float = param(
        0.01, unit='s', above=0.0, maximum=1.0, doc='Control period; torques are held over it.'
    )
    substeps: int = param(4, minimum=1, maximum=1000, doc='RK4 steps in one control period.')
    joint_rate: float = param(
        100.0, unit='Hz', above=0.0, doc='Rate of /joint_states; divides 1/period.'
    )
    imu_rate: float = param(
        100.0, unit='Hz', above=0.0, doc='Rate of /imu/data; divides 1/period.'
    )
    attitude_rate: float = param(
        10.0, unit='Hz', above=0.0, doc='Rate of /attitude; divides 1/period.'
    )
    noise: bool = param(True, doc='Add the noise of `sensors`.')
    seed: int = param(1, minimum=0, doc='Seed of every random stream.')
    lockstep: bool = param(
        False, doc='Wait for the command of step k before step k+1 (deterministic).'
    )
    lockstep_timeout: float = param(
        5.0, unit='s', above=0.0, doc='Wall time after which a missing command is reported.'
    )
    real_time_factor: float = param(1.0, above=0.0, doc='Pace outside lockstep.')
    command_timeout: float = param(
        0.5, unit='s', above=0.0, doc='Age after which a held torque falls to zero.'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class IdentifierSettings:
    """The identifier: what is estimated, and when it counts as known."""

    structure: str = param(
        'symmetric',
        choices=('symmetric', 'generic'),
        doc='symmetric: zeros of the URDF in link centres of mass and products of inertia are '
        'taken as known.',
    )
    manifold: str = param(
        'physical',
        choices=('physical', 'linear'),
        doc='physical: what rigid bodies can be; linear: the minimal set is left free.',
    )
    nuisances: TextList = param(
        ('gyro_bias', 'torque_hold'),
        doc='Further unknowns: gyro_bias, torque_hold (sampled control), encoder_offset, '
        'imu_delay, attitude_delay, external_torque_inertial, target_wheel_drag, '
        'servicer_wheel_drag.',
    )
    solve_period: float = param(1.0, unit='s', above=0.0, doc='Period of /estimate.')
    prior_std: float = param(
        1.0, above=0.0, doc='Relative standard deviation of the prior on inertial parameters.'
    )
    momentum_prior_std: float = param(
        1000.0, unit='N m s', above=0.0, doc='Prior on the wheel momentum, each axis.'
    )
    valid_std: float = param(
        0.05, above=0.0, doc='Valid once the std of the AAM is below this fraction of its scale.'
    )
    buffer: float = param(
        120.0, unit='s', above=0.0, doc='Length of the raw-sample buffer used to re-linearise.'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ControllerSettings:
    """The controller: law, gains, limits and time-outs."""

    law: str = param(
        'computed_torque',
        choices=('computed_torque', 'computed_torque_no_aam', 'computed_torque_paper'),
        doc='Control law.',
    )
    bandwidth: float = param(
        1.0, unit='rad/s', above=0.0, maximum=100.0, doc='Double pole of the error dynamics.'
    )
    use_estimate: bool = param(
        True, doc='Use the latest valid /estimate; otherwise the model of the robot file.'
    )
    torque_limit: FloatList = param(
        (), unit='N m', above=0.0, doc="One a joint; empty: the URDF's effort limits."
    )
    damping: float = param(
        1.0, unit='1/s', above=0.0, doc='Decay of the joint rates while damping to zero.'
    )
    state_timeout: float = param(
        0.1, unit='s', above=0.0, doc='Age of the joint states or gyro that ends tracking.'
    )
    hold_compensation: bool = param(
        True, doc='Evaluate the law at the middle of the interval that holds its torque.'
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationSettings:
    """Design of an identification motion (`spacerobot excite`): family, limits, search.

    A joint limit is one number for all joints or one a joint. The URDF's position limits hold
    besides.
    """

    duration: float = param(20.0, unit='s', above=0.0, doc='Duration of the motion.')
    harmonics: int = param(3, minimum=1, maximum=20, doc='Number of Fourier harmonics a joint.')
    start: str = param(
        'auto',
        choices=('auto', 'initial', 'rest', 'spin_up'),
        doc='Base rate at the start: initial.angular_velocity; rest; spin_up: at rest, then the '
        "servicer's wheels are spun up; auto: initial where base_rate and base_rotation allow "
        'it, else rest.',
    )
    joint_range: FloatList = param(
        (3.0543261909900763,), unit='rad', above=0.0, doc='Largest joint angle; 175 deg.'
    )
    joint_rate: FloatList = param(
        (), unit='rad/s', above=0.0, doc='Largest joint rate; empty: no limit.'
    )
    joint_acceleration: FloatList = param(
        (), unit='rad/s^2', above=0.0, doc='Largest joint acceleration; empty: no limit.'
    )
    joint_torque: FloatList = param(
        (),
        unit='N m',
        above=0.0,
        doc="Largest joint torque; 90 % of the URDF's effort limits hold besides.",
    )
    base_rotation: float | None = param(
        None, unit='rad', above=0.0, doc='Largest turn of the base from its first attitude.'
    )
    base_rate: float | None = param(
        None, unit='rad/s', above=0.0, doc='Largest rate of the base, such that trackers see.'
    )
    momentum_uncertainty: float = param(
        0.0,
        unit='N m s',
        minimum=0.0,
        doc="Limits hold also where an axis of the captured wheels' momentum is off by this.",
    )
    criterion: str = param(
        'information',
        choices=('information', 'condition', 'unit_condition'),
        doc="information: bits told of the whole estimate; condition: the paper's condition "
        'number; unit_condition: the same with columns of unit norm.',
    )
    starts: int = param(3, minimum=1, maximum=1000, doc='Number of starting points.')
    iterations: int = param(80, minimum=1, maximum=10000, doc='Largest number of steps a start.')
    seed: int = param(1, minimum=0, doc='Seed of the starting points.')


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All sections of a robot file."""

    robot: RobotSettings
    sensors: SensorSettings = field(default_factory=SensorSettings)
    reference: ReferenceSettings = field(default_factory=ReferenceSettings)
    initial: InitialSettings = field(default_factory=InitialSettings)
    truth: TruthSettings = field(default_factory=TruthSettings)
    simulator: SimulatorSettings = field(default_factory=SimulatorSettings)
    identifier: IdentifierSettings = field(default_factory=IdentifierSettings)
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    excitation: ExcitationSettings = field(default_factory=ExcitationSettings)


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


__all__ = [
    'ControllerSettings',
    'ExcitationSettings',
    'FloatList',
    'IdentifierSettings',
    'InitialSettings',
    'ReferenceSettings',
    'RobotSettings',
    'SensorSettings',
    'Settings',
    'SimulatorSettings',
    'TextList',
    'TruthSettings',
    'WheelSettings',
    'parse_settings',
]
