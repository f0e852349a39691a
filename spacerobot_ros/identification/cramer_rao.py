"""Cramer-Rao bound of the wheel momentum, the bodies and the minimal parameters along a motion.

What the sensors of a run can tell at best, however they are processed. Unknown are the whole joint
trajectory, the first attitude, the total momentum h_W, the AAM, the coordinates y of the bodies
and the nuisances; body rate and attitude follow from the conservation of momentum. That is the
model of the momentum filter, whose whitened rows on samples without noise, linearized about the
truth, are a square root of the Fisher information.

Symbols: p constants [h_W; AAM; y; nuisances], k minimal parameters x.
"""

from __future__ import annotations

import numpy as np

from ..estimation.filters.momentum_filter import MomentumFilter
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import NoiseLevels
from ..estimation.unknowns.minimal import minimal_set
from ..estimation.unknowns.torque_hold import Holds
from ..recording.record import Record
from ..types import Array
from .maximum_likelihood import prepare

_KNOWN = 1e-7  # of the largest singular value; the columns have unit norm
_OPEN = 1e-5  # share of a number's derivatives along what is not told; differences leave 1e-9


def information_root(
    model: MomentumModel,
    record: Record,
    noise: NoiseLevels,
    constants: Array | None = None,
    holds: Holds | None = None,
) -> Array:
    """(p, p) triangular square root of the Fisher information of [h_W; AAM; y; nuisances].

    Args:
        model: What is identified.
        record: Samples without noise of the true robot, at least a second of each sensor.
        noise: What the sensors would add to each.
        constants: (p,) the truth, whose total momentum is found from the record; None: the
            model's robot and its captured wheels' momentum are the truth.
        holds: When torques were set; None where that is of no interest.

    Raises:
        ConfigurationError: fixed base.
    """
    stretch = prepare(record, noise, holds)
    constants = model.prior() if constants is None else constants.copy()
    constants[:3] = model.total_momentum(stretch.kinematics, constants)
    momentum_filter = MomentumFilter(model)
    momentum_filter.run(stretch, constants)
    return momentum_filter.information.factor[:, :-1]


def bound_std(root: Array, model: MomentumModel) -> Array:
    """(3 n_links + k,) smallest standard deviations of an unbiased estimate of [AAM; x].

    Args:
        root: (p, p) square root of an information. What it tells nothing of is infinite.
        model: Its robot is the truth; x are its minimal parameters.
    """
    minimal = minimal_set(model.robot, model.structure)
    bodies, n = model.bodies, model.n_aam
    asked = np.zeros((n + len(minimal), model.size - 3))
    asked[:n, :n] = np.eye(n)
    y = slice(n, n + bodies.size)
    asked[n:, y] = bodies.derivatives(minimal.of_bodies, np.zeros(bodies.size))
    wanted = root[3:, 3:]
    scale = np.linalg.norm(wanted, axis=0)
    scale = np.where(scale > 0.0, scale, 1.0)
    _, singular, right = np.linalg.svd(wanted / scale)
    known = singular > _KNOWN * singular[0]
    along = asked / scale @ right.T
    std = np.linalg.norm(along[:, known] / singular[known], axis=1)
    is_open = np.linalg.norm(along[:, ~known], axis=1) > _OPEN * np.linalg.norm(along, axis=1)
    return np.where(is_open, np.inf, std)
