"""The search: sequential quadratic programming from several starting points.

Gradients are forward differences of all amplitudes at once, which costs a few times one candidate.
The smoothed limits leave a little of every limit unused and may miss a peak between two nodes, so
each result is scaled, on a finer grid, to the largest amplitude that keeps every limit. The same
seed gives the same motion to the last bit on the same machine.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from ..types import Array
from .motions import SAFE
from .problem import Objective, Problem

Progress = Callable[[int, float], None]
"""Called after every step with the number of steps done and the best cost so far."""

_STEP = 3e-5  # rad; of the forward differences: the cost is good to some 1e-10
_TOLERANCE = 2e-4  # of the cost: bits an unknown, or log2 of a condition number
_NEARLY = 1e-3  # of the limits may be missing before the final scaling
_GROWTH = 1.25  # largest factor on a result whose limits leave room


@dataclass(frozen=True, slots=True)
class Attempt:
    """One starting point.

    Args:
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


def search(problem: Problem, progress: Progress = lambda *_: None) -> Design:
    """Search from every starting point; an interrupt (Ctrl-C) ends it with the best so far.

    Raises:
        ConfigurationError: the limits leave no motion.
    """
    options = problem.settings.excitation
    best_x, best_cost = np.zeros(problem.family.size), np.inf
    attempts: list[Attempt] = []
    interrupted = False
    for index in range(options.starts):
        origin, x = problem.starting_motion(index)
        done, so_far = index * options.iterations, best_cost
        descent = _Descent(problem, x)

        def on_step(steps: int, cost: float, done: int = done, so_far: float = so_far) -> None:
            progress(done + steps, min(cost, so_far))

        try:
            descent.run(options.iterations, on_step)
        except KeyboardInterrupt:
            interrupted = True
            descent.settle()
        x, cost = descent.x, descent.cost
        attempts.append(Attempt(origin, descent.first, cost, descent.steps))
        if cost < best_cost:
            best_x, best_cost = x, cost
        if interrupted:
            break
        progress(done + options.iterations, best_cost)
    return Design(best_x, best_cost, tuple(attempts), interrupted)


class _Descent:
    """Sequential quadratic programming from one point; knows the best point that keeps the limits.

    Args:
        problem: What to minimise.
        x: (size,) point that keeps the limits.
    """

    def __init__(self, problem: Problem, x: Array) -> None:
        self._problem = problem
        self.x = x
        self.cost = self.first = float(problem.cost(x[None])[0])
        self.steps = 0
        self._reach = _reach(problem)
        self._floor = np.inf
        self._nearly: Array | None = None
        self._last: Array | None = None
        self._at: Array | None = None
        self._score: Objective | None = None
        self._slopes: tuple[Array, Array] | None = None

    def run(self, iterations: int, on_step: Progress) -> None:
        """Minimise, again from every result that is better by more than the tolerance.

        After an interrupt, `settle` makes the best of what was found.
        """
        while self.steps < iterations:
            before, self._floor = self.cost, np.inf
            self._minimise(iterations - self.steps, on_step)
            self.settle()
            if self.cost > before - _TOLERANCE:
                return

    def settle(self) -> None:
        """Scale last and best iterate to the limits, and keep the better if it is better yet."""
        found = [x for x in (self._nearly, self._last) if x is not None]
        for x in found:
            if float(self._problem.cost(x[None])[0]) > self.cost:
                continue
            x = self._problem.scaled(x, SAFE, _GROWTH)
            cost = float(self._problem.cost(x[None])[0])
            if cost < self.cost:
                self.x, self.cost = x, cost
        self._nearly = self._last = None

    def _minimise(self, iterations: int, on_step: Progress) -> None:
        def step(x: Array) -> None:
            self.steps += 1
            self._last = x.copy()
            on_step(self.steps, self.cost)

        minimize(
            lambda x: float(self._values(x).cost[0]),
            self.x,
            jac=lambda x: self._gradients(x)[0],
            method='SLSQP',
            bounds=list(zip(-self._reach, self._reach, strict=True)),
            constraints={
                'type': 'ineq',
                'fun': lambda x: self._values(x).spare[0],
                'jac': lambda x: self._gradients(x)[1],
            },
            callback=step,
            options={'maxiter': iterations, 'ftol': _TOLERANCE},
        )

    def _values(self, x: Array) -> Objective:
        if self._score is None or self._at is None or not np.array_equal(x, self._at):
            self._score, self._slopes, self._at = self._problem.score(x[None]), None, x.copy()
            cost = float(self._score.cost[0])
            if cost < self._floor and np.all(self._score.spare > -_NEARLY):
                self._nearly, self._floor = x.copy(), cost
        return self._score

    def _gradients(self, x: Array) -> tuple[Array, Array]:
        """(size,) of the cost and (m, size) of what is left of the limits."""
        here = self._values(x)
        if self._slopes is None:
            moved = self._problem.score(x + _STEP * np.eye(len(x)))
            self._slopes = (
                (moved.cost - here.cost) / _STEP,
                ((moved.spare - here.spare) / _STEP).T,
            )
        return self._slopes


def _reach(problem: Problem) -> Array:
    """(size,) amplitudes beyond which no step needs to look: a joint's whole range, or a turn."""
    whole = np.minimum(problem.limits.upper - problem.limits.lower, 2.0 * np.pi)
    return np.repeat(whole, problem.family.size // len(whole))
