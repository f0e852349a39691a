r"""Whether an error of the model that is a smooth function of the joint's state may be a pulse.

Beside every column of the balance the torque of a joint may have a function of its state x
(`states.py`), a Gaussian process that all recordings share and another of the pulse's own, as
loads differ,

    k(x, x') = g^2 exp(-|x - x'|^2 / (2 l^2)),

seen at some states (Nystroem). The size g and the length l are where the marginal likelihood of
all rows is largest, the pulse's torque with any prior [RW06, (5.8), section 8.1]. Where the arm
comes back to a state the function is known and only what differs there is a pulse; where it does
not the function may be anything of the size g that it has elsewhere. On a machine whose leftover
is no function of states g is zero, and the pulse as large as it was.

On public recordings of a KUKA and of a small geared arm in which nobody pushes, what is beyond
`LISTED` reaches z = 19 alone and 9.9 beside such a function; bells of 20 deviations that were
added to them keep 10.9 and more, and 12.4 but for one.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from ...types import Array
from .contact import Pulse
from .joint_scan import Pulses
from .moving import PulseSearch
from .states import States

_SIZES = np.array([0.0, 0.25, 0.5, 1.0, 2.0, 4.0])[:, None]
"""g, by what is left of the joint (rms)."""
_LENGTHS = (0.35, 0.7, 1.4)
"""l, by the states' scatter: longer ones are what columns are, shorter ones noise."""
_CENTRES, _OWN = 100, 12  # states of all the recordings, and of the pulse
_JITTER = 1e-6


def beside_function(search: PulseSearch, states: States, p: Pulse) -> float:
    """|z| of a pulse beside a function of its joint's state; at most what it is without.

    Args:
        search: The recordings.
        states: Of the joint.
        p: The pulse.
    """
    centres = np.concatenate(
        [_some(states.states, _CENTRES), _some(states.states[states.inside(p)], _OWN)]
    )
    size = _left(search, p.joint)
    found = [
        _fitted(search, p, size * _functions(states, p.run, centres, length))
        for length in _LENGTHS
    ]
    best = max(found, key=lambda of_length: of_length[0])
    return min(abs(p.z), best[1] / search.colour(p.joint, p.end - p.start))


def _fitted(search: PulseSearch, p: Pulse, functions: Array) -> tuple[float, float]:
    """Log likelihood of the best size of a function, and |z| of the pulse beside it."""
    shape = (0.5 * (p.start + p.end), p.end - p.start, p.edge)
    pulse = Pulses(*(np.array([x]) for x in shape))
    normal, right = search.scan.beside_functions(p.joint, p.run, pulse, functions)
    eigenvalues, vectors = np.linalg.eigh(normal[1:, 1:])
    cross, along = vectors.T @ normal[1:, 0], vectors.T @ right[1:]
    square = _SIZES**2
    taken = square / (1.0 + square * np.maximum(eigenvalues, 0.0))
    den = np.maximum(normal[0, 0] - taken @ cross**2, _JITTER * normal[0, 0])
    num = right[0] - taken @ (cross * along)
    likelihood = taken @ along**2 + num**2 / den - np.log(den)
    likelihood -= np.sum(np.log1p(square * np.maximum(eigenvalues, 0.0)), axis=1)
    at = int(np.argmax(likelihood))
    return float(likelihood[at]), float(abs(num[at]) / np.sqrt(den[at]))


def _functions(states: States, run: int, centres: Array, length: float) -> Array:
    """(M, P) whose sum, with coefficients of unit variance, is such a process of unit size."""
    between = _kernel(centres, centres, length) + _JITTER * np.eye(len(centres))
    lower = np.linalg.cholesky(between)
    shared = solve_triangular(lower, _kernel(centres, states.states, length), lower=True).T
    is_own = states.run == run
    if is_own.all():
        return np.asarray(shared)
    return np.column_stack([shared, shared * is_own[:, None]]) / np.sqrt(2.0)


def _kernel(x: Array, y: Array, length: float) -> Array:
    return np.asarray(np.exp(-0.5 * cdist(x, y, 'sqeuclidean') / length**2))


def _some(states: Array, count: int) -> Array:
    """At most so many, evenly along."""
    return states[np.unique(np.linspace(0, len(states) - 1, count).astype(int))]


def _left(search: PulseSearch, j: int) -> float:
    """Of the joint's rows that are kept, by no function (rms) [N m]."""
    left = search.scan.joints[j].kept.left(search.scan.coefficients)
    return float(np.sqrt(np.mean(left**2))) if len(left) else 0.0
