"""Effects fitted to a run as they will be applied: Gauss and Newton's method on its rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..effects.bodies.bodies import NAMES as INERTIAL
from ..effects.catalogue import changed_robot
from ..effects.effect import Effect
from ..errors import ConfigurationError
from ..types import Array
from .fit import Fit
from .inference.constrained import ConstrainedProblem, PhysicalBody
from .possible import is_physical
from .runs import Run
from .scaling import (
    PROPORTIONAL,
    bounds_of,
    coordinate_of,
    origin_of,
    spread_of,
    value_of,
)

PASSES = 12  # a panel of a dozen numbers takes ten from a first guess of its axis
_SETTLED = 0.02  # of a standard deviation
_HALVINGS = 3
_SECANTS = 2
_LEAST_CURVED = 1e-3  # share of a column's information below which a curvature is not trusted

Secant = tuple[Array, Array]
"""A change of all coordinates (P,), and by how much it lessened the slope (P,)."""
_DRAWS = 30


def refine(run: Run, causes: Sequence[Effect], passes: int = PASSES) -> Fit:
    """The most probable values of the causes' parameters, from the given ones.

    Args:
        run: The run.
        causes: Effects with first guesses.
        passes: Largest number of steps.
    """
    fit = Fit(run, _possible(run, causes))
    earlier: list[Secant] = []
    for _ in range(passes):
        try:
            ahead = _step(fit, earlier)
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
        if better.is_followed:
            earlier.append((better.offsets - fit.offsets, fit.slope - better.slope))
            del earlier[: max(0, len(earlier) - _SECANTS)]
        fit = better
    return _canonical(fit)


def _step(fit: Fit, earlier: Sequence[Secant]) -> list[Effect] | None:
    """The causes after one step, in the light of earlier ones; None where they have settled.

    Columns along a noisy motion hold more than what they change in the data, most of it noise
    where a link is light: by them alone the information is too large, and a step too short.
    """
    if not fit.free:
        return None
    # nothing moves farther at once than it was thought possible
    spread = np.array([spread_of(p) for _, p in fit.free])
    information = fit.gram.matrix + np.diag(spread**-2.0)
    for change, lost in earlier:
        information = _corrected(information, change, lost)
    slope = fit.slope
    change = np.asarray(np.linalg.lstsq(information, slope, rcond=1e-12)[0])
    if float(change @ information @ change) < _SETTLED**2:
        return None
    lower, upper = _room(fit)
    moved, is_inside = fit.moved(change), bool(np.all((lower < change) & (change < upper)))
    if is_inside and is_physical([*fit.run.believed, *moved], fit.run.robot):
        return moved
    problem = ConstrainedProblem(information, slope, spread, lower, upper, _bodies(fit))
    return fit.moved(problem.solve())


def _room(fit: Fit) -> tuple[Array, Array]:
    """How far every coordinate may go down and up: (P,) each."""
    bounds = np.array([bounds_of(p) for _, p in fit.free])
    lower, upper = (bounds - fit.offsets[:, None]).T
    return np.asarray(lower), np.asarray(upper)


def _bodies(fit: Fit) -> tuple[PhysicalBody, ...]:
    """Bodies that causes change, which stay bodies."""
    robot = changed_robot(fit.run.robot, [*fit.run.believed, *fit.causes])
    names = [body.name for body in robot.bodies]
    bodies = (
        PhysicalBody(
            fit.own(i),
            robot.inertial_parameters[names.index(str(c.where))],
            np.array([INERTIAL.index(fit.free[k][1].name) for k in fit.own(i)]),
        )
        for i, c in enumerate(fit.causes)
        if c.id == 'inertial_parameters'
    )
    return tuple(body for body in bodies if body.is_body)


def _corrected(information: Array, change: Array, lost: Array) -> Array:
    """A matrix that says by how much a known change lessens the slope.

    The update of Broyden, Fletcher, Goldfarb and Shanno (Nocedal and Wright, Numerical
    Optimization (2006), eq. 6.19), which stays positive definite; none where it would not.
    """
    expected = information @ change
    if not float(change @ lost) > _LEAST_CURVED * float(change @ expected):
        return information
    return np.asarray(
        information
        - np.outer(expected, expected) / float(change @ expected)
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
