"""Momenta and bodies given what data told and what the robot file states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.unknowns.torque_hold import Holds
from ..inference.curved_posterior import curved_posterior
from ..inference.scaled_prior import ScaledPosterior, scaled_posterior
from ..inference.square_root import ordered
from ..types import Array, Vector3


@dataclass(frozen=True, slots=True, eq=False)
class MomentumPosterior:
    """Constants given data and prior.

    Args:
        mean: (p,). covariance: (p, p).
        bodies: The part of the bodies, about the robot file's values.
        prior_std: (p,) standard deviations of the prior; those of bodies by the data's scale.
        rank: Number of directions that the data tell better than the prior does.
        is_settled: Whether the bodies were found.
    """

    mean: Array
    covariance: Array
    bodies: ScaledPosterior
    prior_std: Array
    rank: int
    is_settled: bool = True


def prior_of(
    model: MomentumModel, wide: float, total: Vector3, holds: Holds | None
) -> tuple[Array, Array]:
    """(p,) mean and standard deviations before any data; the bodies' are in `robot.uncertainty`.

    Args:
        model: The constants.
        wide: Standard deviation of the wheels' momentum [N m s].
        total: (3,) total momentum about which it is left free [N m s].
        holds: When torques were set.
    """
    mean, std = model.prior(), np.full(model.size, wide)
    mean[:3], std[:3] = total, 10.0 * (wide + np.linalg.norm(total))
    std[model.y] = model.bodies.std
    mean[model.other], std[model.other] = model.nuisances.prior(holds)
    return mean, std


def posterior_of(
    model: MomentumModel,
    factor: Array,
    about: Array,
    prior_std: Array,
    *,
    is_expected: bool = False,
    scale: float | None = None,
) -> MomentumPosterior:
    """Combine what data told with the prior of the bodies.

    The other constants are eliminated first, and follow.

    Args:
        model: The constants.
        factor: (g, g + 1) square-root information of the errors of the filter's constants, the
            bodies' prior not included, all others' included.
        about: (p,) constants that the errors count from.
        prior_std: (p,) of the others' priors.
        is_expected: See `scaled_posterior`.
        scale: Factor of the bodies' prior, where it is not sought.
    """
    every, y = np.arange(model.filter_size), np.arange(model.size)[model.y]
    told = every[model.filter_bodies]
    own, across, right, root, values = ordered(factor, np.setdiff1d(every, told), told)
    start, wide, is_settled = about[y], model.bodies.std, True
    if model.is_minimal:
        slopes, bodies, is_settled = curved_posterior(model, root, values, wide, start, scale)
    else:
        right_of_y = values + root @ start
        bodies = scaled_posterior(root, right_of_y, wide, is_expected=is_expected, factor=scale)
        slopes = np.eye(len(y))
    others = np.setdiff1d(np.arange(model.size), y)
    mean, covariance = np.empty(model.size), np.empty((model.size, model.size))
    mean[y] = bodies.mean
    shift = model.told_of(bodies.mean) - model.told_of(start)
    step = scipy.linalg.solve_triangular(own, right - across @ shift)
    mean[others] = about[others] + step
    follow = -scipy.linalg.solve_triangular(own, across @ slopes)
    free = scipy.linalg.solve_triangular(own, np.eye(len(others)))
    covariance[np.ix_(y, y)] = bodies.covariance
    covariance[np.ix_(others, y)] = follow @ bodies.covariance
    covariance[np.ix_(y, others)] = covariance[np.ix_(others, y)].T
    covariance[np.ix_(others, others)] = follow @ bodies.covariance @ follow.T + free @ free.T
    std = prior_std.copy()
    std[y] = np.sqrt(bodies.prior_variance)
    told_better = std[others] > np.sqrt(2.0) * np.sqrt(np.diag(covariance)[others])
    rank = bodies.rank + int(np.sum(told_better))
    return MomentumPosterior(mean, covariance, bodies, std, rank, is_settled)
