"""Where an adaptation starts: the prior, an identifier's estimate, or what was learned before.

What was learned survives in a file (`identification.checked_file`); the covariance of the captured
wheels' momentum is widened by what they may have lost meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...dynamics.pseudo_inertia import pseudo_inertia
from ...dynamics.random_body import body_scales, deformed
from ...errors import IdentificationError
from ...estimation.unknowns.body_coordinates import PARTS
from ...estimation.unknowns.minimal import minimal_set
from ...identification.checked_file import digest, read_checked, run_down, write_checked
from ...identification.estimate import Estimate
from ...model.robot import Robot
from ...model.uncertainty import BodyUncertainty
from ...types import Array
from .regressors import parameter_names, parameter_values, wheel_links

_SAMPLING_ERROR = 1e-4  # acceleration whose torque is taken as error of discretization
_NEAR_ZERO = 1e-3  # of mass, mass x size, mass x size squared: an element's smallest scale


def prior_covariance(robot: Robot, shape: str, wheel_std: float) -> Array:
    """(p, p) covariance of the parameters about a robot's.

    With `bodies` a body is believed to be like the robot's up to a random small deformation and a
    change of density: P = (1 + E) P0 (1 + E)^T, entries of E independent. This needs no scales for
    single parameters, does not depend on the frames, and keeps to physical bodies to first order.
    With `elements` every parameter is wrong on its own, in proportion to its value, as in eq. (46)
    of the adaptive-control paper. The data tell the torques either way; the shape decides on which
    parameters a correction falls that several could explain.

    A massless frame is known to be massless; the servicer's own wheels are known.

    Args:
        robot: The robot; how uncertain each body is says `Robot.uncertainty_of`.
        shape: `bodies` or `elements`.
        wheel_std: Of the captured wheels' momentum, each axis [N m s].
    """
    values = parameter_values(robot)
    bodies = len(robot.bodies)
    G = np.zeros((len(values), len(values)))
    rows = values[: 10 * bodies].reshape(bodies, 10)
    for k, (row, scale) in enumerate(zip(rows, body_scales(rows), strict=True)):
        if scale[3] > 0.0:
            block = slice(10 * k, 10 * k + 10)
            own = robot.uncertainty_of(k)
            is_whole = shape == 'bodies'
            G[block, block] = deformed(row, own) if is_whole else _by_element(row, scale, own)
    known = len(wheel_links(robot)) - len(robot.target_wheels)
    wheels = np.arange(10 * bodies + 3 * known, len(values))
    G[wheels, wheels] = wheel_std**2
    return G


def _by_element(row: Array, scale: Array, own: BodyUncertainty) -> Array:
    """(10, 10) covariance of one body; a parameter near zero counts by the body's size."""
    std = np.array([getattr(own, part) for part in PARTS])
    mass, length = scale[3] ** -2, scale[3] / scale[0]
    size = mass * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    return np.diag((std * np.maximum(np.abs(row), _NEAR_ZERO * size)) ** 2)


def rate_noise(robot: Robot) -> Array:
    """(6 + n,) standard deviations of the measured velocity; a missing one counts as zero."""
    out = np.zeros(6 + robot.n_joints)
    out[3:6] = robot.sensors.gyro_std or 0.0
    out[6:] = robot.sensors.joint_velocity_std or 0.0
    return out


def row_variances(robot: Robot, M: Array, filter_rate: float, extra: float) -> Array:
    """(6 + n,) noise variances of the filtered regression's rows.

    Noise of the rates enters as that of the momentum, M dV, times the filter's rate; to it come
    the torque sensors' noise and what sampling leaves: the torques of 1e-4 m/s^2 or rad/s^2.

    Args:
        robot: A physical robot; `robot.sensors` gives the noise, a missing one counts as zero.
        M: (6 + n, 6 + n) its mass matrix.
        filter_rate: [1/s].
        extra: Standard deviation of further noise [N m].
    """
    effort = np.zeros(len(M))
    effort[6:] = robot.sensors.joint_effort_std or 0.0
    noise = filter_rate**2 * (M**2 @ rate_noise(robot) ** 2) + effort**2 + extra**2
    return np.asarray(noise + np.diag(_SAMPLING_ERROR * M) ** 2)


_ITERATIONS = 10
_STEP = 1e-6  # of the numerical Jacobian, in units of the prior's standard deviation


