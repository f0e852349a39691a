r"""What the axis of a steady spin and its nutation tell of the inertia: ratios, never the scale.

A steady free spin is about a principal axis n of J. With moments I_s about it and I_a, I_b across,
a small disturbance makes the axis nutate in the body at kappa of the spin,

    kappa^2 = (I_s - I_a) (I_s - I_b) / (I_a I_b).

With I_b / I_a as the file has it this gives I_s / I_a.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...model.robot import Robot
from ...types import Array

_CLEAR = 2.0  # times what the sensors disagree by, from which a tilt is both sensors'
_WORTH = 5e-3  # rad; sensors are mounted no better
_PAIRS = {'ixy': (0, 1), 'iyy': (1, 1), 'ixz': (0, 2), 'iyz': (1, 2), 'izz': (2, 2)}


@dataclass(frozen=True, slots=True)
class Tilt:
    """Inertia that differs from the file's.

    Args:
        change: Additions to the file's inertia, ixx as it is, by name [kg m^2].
        stds: Their standard deviations [kg m^2].
        likely: The tilt as a part of a sentence, with its rival; empty where there is none.
        in_words: All there is to say.
        is_tilted: Whether both sensors see a tilt.
    """

    change: Mapping[str, float]
    stds: Mapping[str, float]
    likely: str
    in_words: str
    is_tilted: bool


def tilt_of(
    spin: Array, gyro: Array, line: tuple[float, float] | None, robot: Robot
) -> Tilt | None:
    """From the axis that two sensors see, and a nutation.

    Args:
        spin: (M, 3) by the magnetometer.
        gyro: (M, 3) by the gyro, its bias taken off.
        line: Nutation by the spin, and its standard deviation; None where there is none.
        robot: The file's.

    Returns:
        None where neither tells anything that the file does not have.
    """
    inertia = robot.bodies[0].inertia
    main = int(np.argmax(np.sum(spin**2, axis=0)))
    a, b = (i for i in range(3) if i != main)
    slopes = np.array(
        [seen.T @ spin[:, main] / (seen[:, main] @ spin[:, main]) for seen in (spin, gyro)]
    )
    axis, spread = np.mean(slopes, axis=0), 0.5 * np.abs(slopes[0] - slopes[1])
    seen = [i for i in (a, b) if abs(axis[i]) > max(_CLEAR * spread[i], _WORTH)]
    moments = np.diag(inertia).copy()
    notes, moment_std = [], 0.0
    if line is not None:
        moments[main], moment_std = _moment(moments, main, *line)
        before = _difference(np.diag(inertia), main)
        notes.append(
            f'nutation at {line[0]:.4f} +- {line[1]:.2g} of the spin: moments about '
            f'{"xyz"[main]} and its nearest differ by {100 * _difference(moments, main):.2g} % '
            f'(file {100 * before:.2g} %)'
        )
    if not seen and line is None:
        return None
    change, stds, parts = {}, {}, []
    new = np.diag(moments)
    for i in seen:
        new[i, main] = new[main, i] = (moments[main] - moments[i]) * axis[i]
        degrees = math.degrees(math.atan(abs(axis[i])))
        wide = math.degrees(spread[i])
        parts.append(f'{degrees:.2g} +- {wide:.1g} deg off {"xyz"[main]} towards {"xyz"[i]}')
    new *= inertia[0, 0] / new[0, 0]
    for name, (i, j) in _PAIRS.items():
        change[name] = float(new[i, j] - inertia[i, j]) if new[i, j] != inertia[i, j] else 0.0
        other = i if j == main else j
        lean = abs(moments[main] - moments[other]) * spread[other] if main in (i, j) else 0.0
        stds[name] = float(moment_std if i == j == main else lean + moment_std * abs(axis[other]))
    changed = {name for name, value in change.items() if value}
    likely = (
        f'likely its principal axis lies {" and ".join(parts)}, or gyro and magnetometer sit on '
        'one tilted board'
        if parts
        else ''
    )
    notes += [likely] if likely else []
    return Tilt(
        {n: change[n] for n in changed},
        {n: stds[n] for n in changed},
        likely,
        '; '.join(notes),
        bool(parts),
    )


def _difference(moments: Array, main: int) -> float:
    """Of the spin's moment from the nearest other one, by that one."""
    others = np.delete(moments, main)
    near = float(others[np.argmin(np.abs(others - moments[main]))])
    return abs(float(moments[main]) - near) / near


def _moment(moments: Array, main: int, kappa: float, std: float) -> tuple[float, float]:
    """Moment about the spin's axis that a nutation needs, the one nearer to the file's."""
    a, b = np.delete(moments, main).tolist()

    def root(k: float) -> float:
        half = 0.5 * math.sqrt((a - b) ** 2 + 4.0 * k**2 * a * b)
        roots = [0.5 * (a + b) + half, 0.5 * (a + b) - half]
        return min(roots, key=lambda x: abs(x - float(moments[main])))

    return root(kappa), abs(root(kappa + std) - root(kappa))
