"""Every effect at every place as columns: the hypotheses that compete for a cause."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..effects.effect import Effect, Key
from ..effects.parameter import Parameter
from ..effects.prior import Prior
from ..model.robot import Robot
from ..types import Array
from .filters.torque_process import TorqueDriven
from .possible import is_possible
from .rows import MotionModel, Rows
from .scaling import PROPORTIONAL, bounds_of, origin_of, value_of
from .spectral_search import propose, searched
from .trajectory.sampled_motion import misreading
from .unknowns.response import Response

STEPS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)
"""Of a parameter's plausible size: where its column is taken; the first that is possible."""


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """One effect at one place, linear in K coefficients.

    Args:
        kind: Catalogue entry.
        where: Its place.
        variant: Values of the parameters that it is not linear in.
        directions: K sets of parameter values a small step from doing nothing.
        steps: (K,) that step. sizes: (K,) plausible size of each coefficient.
        lower: (K,) bounds of the coefficients. upper: (K,).
        trials: Number of variants that were looked at.
        parameters: Those of the effect that this robot's motion tells.
        recordings: See `Effect.recordings`.
        prior: On an arm; its sizes are of that.
    """

    kind: type[Effect]
    where: str | None
    variant: Mapping[str, float]
    directions: tuple[Mapping[str, float], ...]
    steps: Array
    sizes: Array
    lower: Array
    upper: Array
    trials: int = 1
    parameters: tuple[Parameter, ...] = ()
    recordings: tuple[int, ...] | None = None
    prior: Prior | None = None

    @property
    def key(self) -> Key:
        """Effect and place."""
        return self.kind.id, self.where

    def repeats(self, others: Iterable[Effect | Candidate]) -> bool:
        """Whether it is a special case of some effect at its place, or one is of it."""
        kinds = self._kinds_here(others)
        return any(k.id in self.kind.refines or self.kind.id in k.refines for k in kinds)

    def contradicts(self, others: Iterable[Effect | Candidate]) -> bool:
        """Whether it is one of some effects at its place, or can not act there beside one."""
        return any(
            kind is self.kind or kind.id in self.kind.excludes or self.kind.id in kind.excludes
            for kind in self._kinds_here(others)
        )

    def _kinds_here(self, others: Iterable[Effect | Candidate]) -> list[type[Effect]]:
        return [
            other.kind if isinstance(other, Candidate) else type(other)
            for other in others
            if (other.where, other.recordings) == (self.where, self.recordings)
        ]

    @property
    def small_steps(self) -> list[tuple[Effect, float]]:
        """K effects a small step from doing nothing, with that step."""
        steps = zip(self.directions, self.steps.tolist(), strict=True)
        return [(self.applied(direction), step) for direction, step in steps]

    def values(self, coefficients: Array) -> dict[str, float]:
        """Parameter values that coefficients (K,) stand for."""
        values = {**self.kind.nominal(), **self.variant}
        used = 0
        for parameter, phase in _linear_parameters(self.parameters):
            first = float(coefficients[used])
            if phase is not None:
                second = float(coefficients[used + 1])
                values[parameter.name] = math.hypot(first, second)
                values[phase.name] = math.atan2(second, first)
            else:
                least = values.get(parameter.beyond, 0.0)
                values[parameter.name] = value_of(parameter, first + origin_of(parameter) + least)
            used += 1 if phase is None else 2
        return values

    def with_prior(self, prior: Prior) -> Candidate:
        """The same with a prior."""
        return replace(self, prior=prior, sizes=prior.sizes)

    def applied(self, values: Mapping[str, float]) -> Effect:
        """The effect with given values."""
        name = self.kind.id if self.where is None else f'{self.kind.id}_{self.where}'
        return self.kind(
            name=name, where=self.where, values=dict(values), recordings=self.recordings
        )


def candidates(
    kinds: Iterable[type[Effect]],
    rows: Rows,
    ringing: tuple[float, ...] = (),
) -> list[Candidate]:
    """Every variant of every effect at every place where this robot can show it.

    Args:
        kinds: Catalogue entries.
        rows: The model's, for what only the data can propose.
        ringing: Frequencies that stand out in them [rad/s]: guesses for what swings by itself.
    """
    robot = rows.robot
    wanted = rows.force_correlation(rows.data)
    return [
        candidate
        for kind in kinds
        if kind.is_fitted and (robot.is_free or not kind.needs_free_base)
        for where in kind.fitted_places(robot)
        for variant, trials in _variants(kind, where, rows, wanted, ringing)
        if (candidate := candidate_at(kind, robot, where, variant, trials)) is not None
    ]


def _variants(
    kind: type[Effect],
    where: str | None,
    rows: Rows,
    wanted: Array,
    ringing: tuple[float, ...],
) -> list[tuple[dict[str, float], int]]:
    """Values of what an effect is not linear in, with the number of values looked at."""
    parameter = searched(kind)
    if parameter is not None:
        values, looked_at = propose(kind, where, rows.motion, wanted)
        return [({parameter.name: value}, looked_at) for value in values]
    variants = kind.variants(rows.robot, where)
    if kind.hidden and variants and 'frequency' in variants[0]:
        others = {tuple((v | {'frequency': 0.0}).items()): v for v in variants}.values()
        variants += tuple(v | {'frequency': f} for f in ringing for v in others)
    return [(variant, 1) for variant in variants]


