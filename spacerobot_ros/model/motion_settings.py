"""Control and motions: laws and gains; where a run starts, what a controller follows, designs."""

from __future__ import annotations

from dataclasses import dataclass

from .schema import FloatList, param


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
    duration: float = param(20.0, 's', minimum=1e-6, maximum=1e9)
    harmonics: int = param(3, minimum=1, maximum=20)
    sine: FloatList = param((), 'rad/s')
    cosine: FloatList = param((), 'rad/s')
    set_point: FloatList = param((), 'rad')
    amplitude: FloatList = param((), 'rad')
    attitude_xyzw: FloatList = param(())
    attitude_amplitude: FloatList = param((), 'rad')
    repeat: bool = param(False)


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
        joint_rate: Largest joint rate; the URDF's velocity limits hold besides.
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

    duration: float = param(20.0, 's', minimum=1e-6, maximum=1e9)
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
        torque_limit: One a joint, at most the URDF's effort limits; empty: these.
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
    damping: float = param(1.0, '1/s', minimum=0.01, maximum=100.0)
    state_timeout: float = param(0.1, 's', minimum=1e-6, maximum=1e9)
    attitude_timeout: float = param(1.0, 's', minimum=1e-6, maximum=1e9)
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
