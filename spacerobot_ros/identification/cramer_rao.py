"""Cramer-Rao bound of the wheel momentum and the minimal parameters along a motion.

What the sensors of a run can tell at best, however they are processed. Unknown are the whole joint
trajectory, the first attitude, the total momentum h_W, and [AAM; x]; body rate and attitude follow
from the conservation of momentum. That is the model of the momentum filter, whose whitened rows on
samples without noise, linearized about the truth, are a square root of the Fisher information.

Symbols: p constants [h_W; AAM; x].
"""

from __future__ import annotations

import numpy as np

from ..estimation.filters.momentum_filter import MomentumFilter
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import NoiseLevels
from ..recording.record import Record
from ..types import Array
from .maximum_likelihood import prepare

_KNOWN = 1e-7  # of the largest singular value; the columns have unit norm


def information_root(model: MomentumModel, record: Record, noise: NoiseLevels) -> Array:
    """(p, p) triangular square root of the Fisher information of [h_W; AAM; x].

    Args:
        model: The true robot, its captured wheels' momentum included, and what is identified.
        record: Samples without noise of its motion, at least a second of each sensor.
        noise: What the sensors would add to each.

    Raises:
        ConfigurationError: fixed base or prismatic joints.
    """
    stretch, constants = prepare(record, noise), model.prior()
    constants[:3] = model.total_momentum(stretch.kinematics, constants)
    momentum_filter = MomentumFilter(model)
    momentum_filter.run(stretch, constants)
    return momentum_filter.information.factor[:, :-1]


def bound_std(root: Array) -> Array:
    """(p - 3,) smallest standard deviations that an unbiased estimate of [AAM; x] can have.

    Args:
        root: Square root of an information. What it tells nothing of is infinite.
    """
    wanted = root[3:, 3:]
    scale = np.linalg.norm(wanted, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    _, singular, right = np.linalg.svd(wanted / scale)
    known = singular > _KNOWN * singular[0]
    std = np.linalg.norm(right[known].T / singular[known], axis=1) / scale
    return np.where(np.any(np.abs(right[~known]) > 1e-6, axis=0), np.inf, std)
