"""The design problem of one robot file: motions to choose from, limits, what to maximise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..dynamics.state import initial_state
from ..effects.robot_file import RobotFile
from ..errors import ConfigurationError
from ..estimation.minimal import MinimalSet, minimal_set
from ..estimation.momentum_process import MomentumModel
from ..model.robot import Robot
from ..model.settings import Settings
from ..simulation.truth import true_robot
from ..types import Array
from .family import MotionFamily
from .free_base import BaseMotion, FreeBase, Start
from .information import Information, noise_density, with_typical
from .limits import Limits
from .unknowns import unknowns_of

FINE = 10  # times as many nodes for the final check of the limits
_NODES = 40  # a cycle of the highest harmonic
_SMOOTHING = 60.0  # of the maximum over time: it overstates by some log(5) / 60
_ROOM = 0.999  # of a limit that a base with resting joints may use
_AMPLE = 0.8  # the same, where the start is ours to choose


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Objective and constraints of B candidates.

    Args:
        cost: (B,) to be minimised.
        spare: (B, m) what is left of every limit, as a fraction; negative where it is broken.
    """

    cost: Array
    spare: Array


class Problem:
    """Everything that a search needs.

    Args:
        file: The robot file.

    Raises:
        ConfigurationError: fixed base, prismatic joints, lists of the wrong length, or limits
            that not even resting joints keep.
    """

    def __init__(self, file: RobotFile) -> None:
        settings = file.settings
        options = settings.excitation
        self.settings = settings
        self.robot = assumed_robot(file.robot, settings)
        self.minimal: MinimalSet = minimal_set(self.robot, settings.identifier.structure)
        self.model = MomentumModel(self.robot, self.minimal)
        self.limits = Limits.of(self.robot, options)
        self.sensors, self.unstated = with_typical(settings.sensors)
        self.unknowns = unknowns_of(self.model, settings.identifier)
        self.information = Information(
            self.model,
            noise_density(self.sensors, settings.simulator),
            self.unknowns,
        )
        nodes = max(120, _NODES * options.harmonics)
        q = initial_state(self.robot, settings.initial).q
        self.family = MotionFamily(
            options.duration, options.harmonics, q, np.linspace(0.0, options.duration, nodes + 1)
        )
        self.fine = self.family.at(np.linspace(0.0, options.duration, FINE * nodes + 1))
        self.base = FreeBase(self.robot)
        self._others = [
            FreeBase(self.robot.with_target_momentum(h))
            for h in _off_momenta(self.robot.target_momentum, options.momentum_uncertainty)
        ]
        self.start_kind, self.start = self._choose_start()

    def score(self, x: Array) -> Score:
        """Objective and smoothed limits of candidates x (B, size)."""
        motion = self.move(x, self.family)
        use = self.limits.fractions(motion)
        if self._others:
            others = [self.limits.fractions(m) for m in self._moves_otherwise(x, self.family)]
            use = np.concatenate([use, *others], axis=1)
        peak = use.max(axis=1)
        excess = np.sum(np.exp(_SMOOTHING * (use - peak[:, None])), axis=1)
        return Score(self._cost(motion), 1.0 - peak - np.log(excess) / _SMOOTHING)

    def move(self, x: Array, family: MotionFamily) -> BaseMotion:
        """Motion of candidates x (B, size) with the wheel momentum assumed."""
        return self.base.move(family.times, *family.motion(x), self.start)

    def worst_use(self, x: Array, family: MotionFamily) -> Array:
        """(B,) largest use of any limit at the family's times, all wheel momenta included."""
        motions = [self.move(x, family), *self._moves_otherwise(x, family)]
        return np.max([self.limits.fractions(m).max(axis=(1, 2)) for m in motions], axis=0)

    def all_motions(self, x: Array) -> list[BaseMotion]:
        """One candidate on the fine grid, the assumed wheel momentum first, then those off it."""
        return [self.move(x[None], self.fine), *self._moves_otherwise(x[None], self.fine)]

    def cost(self, x: Array) -> Array:
        """(B,) objective alone."""
        return self._cost(self.move(x, self.family))

    def _cost(self, motion: BaseMotion) -> Array:
        criterion = self.settings.excitation.criterion
        if criterion == 'information':
            return -self.information.gain(motion) / len(self.unknowns)
        raw, unit = condition_numbers(self.information.columns(motion), motion.R_WB)
        return np.log2(raw if criterion == 'condition' else unit)

    def _moves_otherwise(self, x: Array, family: MotionFamily) -> list[BaseMotion]:
        joints = family.motion(x)
        return [base.move(family.times, *joints, self.start) for base in self._others]

    def _choose_start(self) -> tuple[str, Start]:
        wanted = self.settings.excitation.start
        choices = (
            (('initial', _AMPLE), ('rest', _ROOM)) if wanted == 'auto' else ((wanted, _ROOM),)
        )
        for kind, room in choices:
            self.start = self._start(kind)
            still = np.zeros((1, self.family.size))
            self.resting_use = float(self.worst_use(still, self.family)[0])
            if self.resting_use <= room:
                return kind, self.start
        raise ConfigurationError(
            f'excitation.start ({kind})',
            f'even with resting joints, {self._broken()}: no motion can keep the limits',
        )

    def _start(self, kind: str) -> Start:
        initial = initial_state(self.robot, self.settings.initial)
        omega = np.zeros(3)
        if kind == 'initial':
            omega = initial.omega_WB_B
        elif kind == 'spin_up':
            h0 = self.robot.servicer_wheels.body_momentum
            omega = self.base.spun_up(initial.q, h0)
        return Start(initial.q_WB_xyzw, omega)

    def _broken(self) -> str:
        """The limit that resting joints break most."""
        motions = self.all_motions(np.zeros(self.family.size))
        uses = [use for motion in motions for use in self.limits.uses(motion)]
        use = max(uses, key=lambda u: u.fraction)
        return (
            f'{use.name} of {use.where} reaches {use.value:.4g} {use.unit} (limit {use.limit:.4g})'
        )


def assumed_robot(robot: Robot, settings: Settings) -> Robot:
    """The robot to design for: the file's truth where it states one, else what it believes.

    Wheels stay gyrostats; a plant with true rotors is taken with them locked at their first rates.
    """
    truth = true_robot(robot, settings)
    if not truth.rotor_count:
        return truth
    robot = robot.with_target_momentum(truth.target_momentum)
    return robot.with_servicer_momentum(truth.servicer_momentum)


def condition_numbers(columns: Array, R_WB: Array) -> tuple[Array, Array]:
    """(B,) condition of the paper's A (27), raw and with columns of unit norm.

    Args:
        columns: (B, T, 3, p) regressor in base axes.
        R_WB: (B, T, 3, 3).
    """
    A = R_WB @ columns[..., 3:]
    A = (A - A[:, :1])[:, 1:].reshape(len(A), -1, A.shape[-1])
    norms = np.linalg.norm(A, axis=1, keepdims=True)
    unit = A / np.where(norms > 0.0, norms, 1.0)
    return _condition(A), _condition(unit)


def _condition(A: Array) -> Array:
    singular = np.linalg.svd(A, compute_uv=False)
    return singular[:, 0] / np.maximum(singular[:, -1], 1e-15 * singular[:, 0])


def _off_momenta(momentum: Array, uncertainty: float) -> list[Array]:
    if uncertainty == 0.0:
        return []
    steps = uncertainty * np.eye(len(momentum))
    return [momentum + step for step in np.concatenate([steps, -steps])]


__all__ = ['Problem', 'Score', 'assumed_robot', 'condition_numbers']
