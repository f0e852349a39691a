"""What the demonstration found out, as plain data, and what it aims at."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..estimation.unknowns.minimal import minimal_set
from ..identification.estimate import Estimate
from ..model.robot import Robot
from ..types import Array

AIM_AAM_PERCENT = 1.0  # error of the wheel momentum
AIM_RATIO = 50.0  # tracking error without by that with the estimate
AIM_DRIFT = 1e-10  # relative, of angular momentum: rounding over a run


@dataclass(frozen=True, slots=True, eq=False)
class DemoRun:
    """One simulated run.

    Args:
        time: (N,) [s].
        error: (N, n) reference minus true joint position [rad].
        ledger_time: (M,) [s].
        angular: (M, 3) angular momentum in the inertial frame [N m s].
        drift: (M,) relative drift of it.
        energy_drift: (M,) energy that no work accounts for [J].
        estimates: The estimates that were published.
    """

    time: Array
    error: Array
    ledger_time: Array
    angular: Array
    drift: Array
    energy_drift: Array
    estimates: tuple[Estimate, ...] = ()

    def until(self, end: float) -> DemoRun:
        """The run up to a time [s], without estimates."""
        inside, entered = self.time <= end, self.ledger_time <= end
        return DemoRun(
            time=self.time[inside],
            error=self.error[inside],
            ledger_time=self.ledger_time[entered],
            angular=self.angular[entered],
            drift=self.drift[entered],
            energy_drift=self.energy_drift[entered],
        )

    @property
    def max_error_deg(self) -> float:
        """Largest joint error of the run [deg]."""
        return float(np.degrees(np.abs(self.error).max()))


@dataclass(frozen=True, slots=True, eq=False)
class DemoResults:
    """All runs of the demonstration.

    Args:
        robot: Name of the robot.
        joints: Names of its joints.
        seed: Seed of the sensor noise.
        identification: Run that excites and identifies.
        no_aam: Its first pass: tracking that knows nothing of the wheels.
        identified: Tracking with the identified robot.
        truth: (3 n_links + k,) wheel momentum of the captured body [N m s] and minimal parameters
            that the simulation was made with.
        bags: Folders of the recorded bags, the identification's first.
        wall: Wall time of everything [s].
    """

    robot: str
    joints: tuple[str, ...]
    seed: int
    identification: DemoRun
    no_aam: DemoRun
    identified: DemoRun
    truth: Array
    bags: tuple[str, ...]
    wall: float

    @property
    def estimate(self) -> Estimate:
        """The last estimate."""
        return self.identification.estimates[-1]

    @property
    def aam_error_percent(self) -> float:
        """Largest error of a component of the wheel momentum, in percent of its link's."""
        truth = self.truth[: len(self.estimate.aam)]
        return float(np.abs(momentum_percent(self.estimate.aam - truth, truth)).max())

    @property
    def parameter_error_percent(self) -> float:
        """Largest error of a minimal parameter, in percent of the largest one of its unit."""
        truth, units = self.truth[len(self.estimate.aam) :], np.array(self.estimate.units)
        error = np.abs(self.estimate.parameters - truth)
        of_unit = [units == unit for unit in dict.fromkeys(units)]
        return float(100.0 * max(error[own].max() / np.abs(truth[own]).max() for own in of_unit))

    @property
    def answer(self) -> str:
        """What was found and what it is good for, in a sentence."""
        truth = self.truth[: len(self.estimate.aam)].reshape(-1, 3)
        held = ' and '.join(f'{size:.1f}' for size in np.linalg.norm(truth, axis=1))
        return (
            f'The captured wheels hold {held} N m s, found within {self.aam_error_percent:.1g} %; '
            f'tracking error {self.no_aam.max_error_deg:.2g} deg without them, '
            f'{self.identified.max_error_deg:.2g} deg with them.'
        )

    @property
    def momentum_drift(self) -> float:
        """Largest relative drift of the angular momentum in any run."""
        return float(max(run.drift.max() for run in (self.identification, self.identified)))

    @property
    def ratio(self) -> float:
        """Largest joint error without knowledge of the wheels, by that with it."""
        return self.no_aam.max_error_deg / self.identified.max_error_deg

    @property
    def reached(self) -> bool:
        """Whether the demonstration shows what it promises."""
        is_known = self.estimate.valid and self.aam_error_percent < AIM_AAM_PERCENT
        return is_known and self.ratio > AIM_RATIO and self.momentum_drift < AIM_DRIFT

    def summary(self) -> dict[str, Any]:
        """The content of summary.json."""
        count = len(self.estimate.aam)
        return {
            'aam': {
                'value': self.estimate.aam.tolist(),
                'std': self.estimate.std[:count].tolist(),
                'truth': self.truth[:count].tolist(),
                'max_error_percent': self.aam_error_percent,
            },
            'parameters': {'max_error_percent': self.parameter_error_percent},
            'tracking_max_deg': {
                'no_aam': self.no_aam.max_error_deg,
                'identified': self.identified.max_error_deg,
            },
            'momentum_drift_relative': self.momentum_drift,
            'bag': self.bags[0],
            'wall_s': self.wall,
        }


def truth_of(robot: Robot, plant: Robot, structure: str) -> Array:
    """(3 n_links + k,) what an identification of `plant` should find.

    Args:
        robot: The robot of the model, which gives the minimal set.
        plant: The true robot.
        structure: `identifier.structure`.
    """
    free = robot.with_free_rotors(np.zeros(len(robot.rotors)))
    change = (plant.inertial_parameters - free.inertial_parameters)[: len(robot.bodies)]
    source = robot.with_inertial_parameters(robot.inertial_parameters + change)
    parameters = minimal_set(robot, structure).of_robot(source)
    return np.concatenate([plant.target_momentum, parameters])


def momentum_percent(error: Array, truth: Array) -> Array:
    """(..., 3 n_links) errors of wheel momenta, in percent of the momentum of the link.

    Args:
        error: (..., 3 n_links) [N m s].
        truth: (3 n_links,) momenta; where a link has none, that of all links counts.
    """
    sizes = np.linalg.norm(truth.reshape(-1, 3), axis=1)
    sizes[sizes == 0.0] = np.linalg.norm(truth)
    return 100.0 * error / np.repeat(sizes, 3)