def candidate_at(
    kind: type[Effect],
    robot: Robot,
    where: str | None,
    variant: Mapping[str, float],
    trials: int = 1,
) -> Candidate | None:
    """The effect with steps so small that bodies stay bodies; None where there are none."""
    for share in STEPS:
        candidate = _candidate(kind, robot, where, variant, trials, share)
        if all(is_possible(candidate.applied(d), robot) for d in candidate.directions):
            return candidate
    return None


def _candidate(
    kind: type[Effect],
    robot: Robot,
    where: str | None,
    variant: Mapping[str, float],
    trials: int,
    share: float,
) -> Candidate:
    still, parameters = {**kind.nominal(), **variant}, kind.parameters_at(robot, where)
    directions, steps, sizes, lower, upper = [], [], [], [], []
    for parameter, phase in _linear_parameters(parameters):
        size = parameter.size if math.isfinite(parameter.size) else 1.0
        step = share * size
        value = value_of(parameter, origin_of(parameter) + step)
        for turn in (None,) if phase is None else (0.0, 0.5 * math.pi):
            direction = {**still, parameter.name: value}
            direction |= {p.name: value for p in kind.parameters if p.beyond == parameter.name}
            if phase is not None and turn is not None:
                direction[phase.name] = turn
            directions.append(direction)
            steps.append(step)
            sizes.append(size)
            low, high = bounds_of(parameter) if phase is None else (-math.inf, math.inf)
            lower.append(low)
            upper.append(high)
    return Candidate(
        kind,
        where,
        variant,
        tuple(directions),
        np.array(steps),
        np.array(sizes),
        np.array(lower),
        np.array(upper),
        trials,
        tuple(parameters),
    )


def _linear_parameters(
    parameters: Sequence[Parameter],
) -> list[tuple[Parameter, Parameter | None]]:
    """Parameters with columns, each with the phase that makes a pair of it."""
    phases = [p for p in parameters if p.role == 'phase']
    linear = [p for p in parameters if p.role in PROPORTIONAL]
    phase = phases[0] if phases else None
    return [(p, phase if i == 0 else None) for i, p in enumerate(linear)]


class Signatures:
    """Columns of effects about one model.

    Args:
        rows: The model's rows.
    """

    def __init__(self, rows: MotionModel) -> None:
        self._rows = rows
        self._response = Response(rows.robot, rows.motion)

    def whitened(self, directions: Sequence[tuple[Effect, float]]) -> Array:
        """(R, K) rows by each direction's coefficient.

        Args:
            directions: Effects a small step from doing nothing, with that step.
        """
        forces = [
            (self._response.force(applied) + self._effort_error(applied)) / step
            for applied, step in directions
        ]
        measured = {}
        if any(_is_sensor(applied) for applied, _ in directions):
            for channel in self._rows.samples():
                columns = [self._sensed(channel, applied) / step for applied, step in directions]
                measured[channel] = np.stack(columns, axis=2)
        return self._rows.whitened(np.stack(forces, axis=2), measured)

    def between(
        self,
        run_robot: Robot,
        effects: Sequence[Effect],
        neighbours: Sequence[tuple[int, Effect, float]],
    ) -> Array:
        """(R, P) rows when one of the model's effects moves to a neighbour.

        Args:
            run_robot: The robot before any effect.
            effects: All effects of the model.
            neighbours: Index of the effect, what it becomes, by how far.
        """
        here = self._needed(run_robot, effects)
        forces: list[Array] = []
        measured: dict[str, list[Array]] = {}
        if any(_is_sensor(moved) for _, moved, _ in neighbours):
            measured = {channel: [] for channel in self._rows.samples()}
        for i, moved, step in neighbours:
            changed = [*effects[:i], moved, *effects[i + 1 :]]
            force = self._needed(run_robot, changed) - here
            force += self._effort_error(moved) - self._effort_error(effects[i])
            forces.append(force / step)
            for channel, columns in measured.items():
                change = self._sensed(channel, moved) - self._sensed(channel, effects[i])
                columns.append(change / step)
        return self._rows.whitened(
            np.stack(forces, axis=2),
            {channel: np.stack(columns, axis=2) for channel, columns in measured.items()},
        )

    def _needed(self, robot: Robot, effects: Sequence[Effect]) -> Array:
        """(N, 6 + n) force of the effects less what the changed robot needs for the motion."""
        process = TorqueDriven(robot, effects)
        motion = self._rows.motion.of(process.robot)
        return process.forces(motion) - process.needed(motion)

    def _effort_error(self, applied: Effect) -> Array:
        """(N, 6 + n) true motor torque less what is measured."""
        motion = self._rows.motion
        force = motion.zeros()
        force[:, 6:] = motion.effort - applied.sense('joint_effort', motion.effort, motion)
        late: float | Array = applied.delay('effort')
        if not self._rows.is_held:
            late = late + applied.joint_delays(motion.robot) + applied.delay('joints')
        if np.any(late):
            force[:, 6:] += late * self._rows.effort_rate
        if motion.unpowered is not None:
            force[:, 6:][motion.unpowered] = 0.0
        return force

    def _sensed(self, channel: str, applied: Effect) -> Array:
        """(samples, width) by which a channel reads more than the truth."""
        return misreading(applied, channel, *self._rows.samples()[channel])


def _is_sensor(applied: Effect) -> bool:
    """Whether an effect changes what any sensor says."""
    return any(applied.acts(action) for action in ('sense', 'delay', 'joint_delays'))
