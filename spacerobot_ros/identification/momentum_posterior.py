"""Momenta and bodies given what data told and what the robot file states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..estimation.filters.momentum_process import MomentumModel
from ..inference.scaled_prior import ScaledPosterior, scaled_posterior
from ..inference.square_root import ordered
from ..types import Array


@dataclass(frozen=True, slots=True, eq=False)
class MomentumPosterior:
    """Constants given data and prior.

    Args:
        mean: (p,). covariance: (p, p).
        bodies: The part of the bodies, about the robot file's values.
        prior_std: (p,) standard deviations of the prior; those of bodies by the data's scale.
        rank: Number of directions that the data tell better than the prior does.
    """

    mean: Array
    covariance: Array
    bodies: ScaledPosterior
    prior_std: Array
    rank: int


def posterior_of(
    model: MomentumModel,
    factor: Array,
    about: Array,
    prior_std: Array,
    *,
    is_expected: bool = False,
) -> MomentumPosterior:
    """Combine what data told with the prior of the bodies.

    The other constants are eliminated first, and follow.

    Args:
        model: The constants.
        factor: (p, p + 1) square-root information of their errors, the bodies' prior not
            included, all others' included.
        about: (p,) constants that the errors count from.
        prior_std: (p,) of the others' priors.
        is_expected: See `scaled_posterior`.
    """
    y, others = np.arange(model.size)[model.y], np.delete(np.arange(model.size), model.y)
    own, across, right, root, values = ordered(factor, others, y)
    right_of_y, wide = values + root @ about[y], model.bodies.std
    bodies = scaled_posterior(root, right_of_y, wide, is_expected=is_expected)
    mean, covariance = np.empty(model.size), np.empty((model.size, model.size))
    mean[y] = bodies.mean
    step = scipy.linalg.solve_triangular(own, right - across @ (bodies.mean - about[y]))
    mean[others] = about[others] + step
    follow = -scipy.linalg.solve_triangular(own, across)
    free = scipy.linalg.solve_triangular(own, np.eye(len(others)))
    covariance[np.ix_(y, y)] = bodies.covariance
    covariance[np.ix_(others, y)] = follow @ bodies.covariance
    covariance[np.ix_(y, others)] = covariance[np.ix_(others, y)].T
    covariance[np.ix_(others, others)] = follow @ bodies.covariance @ follow.T + free @ free.T
    std = prior_std.copy()
    std[y] = np.sqrt(bodies.prior_variance)
    told = std[others] > np.sqrt(2.0) * np.sqrt(np.diag(covariance)[others])
    return MomentumPosterior(mean, covariance, bodies, std, bodies.rank + int(np.sum(told)))
