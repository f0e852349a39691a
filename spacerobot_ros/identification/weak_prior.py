"""A prior too weak to bend a result that keeps unexcited directions finite."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import Kinematics
from ..estimation.unknowns.torque_hold import Holds
from ..model.settings import IdentifierSettings
from ..types import Array
from .validity_limits import SMALLEST_INERTIA

_PROBES = 20  # states of the reference at which a proposed inertia must be positive


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Gaussian prior on the constants [h_W; AAM; x].

    Args:
        mean: (p,). std: (p,).
    """

    mean: Array
    std: Array

    def admissible(
        self, model: MomentumModel, reference: Kinematics, current: Array, proposed: Array
    ) -> Array:
        """The proposed constants, or some between them and the current ones.

        Before the data suffice, the inertia proposed may be indefinite, and no linearization about
        it would hold.
        """
        probes = reference.q[:: max(1, len(reference.q) // _PROBES)]
        least = SMALLEST_INERTIA * _smallest_inertia(model, probes, self.mean)
        for fraction in (1.0, 0.5, 0.25, 0.1):
            constants = current + fraction * (proposed - current)
            if _smallest_inertia(model, probes, constants) > least:
                return constants
        return current


def weak_prior(
    model: MomentumModel,
    reference: Kinematics,
    settings: IdentifierSettings,
    holds: Holds | None = None,
) -> Prior:
    """The robot file's values with the identifier's prior standard deviations.

    Every minimal parameter gets `prior_std` times the largest of them, since single ones may be
    zero or regrouped; the total momentum is centred on what the robot file's values imply and left
    free.
    """
    mean = model.prior()
    mean[:3] = model.total_momentum(reference, mean)
    std = np.full(len(mean), settings.prior_std * np.max(np.abs(mean[model.x])))
    std[:3] = 10.0 * (settings.momentum_prior_std + np.linalg.norm(mean[:3]))
    std[model.aam] = settings.momentum_prior_std
    mean[model.other], std[model.other] = model.nuisances.prior(holds)
    return Prior(mean, std)


def _smallest_inertia(model: MomentumModel, q: Array, constants: Array) -> float:
    return float(np.min(np.linalg.eigvalsh(model.inertia(q, constants))))
