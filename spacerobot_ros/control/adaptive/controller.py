r"""Adaptive and passivity-based control of base attitude and joints, translation free.

With the reference velocity V_r (wanted motion plus Lambda times the error), sigma = V_r - V and

    u = Y_SL(q, V, V_r, A_r) pi + K_D sigma     (force rows zero: they drive V_r's linear part)

the loop obeys M sigma' + C sigma + K_D sigma = Y_SL (pi_true - pi) exactly, for any pi. Where the
base's velocity is not measured it follows from zero momentum with the parameters in force.
"""

from __future__ import annotations

import math

import numpy as np
import scipy

from ...dynamics.equations import Dynamics, without_translation
from ...errors import ConfigurationError, MessageRejectedError
from ...identification.estimate import Estimate
from ...model.robot import Robot
from ...recording.faults.gaps import ONE_LOST
from ...types import Array, Vector3
from .law_kernel import command, into_base, reference_motion
from .law_signals import AdaptiveSettings, Health, Measured, ParametersInForce, Target, Torques
from .learner import Learner
from .learning_kernel import has_moved, is_within
from .parameter_prior import Learned, rate_noise, row_variances, standard_parameters
from .regressors import (
    DifferencedRates,
    FilteredMomentum,
    Regressors,
    parameter_names,
    parameter_units,
    with_parameters,
)

_UNKNOWN = np.zeros(3)  # in place of a base velocity or force
_STILL = 5.0  # standard deviations of the rates' sensors within which the robot counts as at rest
_SAME = 0.05  # rad or m that a joint moves before the inertia is looked at again
_CUT = 1e-9  # relative difference between command and applied torque that counts as a limit


