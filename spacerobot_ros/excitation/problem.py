"""The design problem of one robot file: motions to choose from, limits, what to maximize."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..dynamics.state import initial_state
from ..effects.robot_file import RobotFile
from ..errors import ConfigurationError
from ..estimation.filters.momentum_process import MomentumModel
from ..estimation.trajectory.base_response import BaseMotion, BaseResponse, BaseStart
from ..estimation.trajectory.motion_limits import Use
from ..estimation.unknowns.minimal import minimal_regressor, minimal_set
from ..identification.information import Information, with_typical
from ..model.robot import Robot
from ..model.settings import Settings
from ..simulation.truth import true_robot
from ..types import Array
from .motions import SAFE, Chosen, Motions

FINE = 10  # times as many nodes for the final check of the limits
_SMOOTHING = 60.0  # of the maximum over time: it overstates by some log(5) / 60
_ROOM = 0.999  # of a limit that a base with resting joints may use
_AMPLE = 0.8  # the same, where the start is ours to choose
_WORST = 1e15  # condition number; beyond, it says no more
_FIRST_USE = 0.6  # of the limits, by a random starting motion


class Objective(NamedTuple):
    """Objective and constraints of B candidates.

    Attributes:
        cost: (B,) to be minimized.
        spare: (B, m) what is left of every limit, as a fraction; negative where it is broken.
    """

    cost: Array
    spare: Array


class Problem(Motions):
    """Everything that a search needs.

    Args:
        file: The robot file.

    Attributes:
        believed: The robot that the identifier starts from, own wheels as assumed.
        model: Its unknowns. constants: (p,) the robot assumed, total momentum zero.
        noise: Of the sensors. unstated: Which of it is typical.
        start_kind: How the base starts.

    Raises:
        ConfigurationError: fixed base, lists of the wrong length, or limits that not even resting
            joints keep.
    """

    def __init__(self, file: RobotFile) -> None:
        settings = file.settings
        options, identifier = settings.excitation, settings.identifier
        robot = assumed_robot(file.robot, settings)
        momentum = robot.target_momentum
        off = options.momentum_uncertainty * np.eye(len(momentum))
        momenta = [momentum + step for step in (*off, *-off) if step.any()]
        others = [robot.with_target_momentum(h) for h in momenta]
        super().__init__(robot, settings, options.duration, fine=FINE, others=others)
        self.believed = file.believed
        if np.any(robot.servicer_momentum != self.believed.servicer_momentum):
            self.believed = self.believed.with_servicer_momentum(robot.servicer_momentum)
        self.model = MomentumModel(self.believed, identifier.structure, identifier.nuisances)
        self.constants = self.model.prior()
        self.constants[self.model.aam] = robot.target_momentum
        self.constants[self.model.y] = self.model.bodies.coordinates(robot)
        self.noise, self.unstated = with_typical(settings.sensors)
        self.information = Information(
            self.model, self.constants, self.noise, settings.simulator, identifier
        )
        self.start_kind, self.start = self._choose_start()

    def score(self, x: Array) -> Objective:
        """Objective and smoothed limits of candidates x (B, size)."""
        motions = self.moves(x, self.family)
        use = np.concatenate([self.limits.fractions(motion) for motion in motions], axis=1)
        peak = use.max(axis=1)
        excess = np.sum(np.exp(_SMOOTHING * (use - peak[:, None])), axis=1)
        return Objective(self._cost(motions[0]), 1.0 - peak - np.log(excess) / _SMOOTHING)

    def cost(self, x: Array) -> Array:
        """(B,) objective alone."""
        return self._cost(self.move(x, self.family))

    def starting_motion(self, index: int) -> tuple[str, Array]:
        """The robot file's own motion first, if it has one; then random ones, seeded by the index.

        Returns:
            Where it comes from, and amplitudes (size,) that keep the limits.

        Raises:
            ConfigurationError: the limits leave no motion.
        """
        if index == 0 and (own := self.own()) is not None:
            return 'robot file', own
        rng = np.random.default_rng((self.settings.excitation.seed, index))
        return 'random', self.random(rng, max(_FIRST_USE, 0.5 * (self.resting_use + SAFE)))

    def uses(self, chosen: Chosen) -> tuple[Use, ...]:
        """Of every limit the hardest use by one motion, whichever wheels the robot has."""
        nodes = len(self.fine.times)
        family = chosen.family.at(np.linspace(0.0, chosen.family.duration, nodes))
        motions = self.moves(chosen.x[None], family, chosen.start)
        every = zip(*(self.limits.uses(motion) for motion in motions), strict=True)
        return tuple(max(same, key=lambda use: (use.fraction, abs(use.value))) for same in every)

    def _cost(self, motion: BaseMotion) -> Array:
        """(B,) to be minimized; of `information` the mean of bits, wheels and whole alike."""
        criterion = self.settings.excitation.criterion
        if criterion == 'information':
            whole, aam = self.information.bits(motion)
            return -whole / len(self.information.prior_std) - aam / max(self.model.n_aam, 1)
        raw, unit = condition_numbers(self.model, motion)
        return np.log2(raw if criterion == 'condition' else unit)

    def _choose_start(self) -> tuple[str, BaseStart]:
        wanted = self.settings.excitation.start
        choices = (
            (('initial', _AMPLE), ('rest', _ROOM)) if wanted == 'auto' else ((wanted, _ROOM),)
        )
        still = np.zeros(self.family.size)
        for kind, room in choices:
            self.start = self._start(kind)
            self.resting_use = float(self.worst_use(still[None], self.family)[0])
            if self.resting_use <= room:
                return kind, self.start
        uses = self.uses(Chosen(self.family, still, self.start))
        use = max(uses, key=lambda u: u.fraction)
        broken = f'{use.name} of {use.where} reaches {use.value:.4g} {use.unit}'
        raise ConfigurationError(
            f'excitation.start ({kind})',
            f'even with resting joints, {broken} (limit {use.limit:.4g}): no motion can keep the '
            'limits',
        )

    def _start(self, kind: str) -> BaseStart:
        initial = initial_state(self.robot, self.settings.initial)
        omega = np.zeros(3)
        if kind == 'initial':
            omega = initial.omega_WB_B
        elif kind == 'spin_up':
            h0 = self.robot.servicer_wheels.body_momentum
            omega = BaseResponse(self.robot).spun_up(initial.q, h0)
        return BaseStart(initial.q_WB_xyzw, omega)


def assumed_robot(robot: Robot, settings: Settings) -> Robot:
    """The robot to design for: the file's truth where it states one, else what it believes.

    Wheels stay gyrostats; a plant with true rotors is taken with them locked at their first rates.
    """
    truth = true_robot(robot, settings)
    if not truth.rotor_count:
        return truth
    robot = robot.with_target_momentum(truth.target_momentum)
    return robot.with_servicer_momentum(truth.servicer_momentum)


def condition_numbers(model: MomentumModel, motion: BaseMotion) -> tuple[Array, Array]:
    """(B,) condition of the paper's A (27), raw and with columns of unit norm.

    A has the captured wheels' momentum and the minimal parameters, whatever the bodies.
    """
    states = motion.kinematics
    minimal = minimal_set(model.robot, model.structure)
    wheels = -model.balance(states, model.prior())[1][..., model.aam]
    columns = np.concatenate([wheels, minimal_regressor(minimal, states)], axis=2)
    A = motion.R_WB @ columns.reshape(*motion.q.shape[:2], 3, -1)
    A = (A - A[:, :1])[:, 1:].reshape(len(A), -1, A.shape[-1])
    norms = np.linalg.norm(A, axis=1, keepdims=True)
    unit = A / np.where(norms > 0.0, norms, 1.0)
    raw, scaled = (np.minimum(np.linalg.cond(matrix), _WORST) for matrix in (A, unit))
    return raw, scaled
