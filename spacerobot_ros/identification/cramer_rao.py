"""Cramer-Rao bound of the wheel momentum and the bodies along a motion.

What the sensors of a run can tell at best, however they are processed. Unknown are the whole joint
trajectory, the first attitude, the total momentum h_W, the AAM, the coordinates y of the bodies
and the nuisances; body rate and attitude follow from the conservation of momentum. That is the
model of the momentum filter, whose whitened rows on samples without noise, linearized about the
truth, are a square root of the Fisher information.

Symbols: p constants [h_W; AAM; y; nuisances].
"""

from __future__ import annotations

import numpy as np

from ..estimation.filters.momentum_filter import MomentumFilter
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.reference import NoiseLevels
from ..estimation.unknowns.torque_hold import Holds
from ..recording.record import Record
from ..types import Array
from .maximum_likelihood import prepare


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
    factor = momentum_filter.information.factor[:, :-1]
    first, bodies, others = np.split(
        factor, [model.filter_bodies.start, model.filter_bodies.stop], axis=1
    )
    rows = np.hstack([first, bodies @ model.told_slopes(constants[model.y]), others])
    padded = np.pad(rows, ((0, model.size), (0, 0)))
    return np.asarray(np.linalg.qr(padded, mode='r'))
