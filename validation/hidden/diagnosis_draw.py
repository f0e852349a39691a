"""Random effects of a stated strength: so many times what a record of that motion can show.

The detection limit of a direction of parameters is where its likelihood gain is `LIMIT` on
average: size^2 |column|^2 = LIMIT, with the whitened column of the clean record.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from spacerobot_ros.effects.catalogue import CATALOGUE
from spacerobot_ros.effects.effect import Effect, Key
from spacerobot_ros.errors import ConfigurationError
from spacerobot_ros.estimation.fit import Fit
from spacerobot_ros.estimation.possible import is_physical
from spacerobot_ros.estimation.scaling import (
    PROPORTIONAL,
    coordinate_of,
    origin_of,
    size_of,
    value_of,
)
from spacerobot_ros.model.robot import Robot
from spacerobot_ros.types import Array

LIMIT = 30.0
"""Twice the gain in log likelihood at the detection limit."""
_STEPS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # of a plausible size, where the column is taken
_HALVINGS = 20
_GEAR_DAMPING = (10.0, 50.0)  # N m s/rad
_REACH = 0.3  # m, of a payload's place
_FASTEST = 40.0  # largest harmonic or frequency [rad/s] that is drawn
_DRAWS = 50  # of proportions, until they contradict neither each other nor the robot
_DOUBLINGS = 20
_FASTEST_STATE = 1e3  # rad/s: what is stiffer at its limit is drawn softer, to be simulated at all
_UNSEEN = 1e3  # plausible sizes at the limit: what needs more is not seen at all


@dataclass(frozen=True, slots=True)
class Direction:
    """Effects of one kind at one place that differ in strength.

    Args:
        kind: Catalogue entry.
        where: Its place.
        rest: Values of what the strength does not change.
        sizes: Coordinate of every other parameter at strength one, about no effect.
    """

    kind: type[Effect]
    where: str | None
    rest: Mapping[str, float]
    sizes: Mapping[str, float]

    def applied(self, strength: float) -> Effect:
        """The effect, its values within their bounds."""
        values = dict(self.rest)
        for p in self.kind.parameters:
            if p.name in self.sizes:
                values[p.name] = value_of(p, origin_of(p) + strength * self.sizes[p.name])
        return self.kind(name='hidden', where=self.where, values=values)

    def reaches(self, strength: float, robot: Robot) -> bool:
        """Whether bounds and bodies leave room for so much."""
        applied = self.applied(strength)
        return _is_sound(applied, robot) and all(
            math.isclose(
                coordinate_of(p, applied.values[p.name]),
                origin_of(p) + strength * self.sizes[p.name],
                rel_tol=1e-6,
                abs_tol=1e-12,
            )
            for p in self.kind.parameters
            if p.name in self.sizes
        )


def places(robot: Robot) -> list[Key]:
    """Every effect that the diagnosis looks for, at every place."""
    return [
        (effect.id, where)
        for effect in CATALOGUE.values()
        if effect.is_fitted and (robot.is_free or not effect.needs_free_base)
        for where in effect.fitted_places(robot)
    ]


def drawn(
    clean: Fit, effect_id: str, where: str | None, multiple: float, rng: np.random.Generator
) -> tuple[Effect, float]:
    """An effect at a place, of a strength by what the motion can show.

    Args:
        clean: The model on a clean record of the motion.
        effect_id: Id in the catalogue.
        where: Its place.
        multiple: Strength wanted, by the detection limit.
        rng: Draws direction, phases and frequencies.

    Returns:
        The effect, and its strength by the detection limit: less where bounds leave no more, more
        where a gear would be too stiff to be simulated, 0 where the robot does not show it.
    """
    robot = clean.run.robot
    for _ in range(_DRAWS):
        direction = _direction(CATALOGUE[effect_id], robot, where, rng)
        step = next((s for s in _STEPS if direction.reaches(s, robot)), None)
        if step is not None:
            break
    else:
        return direction.applied(0.0), 0.0
    column = clean.signatures.whitened([(direction.applied(step), step)])[:, 0]
    limit = math.sqrt(LIMIT) / max(float(np.linalg.norm(column)), 1e-12)
    if limit > _UNSEEN:
        return direction.applied(0.0), 0.0
    shares = (0.5**k for k in range(_HALVINGS))
    share = next((s for s in shares if direction.reaches(s * multiple * limit, robot)), 0.0)
    share *= _softening(direction, share * multiple * limit, robot)
    return direction.applied(share * multiple * limit), share * multiple


def _softening(direction: Direction, strength: float, robot: Robot) -> float:
    """By how much more of an effect of its own states moves slowly enough; 1 where none does."""
    if not direction.kind.hidden or not strength:
        return 1.0
    for share in (2.0**k for k in range(_DOUBLINGS)):
        if not direction.reaches(share * strength, robot):
            break
        if direction.applied(share * strength).fastest(robot) <= _FASTEST_STATE:
            return share
    return 1.0


def _is_sound(applied: Effect, robot: Robot) -> bool:
    """Whether values contradict neither each other nor the robot."""
    try:
        applied.check(robot)
    except ConfigurationError:
        return False
    return is_physical([applied], robot)


def _direction(
    kind: type[Effect], robot: Robot, where: str | None, rng: np.random.Generator
) -> Direction:
    """Random proportions of the parameters, phases and frequencies."""
    rest = {**kind.nominal(), **rng.choice(np.array(kind.variants(robot, where), dtype=object))}
    sizes = {}
    for p in kind.parameters:
        if p.role in PROPORTIONAL:
            amount = float(rng.standard_normal()) * size_of(p)
            one_sided = p.role != 'linear' or max(p.minimum, p.above) >= p.nominal
            sizes[p.name] = abs(amount) if one_sided else amount
        elif p.role == 'phase':
            rest[p.name] = float(rng.uniform(-math.pi, math.pi))
        elif min(p.guesses, default=0.0) > 0.0 and len(p.guesses) > 1:
            low, high = math.log(min(p.guesses)), math.log(min(max(p.guesses), _FASTEST))
            rest[p.name] = math.exp(rng.uniform(low, high))
    if kind.id == 'inertial_parameters':
        sizes = _payload(rng)
    if kind.id == 'joint_flexibility':  # without losses its rotor would ring for minutes
        del sizes['damping']
        rest['damping'] = float(rng.uniform(*_GEAR_DAMPING))
    return Direction(kind, where, rest, sizes)


def _payload(rng: np.random.Generator) -> dict[str, float]:
    """A kilogram at one point."""
    names = (p.name for p in CATALOGUE['inertial_parameters'].parameters)
    return dict(zip(names, point_mass(rng, _REACH).tolist(), strict=True))


def point_mass(rng: np.random.Generator, reach: float) -> Array:
    """(10,) a kilogram at a point: mass, first moment, inertia about the body's origin.

    Args:
        rng: Draws its place.
        reach: Standard deviation of that along each axis [m].
    """
    point = pin.Inertia(1.0, rng.normal(0.0, reach, 3), np.zeros((3, 3)))
    return np.asarray(point.toDynamicParameters())
