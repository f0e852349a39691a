"""The identifier."""

from __future__ import annotations

from dataclasses import dataclass

from ..schema import TextList
from .parameter import param


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
    torque_hold_period: float = param(
        0.0,
        unit='s',
        minimum=0.0,
        doc='Period over which motors hold their torque; 0: seen in the efforts or estimated.',
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
    lateness: float = param(
        0.5,
        unit='s',
        minimum=0.0,
        maximum=10.0,
        doc='How far a sample may come behind newer joint and gyro samples; the node keeps back '
        'the newest data for as long (0.5 s at least).',
    )
    buffer: float = param(
        120.0, unit='s', above=0.0, doc='Length of the raw-sample buffer used to re-linearise.'
    )
