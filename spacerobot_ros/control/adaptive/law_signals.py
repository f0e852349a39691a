"""Settings of an adaptive law, what goes into it and what comes out of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from ...errors import ConfigurationError
from ...model.control_settings import AdaptationSettings
from ...model.settings import Settings
from ...types import Array, Quaternion, Vector3


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """State of the robot at one sample.

    Args:
        q_WB_xyzw: (4,) attitude of the base.
        omega_WB_B: (3,) angular velocity of the base [rad/s].
        q: (n,) joint positions [rad].
        qd: (n,) joint rates [rad/s].
        v_WB_B: (3,) velocity of the base origin, in base coordinates [m/s], in any inertial frame;
            None where it is not measured: then it is predicted from the conservation of momentum,
            centre of mass at rest, with the parameters in force.
    """

    q_WB_xyzw: Quaternion
    omega_WB_B: Vector3
    q: Array
    qd: Array
    v_WB_B: Vector3 | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """Point of the motion to follow; D is the wanted base frame.

    Args:
        q_WD_xyzw: (4,) wanted attitude.
        omega_WD_D: (3,) its angular velocity, in D [rad/s].
        omega_dot_D: (3,) time derivative of the components omega_WD_D [rad/s^2].
        q: (n,) joint positions [rad].
        qd: (n,) joint rates [rad/s].
        qdd: (n,) joint accelerations [rad/s^2].
    """

    q_WD_xyzw: Quaternion
    omega_WD_D: Vector3
    omega_dot_D: Vector3
    q: Array
    qd: Array
    qdd: Array


@dataclass(frozen=True, slots=True, eq=False)
class Torques:
    """Command of a law, before any limit.

    Args:
        base: (3,) attitude torque on the base, in base coordinates [N m].
        joints: (n,) joint torques [N m].
        attitude_error: (3,) rotation vector from the base to the wanted frame, in B [rad].
        joint_error: (n,) wanted minus measured joint positions [rad].
    """

    base: Vector3
    joints: Array
    attitude_error: Vector3
    joint_error: Array


@dataclass(frozen=True, slots=True)
class Health:
    """State of the adaptation, for diagnostics.

    Args:
        adapting: Whether the last step changed the parameters.
        reason: Why not; empty while adapting.
        excitation: Largest ratio of predicted parameter effect to noise of the last sample; below
            one the sample tells nothing.
        sampling: (kappa + Lambda) x period, the fastest pole in units of the sampling rate.
        sampling_warning: What to do about it; empty where it is slow enough.
        physical: Whether every body's mass, centre and inertia in force are physical.
        base_velocity_measured: False while the base's velocity is predicted from momentum.
    """

    adapting: bool
    reason: str
    excitation: float
    sampling: float
    sampling_warning: str
    physical: bool
    base_velocity_measured: bool


@dataclass(frozen=True, slots=True, eq=False)
class ParametersInForce:
    """The parameters that the law uses.

    Args:
        names: Such as `link_1.m`, `link_1.mcx`, `link_1.Ixx`, `link_3.aam_x`.
        units: One a parameter.
        values: (p,) ten a body in the order of Pinocchio's `toDynamicParameters`, bodies in the
            robot's order, then three a link with wheels.
        covariance: (p, p), or None where the law has none.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array | None

    @property
    def std(self) -> Array | None:
        """(p,) standard deviations, or None."""
        return None if self.covariance is None else np.sqrt(np.diag(self.covariance))


SLOW_ENOUGH = 0.7  # (kappa + Lambda) T up to which tracking is as in continuous time
LIMIT = 1.2  # from which held torques make the loop oscillate


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptiveSettings(AdaptationSettings):
    """Section `adaptive` of the robot file, and the choice of law in section `controller`."""

    law: str = 'adaptive_composite'
    physical_consistency: str = 'project'

    @classmethod
    def of(cls, settings: Settings) -> AdaptiveSettings:
        """What the settings of a robot file ask for."""
        controller = settings.controller
        return cls(
            law=controller.law,
            physical_consistency=controller.physical_consistency,
            **asdict(settings.adaptive),
        )

    def largest_rate(self, period: float) -> float:
        """Rate of the errors' rates up to which the period samples them [1/s], at least kappa."""
        fastest = max(self.attitude_bandwidth, self.joint_bandwidth)
        return max(self.kappa, LIMIT / period - fastest)

    def sampling(self, period: float) -> tuple[float, str]:
        """(kappa + Lambda) x period, with the larger Lambda, and what is wrong with it, if it is.

        Torques are held over a period. A double integrator under held torques is unstable from
        (kappa + Lambda) T = 2 on; with the robot's couplings, and the gain of the start
        throughout, it oscillates from 1.2 to 1.5 on.

        Raises:
            ConfigurationError: beyond that limit, unless `sampling_check` is `warn`.
        """
        ratio = (self.kappa + max(self.attitude_bandwidth, self.joint_bandwidth)) * period
        if ratio <= SLOW_ENOUGH:
            return ratio, ''
        text = (
            f'(kappa + Lambda) x period = {ratio:.3g} is above {SLOW_ENOUGH:g}: choose lower '
            f'bandwidths or a shorter period than {period:g} s'
        )
        if ratio > LIMIT and self.sampling_check == 'refuse':
            raise ConfigurationError('adaptive.kappa', text)
        return ratio, text
