"""Everything that a user is told of a design: one object for tables, JSON and report.

Own wheels are a design lever: their known momentum fixes the common scale of the estimate. The
momentum equation A x = b is nearly homogeneous: the right-hand side is the momentum of the
servicer's own wheels alone. Without it only ratios can be told, and the scale is what the file
says; the faster they spin, the better the scale.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..dynamics.equations import Dynamics, without_translation
from ..effects.robot_file import RobotFile
from ..estimation.trajectory.motion_limits import Use
from ..types import Array
from .design import Design, OnIteration, search
from .motions import Chosen
from .precision import REST, Prediction, own_motion, predict, predict_with_wheels
from .problem import Problem

_FACTORS = (1.0, 2.0, 5.0)  # on the momentum of the own wheels
_TRIED = 5e-3  # rad/s at which momentum turns the robot, where the file has the wheels at rest
_WORTH = 0.9  # of the std; a smaller gain is not worth a spin-up
_BLIND = 0.1  # rad/s
_BETTER = 0.98  # of the figure of another motion; what is closer is as good
_KEPT = 1.0 + 1e-6  # of a limit


@dataclass(frozen=True, slots=True, eq=False)
class WheelOption:
    """The same joint motion with other wheel momentum.

    Args:
        factor: On the momentum of the robot file; where that is zero on one that turns the robot
            at 5 mrad/s about each axis.
        momentum: (3,) in base_link [N m s].
        prediction: What it reaches.
    """

    json_too = ('allowed',)
    factor: float
    momentum: Array
    prediction: Prediction

    @property
    def allowed(self) -> bool:
        """Whether every limit holds."""
        return self.prediction.hardest_use.fraction <= 1.0


class Summary:
    """A design and what it is worth.

    The robot file's own motion is compared with what the search found, and takes its place where
    it is better and keeps the limits.

    Args:
        problem: What was to be designed. found: The result of the search.

    Attributes:
        chosen: The motion to be written. is_own: Whether it is the robot file's own.
        uses: How it uses every limit, off-nominal wheel momenta included.
        design: Prediction for it. searched: For what the search found.
        reference: For the robot file's own, if it has one.
        with_rest: For a spin-up with a measured rest before it.
        wheels: The same motion with other momentum of the own wheels. advice: On them.
        notes: Remarks.
    """

    def __init__(self, problem: Problem, found: Design) -> None:
        h0 = problem.robot.servicer_wheels.momentum
        if not h0.any():
            h0 = np.full(3, _TRIED * _moment(problem))
        self.problem, self.found = problem, found
        self.chosen, own = Chosen(problem.family, found.x, problem.start), own_motion(problem)
        self.searched = self.design = predict(problem, self.chosen)
        self.reference = None if own is None else predict(problem, own)
        self.is_own, comparison = False, ''
        criterion = problem.settings.excitation.criterion
        if own is not None and self.reference is not None:
            why_not = _why_not(problem, own)
            better = _better(problem, self.reference, self.searched)
            self.is_own = bool(better) and not why_not
            is_of_wheels = bool(self.reference.n_aam) and criterion == 'information'
            gain = self.reference.bits - self.searched.bits if is_of_wheels else 0.0
            comparison = _compared(better, why_not, gain)
            if self.is_own:
                self.chosen, self.design = own, self.reference
        x, self.uses = self.chosen, problem.uses(self.chosen)
        is_spun_up = problem.start_kind == 'spin_up'
        self.with_rest = predict(problem, x, with_rest=True) if is_spun_up else None
        self.wheels = [
            WheelOption(factor, factor * h0, predict_with_wheels(problem, x, factor * h0))
            for factor in _FACTORS
        ]
        self.advice = _advice(problem, self.wheels)
        self.notes = [comparison] if comparison else []
        self.notes += _notes(problem, self.design, self.uses)

    @property
    def headline(self) -> str:
        """What the motion tells of the AAM, in a sentence; empty where there is none."""
        if not self.design.n_aam:
            return ''
        design, problem = self.design, self.problem
        is_stated = bool(np.any(problem.constants[problem.model.y] != 0.0))
        bodies = "those of the file's truth" if is_stated else "the file's"
        return (
            f'wheel momentum +- {design.aam_std:.3g} N m s if the bodies are {bodies}, '
            f'+- {design.aam_std_as_stated:.3g} if they are as uncertain as robot.uncertainty says'
        )

    def to_json(self) -> dict[str, Any]:
        """As in the command's JSON."""
        problem = self.problem
        return {
            'schema': 1,
            'robot': problem.robot.name,
            'criterion': problem.settings.excitation.criterion,
            'structure': problem.settings.identifier.structure,
            'start': {'kind': problem.start_kind, 'angular_velocity': self.chosen.start.omega},
            'attempts': [a._asdict() for a in self.found.attempts],
            'interrupted': self.found.interrupted,
            'written': 'robot file' if self.is_own else 'search',
            'limits': [{**u._asdict(), 'margin': 1.0 - u.fraction} for u in self.uses],
            'design': self.design,
            'searched': self.searched,
            'reference': self.reference,
            'with_rest': self.with_rest,
            'own_wheels': self.wheels,
            'advice': self.advice,
            'notes': self.notes,
        }


