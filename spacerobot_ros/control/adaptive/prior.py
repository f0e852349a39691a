"""What is believed of the parameters before the data: mean, covariance, scales."""

from __future__ import annotations

import numpy as np

from ...model.robot import Robot
from ...types import Array
from .pseudo_inertia import INVERSE, body_scales, pseudo_inertia
from .regressors import parameter_values, wheel_links

_SAMPLING_ERROR = 1e-4  # acceleration whose torque is taken as error of discretisation
_NEAR_ZERO = 1e-3  # of mass, mass x size, mass x size squared: an element's smallest scale
_TINY = 1e-3  # smallest relative eigenvalue of a pseudo-inertia that sets a scale


def prior_covariance(robot: Robot, shape: str, std: float, wheel_std: float) -> Array:
    """(p, p) covariance of the parameters about a robot's.

    With `bodies` a body is believed to be like the robot's up to a random small deformation and a
    change of density: P = (1 + E) P0 (1 + E)^T, entries of E independent. This needs no scales for
    single parameters, does not depend on the frames, and keeps to physical bodies to first order.
    With `elements` every parameter is wrong on its own, in proportion to its value, as in eq. (46)
    of the adaptive-control paper. The data tell the torques either way; the shape decides on which
    parameters a correction falls that several could explain.

    A massless frame is known to be massless; the servicer's own wheels are known.

    Args:
        robot: The robot.
        shape: `bodies` or `elements`.
        std: Relative standard deviation of a mass.
        wheel_std: Of the captured wheels' momentum, each axis [N m s].
    """
    values = parameter_values(robot)
    bodies = len(robot.bodies)
    G = np.zeros((len(values), len(values)))
    rows = values[: 10 * bodies].reshape(bodies, 10)
    for k, (row, scale) in enumerate(zip(rows, body_scales(rows), strict=True)):
        if scale[3] > 0.0:
            block = slice(10 * k, 10 * k + 10)
            is_body = shape == 'bodies'
            own = _body_covariance(row, scale, std) if is_body else _by_element(row, scale, std)
            G[block, block] = own
    known = len(wheel_links(robot)) - len(robot.target_wheels)
    wheels = np.arange(10 * bodies + 3 * known, len(values))
    G[wheels, wheels] = wheel_std**2
    return G


def _by_element(row: Array, scale: Array, std: float) -> Array:
    """(10, 10) covariance of one body; a parameter near zero counts by the body's size."""
    mass, length = scale[3] ** -2, scale[3] / scale[0]
    size = mass * length ** np.array([0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
    return np.diag((std * np.maximum(np.abs(row), _NEAR_ZERO * size)) ** 2)


def _body_covariance(row: Array, scale: Array, std: float) -> Array:
    """(10, 10) covariance of one body; an indefinite one counts by its absolute eigenvalues."""
    values, vectors = np.linalg.eigh(pseudo_inertia(row) * np.outer(scale, scale))
    values = np.maximum(np.abs(values), _TINY * np.max(np.abs(values)))
    P = (vectors * values) @ vectors.T / np.outer(scale, scale)
    # entries i, j of E in units of the body's size, so that a shift weighs like a stretch: E P
    units = np.outer(1.0 / scale, scale)
    grown = np.einsum('ij,ia,jb->ijab', units, np.eye(4), P)
    columns = INVERSE @ (grown + np.swapaxes(grown, 2, 3)).reshape(16, 16).T
    return np.asarray((0.5 * std) ** 2 * columns @ columns.T)


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
