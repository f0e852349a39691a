"""Effects fitted to a run as they will be applied: Gauss and Newton's method on its rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..effects.bodies.bodies import NAMES as INERTIAL
from ..effects.catalogue import changed_robot
from ..effects.effect import Effect
from ..effects.parameter import Parameter
from ..errors import ConfigurationError
from ..types import Array, IntArray
from .columns import STEPS, Signatures, is_physical, is_possible
from .inference.constrained import ConstrainedProblem, PhysicalBody
from .inference.evidence import price
from .rows import blocks
from .runs import Run
from .scaling import (
    PROPORTIONAL,
    bounds_of,
    coordinate_of,
    has_prior,
    origin_of,
    size_of,
    spread_of,
    value_of,
    value_std,
)

PASSES = 12  # a panel of a dozen numbers takes ten from a first guess of its axis
_SETTLED = 0.02  # of a standard deviation
_HALVINGS = 3
_SECANTS = 2
_LEAST_CURVED = 1e-3  # share of a column's information below which a curvature is not trusted

Secant = tuple[Array, Array]
"""A change of all coordinates (P,), and by how much it lessened the slope (P,)."""
_DRAWS = 30


class Fit:
    """One model of a run: causes with values, its rows, and the derivatives by the values.

    Args:
        run: The run.
        causes: Effects beyond the robot file's.
    """

    def __init__(self, run: Run, causes: Sequence[Effect]) -> None:
        self.run = run
        self.causes = tuple(causes)
        self.rows = run.rows(self.causes)

    @cached_property
    def free(self) -> list[tuple[int, Parameter]]:
        """Every fitted number: index of its cause, parameter."""
        robot = self.run.robot
        return [(i, p) for i, c in enumerate(self.causes) for p in c.parameters_at(robot, c.where)]

    @cached_property
    def data(self) -> Array:
        """(R,) whitened residuals."""
        return self.rows.data

    @cached_property
    def misfit(self) -> float:
        """Squared whitened residuals beyond their number, and what the priors of values add.

        Twice what is lost in log posterior density. Clocks that put a sample out of the record
        win nothing by it. Errors of efforts are fitted, not integrated out: the determinant of
        the innovations' covariance would be the errors' spread as accelerations, and speak for
        whatever makes a light link heavier.
        """
        squares = float(self.data @ self.data) - len(self.data)
        return squares + float(self.offsets @ (self.precision * self.offsets))

    @property
    def offsets(self) -> Array:
        """(P,) coordinates of all fitted numbers, from no effect."""
        values = [coordinate_of(p, self.causes[i].values[p.name]) for i, p in self.free]
        return np.array(values) - np.array([origin_of(p) for _, p in self.free])

    def own(self, index: int) -> IntArray:
        """Places of a cause's numbers among all fitted ones."""
        return np.array([k for k, (i, _) in enumerate(self.free) if i == index])

    @cached_property
    def signatures(self) -> Signatures:
        """Columns of anything about this model."""
        return Signatures(self.rows)

    @cached_property
    def tangents(self) -> Array:
        """(R, P) rows by every fitted number's coordinate."""
        if not self.free:
            return np.zeros((len(self.data), 0))
        own = len(self.run.believed)
        moves = [self.neighbours(i, p) for i, p in self.free]
        return self.signatures.between(
            self.run.robot,
            (*self.run.believed, *self.causes),
            [(own + i, moved, step) for i, moved, step in moves],
        )

    @property
    def precision(self) -> Array:
        """(P,) prior precision of every coordinate."""
        return np.array([1.0 / size_of(p) ** 2 if has_prior(p) else 0.0 for _, p in self.free])

    @cached_property
    def evidence(self) -> float:
        """Log evidence by Laplace's approximation, but for a constant of the run.

        Minus infinity where the model can not be followed.
        """
        if not (math.isfinite(self.misfit) and self._is_followed):
            return -math.inf
        sizes = np.array([spread_of(p) for _, p in self.free])
        scaled = sizes[:, None] * (self.tangents.T @ self.tangents) * sizes
        values = np.linalg.eigvalsh(scaled) if len(sizes) else np.zeros(0)
        return -0.5 * self.misfit - price(values, len(self.data))

    @cached_property
    def _is_followed(self) -> bool:
        """Whether the model and its neighbours are robots whose motion stays finite."""
        try:
            return bool(np.all(np.isfinite(self.tangents)))
        except ConfigurationError:
            return False

    def changed(self, index: int) -> Array:
        """(R,) what a cause takes from the rows, by all that its entry is in proportion to."""
        moved = [k for k in self.own(index) if self.free[k][1].role in PROPORTIONAL]
        return np.asarray(self.tangents[:, moved] @ self.offsets[moved])

    def held_out(self, without: int | None = None) -> Array:
        """(R,) whitened residuals of each block of rows with the values that the others give.

        Args:
            without: A cause that is left out.
        """
        kept, out = np.arange(len(self.free)), self.data.copy()
        if without is not None:
            out += self.changed(without)
            kept = np.setdiff1d(kept, self.own(without))
        columns, precision = self.tangents[:, kept], self.precision[kept]
        information, slope = columns.T @ columns, columns.T @ out
        slope -= precision * self.offsets[kept]
        for block in blocks(self.rows.row_times) if len(kept) else ():
            part = columns[block]
            rest = information - part.T @ part + np.diag(precision)
            change = np.linalg.lstsq(rest, slope - part.T @ out[block], 1e-12)[0]
            out[block] -= part @ change
        return out

    def covariance(self) -> Array:
        """(P, P) of the coordinates, by the level of the noise alone."""
        if not self.free:
            return np.zeros((0, 0))
        # what the data do not tell is as uncertain as it was thought possible
        weak = np.array([spread_of(p) for _, p in self.free]) ** -2.0
        return np.asarray(np.linalg.inv(self.tangents.T @ self.tangents + np.diag(weak)))

    def standard_deviations(self) -> list[dict[str, float]]:
        """Of every cause's parameters, in their own units, by the level of the noise alone."""
        spread = np.sqrt(np.maximum(np.diag(self.covariance()), 0.0))
        out: list[dict[str, float]] = [{} for _ in self.causes]
        for (i, p), std in zip(self.free, spread, strict=True):
            value = self.causes[i].values[p.name]
            out[i][p.name] = value_std(p, value, float(std))
        return out

    @property
    def promised(self) -> float:
        """Misfit that the best values near these take, by the tangents."""
        return float(self.slope @ self.covariance() @ self.slope)

    @property
    def slope(self) -> Array:
        """(P,) minus half the derivative of the misfit by every coordinate."""
        return np.asarray(self.tangents.T @ self.data - self.precision * self.offsets)

    def step(self, earlier: Sequence[Secant] = ()) -> list[Effect] | None:
        """The causes after one step, in the light of earlier ones; None where they have settled.

        Columns along a noisy motion hold more than what they change in the data, most of it noise
        where a link is light: by them alone the information is too large, and a step too short.
        """
        if not self.free:
            return None
        # nothing moves farther at once than it was thought possible
        spread = np.array([spread_of(p) for _, p in self.free])
        information = self.tangents.T @ self.tangents + np.diag(spread**-2.0)
        for change, lost in earlier:
            information = _corrected(information, change, lost)
        slope = self.slope
        change = np.asarray(np.linalg.lstsq(information, slope, rcond=1e-12)[0])
        if float(change @ information @ change) < _SETTLED**2:
            return None
        moved, is_inside = self.moved(change), self._is_inside(change)
        if is_inside and is_physical([*self.run.believed, *moved], self.run.robot):
            return moved
        return self.moved(self._constrained(information, slope))

    def _is_inside(self, change: Array) -> bool:
        return all(low < x < high for x, (low, high) in zip(change, self._room, strict=True))

    @property
    def _room(self) -> list[tuple[float, float]]:
        """How far every coordinate may go down and up."""
        offsets = zip((p for _, p in self.free), self.offsets.tolist(), strict=True)
        return [(low - x, high - x) for p, x in offsets for low, high in [bounds_of(p)]]

    def _constrained(self, information: Array, slope: Array) -> Array:
        """(P,) the most probable change that leaves values within bounds, and bodies bodies."""
        robot = changed_robot(self.run.robot, [*self.run.believed, *self.causes])
        names = [body.name for body in robot.bodies]
        bodies = (
            PhysicalBody(
                self.own(i),
                robot.inertial_parameters[names.index(str(c.where))],
                np.array([INERTIAL.index(self.free[k][1].name) for k in self.own(i)]),
            )
            for i, c in enumerate(self.causes)
            if c.id == 'inertial_parameters'
        )
        lower, upper = np.array(self._room).T
        known = tuple(body for body in bodies if body.is_body)
        sizes = np.array([spread_of(p) for _, p in self.free])
        return ConstrainedProblem(information, slope, sizes, lower, upper, known).solve()

    def moved(self, change: Array) -> list[Effect]:
        """The causes with every coordinate changed, within its bounds."""
        values: list[dict[str, float]] = [dict(c.values) for c in self.causes]
        for (i, p), delta in zip(self.free, change, strict=True):
            values[i][p.name] = value_of(p, coordinate_of(p, values[i][p.name]) + float(delta))
        return [replace(c, values=v) for c, v in zip(self.causes, values, strict=True)]

    def neighbours(self, i: int, p: Parameter) -> tuple[int, Effect, float]:
        """A cause with one coordinate moved a little to where it may go, and by how much."""
        cause = self.causes[i]
        here = coordinate_of(p, cause.values[p.name])
        scale = size_of(p) if has_prior(p) or here == 0.0 else abs(here)
        moved, there = cause, here
        for step in (sign * share * scale for share in STEPS for sign in (1.0, -1.0)):
            value = value_of(p, here + step)
            moved = replace(cause, values={**cause.values, p.name: value})
            there = coordinate_of(p, value)
            others = [*self.run.believed, *self.causes[:i], moved, *self.causes[i + 1 :]]
            if there != here and is_possible(others, self.run.robot):
                break
        return i, moved, there - here