def standard_parameters(
    robot: Robot, structure: str, estimate: Estimate, mean: Array, covariance: Array
) -> tuple[Array, Array]:
    """Most probable standard parameters given an estimate of the minimal ones.

    The minimal parameters are products of masses and first moments over the total mass, so the
    estimate is a nonlinear measurement of the standard parameters: Gauss-Newton steps on prior and
    estimate. What the estimate does not tell keeps the prior's mean and covariance.

    Args:
        robot: The robot as the model believes it to be.
        structure: `identifier.structure`.
        estimate: Valid estimate.
        mean: (p,) prior mean, physical.
        covariance: (p, p) prior covariance.

    Returns:
        (p,) mean and (p, p) covariance.

    Raises:
        IdentificationError: not valid, names that don't fit, or an indefinite covariance.
    """
    minimal = minimal_set(robot, structure)
    _check(estimate, robot, minimal.names)
    size = 10 * len(robot.bodies)
    own = 3 * (len(wheel_links(robot)) - len(robot.target_wheels))
    n_aam = len(estimate.aam)

    def predicted(pi: Array) -> Array:
        x = minimal.of_bodies(*_bodies(pi[..., :size].reshape(*pi.shape[:-1], -1, 10)))
        return np.concatenate([pi[..., size + own :], x], axis=-1)

    measured = np.concatenate([estimate.aam, estimate.parameters])
    # the wheels' momentum is told by the estimate alone
    G = covariance.copy()
    wheels = np.arange(size + own, size + own + n_aam)
    G[wheels, wheels] = np.maximum(G[wheels, wheels], 1e6 * np.diag(estimate.covariance)[:n_aam])
    steps = _STEP * np.sqrt(np.diag(G))
    pi = mean.copy()
    for _ in range(_ITERATIONS):
        J = _jacobian(predicted, pi, steps)
        S = J @ G @ J.T + estimate.covariance
        # a ridge in units of S's own diagonal: structures leave exact dependencies
        ridge = np.diag(1e-12 * np.diag(S) + np.finfo(float).tiny)
        K = np.linalg.solve(S + ridge, J @ G).T
        new = mean + K @ (measured - predicted(pi) - J @ (mean - pi))
        change = float(np.max(np.abs(new - pi) / np.where(steps > 0.0, steps / _STEP, 1.0)))
        pi = new
        if change < 1e-9:
            break
    out = G - K @ J @ G
    return pi, 0.5 * (out + out.T)


def _bodies(rows: Array) -> tuple[Array, Array, Array]:
    """Masses (...), centres (..., 3) and inertias about them (..., 3, 3) of parameters (..., 10).

    A massless frame stays one: its centre of mass would be 0/0.
    """
    P = pseudo_inertia(rows)
    mass = P[..., 3, 3]
    com = P[..., :3, 3] / np.where(mass == 0.0, 1.0, mass)[..., None]
    moments = P[..., :3, :3] - mass[..., None, None] * com[..., :, None] * com[..., None, :]
    trace = np.trace(moments, axis1=-2, axis2=-1)[..., None, None]
    return mass, com, trace * np.eye(3) - moments


def _jacobian(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """(N, p) by central differences of all p parameters at once; zero where the step is zero."""
    shifts = np.diag(steps)
    difference = function(at + shifts) - function(at - shifts)
    return (difference / np.where(steps > 0.0, 2.0 * steps, 1.0)[:, None]).T


def _check(estimate: Estimate, robot: Robot, names: tuple[str, ...]) -> None:
    if not estimate.valid:
        raise IdentificationError(f'estimate not valid: {estimate.reason}')
    estimate.check()
    links = tuple(g.link for g in robot.target_wheels)
    if estimate.parameter_names != names or estimate.aam_links != links:
        raise IdentificationError('estimate: names do not fit the robot and its structure')
    values = np.linalg.eigvalsh(estimate.covariance)
    if values[0] < -1e-9 * max(values[-1], 0.0) or not values[-1] > 0.0:
        raise IdentificationError('estimate: the covariance is indefinite')


VERSION = 1


class Learned(NamedTuple):
    """Parameters (p,) in the order of `parameter_names`, and their covariance (p, p)."""

    mean: Array
    covariance: Array


def save(path: Path, robot: Robot, learned: Learned, now_ns: int) -> None:
    """Write what was learned of a robot at a wall time [ns].

    Raises:
        ConfigurationError: it can not be written.
    """
    content = {'mean': learned.mean.tolist(), 'covariance': learned.covariance.tolist()}
    write_checked(path, VERSION, _fingerprint(robot), content, now_ns)


def load(path: Path, robot: Robot, now_ns: int) -> Learned:
    """Read what was learned of a robot until a wall time [ns].

    Raises:
        RecordingError: neither the file nor the one before can be used.
    """
    return read_checked(path, VERSION, _fingerprint(robot), partial(_widened, robot), now_ns)


def _widened(robot: Robot, content: dict[str, Any], seconds: float) -> Learned:
    mean, covariance = np.array(content['mean']), np.array(content['covariance'])
    size = len(parameter_names(robot))
    if mean.shape != (size,) or covariance.shape != (size, size):
        raise ValueError(f'{mean.shape} and {covariance.shape} numbers for {size} parameters')
    spread = np.linalg.eigvalsh(covariance)
    if not (np.all(np.isfinite(mean)) and spread[0] >= -1e-9 * spread[-1] > -np.inf):
        raise ValueError('no finite parameters with a covariance')
    captured = np.arange(size - 3 * len(robot.target_wheels), size)
    covariance[captured, captured] += (mean[captured] * run_down(seconds)) ** 2
    return Learned(mean, covariance)


def _fingerprint(robot: Robot) -> str:
    return digest('\n'.join((robot.urdf, *robot.joints, *parameter_names(robot))))
