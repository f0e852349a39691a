"""What is to be estimated: the linear minimal set, or bodies, as `identifier.manifold` says.

    [h_W; AAM; x] = constants + map @ y

with y the errors of [h_W; AAM; x] themselves, or of [h_W; AAM; coordinates of the bodies]: a
motion that tells much of a linear set, which no bodies fill, need not tell much of the bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimation.momentum_process import MomentumModel
from ..identification.physical import BodyParameters
from ..model.settings import IdentifierSettings
from ..types import Array

_RANK_TOLERANCE = 1e-8
_STEP = 1e-5  # of the bodies' coordinates, which are of order one


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Unknowns y.

    Args:
        to_constants: (p, 3 + m) map from y to the constants' errors; h_W stands first in both.
        prior_std: (m,) what is known of y, h_W left out, before any measurement.
    """

    to_constants: Array
    prior_std: Array

    def __len__(self) -> int:
        """Number m of unknowns, h_W left out."""
        return len(self.prior_std)

    @property
    def tellable(self) -> int:
        """Number of directions that change the constants at all, h_W left out."""
        singular = np.linalg.svd(self.to_constants[3:, 3:] * self.prior_std, compute_uv=False)
        return int(np.sum(singular > _RANK_TOLERANCE * singular[0]))


def unknowns_of(model: MomentumModel, settings: IdentifierSettings) -> Unknowns:
    """Unknowns that the identifier's settings ask for, with its prior."""
    head = 3 + model.n_aam
    momenta = np.full(model.n_aam, settings.momentum_prior_std)
    if settings.manifold == 'linear':
        largest = float(np.max(np.abs(model.prior()[head:])))
        inertia = np.full(model.size - head, settings.prior_std * largest)
        return Unknowns(np.eye(model.size), np.concatenate([momenta, inertia]))
    bodies = BodyParameters(model.robot, settings.structure)
    steps = _STEP * np.eye(bodies.size)
    ahead, behind = (
        model.tree.block_parameters(*bodies.bodies(x)) @ model.minimal.grouping.T
        for x in (steps, -steps)
    )
    lift = np.zeros((model.size, head + bodies.size))
    lift[:head, :head] = np.eye(head)
    lift[head:, head:] = (ahead - behind).T / (2.0 * _STEP)
    return Unknowns(lift, np.concatenate([momenta, np.full(bodies.size, settings.prior_std)]))
