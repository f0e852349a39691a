"""Control: the law and its gains."""

from __future__ import annotations

from dataclasses import dataclass

from .schema import TIMES, FloatList, param

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
    damping: float = param(5.0, '1/s', minimum=0.01, maximum=100.0)
    state_timeout: float = param(0.1, 's', **TIMES)
    attitude_timeout: float = param(1.0, 's', **TIMES)
    hold_compensation: bool = param(True)
    save_parameters: str = param('')
    save_file: str = param('')


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptationSettings:
    """Adaptive control of base attitude and joints: bandwidths, prior, gains.

    `controller.law` and `controller.physical_consistency` choose the law; `robot.uncertainty` says
    how wrong the bodies may be.

    Args:
        kappa: Bandwidth of the rate loop: K_D = kappa M(q0).
        attitude_bandwidth: Lambda of the attitude.
        joint_bandwidth: Lambda of the joints.
        sampling_check: What to do where bandwidths are too fast for the control period.
        filter_rate: Low-pass of the momentum regression.
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
    prior_shape: str = param('bodies', choices=('bodies', 'elements'))
    wheel_momentum_std: float = param(0.0, 'N m s', minimum=0.0)
    adaptation_error: float = param(0.005, 'rad', above=0.0)
    torque_noise: float = param(0.0, 'N m', minimum=0.0)
