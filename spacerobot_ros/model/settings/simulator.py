"""The simulated plant: start, truth, steps and pacing."""

from __future__ import annotations

from dataclasses import dataclass

from ..schema import FloatList, TextList
from .parameter import param


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
    substeps: int = param(
        1, minimum=1, maximum=1000, doc='Runge-Kutta steps (order 8) in one control period.'
    )
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
