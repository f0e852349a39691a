"""Computed torque of a free-floating robot with wheels, in three variants.

    tau = H(q) (q''_d + Kd e' + Kp e) + c,    Kp = w^2, Kd = 2 w, e = q_d - q

which is eq. (34) of the identification paper (docs/references.md), with three choices of c:

- `computed_torque`: the corrected equations (docs/equations.md), wheels of the captured body
  included;
- `computed_torque_paper`: the paper's own c, eq. (35), without the wheels' torque on the joints;
- `computed_torque_no_aam`: eq. (37), which takes the wheels of the captured body as at rest.

A torque that is held over [t, t + T] is right to second order in T if it is evaluated at t + T/2:
the joints are predicted there with the acceleration that the law asks for, the base rate with its
measured slope.

Of the physical effects that a model believes in, bodies and wheels are the changed robot's. Forces
inside the machine that follow from the motion (friction, learned ones with their history, gains of
motors, harnesses) are fed forward along the reference, so that nothing is fed back through a
friction that changes its sign; sensor faults are undone before the law sees a sample. What comes
from outside, runs by a clock of its own or swings on states that no sensor shows is left to the
feedback.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from ..dynamics.equations import Dynamics
from ..dynamics.reduction import ReducedEquation
from ..dynamics.state import State
from ..effects.effect import Effect
from ..effects.motion import Motion
from ..errors import ConfigurationError
from ..formats import counted
from ..identification.estimate import Estimate
from ..identification.reduced import EstimatedDynamics
from ..model.control_settings import COMPUTED_TORQUE_LAWS
from ..model.robot import Robot
from ..types import Array, Vector3
from .command import Feedback, Torque
from .joint_reference import Reference, Setpoint

_PASSES = 3  # of the fixed point for forces in proportion to the torque itself


class FeedForward:
    """Joint torques that make up for the forces of effects along a reference.

    Args:
        robot: The robot as all effects have made it.
        effects: The believed effects; those that can't be fed forward are passed over.
    """

    def __init__(self, robot: Robot, effects: Sequence[Effect]) -> None:
        self._robot = robot
        self._effects = tuple(effect for effect in effects if effect.is_known_ahead)
        self._dynamics = Dynamics(robot)
        self._own = [np.zeros(effect.hidden) for effect in self._effects]
        self._last: Array | None = None  # joint angles of the reference

    def __call__(self, setpoint: Setpoint, omega_WB_B: Vector3, tau: Array) -> Array:
        """(n,) torque under which the effects leave of `tau` (n,) what it was meant to do.

        Args:
            setpoint: The reference.
            omega_WB_B: (3,) base rate.
            tau: (n,) torque of a law that knows of no effects [N m].
        """
        if not self._effects:
            return tau
        self._follow(setpoint.q)
        wanted, base_share = tau, self._base_share(setpoint.q)
        for _ in range(_PASSES):
            force = self._force(setpoint, omega_WB_B, tau)
            tau = wanted - (force[6:] - base_share @ force[:6])
        return tau

    def _force(self, setpoint: Setpoint, omega_WB_B: Vector3, tau: Array) -> Array:
        """(6 + n,) generalized force of all effects."""
        state = np.zeros(1), setpoint.q[None], setpoint.qd[None], tau[None]
        motion = Motion(self._robot, *state, omega=omega_WB_B[None])
        pairs = zip(self._effects, self._own, strict=True)
        return np.asarray(sum(effect.force(motion, own[None])[0] for effect, own in pairs))

    def _follow(self, q: Array) -> None:
        """Own states of effects along the reference, whose history they are."""
        if self._last is not None:
            self._own = [
                effect.followed(self._robot, own, self._last, q)
                for effect, own in zip(self._effects, self._own, strict=True)
            ]
        self._last = q

    def _base_share(self, q: Array) -> Array:
        """(n, 6) joint force that a force on the free base amounts to, its motion eliminated."""
        n = self._robot.n_joints
        if not self._robot.is_free:
            return np.zeros((n, 6))
        M = self._dynamics.mass_matrix(q)
        return np.asarray(np.linalg.solve(M[:6, :6], M[:6, 6:]).T)


Model = Callable[[Array, Array, Vector3], ReducedEquation]
"""Arm positions (n,), rates (n,) and omega_WB_B (3,) to the arm's reduced equation."""


def robot_model(robot: Robot, *, joint_reaction: bool = True) -> Model:
    """Reduced equation of the arm from the robot file.

    Args:
        robot: The robot as the model believes it to be, its rotors locked (gyrostat view).
        joint_reaction: False for the paper's printed equations.
    """
    dynamics = Dynamics(robot, joint_reaction=joint_reaction)
    zeros, identity = np.zeros(3), np.array([0.0, 0.0, 0.0, 1.0])

    def reduced(q: Array, qd: Array, omega_WB_B: Vector3) -> ReducedEquation:
        # uniform gravity moves base and arm alike: the attitude of a free base does not matter
        return dynamics.reduced(State(zeros, identity, q, zeros, omega_WB_B, qd))

    return reduced


