"""The simulated plant: start, truth, steps and pacing."""

from __future__ import annotations

from dataclasses import dataclass

from ..schema import FloatList, TextList, param


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
