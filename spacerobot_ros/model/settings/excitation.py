"""The design of identification motions."""

from __future__ import annotations

from dataclasses import dataclass

from ..schema import FloatList
from .parameter import param


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
