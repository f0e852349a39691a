"""What an adaptive law has learned, in a file that survives it (`identification.checked_file`).

The covariance of the captured wheels' momentum is widened by what they may have lost meanwhile.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...identification.checked_file import digest, read_checked, run_down, write_checked
from ...model.robot import Robot
from ...types import Array
from .regressors import parameter_names

VERSION = 1


class Learned(NamedTuple):
    """Parameters (p,) in the order of `parameter_names`, and their covariance (p, p)."""

    mean: Array
    covariance: Array


def save(path: Path, robot: Robot, learned: Learned, now_ns: int) -> None:
    """Write what was learned of a robot at a wall time [ns].

    Raises:
        ConfigurationError: it can not be written.
    """
    content = {'mean': learned.mean.tolist(), 'covariance': learned.covariance.tolist()}
    write_checked(path, VERSION, _fingerprint(robot), content, now_ns)


def load(path: Path, robot: Robot, now_ns: int) -> Learned:
    """Read what was learned of a robot until a wall time [ns].

    Raises:
        RecordingError: neither the file nor the one before can be used.
    """
    return read_checked(path, VERSION, _fingerprint(robot), partial(_widened, robot), now_ns)


def _widened(robot: Robot, content: dict[str, Any], seconds: float) -> Learned:
    mean, covariance = np.array(content['mean']), np.array(content['covariance'])
    size = len(parameter_names(robot))
    if mean.shape != (size,) or covariance.shape != (size, size):
        raise ValueError(f'{mean.shape} and {covariance.shape} numbers for {size} parameters')
    spread = np.linalg.eigvalsh(covariance)
    if not (np.all(np.isfinite(mean)) and spread[0] >= -1e-9 * spread[-1] > -np.inf):
        raise ValueError('no finite parameters with a covariance')
    captured = np.arange(size - 3 * len(robot.target_wheels), size)
    covariance[captured, captured] += (mean[captured] * run_down(seconds)) ** 2
    return Learned(mean, covariance)


def _fingerprint(robot: Robot) -> str:
    return digest('\n'.join((robot.urdf, *robot.joints, *parameter_names(robot))))