def refine(
    run: Run,
    causes: Sequence[Effect],
    passes: int = PASSES,
    is_worth: Callable[[Fit], bool] = lambda fit: True,
) -> Fit:
    """The most probable values of the causes' parameters, from the given ones.

    Args:
        run: The run.
        causes: Effects with first guesses.
        passes: Largest number of steps.
        is_worth: Whether one more step may lead to a fit that is wanted.
    """
    fit = Fit(run, _possible(run, causes))
    earlier: list[Secant] = []
    for _ in range(passes):
        try:
            if not is_worth(fit):
                break
            ahead = fit.step(earlier)
        except (ConfigurationError, np.linalg.LinAlgError):
            break  # at the edge of what is physical: no neighbour is a robot that can be followed
        if ahead is None:
            break
        better = _descend(fit, ahead)
        if better is None and earlier:
            earlier.clear()  # of a model that was too different
            continue
        if better is None:
            break
        if better._is_followed:
            earlier.append((better.offsets - fit.offsets, fit.slope - better.slope))
            del earlier[: max(0, len(earlier) - _SECANTS)]
        fit = better
    return _canonical(fit)


def _corrected(information: Array, change: Array, lost: Array) -> Array:
    """A matrix that says by how much a known change lessens the slope.

    The update of Broyden, Fletcher, Goldfarb and Shanno (Nocedal and Wright, Numerical
    Optimization (2006), eq. 6.19), which stays positive definite; none where it would not.
    """
    said = information @ change
    if not float(change @ lost) > _LEAST_CURVED * float(change @ said):
        return information
    return np.asarray(
        information
        - np.outer(said, said) / float(change @ said)
        + np.outer(lost, lost) / float(change @ lost)
    )


