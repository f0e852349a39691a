"""An identifier's estimate as standard parameters: the start of an adaptation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...dynamics.blocks import BlockTree
from ...errors import IdentificationError
from ...estimation.minimal import minimal_set
from ...identification.estimate import Estimate
from ...model.robot import Robot
from ...types import Array
from .regressors import wheel_links, with_parameters

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
    tree, size = BlockTree(robot), 10 * len(robot.bodies)
    own = 3 * (len(wheel_links(robot)) - len(robot.target_wheels))
    n_aam = len(estimate.aam)

    def predicted(pi: Array) -> Array:
        blocks = tree.parameters(with_parameters(robot, pi))
        return np.concatenate([pi[size + own :], minimal.regrouping @ blocks])

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


def _jacobian(function: Callable[[Array], Array], at: Array, steps: Array) -> Array:
    """Central differences, one column a parameter; zero where the step is zero."""
    columns = []
    for i, step in enumerate(steps):
        shift = np.zeros(len(at))
        shift[i] = step
        difference = function(at + shift) - function(at - shift)
        columns.append(difference / (2.0 * step) if step > 0.0 else np.zeros(len(difference)))
    return np.array(columns).T


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
