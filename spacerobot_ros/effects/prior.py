"""How large an effect may be on a machine where it is a cause, and what any machine has of it.

Both are in the machine's own units: torques by the rms that it needs, masses by its own. The
figures, on the classes of the effects, are those of measured arms, tried on simulated ones with a
coloured leftover (docs/real_machines.md): wider tolerances hide more causes than they save false
names.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..model.uncertainty import BodyUncertainty
from ..types import Array

RUN_TO_RUN = 0.05
"""Of a friction: by so much it differs from run to run of one machine, which a single recording
can not show (docs/real_machines.md)."""
BY_DIRECTION = RUN_TO_RUN / math.sqrt(2.0)
"""Of a friction: half of the difference between its directions, each of which differs by that."""
REFINED = -4.0
"""Log odds of a law that is finer than a straight one of its joint, whose place it takes for
what is left of any kind at turns, where nothing is as it is thought."""
UNTOUCHED = 0.025
"""Of a plausible size: by so much a machine that nobody touched differs between two recordings, in
what is not its friction: 0.75 % of its torques, half a milliradian of its encoders."""
INSIDE = -12.0
"""Log odds, beyond those of a load, that another body than the last link changed: nobody opens an
arm between two recordings. Fewer joints see such a body, so that its evidence pays for fewer of
its ten numbers: on 4 s of motion by up to 14 nats."""
NOTHING = 1e-4
"""Of a size: next to nothing, and still a number."""


@dataclass(frozen=True, slots=True, eq=False)
class Prior:
    """Of the k coefficients of an effect, about zero.

    Args:
        slab: Where it is a cause: (k,) standard deviations, or (k, k) covariance.
        spike: Where it is none, the same; zeros where it is then not there.
        log_odds: Of its being a cause, beyond those of any effect [nats]: below zero for what a
            smooth leftover that nobody knows looks like most.
    """

    slab: Array
    spike: Array
    log_odds: float = 0.0

    @property
    def sizes(self) -> Array:
        """(k,) standard deviations of a cause."""
        return _deviations(self.slab)

    @property
    def tolerances(self) -> Array:
        """(k,) those of what is none; next to nothing where it is not there."""
        return np.maximum(_deviations(self.spike), NOTHING * self.sizes)


def _deviations(prior: Array) -> Array:
    return np.sqrt(np.diag(prior)) if prior.ndim > 1 else prior


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyScale:
    """Magnitudes of a link.

    Args:
        row: (10,) its inertial parameters in the file.
        uncertainty: Of these; None: it is right, a load apart.
        whole: Mass of all that moves [kg].
        length: Longest distance from one joint to the next [m].
        is_last: Whether nothing hangs on it.
        is_lone: Whether it is all that moves.
    """

    row: Array
    uncertainty: BodyUncertainty | None
    whole: float
    length: float
    is_last: bool
    is_lone: bool


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Scale:
    """Magnitudes of a machine and its recordings at a place; of joints where it is one.

    Args:
        sizes: (k,) of the effect's coefficients, as its parameters state them.
        interval: Longest sample interval [s].
        gravity: (3,) [m/s^2].
        torque: Rms of the measured torque where the joint moves [N m].
        needed: The same, or the rms that the model needs there if that is more [N m].
        rate: Rms [rad/s]. acceleration: Rms [rad/s^2]. range: Of its angle [rad].
        has_angle: Whether its angle is measured, not its rate alone.
        inertia: Largest that it turns [kg m^2].
        unit: Torque of an ampere of its motor [N m].
        gain: Share by which the scale of its measured torques is uncertain.
        dry: Coulomb friction in the file [N m]. viscous: Viscous one [N m s/rad].
        body: Of a link.
    """

    sizes: Array
    interval: float
    gravity: Array
    torque: float = 0.0
    needed: float = 0.0
    rate: float = 1.0
    acceleration: float = 1.0
    range: float = 1.0
    has_angle: bool = True
    inertia: float = 0.0
    unit: float = 1.0
    gain: float = 0.0
    dry: float = 0.0
    viscous: float = 0.0
    body: BodyScale | None = None

    def alike(
        self, slab: float | Array, spike: float | Array = 0.0, log_odds: float = 0.0
    ) -> Prior:
        """A prior with one number, or (k,), for all coefficients."""
        ones = np.ones(len(self.sizes))
        return Prior(slab * ones, spike * ones, log_odds)