def estimated_model(
    robot: Robot, structure: str, estimate: Estimate, *, joint_reaction: bool = True
) -> Model:
    """Reduced equation of the arm from an estimate.

    Raises:
        IdentificationError: the estimate's names don't fit the robot.
    """
    dynamics = EstimatedDynamics.from_estimate(robot, structure, estimate)
    return partial(dynamics.reduced, joint_reaction=joint_reaction)


def law_model(
    law: str, robot: Robot, structure: str = 'symmetric', estimate: Estimate | None = None
) -> Model:
    """The equations that a law uses: from an estimate where there is one and the law takes it.

    Args:
        law: One of `COMPUTED_TORQUE_LAWS`.
        robot: The robot as the model believes it to be.
        structure: `identifier.structure`, which names the estimate's parameters.
        estimate: A valid estimate, or None.
    """
    if law not in COMPUTED_TORQUE_LAWS:
        known = ', '.join(COMPUTED_TORQUE_LAWS)
        raise ConfigurationError('controller.law', f'{law!r} is not one of {known}')
    if law == 'computed_torque_no_aam':
        return robot_model(robot.with_target_momentum(np.zeros(3 * len(robot.target_wheels))))
    joint_reaction = law != 'computed_torque_paper'
    if estimate is None:
        return robot_model(robot, joint_reaction=joint_reaction)
    return estimated_model(robot, structure, estimate, joint_reaction=joint_reaction)


class ComputedTorque:
    """Computed torque with one double pole, and its damping law for when tracking must end.

    Args:
        model: Reduced equation of the arm.
        bandwidth: Double pole w of the error dynamics [rad/s].
        limits: (n,) torque limits [N m], infinite where there is none.
        damping: Decay of the joint rates while damping [1/s].
        feed_forward: Makes up for physical effects along the reference; None: there are none.
    """

    def __init__(
        self,
        model: Model,
        bandwidth: float,
        limits: Array,
        damping: float = 1.0,
        feed_forward: FeedForward | None = None,
    ) -> None:
        self.model = model
        self._feed_forward = feed_forward
        self.tune(bandwidth, limits, damping)
        rest = np.zeros(len(limits))
        model(rest, rest, np.zeros(3))  # what it compiles must not delay the first torque

    def tune(self, bandwidth: float, limits: Array, damping: float) -> None:
        """Set the gains, the limits and the damping."""
        self._kp, self._kd = bandwidth**2, 2.0 * bandwidth
        self._limits = np.array(limits, dtype=float)
        self._damping = damping

    def acceleration(self, setpoint: Setpoint, q: Array, qd: Array) -> Array:
        """(n,) joint acceleration that the law asks for [rad/s^2]."""
        return setpoint.qdd + self._kd * (setpoint.qd - qd) + self._kp * (setpoint.q - q)

    def track(self, reference: Reference, t: float, sample: Feedback, hold: float = 0.0) -> Torque:
        """Torque that follows the reference.

        Args:
            reference: The motion to follow.
            t: Time of the sample since the start of the motion [s].
            sample: Measured state at t.
            hold: Time over which the torque will be held [s]; 0 evaluates the law at t.
        """
        half = 0.5 * hold
        v = self.acceleration(reference.at(t), sample.q, sample.qd)
        q = sample.q + half * sample.qd + 0.5 * half**2 * v
        qd = sample.qd + half * v
        setpoint = reference.at(t + half)
        if hold:
            v = self.acceleration(setpoint, q, qd)
        omega = sample.omega_WB_B + half * sample.omega_slope
        equation = self.model(q, qd, omega)
        tau = equation.H @ v + equation.c
        if self._feed_forward is not None:
            tau = self._feed_forward(setpoint, omega, tau)
        return Torque(*within_limits(tau, self._limits))

    def damp(self, sample: Feedback, trust: float = 1.0) -> Torque:
        """Torque under which the joint rates decay, q'' = -damping q'.

        Args:
            sample: Measured, or, where the joints are not seen any more, extrapolated state.
            trust: Part of the compensating torque c to apply: 1 where the state is measured,
                falling to 0 with the age of an extrapolated one, for a torque that rests on a
                guess must not stay on.
        """
        equation = self.model(sample.q, sample.qd, sample.omega_WB_B)
        tau = equation.H @ (-self._damping * sample.qd) + trust * equation.c
        return Torque(*within_limits(tau, self._limits))


def within_limits(tau: Array, limits: Array) -> tuple[Array, np.ndarray]:
    """Torques (n,) within limits (n,), and where they were cut; zeros where one is not finite."""
    if not np.isfinite(tau).all():
        return np.zeros(len(tau)), np.ones(len(tau), dtype=bool)
    limited = np.clip(tau, -limits, limits)
    return limited, limited != tau


def torque_limits(limits: tuple[float, ...], otherwise: Array, name: str, each: str) -> Array:
    """Torque limits [N m]: those given, at most others.

    Args:
        limits: Those of the robot file; may be empty.
        otherwise: (k,) limits beyond which none may be, as of the URDF.
        name: Of the parameter in section `controller`.
        each: What has a limit each.

    Raises:
        ConfigurationError: a wrong number of limits.
    """
    if len(limits) not in (0, len(otherwise)):
        expected = f'expected {counted(len(otherwise), "number")} (one {each}), got {len(limits)}'
        raise ConfigurationError(f'controller.{name}', expected)
    return np.minimum(limits, otherwise) if limits else otherwise
