"""What learns from flights: identifier, monitor, and the design of motions for them."""

from __future__ import annotations

from dataclasses import dataclass

from ..schema import FloatList, TextList, param


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