class AdaptiveController:
    """One adaptive law on one robot.

    Args:
        robot: The robot as the model believes it to be; the start of the adaptation.
        settings: Law, bandwidths, adaptation.
        period: Control period [s]; torques are held over it.

    Raises:
        ConfigurationError: fixed base, no positive total mass, or bandwidths beyond what the
            period can sample.
    """

    def __init__(self, robot: Robot, settings: AdaptiveSettings, period: float) -> None:
        self.robot, self.period = robot, period
        self.n = robot.n_joints
        self._bandwidths = np.zeros(1 + self.n)
        self.retune(settings)
        self._regressors = Regressors(robot)
        self._learner = Learner(robot, settings)
        if not np.sum(self._learner.pi[: 10 * len(robot.bodies) : 10]) > 0.0:
            raise ConfigurationError('robot', 'the total mass must be above zero')
        self._is_paper = settings.law.endswith('_paper')
        self._regression = (
            DifferencedRates(self._regressors)
            if settings.law == 'adaptive_rls_paper'
            else FilteredMomentum(self._regressors, settings.filter_rate)
        )
        self._allocate()
        self._is_started = False
        self._reason = 'not started'
        self._adapting = False

    def _allocate(self) -> None:
        rows, n = self._regressors.shape[0], self.n
        self._motion = np.zeros((3, rows))
        self._V, self._Vr, _ = self._motion
        self._u, self._applied = np.zeros(rows), np.zeros(rows)
        self._Y = np.zeros(self._regressors.shape)
        self._state, self._target = np.zeros(10 + 2 * n), np.zeros(10 + 3 * n)
        self._q = self._state[10 : 10 + n]
        self._error = np.zeros(3 + n)
        self._rates = np.ascontiguousarray(self.robot.velocity_limits, dtype=float)
        self._gravity_speed = np.zeros(3)
        self._has_gravity = bool(self.robot.gravity.any())
        self._K, self._P = np.zeros((rows, rows)), np.zeros((3, rows))
        self._variances = np.ones(rows)
        self._still = _STILL * rate_noise(self.robot)
        self._has_noise = bool(self._still.any())
        self._measures_velocity = True
        self._is_cut = False

    def start(self, measured: Measured) -> None:
        """Begin, or begin again, at a measured state; the parameters in force stay.

        Raises:
            MessageRejectedError: a state of the wrong size or not finite.
        """
        self._read(measured)
        q = self._q
        physical = with_parameters(self.robot, self._learner.physical_pi)
        self._dynamics = Dynamics(physical)
        M = self._dynamics.mass_matrix(q)
        reduced = without_translation(M)
        self._whole_K = self.settings.kappa * reduced
        self._K[3:, 3:] = self._whole_K
        self._weighed_at = q.copy()
        # twice the energy of the error dynamics at `adaptation_error` in the attitude [J]
        rate = self.settings.attitude_bandwidth * self.settings.adaptation_error
        energy = float(np.trace(reduced[:3, :3]) / 3.0 * rate**2)
        self._learner.weigh(energy, self.settings.kappa * M)
        extra = (self.settings.filter_rate, self.settings.torque_noise)
        self._variances = row_variances(physical, M, *extra)
        self._gravity_speed[:] = 0.0
        self._is_started = True
        self._begin(measured.v_WB_B is not None)

    def _begin(self, measures_velocity: bool) -> None:
        """Start regression and internal reference anew; the state has been read."""
        self._measures_velocity = measures_velocity
        self._regression.restart()
        self._learner.has_slope = False
        self._Vr[:3] = self._state[4:7]
        self._is_cut = False

    def retune(self, settings: AdaptiveSettings) -> None:
        """Go on with other bandwidths; `start` must follow.

        Raises:
            ConfigurationError: bandwidths beyond what the period can sample.
        """
        self._sampling, self.settings = settings.sampling(self.period), settings
        self._bandwidths[0] = settings.attitude_bandwidth
        self._bandwidths[1:] = settings.joint_bandwidth

    def step(self, measured: Measured, target: Target, elapsed: float | None = None) -> Torques:
        """Adapt to what was measured and command the next period's torques.

        Args:
            measured: State at this sample.
            target: Point to follow at this sample.
            elapsed: Time since the last step [s]; None: one period. After more than one and a half
                periods (lost samples) the regression starts again.

        Raises:
            MessageRejectedError: an input of the wrong size or not finite; nothing has changed.
        """
        if not self._is_started:
            self.start(measured)
        h = self.period if elapsed is None else float(elapsed)
        self._read(measured)
        self._read_target(target)
        lost = h > ONE_LOST * self.period
        if lost or (measured.v_WB_B is not None) != self._measures_velocity:
            self._begin(measured.v_WB_B is not None)
        self._fall(h)
        reference_motion(
            self._state, self._target, self._bandwidths, self._rates, self._motion, self._error
        )
        self._adapt(h, lost)
        learner, predicts = self._learner, not self._measures_velocity
        is_reduced = self._is_paper or predicts
        self._weaken()
        gains = self._K, 0.0 if is_reduced else self.settings.kappa, self.period
        out = self._u, self._Y, learner.slope, self._P
        machine, at_rest = self._regressors.machine, (predicts, is_reduced)
        command(machine, self._q, self._motion, learner.pi, gains, at_rest, out)
        learner.has_slope = True
        self._applied[:] = self._u
        u, error = self._u.copy(), self._error.copy()
        return Torques(u[3:6], u[6:], error[:3], error[3:])

    def _weaken(self) -> None:
        """Take as much of the gain as torques held for a period bear here.

        Of the loop's rates, the eigenvalues of M^-1 K_D, the fastest grows where inertias are
        smaller than at the start; K_D may be any positive definite matrix.
        """
        if not has_moved(self._q, self._weighed_at, _SAME):
            return
        self._weighed_at[:] = self._q
        M = without_translation(self._dynamics.mass_matrix(self._q))
        fastest = float(scipy.linalg.eigh(self._whole_K, M, eigvals_only=True)[-1])
        share = min(1.0, self.settings.largest_rate(self.period) / fastest)
        self._K[3:, 3:] = share * self._whole_K
        self._learner.weaken(share)

    def _adapt(self, h: float, lost: bool) -> None:
        """Learn from the interval that ends now."""
        learner = self._learner
        reason = ''
        if self.settings.law == 'passivity':
            reason = 'fixed parameters'
        elif lost:
            reason = 'samples were lost'
        elif self._is_cut:
            reason = 'a torque limit was reached'
        elif self._has_noise and is_within(self._V, self._still):
            reason = 'the rates are within the noise of their sensors'
        if learner.uses_regression:
            reason = self._regress(h, reason)
        if learner.uses_gradient and not reason:
            learner.descend(h, self._Y)
        learner.has_slope = False
        self._is_cut = False
        self._adapting, self._reason = not reason, reason

    def _regress(self, h: float, reason: str) -> str:
        learner = self._learner
        args = (self._q, self._V, self._applied, h, learner.pi, self._measures_velocity)
        if not self._regression.add(*args):
            return reason or 'the first sample'
        if reason:
            return reason
        learner.regress(self._regression.F, self._regression.T, self._variances)
        return ''

    def applied(self, base: Vector3, joints: Array, limited: bool | None = None) -> None:
        """Say what the actuators apply until the next step, where that is not the command.

        Torques cut by a limit pause the adaptation at the next step. Without a call the command
        counts as applied.

        Args:
            base: (3,) attitude torque [N m].
            joints: (n,) joint torques [N m].
            limited: Whether a limit was reached; None: where they are not the command. Say it for
                measured torques, whose noise is no limit.
        """
        _join('applied', (_UNKNOWN, base, joints), (3, 3, self.n), self._applied)
        if limited is None:
            tolerance = _CUT * float(np.max(np.abs(self._u), initial=1e-3))
            limited = bool(np.any(np.abs(self._applied - self._u)[3:] > tolerance))
        self._is_cut = limited

    def hand_over(self, estimate: Estimate, structure: str) -> None:
        """Start the adaptation from an identifier's estimate, mean and covariance.

        Args:
            estimate: Valid estimate of wheel momentum and minimal parameters.
            structure: `identifier.structure`, which names its parameters.

        Raises:
            IdentificationError: it does not fit the robot, or its covariance is indefinite.
        """
        learner = self._learner
        prior = (learner.physical_pi, learner.G)
        learner.take(*standard_parameters(self.robot, structure, estimate, *prior))

    @property
    def learned(self) -> Learned:
        """What was learned so far, for a file."""
        return Learned(self._learner.pi.copy(), self._learner.G.copy())

    def take(self, learned: Learned) -> None:
        """Go on from what was learned before."""
        self._learner.take(*learned)

    @property
    def parameters(self) -> ParametersInForce:
        """The parameters that the next step starts from."""
        learner = self._learner
        covariance = learner.G.copy() if learner.uses_regression else None
        names, units = parameter_names(self.robot), parameter_units(self.robot)
        return ParametersInForce(names, units, learner.pi.copy(), covariance)

    def robot_in_force(self) -> Robot:
        """The robot with the parameters in force, for a robot file.

        Raises:
            ConfigurationError: the parameters in force are not physical.
        """
        if not self._learner.is_physical:
            raise ConfigurationError(
                'parameters in force',
                'are not those of physical bodies: choose physical_consistency project or natural',
            )
        return with_parameters(self.robot, self._learner.pi)

    @property
    def health(self) -> Health:
        """State of the adaptation after the last step."""
        ratio, warning = self._sampling
        return Health(
            adapting=self._adapting,
            reason=self._reason,
            excitation=self._learner.excitation,
            sampling=ratio,
            sampling_warning=warning,
            physical=self._learner.is_physical,
            base_velocity_measured=self._measures_velocity,
        )

    def _fall(self, h: float) -> None:
        """Take out the velocity of free fall: uniform gravity moves everything alike."""
        if self._has_gravity and self._measures_velocity:
            self._state[4:7] -= into_base(self._state[:4], self._gravity_speed)
            self._gravity_speed += h * self.robot.gravity

    def _read(self, measured: Measured) -> None:
        n, v = self.n, measured.v_WB_B
        base = (measured.q_WB_xyzw, _UNKNOWN if v is None else v, measured.omega_WB_B)
        parts = (*base, measured.q, measured.qd)
        _join('measured', parts, (4, 3, 3, n, n), self._state)

    def _read_target(self, target: Target) -> None:
        n = self.n
        base = (target.q_WD_xyzw, target.omega_WD_D, target.omega_dot_D)
        joints = (target.q, target.qd, target.qdd)
        _join('target', base + joints, (4, 3, 3, n, n, n), self._target)


def _join(what: str, parts: tuple[Array, ...], sizes: tuple[int, ...], out: Array) -> None:
    """Write the parts one behind the other.

    Raises:
        MessageRejectedError: a part of another size, or not finite.
    """
    found = tuple(map(len, parts))
    if found != sizes:
        raise MessageRejectedError(f'{what}: expected {sizes} numbers, got {found}')
    np.concatenate(parts, out=out)
    # one pass: squares of finite numbers of any use do not overflow
    if not math.isfinite(out @ out):
        raise MessageRejectedError(f'{what}: not finite')
