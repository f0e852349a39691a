"""The robot and its sensors: what a robot file says of them beside the URDF."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from .schema import FloatList, FloatMap, FloatOrList, FreeMaps, TextList, TextOrList, param
from .uncertainty import UncertaintySettings

ANCHORS = ('none', 'gravity', 'inertia')


COMPENSATED = 'gravity_compensated'
LINK_SIDE = 'link'  # what a torque sensor measures
EFFORT_KINDS = ('motor', LINK_SIDE, 'current', COMPENSATED, 'command')


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

    `held` are joints of the URDF that do not move and that no message has, such as a gripper's, by
    name: {finger: 0.04}, rad, or m where they slide. Joints that mimic one are held with it.
    `rest` for a name, or for the map, are all that are not listed: at zero, or as near as they go.

    Args:
        urdf: package:// URL, absolute path, or path beside the robot file.
        base: Free-floating base, or fixed for a ground test, which asks nothing of the root link's
            inertia.
        base_link: Root link of the URDF; empty: whichever it is.
        gravity: Gravity in the inertial frame.
        inertia_uncertainty: Standard deviation of every inertial parameter, as a share of its
            magnitude, in the diagnosis.
        joints: Manipulator joints in the order of every vector and message.
        effort_kind: What measured efforts are; one for all joints, or one a joint.
        motor_constant: Torque at the joint of one ampere; one for all joints, or one a joint.
            Without it currents are read in A, and the diagnosis estimates it.
        passive_joints: Joints without a motor: their torque is zero.
        effect_modules: Python modules with effects of your own: names that can be imported, or
            files ending in .py beside the robot file. They are run as they are.
        thrusters: Of a thruster on the base.
        held: Where a joint of the URDF stays that does not move.
    """

    urdf: str = param('')
    base: str = param('free', choices=('free', 'fixed'))
    base_link: str = param('')
    gravity: FloatList = param((0.0, 0.0, 0.0), 'm/s^2', length=3)
    inertia_uncertainty: float = param(0.1, above=0.0, maximum=1.0)
    joints: TextList = param()
    effort_kind: TextOrList = param('motor', choices=EFFORT_KINDS)
    motor_constant: FloatOrList | None = param(None, 'N m/A', above=0.0)
    passive_joints: TextList = param(())
    effect_modules: TextList = param(())
    scale: ScaleSettings = field(default_factory=ScaleSettings)
    uncertainty: UncertaintySettings = field(default_factory=UncertaintySettings)
    thrusters: FreeMaps = field(default_factory=dict)
    held: FloatMap = field(default_factory=dict)
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
