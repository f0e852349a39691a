"""The search: sequential quadratic programming from several starting points.

Gradients are forward differences of all amplitudes at once, which costs a few times one candidate.
The smoothed limits leave a little of every limit unused and may miss a peak between two nodes, so
each result is scaled, on a finer grid, to the largest amplitude that keeps every limit. The same
seed gives the same motion to the last bit on the same machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.optimize import minimize

from ..types import Array
from .motions import SAFE
from .problem import Objective, Problem

OnIteration = Callable[[int, float], None]
"""Called after every step with the number of steps done and the best cost so far."""

_STEP = 3e-5  # rad; of the forward differences: the cost is good to some 1e-10
_TOLERANCE = 2e-4  # of the cost: bits an unknown, or log2 of a condition number
_NEARLY = 1e-3  # of the limits may be missing before the final scaling
_GROWTH = 1.25  # largest factor on a result whose limits leave room


class Attempt(NamedTuple):
    """One starting point.

    Attributes:
        origin: `robot file` or `random`.
        first: Cost of the starting point.
        cost: Cost of its result, all limits kept.
        steps: Steps taken.
    """

    origin: str
    first: float
    cost: float
    steps: int


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """The best motion found.

    Args:
        x: (size,) amplitudes [rad].
        cost: Its cost.
        attempts: What every starting point led to.
        interrupted: Whether the search was stopped early.
    """

    x: Array
    cost: float
    attempts: tuple[Attempt, ...]
    interrupted: bool


def search(problem: Problem, progress: OnIteration = lambda *_: None) -> Design:
    """Search from every starting point; an interrupt (Ctrl-C) ends it with the best so far.

    Raises:
        ConfigurationError: the limits leave no motion.
    """
    options = problem.settings.excitation
    tried: list[_Descent] = []

    def on_step(steps: int) -> None:
        done = options.iterations * (len(tried) - 1)
        progress(done + steps, min(descent.cost for descent in tried))

    interrupted = False
    while len(tried) < options.starts and not interrupted:
        tried.append(_Descent(problem, *problem.starting_motion(len(tried))))
        interrupted = not tried[-1].run(options.iterations, on_step)
    best = min(tried, key=lambda descent: descent.cost)
    attempts = tuple(Attempt(d.origin, d.first, d.cost, d.steps) for d in tried)
    return Design(best.x, best.cost, attempts, interrupted)


class _Descent:
    """Sequential quadratic programming from one point; knows the best point that keeps the limits.

    Args:
        problem: What to minimize.
        origin: Where the point comes from.
        x: (size,) point that keeps the limits.
    """

    def __init__(self, problem: Problem, origin: str, x: Array) -> None:
        self._problem, self.origin, self.x = problem, origin, x
        self.cost = self.first = self._cost(x)
        self.steps = 0
        self._nearly: tuple[float, Array | None] = (np.inf, None)
        self._last: Array | None = None

    def run(self, iterations: int, on_step: Callable[[int], None]) -> bool:
        """Minimize, again from every result that is better by more than the tolerance.

        Returns:
            Whether it was not interrupted; the best of what was found is kept in any case.
        """
        try:
            before = np.inf
            while self.steps < iterations and self.cost <= before - _TOLERANCE:
                before = self.cost
                self._minimize(iterations - self.steps, on_step)
                self._settle()
            on_step(iterations)
        except KeyboardInterrupt:
            self._settle()
            return False
        return True

    def _cost(self, x: Array) -> float:
        return float(self._problem.cost(x[None])[0])

    def _settle(self) -> None:
        """Scale last and best iterate to the limits, and keep the better if it is better yet."""
        for x in (self._nearly[1], self._last):
            if x is None or self._cost(x) > self.cost:
                continue
            x = self._problem.scaled(x, SAFE, _GROWTH)
            if (cost := self._cost(x)) < self.cost:
                self.x, self.cost = x, cost
        self._nearly, self._last = (np.inf, None), None

    def _minimize(self, iterations: int, on_step: Callable[[int], None]) -> None:
        def step(x: Array) -> None:
            self.steps += 1
            self._last = x.copy()
            on_step(self.steps)

        @lru_cache(maxsize=1)
        def values(at: bytes) -> Objective:
            x = np.frombuffer(at)
            score = self._problem.score(x[None])
            if score.cost[0] < self._nearly[0] and np.all(score.spare > -_NEARLY):
                self._nearly = float(score.cost[0]), x
            return score

        @lru_cache(maxsize=1)
        def slopes(at: bytes) -> Objective:
            x, here = np.frombuffer(at), values(at)
            moved = self._problem.score(x + _STEP * np.eye(len(x)))
            return Objective(
                (moved.cost - here.cost) / _STEP, ((moved.spare - here.spare) / _STEP).T
            )

        limits = self._problem.limits
        reach = np.minimum(limits.upper - limits.lower, 2.0 * np.pi)  # a whole range, or a turn
        bounds = np.repeat(reach, len(self.x) // len(reach))
        minimize(
            lambda x: float(values(x.tobytes()).cost[0]),
            self.x,
            jac=lambda x: slopes(x.tobytes()).cost,
            method='SLSQP',
            bounds=list(zip(-bounds, bounds, strict=True)),
            constraints={
                'type': 'ineq',
                'fun': lambda x: values(x.tobytes()).spare[0],
                'jac': lambda x: slopes(x.tobytes()).spare,
            },
            callback=step,
            options={'maxiter': iterations, 'ftol': _TOLERANCE},
        )
