r"""The wrench of a contact, where the joints inboard of it tell all six numbers.

    tau_j = sum_k (J' e_k)_j w_k,    w = (M' M)^-1 M' (tau / std),  M = J' / std,

with the joints' torques from outside by one template at the event's time, those that do not feel
it included, and J of the last link that does: a contact beyond it has the same force there, and a
torque that counts its lever.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...effects.surroundings.external import ExternalWrench
from ...estimation.balance.balance import Balance
from ...types import Array
from .contact import Pulse
from .joint_scan import Pulses
from .moving import PulseSearch

NAMES = tuple(f'{what}_{axis}' for what in ('force', 'torque') for axis in 'xyz')

Wrench = Mapping[str, tuple[float, float]]
"""Largest force [N] and torque [N m] at a link's origin in its frame, with deviations."""


def wrench_of(search: PulseSearch, first: Pulse, link: str) -> Wrench | None:
    """The wrench at a link; None where joints tell less than all of it.

    Args:
        search: The recordings.
        first: The event's largest pulse.
        link: The last that feels it.
    """
    columns = _transposed_jacobian(search.rows.balances[first.run], first, link)
    inboard = np.flatnonzero(np.any(columns != 0.0, axis=1)).tolist()
    duration = first.end - first.start
    shape = ([0.5 * (first.start + first.end)], [duration], [first.edge])
    pulse = Pulses(*(np.array(x) for x in shape))
    torques, stds = [], []
    for j in inboard:
        found = search.scan.test(j, first.run, pulse)
        torques.append(found.torque[0])
        stds.append(found.std[0] * search.colour(j, duration))
    seen = np.isfinite(torques)
    weights = 1.0 / np.array(stds)[seen]
    matrix = columns[inboard][seen] * weights[:, None]
    if np.linalg.matrix_rank(matrix) < len(NAMES):
        return None
    covariance = np.linalg.inv(matrix.T @ matrix)
    values = covariance @ (matrix.T @ (np.array(torques)[seen] * weights))
    deviations = np.sqrt(np.diag(covariance))
    pairs = zip(values.tolist(), deviations.tolist(), strict=True)
    return dict(zip(NAMES, pairs, strict=True))


def applied_wrench(pulse: Pulse, link: str, wrench: Wrench) -> ExternalWrench:
    """As an effect, with the times of a pulse."""
    sizes = {name: value for name, (value, _) in wrench.items()}
    return ExternalWrench(name=f'event_{link}', where=link, values=pulse.times | sizes)


def _transposed_jacobian(balance: Balance, pulse: Pulse, link: str) -> Array:
    """(n, 6) torques on the joints of a unit of each number, in the middle of a pulse."""
    motion = balance.motion
    at = int(np.argmin(np.abs(motion.time - 0.5 * (pulse.start + pulse.end))))
    none = dict.fromkeys(NAMES, (0.0, 0.0))
    units = [applied_wrench(pulse, link, {**none, name: (1.0, 0.0)}) for name in NAMES]
    hidden = np.zeros((len(motion), 0))
    return np.column_stack([unit.force(motion, hidden)[at, 6:] for unit in units])
