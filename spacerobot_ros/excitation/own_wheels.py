"""Own wheels as a design lever: their known momentum fixes the common scale of the estimate.

The momentum equation A x = b is nearly homogeneous: the right-hand side is the momentum of the
servicer's own wheels alone. Without it only ratios can be told; the faster they spin, the better
the scale.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..types import Array
from .free_base import FreeBase
from .prediction import Prediction, predict
from .problem import Problem

FACTORS = (1.0, 2.0, 5.0)
_TRIED = 10.0  # N m s an axis, where the file has the wheels at rest
_WORTH = 0.9  # of the std; a smaller gain is not worth a spin-up


@dataclass(frozen=True, slots=True, eq=False)
class WheelOption:
    """The same joint motion with other wheel momentum.

    Args:
        factor: On the momentum of the robot file (on 10 N m s an axis where that is zero).
        momentum: (3,) in base_link [N m s].
        prediction: What it reaches.
        allowed: Whether every limit holds.
    """

    factor: float
    momentum: Array
    prediction: Prediction
    allowed: bool


def wheel_options(problem: Problem, x: Array) -> tuple[WheelOption, ...]:
    """Predictions for the motion x (size,) at the `FACTORS` of the own wheels' momentum."""
    h0 = problem.robot.servicer_wheels.momentum
    if not h0.any():
        h0 = np.full(3, _TRIED)
    return tuple(_option(problem, x, factor, factor * h0) for factor in FACTORS)


def recommendation(problem: Problem, options: tuple[WheelOption, ...]) -> str:
    """One sentence of advice."""
    if not problem.robot.servicer_wheels.momentum.any():
        return (
            "the servicer's wheels are at rest: the common scale of all estimates is unknown and "
            'only ratios can be told; spin the wheels up first'
        )
    allowed = [o for o in options if o.allowed]
    if not allowed:
        return 'the limits hold at no multiple of the present wheel momentum'
    best = max(allowed, key=lambda o: o.prediction.bits)
    now = options[0]
    if best is now or best.prediction.scale_std > _WORTH * now.prediction.scale_std:
        broken = [o for o in options[1:] if not o.allowed]
        why = f': {_worst(broken[0])} beyond its limit at x{broken[0].factor:g}' if broken else ''
        return f'keep the present wheel momentum{why}; a search at a higher one may still pay'
    gain = now.prediction.scale_std / best.prediction.scale_std
    return (
        f'spin the wheels up to x{best.factor:g} '
        f'({np.linalg.norm(best.momentum):.4g} N m s) before identifying: the common scale gets '
        f'{gain:.2g} times better known, the whole estimate '
        f'{best.prediction.bits - now.prediction.bits:.1f} bits'
    )


def _option(problem: Problem, x: Array, factor: float, momentum: Array) -> WheelOption:
    robot = problem.robot.with_servicer_momentum(momentum)
    start = problem.start
    if problem.start_kind == 'spin_up':
        omega = FreeBase(robot).spun_up(problem.family.start, momentum)
        start = replace(start, omega=omega)
    prediction = predict(problem, robot, problem.family, x, start)
    allowed = all(use.fraction <= 1.0 for use in prediction.uses)
    return WheelOption(factor, momentum, prediction, allowed)


def _worst(option: WheelOption) -> str:
    use = max(option.prediction.uses, key=lambda u: u.fraction)
    return f'{use.name} of {use.where}'
