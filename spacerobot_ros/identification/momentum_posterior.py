"""Momenta and bodies given what data told and what the robot file states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.inference.square_root import ordered
from ..estimation.unknowns.torque_hold import Holds
from ..inference.curved_posterior import curved_posterior
from ..inference.scaled_prior import scaled_posterior
from ..types import Array, Vector3


@dataclass(frozen=True, slots=True, eq=False)
class MomentumPosterior:
    """Constants given data and prior.

    Args:
        mean: (p,). covariance: (p, p).
        prior_std: (p,) standard deviations of the prior; those of bodies by the data's scale.
        rank: Number of directions that the data tell better than the prior does.
        factor: Of the bodies' prior; NaN without data.
        above: Probability that it is above half of the largest.
        is_settled: Whether the bodies were found.
    """

    mean: Array
    covariance: Array
    prior_std: Array
    rank: int = 0
    factor: float = float('nan')
    above: float = 0.0
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
) -> MomentumPosterior:
    """Combine what data told with the prior of the bodies.

    The other constants are eliminated first, and follow.

    Args:
        model: The constants.
        factor: (g, g + 1) square-root information of the errors of the filter's constants, the
            bodies' prior not included, all others' included.
        about: (p,) constants that the errors count from.
        prior_std: (p,) of the others' priors.
        is_expected: Whether it is sought as data will have it in the mean (`scaled_posterior`);
            the factor, (p, p + 1), is then that of the constants about them.
    """
    every, start, wide = np.arange(len(factor)), about[model.y], model.bodies.std
    told = model.y if is_expected else model.filter_bodies
    own, across, right, root, values = ordered(factor, np.delete(every, told), every[told])
    if is_expected:
        bodies = scaled_posterior(root, values + root @ start, wide, is_expected=True)
        slopes, shift, is_settled = np.eye(len(wide)), bodies.mean - start, True
    else:
        slopes, bodies, is_settled = curved_posterior(model, root, values, wide, start)
        shift = model.told_of(bodies.mean) - model.told_of(start)
    y, others = np.arange(model.size)[model.y], np.delete(np.arange(model.size), model.y)
    free = scipy.linalg.solve_triangular(own, np.eye(len(others)))
    mean, std = about.copy(), prior_std.copy()
    mean[y], std[y] = bodies.mean, np.sqrt(bodies.prior_variance)
    mean[others] += free @ (right - across @ shift)
    follow = np.empty((model.size, len(y)))
    follow[y], follow[others] = np.eye(len(y)), -free @ across @ slopes
    covariance = follow @ bodies.covariance @ follow.T
    covariance[np.ix_(others, others)] += free @ free.T
    told_better = std[others] > np.sqrt(2.0 * np.diag(covariance)[others])
    rank = bodies.rank + int(np.sum(told_better))
    return MomentumPosterior(mean, covariance, std, rank, bodies.factor, bodies.above, is_settled)