def design_motion(file: RobotFile, progress: OnIteration = lambda *_: None) -> Summary:
    """Design a joint motion from which wheel momentum and inertia are identified precisely.

    Args:
        file: The robot file; section `excitation` has limits and search.
        progress: Called after every step with the number of steps done and the best cost so far.

    Returns:
        The design; `chosen` is what `write_trajectory` takes.

    Raises:
        ConfigurationError: fixed base, or limits that leave no motion.
    """
    problem = Problem(file)
    return Summary(problem, search(problem, progress))


def _better(problem: Problem, own: Prediction, searched: Prediction) -> str:
    """By what the file's own motion is better than what was found; empty where it is not."""
    criterion = problem.settings.excitation.criterion
    if criterion != 'information':
        mine, other = getattr(own, criterion), getattr(searched, criterion)
        words = criterion.replace('_', ' ')
        return f'{words} {mine:.4g} against {other:.4g}' if mine < _BETTER * other else ''
    if own.n_aam:
        mine, other = own.aam_std, searched.aam_std
        words = f'wheel momentum +- {mine:.3g} against +- {other:.3g} N m s'
        return words if mine < _BETTER * other else ''
    words = f'{own.bits:.1f} against {searched.bits:.1f} bits'
    return words if searched.bits < _BETTER * own.bits else ''


def _why_not(problem: Problem, own: Chosen) -> str:
    """Why the file's own motion is no choice; empty where it is one."""
    use = max(problem.uses(own), key=lambda use: use.fraction)
    if use.fraction > _KEPT:
        return f'breaks a limit: {_reached(use)}'
    allowed, duration = problem.settings.excitation.duration, own.family.duration
    if duration > _KEPT * allowed:
        return f'takes {duration:g} s, excitation.duration is {allowed:g} s'
    if not np.array_equal(own.start.omega, problem.start.omega):
        return f'starts at another base rate than a start of kind {problem.start_kind!r}'
    return ''


def _reached(use: Use) -> str:
    return f'{use.name} of {use.where} reaches {use.value:.3g} {use.unit} (limit {use.limit:.3g})'


def _compared(better: str, why_not: str, gain: float) -> str:
    """What to say of the file's own motion, which tells `gain` bits more than what was found."""
    if better and why_not:
        return (
            f"the file's own motion tells more ({better}), but {why_not}; what the search found "
            'is written'
        )
    if better:
        return (
            f"the file's own motion is better than what the search found ({better}) and keeps "
            'the limits: it is written'
        )
    if gain > 0.0:
        return (
            f"the file's own motion tells {gain:.1f} bits more of wheels and bodies together, but "
            f'no more of the wheels alone{why_not and f", and {why_not}"}; what the search found '
            'is written'
        )
    return f"the file's own motion is no better, and {why_not}" if why_not else ''


