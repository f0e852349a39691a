r"""Allan deviation: which part of a rate's error is white, and which walks.

Of the integral e of a rate's error over time, with samples dt apart and tau = m dt,

    sigma^2(tau) = <(e(t + 2 tau) - 2 e(t + tau) + e(t))^2> / (2 tau^2)

(IEEE Std 952-1997, annex C). Errors of three kinds make

    sigma^2(tau) = 3 Q^2 / tau^2 + N^2 / tau + K^2 tau / 3

Q white error of the angle that e is compared with, N white error of the rate, K its random walk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from ...types import Array

_LONGEST = 0.2  # of the record: beyond it too few differences are left
_FEWEST = 5  # averaging times
_PER_OCTAVE = 2
_CLEAR = 9.0  # chi-square of one term, three standard deviations: it is there


@dataclass(frozen=True, slots=True, eq=False)
class Allan:
    """Allan deviation of one sensor's rate, all its axes together.

    Args:
        channel: The rate.
        tau: (M,) averaging times [s].
        deviation: (M,) [unit/s].
        white: Density N of white noise [unit/s/sqrt(Hz)]; None where it is not seen.
        random_walk: K [unit/s/sqrt(s)]; None where it is not seen.
        most_walk: Largest random walk that would have stayed unseen [unit/s/sqrt(s)].
        angle: White error Q of the angle [unit]; None where it is not seen.
        unit: Of angles, or of ways where joints slide.
    """

    channel: str
    tau: Array
    deviation: Array
    white: float | None
    random_walk: float | None
    most_walk: float
    angle: float | None
    unit: str


def allan(channel: str, time: Array, angle_error: Array, unit: str = 'rad') -> Allan | None:
    """From the integral of a rate's error.

    Args:
        channel: The rate.
        time: (N,) sample times; taken as even [s].
        angle_error: (N, k) [unit].
        unit: Of that.

    Returns:
        None where the record is too short for five averaging times.
    """
    count, length = len(time), float(time[-1] - time[0])
    step = length / (count - 1)
    octaves = np.log2(max(_LONGEST * count, 1.0))
    spans = np.unique(np.round(2.0 ** np.arange(0.0, octaves, 1.0 / _PER_OCTAVE)).astype(int))
    if len(spans) < _FEWEST:
        return None
    even = np.linspace(time[0], time[-1], count)
    error = np.column_stack([np.interp(even, time, column) for column in angle_error.T])
    tau = step * spans
    variance = np.array([_variance(error, m) for m in spans]) / (2.0 * tau**2)
    if not np.all(variance > 0.0):
        return None
    # of that many independent differences an estimate of a variance has relative variance 2 / n
    independent = np.maximum(length / tau - 1.0, 1.0) * error.shape[1]
    columns = np.column_stack([3.0 / tau**2, 1.0 / tau, tau / 3.0])
    scaled = columns / variance[:, None] * np.sqrt(0.5 * independent)[:, None]
    data = np.sqrt(0.5 * independent)
    terms, rest = nnls(scaled, data)
    seen = [_is_seen(scaled, data, k, rest) for k in range(3)]
    angle, white, walk = (
        float(np.sqrt(term)) if is_seen else None
        for term, is_seen in zip(terms, seen, strict=True)
    )
    unseen = 3.0 / np.linalg.norm(scaled[:, 2])
    most = float(np.sqrt(unseen))
    return Allan(channel, tau, np.sqrt(variance), white, walk, most, angle, unit)


def _variance(error: Array, m: int) -> float:
    return float(np.mean((error[2 * m :] - 2.0 * error[m:-m] + error[: -2 * m]) ** 2))


def _is_seen(columns: Array, data: Array, k: int, rest: float) -> bool:
    """Whether the others leave clearly more without one term."""
    without = nnls(np.delete(columns, k, axis=1), data)[1]
    return bool(without**2 - rest**2 > _CLEAR)
