"""One model of a run: its rows, their derivatives by the values, evidence and deviations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..effects.effect import Effect
from ..effects.parameter import Parameter
from ..errors import ConfigurationError
from ..inference.gram import Gram
from ..types import Array, IntArray
from .columns import STEPS, Signatures
from .inference.evidence import price
from .possible import is_possible
from .runs import Run
from .scaling import (
    PROPORTIONAL,
    coordinate_of,
    has_prior,
    origin_of,
    size_of,
    spread_of,
    value_of,
    value_std,
)


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
        squares += self.rows.spread_cost
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

    @cached_property
    def gram(self) -> Gram:
        """Sums over the rows: tangents (P) and whitened residuals."""
        return Gram.of(self.tangents, self.data)

    @property
    def precision(self) -> Array:
        """(P,) prior precision of every coordinate."""
        return np.array([1.0 / size_of(p) ** 2 if has_prior(p) else 0.0 for _, p in self.free])

    @cached_property
    def evidence(self) -> float:
        """Log evidence by Laplace's approximation, but for a constant of the run.

        Minus infinity where the model can not be followed.
        """
        if not (math.isfinite(self.misfit) and self.is_followed):
            return -math.inf
        sizes = np.array([spread_of(p) for _, p in self.free])
        scaled = sizes[:, None] * self.gram.matrix * sizes
        values = np.linalg.eigvalsh(scaled) if len(sizes) else np.zeros(0)
        return -0.5 * self.misfit - price(values, len(self.data))

    @cached_property
    def is_followed(self) -> bool:
        """Whether the model and its neighbours are robots whose motion stays finite."""
        try:
            return bool(np.all(np.isfinite(self.tangents)))
        except ConfigurationError:
            return False

    def share(self, index: int) -> Array:
        """(P,) coordinates of what a cause's entry is in proportion to; of all else none."""
        counts = [i == index and p.role in PROPORTIONAL for i, p in self.free]
        return np.where(counts, self.offsets, 0.0)

    def drifting(self, count: int) -> Gram:
        """Sums of tangents times so many cosines of the record's length, 1 the first."""
        times = self.rows.row_times
        phase = np.pi * (times - times[0]) / (times[-1] - times[0])
        columns = [self.tangents * np.cos(k * phase)[:, None] for k in range(count)]
        return Gram.of(np.concatenate(columns, axis=1), self.data)

    def covariance(self) -> Array:
        """(P, P) of the coordinates, by the level of the noise alone."""
        if not self.free:
            return np.zeros((0, 0))
        # what the data do not tell is as uncertain as it was thought possible
        weak = np.array([spread_of(p) for _, p in self.free]) ** -2.0
        return np.asarray(np.linalg.inv(self.gram.matrix + np.diag(weak)))

    def standard_deviations(self) -> list[dict[str, float]]:
        """Of every cause's parameters, in their own units, by the level of the noise alone."""
        spread = np.sqrt(np.maximum(np.diag(self.covariance()), 0.0))
        out: list[dict[str, float]] = [{} for _ in self.causes]
        for (i, p), std in zip(self.free, spread, strict=True):
            value = self.causes[i].values[p.name]
            out[i][p.name] = value_std(p, value, float(std))
        return out

    @property
    def slope(self) -> Array:
        """(P,) minus half the derivative of the misfit by every coordinate."""
        return np.asarray(self.gram.vector - self.precision * self.offsets)

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