def _moment(problem: Problem) -> float:
    """Mean moment of inertia of the whole about its centre of mass, at the start [kg m^2]."""
    M = Dynamics(problem.robot).mass_matrix(problem.family.start)
    return float(np.trace(without_translation(M)[:3, :3])) / 3.0


def _advice(problem: Problem, options: Sequence[WheelOption]) -> str:
    """One sentence on the own wheels."""
    if not problem.robot.servicer_wheels.momentum.any():
        return (
            "the servicer's wheels are at rest: the common scale of all numbers is the file's and "
            'only ratios can be told; spin the wheels up first'
        )
    allowed = [o for o in options if o.allowed]
    if not allowed:
        return 'the limits hold at no multiple of the present wheel momentum'
    best = max(allowed, key=lambda o: o.prediction.bits)
    now = options[0]
    if best is now or best.prediction.scale_std > _WORTH * now.prediction.scale_std:
        broken = next((o for o in options[1:] if not o.allowed), None)
        why = ''
        if broken is not None:
            use = broken.prediction.hardest_use
            why = f': {use.name} of {use.where} beyond its limit at x{broken.factor:g}'
        return f'keep the present wheel momentum{why}; a search at a higher one may still pay'
    gain = now.prediction.scale_std / best.prediction.scale_std
    return (
        f'spin the wheels up to x{best.factor:g} '
        f'({np.linalg.norm(best.momentum):.4g} N m s) before identifying: the common scale gets '
        f'{gain:.2g} times better known, the whole estimate '
        f'{best.prediction.bits - now.prediction.bits:.1f} bits'
    )


def _notes(problem: Problem, prediction: Prediction, uses: Sequence[Use]) -> Iterator[str]:
    settings = problem.settings
    options, momentum = settings.excitation, problem.robot.target_momentum
    if len(momentum):
        stated = settings.truth.target_momentum or settings.truth.target_rates
        source = 'truth of the robot file' if stated else 'belief of the robot file'
        yield (
            f'designed for wheel momentum [{", ".join(f"{h:.4g}" for h in momentum)}] N m s of '
            f'the captured body ({source}), each axis +- {options.momentum_uncertainty:g}'
        )
    if options.start == 'auto' and problem.start_kind == 'rest':
        rate = float(np.linalg.norm(settings.initial.angular_velocity))
        yield (
            f'starts with the base at rest: at the initial rate of {rate:.3g} rad/s in the robot '
            'file the limits leave no room; bring the base to rest first'
        )
    if problem.start_kind == 'spin_up':
        yield (
            'starts from rest with the own wheels just spun up; `with rest` also counts '
            f'{REST:g} s of rest measured before the spin-up, own wheels still'
        )
    fastest = max(use.value for use in uses if use.name == 'base_rate')
    if fastest > _BLIND and settings.sensors.attitude_rate_limit is None:
        yield (
            f'the base turns at up to {fastest:.2g} rad/s: many star trackers are blind above '
            f'{_BLIND:g} rad/s; sensors.attitude_rate_limit and excitation.base_rate limit it'
        )
    if problem.unstated:
        yield (f'typical sensor noise assumed for {", ".join(problem.unstated)}')
    if prediction.told < prediction.tellable:
        yield (
            f'{prediction.tellable - prediction.told} of {prediction.tellable} directions of '
            'wheel momentum and bodies are told no better by this motion than by robot.uncertainty'
        )
    if prediction.aam_std > prediction.aam_limit:
        yield (
            f'identify will not call the estimate valid: wheel momentum is known to '
            f'{prediction.aam_std:.3g} N m s only, the limit is {prediction.aam_limit:.3g}; allow '
            'more motion or a longer one'
        )
    elif prediction.aam_std_as_stated > prediction.aam_limit:
        yield (
            'identify will call the estimate valid only if the bodies are as assumed: the limit '
            f'of the wheel momentum is {prediction.aam_limit:.3g} N m s'
        )
