"""How an adaptive law adapts."""

from __future__ import annotations

from dataclasses import dataclass

from .parameter import param


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptationSettings:
    """Adaptive control of base attitude and joints: bandwidths, prior, gains.

    `controller.law` and `controller.physical_consistency` choose the law.
    """

    kappa: float = param(
        2.0,
        unit='1/s',
        above=0.0,
        maximum=100.0,
        doc='Bandwidth of the rate loop: K_D = kappa M(q0).',
    )
    attitude_bandwidth: float = param(
        1.0, unit='1/s', above=0.0, maximum=100.0, doc='Lambda of the attitude.'
    )
    joint_bandwidth: float = param(
        1.0, unit='1/s', above=0.0, maximum=100.0, doc='Lambda of the joints.'
    )
    sampling_check: str = param(
        'refuse',
        choices=('refuse', 'warn'),
        doc='What to do where bandwidths are too fast for the control period.',
    )
    filter_rate: float = param(
        2.0, unit='1/s', above=0.0, maximum=1000.0, doc='Low-pass of the momentum regression.'
    )
    prior_std: float = param(
        0.3, above=0.0, maximum=10.0, doc='Relative standard deviation of the inertial parameters.'
    )
    prior_shape: str = param(
        'bodies',
        choices=('bodies', 'elements'),
        doc='bodies: each is like the believed one, stretched and moved; elements: each parameter '
        'is wrong on its own, which few physical bodies are.',
    )
    wheel_momentum_std: float = param(
        0.0,
        unit='N m s',
        minimum=0.0,
        doc="Standard deviation of the captured wheels' momentum, each axis; 0: known.",
    )
    adaptation_error: float = param(
        0.005,
        unit='rad',
        above=0.0,
        doc='Attitude error that weighs as much in the gradient laws as a parameter wrong by its '
        'prior standard deviation; a smaller one adapts faster.',
    )
    torque_noise: float = param(
        0.0,
        unit='N m',
        minimum=0.0,
        doc="Noise of the torques besides the sensors'; weighs data against the prior.",
    )