def _possible(run: Run, causes: Sequence[Effect]) -> Sequence[Effect]:
    """The causes, drawn towards no effect until a physical robot has them together.

    One may have taken what another had given: without that other it is too much.
    """
    for _ in range(_DRAWS):
        if is_physical([*run.believed, *causes], run.robot):
            break
        causes = [replace(c, values={**c.values, **_halved(c)}) for c in causes]
    return causes


def _halved(cause: Effect) -> dict[str, float]:
    return {
        p.name: value_of(p, 0.5 * (coordinate_of(p, cause.values[p.name]) + origin_of(p)))
        for p in cause.parameters
        if p.role in PROPORTIONAL
    }


def _canonical(fit: Fit) -> Fit:
    """The same model with its causes' values in their usual form, such as axes of unit length."""
    causes = [c.canonical() for c in fit.causes]
    if all(new.values == old.values for new, old in zip(causes, fit.causes, strict=True)):
        return fit
    return Fit(fit.run, causes)


def _descend(fit: Fit, ahead: list[Effect]) -> Fit | None:
    """The next fit along a step, shortened until it is better; None where nothing is."""
    for k in range(_HALVINGS):
        share = 0.4**k
        causes = [
            replace(new, values=_between(old, new, share))
            for old, new in zip(fit.causes, ahead, strict=True)
        ]
        try:
            trial = Fit(fit.run, causes)
            if math.isfinite(trial.misfit) and trial.misfit < fit.misfit:
                return trial
        except (ConfigurationError, np.linalg.LinAlgError):
            continue  # a step too far: no physical robot there
    return None


def _between(old: Effect, new: Effect, share: float) -> Mapping[str, float]:
    a, b = ([coordinate_of(p, e.values[p.name]) for p in old.parameters] for e in (old, new))
    moved = (x + share * (y - x) for x, y in zip(a, b, strict=True))
    return {p.name: value_of(p, x) for p, x in zip(old.parameters, moved, strict=True)}
